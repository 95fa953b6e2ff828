"""Judges of the claims, by figure.

Every module in this folder is imported, and registers its judges. A judge of a later claim is one more module here (or
a function decorated with `judges` anywhere); the page lists its finding without a change.
"""

from importlib import import_module
from pkgutil import iter_modules

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")
