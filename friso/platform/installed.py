"""Find what is installed beside friso: optional dependencies ("extras"), and modules that packages add to friso.

For an extra that a command needs, friso says how to install it.

Packages add modules by entry points, by group. Names come from the metadata of packages; a module is imported only when
it is needed. A name that is taken, or a module that cannot be used, is reported in one sentence and skipped.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Mapping
from contextlib import redirect_stdout
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import Any

from friso.errors import InputError

EXTRAS = {"cluster": ("dask", "distributed"), "design": ("exudyn", "pymoo"), "fmu": ("fmpy",)}
"""Packages of each extra that commands or what they write need, by the extra's name in pyproject.toml.
`friso.identification.logs.read` lists packages of log formats."""


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


LOGGER = logging.getLogger("friso")

RENAMED = {"friso.commands": "friso.questions", "friso.functions": "friso.questions"}
"""Groups of friso 0.2, and the groups that replace them."""


@cache
def installed_modules(group: str, taken: frozenset[str] = frozenset()) -> Mapping[str, str]:
    """Return the modules that packages name in a group of entry points, by name.

    Names that friso has `taken`, or that several packages give, are reported and left out.
    """
    modules: dict[str, list[str]] = {}
    for name, module in _entry_points().get(group, ()):
        modules.setdefault(name, []).append(module)
    for name in [name for name, named in modules.items() if name in taken or len(named) > 1]:
        has = "friso has it" if name in taken else "several packages give it"
        leave_out(InputError(f"{group}: {name}", " and ".join(modules.pop(name)), f"a name that is not taken: {has}"))
    return {name: module for name, (module,) in modules.items()}


@cache
def _entry_points() -> Mapping[str, list[tuple[str, str]]]:
    """Return names and modules of all entry points for friso, by group."""
    from importlib.metadata import entry_points  # takes as long as all of friso's stage file

    points = entry_points()
    groups = [group for group in points.groups if group.startswith("friso.")]
    for group in RENAMED.keys() & {*groups}:
        names = ", ".join(sorted(f"{point.name} ({point.module})" for point in points.select(group=group)))
        LOGGER.warning(
            f"{group} is of friso 0.2: {names} is left out until its package names a {RENAMED[group]} "
            "(CONTRIBUTING.md, docs/migration.md)"
        )
    return {group: sorted((point.name, point.module) for point in points.select(group=group)) for group in groups}


def load_module(group: str, name: str, module: str) -> ModuleType:
    """Import the module that a package names in a group.

    Raises InputError if it cannot be imported.
    """
    try:
        with redirect_stdout(sys.stderr):  # output of plug-ins must not mix with answers
            return import_module(module)
    except InputError as error:
        raise error.under(f"{group}: {name}") from None
    except (Exception, SystemExit) as error:
        actual = f"{module}, which cannot be imported: {error}"
        raise InputError(f"{group}: {name}", actual, "a module that can be imported") from error


def load_declared(group: str, name: str, module: str, attribute: str, kind: Any = object) -> Any:
    """Return what a package's module declares as an `attribute`.

    The module is the one called `name` in a `group` of entry points. Raises InputError if the module cannot be
    imported, or declares nothing of this `kind`.
    """
    declared = getattr(load_module(group, name, module), attribute, None)
    if declared is None or not isinstance(declared, kind):
        actual = f"{module}, whose {attribute} is {'missing' if declared is None else type(declared).__name__}"
        expected = f"a module that declares {attribute}{f', {kind.__name__}' if kind is not object else ''}"
        raise InputError(f"{group}: {name}", actual, expected)
    return declared


def leave_out(error: InputError) -> None:
    """Report in one sentence why an extension is skipped."""
    LOGGER.warning(f"{error.key} is left out: {error.actual}; expected: {error.expected}")
