"""Tuning numbers that a test, a benchmark or a command changes, each a field of one frozen class of its room.

A number that nobody changes is a constant above the function that uses it. A room is a package such as `friso.hunting`;
its `settings.py` declares a class and an object, `search_settings = SearchSettings.live()`, whose fields are the values
in use. Other values are given for a block of code, as NumPy's `errstate` and friso's `allowance` do:

    with SearchSettings(candidate_work=2.0).in_use():
        friso.check("stage.toml")

The reason for a value, of a setting as of a constant, is the text below it: what fails when it is smaller, what it
costs when it is larger.

Other processes, and stores that a study is kept in, know nothing of settings: use them within one process.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, Self, cast


class Settings:
    """Base of the settings of a package: a frozen dataclass."""

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
