"""Registries of what modules declare, by name, from a folder of friso and from installed packages."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from pkgutil import iter_modules
from typing import Any, Generic, TypeVar

from friso.errors import InputError
from friso.platform.installed import installed_modules, leave_out, load_declared

Item = TypeVar("Item")


class Registry(Generic[Item]):
    """What modules declare under the name `attribute`, by the name of the module.

    A module `break_away.py` declares "break-away", unless `dashes` are declined. The modules are those of a `package`,
    and, if there is a `group` of entry points, those that installed packages name in it; what the latter declare must
    be of a `kind`. Names and their descriptions, the first line of each module's docstring, are read without importing
    any module. A module is imported when its declaration is first asked for. The package may declare more in a table,
    TABLE, as (declared, description), by name; without an `attribute` it declares all there. `added` takes what is
    declared elsewhere, in the same way.
    """

    def __init__(self, package: str, attribute: str, group: str = "", kind: type = object, dashes: bool = True) -> None:
        self.package, self.attribute, self.group, self.kind = package, attribute, group, kind
        self.dash = "-" if dashes else "_"
        self.added: dict[str, tuple[Item, str]] = {}

    @cached_property
    def _own(self) -> dict[str, str]:
        """Return friso's own modules by name; of an entry in the table, the package."""
        modules = iter_modules(import_module(self.package).__path__) if self.attribute else ()
        own = {module.name.replace("_", self.dash): f"{self.package}.{module.name}" for module in modules}
        return own | dict.fromkeys(self._listed, self.package)

    @cached_property
    def _listed(self) -> dict[str, tuple[Item, str]]:
        """Return what the table of friso's own package declares."""
        return getattr(import_module(self.package), "TABLE", {})

    @property
    def installed(self) -> Mapping[str, str]:
        """Return the modules of installed packages by name; empty for a registry without a `group`."""
        return installed_modules(self.group, frozenset(self._own)) if self.group else {}

    @property
    def others(self) -> list[str]:
        """Return the names that do not belong to friso itself."""
        return sorted({*self.installed, *self.added})

    def __iter__(self) -> Iterator[str]:
        """Yield the names in alphabetical order."""
        return iter(sorted({*self._own, *self.installed, *self.added}))

    def __contains__(self, name: object) -> bool:
        return name in self.added or name in self._own or name in self.installed

    def __getitem__(self, name: str) -> Item:
        """Return what is declared under a name.

        Raises KeyError for an unknown one, InputError if another package's module declares nothing.
        """
        if described := (self._listed | self.added).get(name):
            return described[0]
        if name in self._own:
            return getattr(import_module(self._own[name]), self.attribute)
        if name not in self.installed:
            raise KeyError(name)
        return load_declared(self.group, name, self.installed[name], self.attribute, self.kind)

    def items(self) -> Iterator[tuple[str, Item]]:
        """Return the names with what is declared.

        What another package's module does not declare is reported, and left out.
        """
        for name in self:
            try:
                yield name, self[name]
            except InputError as error:
                leave_out(error)

    def one_line(self, name: str) -> str:
        """Return the description of a registered name, the first line of its docstring.

        Its full stop is removed. Raises KeyError for an unknown name.
        """
        if described := (self._listed | self.added).get(name):
            return described[1]
        module = self._own.get(name) or self.installed[name]
        try:
            loader: Any = getattr(find_spec(module), "loader", None)
            docstring = ast.get_docstring(ast.parse(loader.get_source(module)))
        except (Exception, SystemExit):  # of another package, told where it is used
            return f"cannot be read from {module}"
        return (docstring or "").partition("\n")[0].removesuffix(".")

    def checked(self, name: str, option: str, example: str) -> str:
        """Return a name if it is registered.

        Raises InputError for the `option` otherwise; its `example`, with {} for the name, shows the nearest name.
        """
        names = tuple(self)
        if isinstance(name, str) and name in names:
            return name
        from friso.quantities import quoted  # imports pydantic, which takes longer than the list of commands

        nearest = next(iter(get_close_matches(str(name), names, 1, 0)), "")
        raise InputError(option, quoted(name), f"one of {', '.join(names)}", example.format(nearest))
