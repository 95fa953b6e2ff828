"""Find modules that installed packages add to friso by entry points, by group.

Names come from the metadata of packages; a module is imported only when it is needed. A name that is taken, or a module
that cannot be used, is reported in one sentence and skipped.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Mapping
from contextlib import redirect_stdout
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Any

from friso.errors import InputError

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
