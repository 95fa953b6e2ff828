"""The judges of the claims, by figure; every module in this folder is imported, and registers those in it.

A judge of a later claim is one more module here (or a function decorated with `judges` anywhere): the page lists
its finding without a change.
"""

from importlib import import_module
from pkgutil import iter_modules

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")
