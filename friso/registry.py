"""Registries of what friso declares, by name, in a table or in the modules of a folder, and of installed packages."""

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
    """What is declared of one kind, by name: in a table, in the modules of a folder, by installed packages.

    A module `place` with a table TABLE declares everything there, as (declared, description) by name. A package without
    a table has a module for each, which declares it under the name `attribute`: `break_away.py` declares "break-away",
    unless `dashes` are declined. Of such modules, names and descriptions, the first line of each module's docstring,
    are read without importing any. If there is a `group` of entry points, so do the modules that installed packages
    name in it; what these declare must be of a `kind`. A module is imported when its declaration is first asked for.
    `added` takes what is declared elsewhere, as a table does.
    """

    def __init__(self, place: str, attribute: str, group: str = "", kind: type = object, dashes: bool = True) -> None:
        self.place, self.attribute, self.group, self.kind = place, attribute, group, kind
        self.dash = "-" if dashes else "_"
        self.added: dict[str, tuple[Item, str]] = {}

    @cached_property
    def _listed(self) -> dict[str, tuple[Item, str]]:
        """Return what friso's own table declares; empty for a folder of modules."""
        return getattr(import_module(self.place), "TABLE", {})

    @cached_property
    def _own(self) -> dict[str, str]:
        """Return friso's own modules by name; of an entry in a table, the table's."""
        if self._listed:
            return dict.fromkeys(self._listed, self.place)
        modules = iter_modules(import_module(self.place).__path__)
        return {module.name.replace("_", self.dash): f"{self.place}.{module.name}" for module in modules}

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
