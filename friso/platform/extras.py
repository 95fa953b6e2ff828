"""List optional dependencies ("extras") of commands, and say how to install them."""

from __future__ import annotations

from importlib.util import find_spec

from friso.errors import InputError

EXTRAS = {"cluster": ("dask", "distributed"), "design": ("exudyn", "pymoo"), "fmu": ("fmpy",)}
"""Packages of each extra that commands or what they write need, by the extra's name in pyproject.toml.
`friso.identification.logs.confined` lists packages of log formats."""


def install(extra: str) -> str:
    """Return the command that installs an extra."""
    return f'pip install "friso[{extra}]"'


def is_installed(package: str) -> bool:
    """Tell whether a package is installed, without importing it."""
    try:
        return find_spec(package) is not None
    except ValueError:  # a module of that name made by hand
        return False


def missing(extra: str) -> list[str]:
    """Return the packages of an extra that are not installed."""
    return [package for package in EXTRAS[extra] if not is_installed(package)]


def need(extra: str, subject: str) -> None:
    """Check that an extra is installed, before anything is computed.

    Raises InputError if it is not. The message names the `subject`, a command or an option, and says how to install the
    extra.
    """
    if packages := missing(extra):
        actual = f"an installation of friso without {' and '.join(packages)}"
        raise InputError(subject, actual, f"the extra {extra}", install(extra))
