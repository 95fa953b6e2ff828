"""Tuning numbers of a room, each a named field of one frozen class, with its unit and the reason for its value.

A room is a package such as `friso.hunting`. Its `settings.py` declares a class; its code reads the values in use
with `current()`. Other values are given for a block of code, as NumPy's `errstate` and friso's `allowance` do:

    with SearchSettings(candidate_work=2.0).in_use():
        friso.check("stage.toml")

Numbers of physics or mathematics are no settings: they stand where they are used, with their source.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, fields
from functools import cache
from importlib import import_module
from pkgutil import walk_packages
from typing import Any, ClassVar, Self


def setting(value: Any, unit: str, reason: str) -> Any:
    """Declare a field of a Settings class.

    Parameters
    ----------
    value
        The value that friso uses.
    unit : str
        Its unit, "s" or "N/m"; "" for a number without one.
    reason : str
        Why it has this value, in one sentence or two: what fails when it is smaller, what it costs when it is larger.
    """
    return field(default=value, metadata={"unit": unit, "reason": reason})


@dataclass(frozen=True)
class SettingRow:
    """One setting as the reference page lists it."""

    name: str
    value: Any
    unit: str
    reason: str


class Settings:
    """Base of the settings of a room: a frozen dataclass whose fields are declared with `setting`."""

    _in_use: ClassVar[ContextVar[Any]]

    def __init_subclass__(cls) -> None:
        cls._in_use = ContextVar(cls.__qualname__)

    @classmethod
    def current(cls) -> Self:
        """Return the settings in use: those of the innermost `in_use` block, or the default values."""
        return cls._in_use.get(None) or _defaults(cls)

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
        """List the settings with their default values, units and reasons.

        Raises TypeError for a field that is not declared with `setting`.
        """
        rows = []
        for item in fields(cls):  # type: ignore[arg-type]  # every subclass is a dataclass
            if {*item.metadata} != {"unit", "reason"}:
                raise TypeError(f"{cls.__name__}.{item.name} is not declared with setting(value, unit, reason)")
            rows.append(SettingRow(item.name, item.default, item.metadata["unit"], item.metadata["reason"]))
        return rows


@cache
def _defaults(settings: type[Any]) -> Any:
    """Return the default values, the same object at every call: making one costs as much as many a function."""
    return settings()


def settings_classes() -> list[type[Settings]]:
    """List the settings classes of friso and friso_thesis: one from each module called `settings`."""
    classes: dict[str, type[Settings]] = {}
    for package in ("friso", "friso_thesis"):
        for module in walk_packages(import_module(package).__path__, f"{package}."):
            if module.name.endswith(".settings") and module.name != __name__:
                names = vars(import_module(module.name)).values()
                declared = (item for item in names if isinstance(item, type) and item.__module__ == module.name)
                classes |= {item.__qualname__: item for item in declared if issubclass(item, Settings)}
    return [*classes.values()]
