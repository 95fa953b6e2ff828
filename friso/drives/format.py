"""Declare kinds of parameter files.

A kind says how to recognise, read and write its files, and what they leave open.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from friso.axis import AxisKind
from friso.drives.questions import OpenQuestion, UserAnswers
from friso.errors import InputError, one_line
from friso.quantities import quoted
from friso.registry import Registry

FlatStage = Mapping[str, Any]
"""A stage as flat keys such as controller.kp, with SI values."""

Beside = Callable[[str], str | None]
"""Function that returns the text of another file.

The file's name is relative to the folder of a parameter file. The result is None for a file outside that folder."""


@dataclass(frozen=True)
class AxisParameters:
    """The parameters of one axis, as a parameter file holds them.

    `name` is the axis's name in the file, and `letter` is what users of the machine call it. `values` holds texts or
    numbers by name. `machine` holds the settings of the whole machine that matter for the axis.
    """

    name: str
    values: Mapping[str, Any]
    machine: Mapping[str, Any] = field(default_factory=dict)
    letter: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", one_line(self.name))

    def number(self, name: str, default: float | None = None, symbols: Mapping[str, float] | None = None) -> float:
        """Return a parameter as a finite number.

        A text may be one of the `symbols`, which stand for numbers. Raises InputError if the parameter is no number, or
        if it is absent and has no `default`.
        """
        entry = self.values.get(name, self.machine.get(name, default))
        if entry is None:
            raise InputError(name, "nothing", "a number", f"{name} = 1.0")
        if symbols and isinstance(entry, str) and not _NUMBER.fullmatch(entry.strip()):
            if entry not in symbols:
                names = [*symbols][: len({*symbols.values()})]  # each symbol in one spelling
                expected = f"a number, or one of {', '.join(names)}"
                raise InputError(name, quoted(entry), expected, f"{name} = 1")
            return symbols[entry]
        try:
            if isinstance(entry, bool) or (isinstance(entry, str) and not _NUMBER.fullmatch(entry.strip())):
                raise TypeError
            value = float(entry)
        except (TypeError, ValueError, OverflowError):
            raise InputError(name, quoted(str(entry)), "a number", f"{name} = 1.0") from None
        if abs(value) > LARGEST_PARAMETER or value != value:
            raise InputError(name, f"{value:g}", f"a number of at most {LARGEST_PARAMETER:g}", f"{name} = 1.0")
        return value

    def flag(self, name: str, default: bool = False) -> bool:
        """Tell whether a switch is on; an absent one is as `default` says.

        Raises InputError if its value is neither true nor false, 0 nor 1.
        """
        entry = self.values.get(name, default)
        if not isinstance(entry, bool) and entry not in (0, 1):
            raise InputError(name, quoted(str(entry)), "true or false", f"{name} = true")
        return bool(entry)

    def is_set(self, name: str) -> bool:
        """Tell whether a parameter exists and is neither 0 nor infinite."""
        entry = self.values.get(name)
        return entry is not None and str(entry).strip().lower() not in ENDLESS and self.number(name) != 0


_NUMBER = re.compile(r"[+-]?(?:(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:e[+-]?[0-9]+)?|inf(?:inity)?|nan)", re.IGNORECASE)
"""Pattern of a number as drives read it.

Unlike Python, drives accept neither underscores nor digits of other scripts. The pattern matches a run of digits in
only one way, so that a hundred thousand take no time."""

LARGEST_PARAMETER = 1e30
"""Largest value of a parameter."""

ENDLESS = ("", "inf", "+inf", "infinity")
"""Values that stand for no limit, or for an empty parameter."""


@dataclass(frozen=True)
class AsStage:
    """Stage that an axis's parameters describe, as tables of a stage file.

    `left_out` says in sentences which settings of the drive a stage cannot describe.
    """

    tables: Mapping[str, Mapping[str, Any]]
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True)
class Parameters:
    """Parameters of a drive: their `values` by name.

    `held` are the names of the keys of [controller] that these parameters hold.
    """

    values: Mapping[str, float]
    held: frozenset[str]


@dataclass(frozen=True)
class ParameterFormat:
    """One kind of parameter file, with the functions that read and write it.

    `title` names the kind. `firmware` and `source` say whose formulas are used, and where they are published.
    `recognises` tells from name and text whether a file is of this kind. `axes` reads the axes of a text and raises
    InputError for a text that it cannot read.

    `questions` lists what an axis leaves open; it raises InputError for an axis that friso cannot describe. `stage`
    turns the axis and the answers into a stage. It raises InputError for unusable numbers, before the user is asked
    anything.

    `questions_back`, `parameters` and `text` lead from a stage back to the drive. They list what is still unknown,
    compute the parameters, and write them as a file. `whole` includes other files of the same folder, which it reads
    through `Beside`.
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


TOLD = ("machine_unit", "force_per_output", "length_per_unit", "velocity_per_output", "travel_per_turn")
"""Keys of [drive] that hold the units of a drive. They are given to friso init --from or read from a file, and friso
export needs them."""

FORMATS: Registry[ParameterFormat] = Registry("friso.drives.formats", "FORMAT")


def si(value: float, unit: str) -> str:
    """Write a number in SI with its unit, in the form of a stage file."""
    return f"{value:.15g} {unit}"


def there_and_back(fastest: float, acceleration: float, unit: float, kind: AxisKind) -> dict[str, str]:
    """Return the table [motion] of a move there and back that uses all of a drive's speed and acceleration.

    `fastest` and `acceleration` are in the drive's unit per second or square second; its `unit` is in [m] or [rad].
    """
    back = max(5.0, 4 * fastest / acceleration)
    return {
        "kind": "there_and_back",
        "acceleration": si(acceleration * unit, kind.unit("m/s^2")),
        "acceleration_time": si(fastest / acceleration, "s"),
        "return_at": si(back, "s"),
        "duration": si(back + 15, "s"),
    }


def lacks(what: str, expected: str, example: str = "") -> InputError:
    """Build the error for a controller that a parameter format cannot hold.

    `what` is the controller, and `expected` the kind of controller that the format can hold.
    """
    return InputError("controller", what, expected, example)
