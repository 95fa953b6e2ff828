"""What the modules of a package declare, one each, by name: the one way in which friso is extended by a file."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from difflib import get_close_matches
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, Generic, TypeVar

from friso.errors import InputError

Item = TypeVar("Item")


class Registry(Generic[Item]):
    """What the modules of a `package` declare under the name `attribute`, by the name of the module with dashes:
    `break_away.py` declares "break-away".

    The names, and what each is in one line, the first one of the module's docstring, are read without importing any of
    them; a module is imported when what it declares is first asked for. `added` takes what is declared elsewhere, as
    (declared, one line), by name.
    """

    def __init__(self, package: str, attribute: str) -> None:
        self.package, self.attribute = package, attribute
        self.added: dict[str, tuple[Item, str]] = {}

    def __iter__(self) -> Iterator[str]:
        """The names, in alphabetical order."""
        paths = import_module(self.package).__path__
        return iter(sorted({module.name.replace("_", "-") for module in iter_modules(paths)} | self.added.keys()))

    def __contains__(self, name: object) -> bool:
        return name in tuple(self)

    def __getitem__(self, name: str) -> Item:
        """What is declared under a name. Raises KeyError for an unknown one."""
        if name in self.added:
            return self.added[name][0]
        if name not in self:
            raise KeyError(name)
        return getattr(import_module(f"{self.package}.{name.replace('-', '_')}"), self.attribute)

    def one_line(self, name: str) -> str:
        """What is declared under a name, in one line without a full stop. Raises KeyError for an unknown name."""
        if name in self.added:
            return self.added[name][1]
        for module in iter_modules(import_module(self.package).__path__):
            if module.name.replace("_", "-") == name:
                finder: Any = module.module_finder
                source = finder.find_spec(module.name).loader.get_source(module.name)
                return (ast.get_docstring(ast.parse(source)) or "").partition("\n")[0].removesuffix(".")
        raise KeyError(name)

    def checked(self, name: str, option: str, example: str) -> str:
        """The name, if it is one of these. Raises InputError for the `option` otherwise, whose `example`, with {} for
        the name, shows the nearest one."""
        names = tuple(self)
        if isinstance(name, str) and name in names:
            return name
        from friso.quantities import quoted  # imports pydantic, which takes longer than the list of commands

        nearest = next(iter(get_close_matches(str(name), names, 1, 0)), "")
        raise InputError(option, quoted(name), f"one of {', '.join(names)}", example.format(nearest))
