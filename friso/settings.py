"""Tuning numbers of a room, each a named field of one frozen class, with its unit and the reason for its value.

A room is a package such as `friso.hunting`. Its `settings.py` declares a class and an object, `search_settings =
SearchSettings.live()`, whose fields are the values in use. Other values are given for a block of code, as NumPy's
`errstate` and friso's `allowance` do:

    with SearchSettings(candidate_work=2.0).in_use():
        friso.check("stage.toml")

The reason for a value is the text below its field: what fails when it is smaller, what it costs when it is larger.

Other processes, and stores that a study is kept in, know nothing of them: use them within one process.

Numbers of physics or mathematics are no settings: they stand where they are used, with their source.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, fields
from functools import cache
from importlib import import_module
from itertools import pairwise
from pkgutil import walk_packages
from typing import Any, ClassVar, Self, cast


def setting(value: Any, unit: str) -> Any:
    """Declare a field of a Settings class; the text below the field is the reason for its value.

    Parameters
    ----------
    value
        The value that friso uses.
    unit : str
        Its unit, "s" or "N/m"; "" for a number without one.
    """
    return field(default=value, metadata={"unit": unit})


@dataclass(frozen=True)
class SettingRow:
    """One setting as the reference page lists it."""

    name: str
    value: Any
    unit: str
    reason: str


class Settings:
    """Base of the settings of a package: a frozen dataclass whose fields use `setting`."""

    _in_use: ClassVar[ContextVar[Any]]

    def __init_subclass__(cls) -> None:
        cls._in_use = ContextVar(cls.__qualname__)

    @classmethod
    def current(cls) -> Self:
        """Return the settings in use: those of the innermost `in_use` block, or the default values."""
        return cls._in_use.get(None) or _defaults(cls)

    @classmethod
    def live(cls) -> Self:
        """Return an object whose fields are those of the settings in use when they are read."""
        return cast(Self, _Live(cls))

    @contextmanager
    def in_use(self) -> Iterator[Self]:
        """Use these settings in the block, and in threads that copy its context."""
        token = self._in_use.set(self)
        try:
            yield self
        finally:
            self._in_use.reset(token)

    @classmethod
    def rows(cls) -> list[SettingRow]:
        """List the settings with their default values, units and reasons, which are read from the source.

        Raises TypeError for a field that is not declared with `setting`, or has no text below it.
        """
        (declared,) = ast.parse(inspect.getsource(cls)).body
        assert isinstance(declared, ast.ClassDef)
        reasons = {
            field.target.id: below.value.value
            for field, below in pairwise(declared.body)
            if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
            if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
        }
        rows = []
        for item in fields(cls):  # type: ignore[arg-type]  # every subclass is a dataclass
            if {*item.metadata} != {"unit"} or item.name not in reasons:
                raise TypeError(f"{cls.__name__}.{item.name} is no setting(value, unit) with a reason below it")
            reason = " ".join(str(reasons[item.name]).split())
            rows.append(SettingRow(item.name, item.default, item.metadata["unit"], reason))
        return rows


@dataclass(frozen=True)
class _Live:
    """The settings in use, read field by field."""

    settings_class: type[Settings]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "settings_class":  # copying and pickling ask before the field is set
            raise AttributeError(name)
        return getattr(self.settings_class.current(), name)


@cache
def _defaults(settings: type[Any]) -> Any:
    """Return the default values of a settings class; the result is cached."""
    return settings()


def settings_classes() -> list[type[Settings]]:
    """List the settings classes of friso and friso_thesis: one from each module called `settings`."""
    classes: dict[str, type[Settings]] = {}
    for package in ("friso", "friso_thesis"):
        for module in walk_packages(import_module(package).__path__, f"{package}."):
            if module.name.endswith(".settings") and module.name != __name__:
                names = vars(import_module(module.name)).values()
                declared = (item for item in names if isinstance(item, type) and item.__module__ == module.name)
                classes |= {f"{module.name}.{item.__name__}": item for item in declared if issubclass(item, Settings)}
    return [*classes.values()]
