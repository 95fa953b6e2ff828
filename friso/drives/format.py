"""What a kind of parameter file declares: how it is recognised and read, what it leaves open, and the way back."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from friso.drives.questions import OpenQuestion, UserAnswers
from friso.errors import InputError
from friso.escapes import one_line
from friso.quantities import quoted
from friso.registry import Registry

FlatStage = Mapping[str, Any]
"""A stage as flat keys."""

Beside = Callable[[str], str | None]
"""The text of another file, by its name relative to the folder of a parameter file; None for one that is not in that
folder or below it."""


@dataclass(frozen=True)
class AxisParameters:
    """The parameters of one axis in a file: its `name` there, texts or numbers by name, those of the whole machine
    that matter, and the `letter` that the machine's users call it by."""

    name: str
    values: Mapping[str, Any]
    machine: Mapping[str, Any] = field(default_factory=dict)
    letter: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", one_line(self.name))

    def number(self, name: str, default: float | None = None, symbols: Mapping[str, float] | None = None) -> float:
        """A finite number, or what one of the `symbols` stands for. Raises InputError where it is something else, or
        absent without a `default`."""
        entry = self.values.get(name, self.machine.get(name, default))
        if entry is None:
            raise InputError(name, "nothing", "a number", f"{name} = 1.0")
        if symbols and isinstance(entry, str) and not _NUMBER.fullmatch(entry.strip()):
            if entry not in symbols:
                names = [*symbols][: len({*symbols.values()})]  # those written in one way
                expected = f"a number, or one of {', '.join(names)}"
                raise InputError(name, quoted(entry), expected, f"{name} = 1")
            return symbols[entry]
        try:
            if isinstance(entry, bool) or (isinstance(entry, str) and not _NUMBER.fullmatch(entry.strip())):
                raise TypeError
            value = float(entry)
        except (TypeError, ValueError, OverflowError):
            raise InputError(name, quoted(str(entry)), "a number", f"{name} = 1.0") from None
        if abs(value) > MOST or value != value:
            raise InputError(name, f"{value:g}", f"a number of at most {MOST:g}", f"{name} = 1.0")
        return value

    def flag(self, name: str, default: bool = False) -> bool:
        """Whether a switch is on. Raises InputError where it is neither true nor false, 0 nor 1."""
        entry = self.values.get(name, default)
        if not isinstance(entry, bool) and entry not in (0, 1):
            raise InputError(name, quoted(str(entry)), "true or false", f"{name} = true")
        return bool(entry)

    def is_set(self, name: str) -> bool:
        """Whether there is such a parameter, and it is neither 0 nor infinite."""
        entry = self.values.get(name)
        return entry is not None and str(entry).strip().lower() not in ENDLESS and self.number(name) != 0


_NUMBER = re.compile(r"[+-]?(?:(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:e[+-]?[0-9]+)?|inf(?:inity)?|nan)", re.IGNORECASE)
"""A number as drives read it: neither the underscores nor the digits of other scripts that Python takes. There is one
way to read a run of digits: a hundred thousand take no time."""

MOST = 1e30
"""Largest number that a parameter can be."""

ENDLESS = ("", "inf", "+inf", "infinity")
"""How files write that there is no limit, or leave a parameter empty."""


@dataclass(frozen=True)
class AsStage:
    """Tables of a stage file that follow from an axis's parameters, and what they cannot say of it, in sentences."""

    tables: Mapping[str, Mapping[str, Any]]
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True)
class Parameters:
    """Parameters of a drive by name, and the names in [controller] that they hold."""

    values: Mapping[str, float]
    held: frozenset[str]


@dataclass(frozen=True)
class ParameterFormat:
    """A kind of parameter file.

    Its `title`; the `firmware` whose formulas are used; the `source` of these; whether a file is of this kind by its
    name and text; its axes (raises InputError); what it leaves open of an axis (raises InputError for an axis that
    friso cannot describe); the stage of an axis with the answers to that (raises InputError for numbers that it cannot
    be made of, which are refused before anything is asked); what the parameters of a stage need to know, these
    parameters, how a file holds them; and its text with other files of its folder taken in (by `Beside`).
    """

    title: str
    firmware: str
    source: str
    recognises: Callable[[str, str], bool]
    axes: Callable[[str], tuple[AxisParameters, ...]]
    questions: Callable[[AxisParameters, UserAnswers], tuple[OpenQuestion, ...]]
    stage: Callable[[AxisParameters, UserAnswers], AsStage]
    questions_back: Callable[[FlatStage, UserAnswers], tuple[OpenQuestion, ...]]
    parameters: Callable[[FlatStage, UserAnswers], Parameters]
    text: Callable[[Mapping[str, float]], str]
    suffix: str
    whole: Callable[[str, Beside], str] = lambda text, beside: text


TOLD = ("machine_unit", "force_per_output", "velocity_per_output", "travel_per_turn")
"""Names in [drive] of what friso init --from was told, or read, of a drive's units, and friso export asks for."""

FORMATS: Registry[ParameterFormat] = Registry("friso.drives.formats", "FORMAT")


def si(value: float, unit: str) -> str:
    """A number in SI as it stands in a stage file."""
    return f"{value:.15g} {unit}"


def lacks(what: str, expected: str, example: str = "") -> InputError:
    """The refusal of a controller whose numbers a format cannot hold."""
    return InputError("controller", what, expected, example)
