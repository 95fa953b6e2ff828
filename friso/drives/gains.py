"""Give the gains of a stage as an engineer types them into a drive."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from friso.drives.ask import TRAVEL, Ask
from friso.drives.conversions import MOTOR_CONSTANT, Conversion, Turn, conversions
from friso.drives.diagram import loop_diagram
from friso.drives.drive import FORMATS, TOLD, DriveFormat
from friso.errors import InputError
from friso.quantities import quoted
from friso.stage import Stage
from friso.stage.controllers import CONTROLLER

DRIVE_OUTPUT = "output of the drive"
"""What stands for a unit where the output of a drive has none."""


@dataclass(frozen=True)
class Gains:
    """The gains of a stage, with its loop drawn (`diagram`) and the gains in drives' units.

    `conversions` has the gains in these units. For a `kind` of drive, `parameters` holds its parameters by name.
    `not_held` lists the keys of the stage that these parameters cannot hold.
    """

    stage: Stage
    diagram: str
    conversions: tuple[Conversion, ...]
    kind: DriveFormat | None = None
    parameters: Mapping[str, float] | None = None
    not_held: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """Return the parameters as the drive's file holds them; "" without a kind of drive."""
        return self.kind.text(self.parameters) if self.kind and self.parameters else ""


def gains_of(stage: Stage, user_values: Mapping[str, Any], to: str | None = None) -> Gains:
    """Return the gains of a stage, and the parameters of the drive `to` if one is named.

    `user_values` are the user's answers to what the drive needs besides. Raises InputError for a controller that the
    drive does not have, for an answer that nothing asks for, and for all missing answers together.
    """
    flat = stage.flat()
    answers = Ask({**_told(stage, flat), **user_values})
    kind = None if to is None else FORMATS[FORMATS.checked(to, "--to", "--to {}")]
    askable = {TRAVEL, MOTOR_CONSTANT}
    if kind is not None:
        askable |= {question.key for question in _asked(kind, flat, {}).open}
    for key in user_values:
        if key not in askable:
            raise InputError("--set", quoted(key), f"a key of the stage, or one of {', '.join(sorted(askable))}")
    rows = conversions(flat, answers, stage.axis_kind.exerts)
    if kind is None:
        return Gains(stage, loop_diagram(flat), rows)
    _asked(kind, flat, answers.texts).refuse_open(f"--to {to}")
    back = kind.parameters(flat, answers)
    return Gains(stage, loop_diagram(flat), rows, kind, back.values, _not_held(flat, back.held))


def _asked(kind: DriveFormat, flat: Mapping[str, Any], texts: Mapping[str, Any]) -> Ask:
    """Return what a drive asks for on the way back, whether or not it can hold the controller."""
    ask = Ask(texts)
    with suppress(InputError):
        kind.parameters(flat, ask)
    return ask


def output_of(stage: Stage, user_values: Mapping[str, Any]) -> tuple[str, float]:
    """Return the unit of a controller's output, and the output per newton of its force.

    It is amperes if the motor constant is known, else the unit of a drive's output if the stage has it, else newtons.
    Raises InputError for an answer that nothing asks for.
    """
    for key in user_values:
        if key not in (TRAVEL, MOTOR_CONSTANT):
            raise InputError("--set", quoted(key), f"a key of the stage, {TRAVEL} or {MOTOR_CONSTANT}")
    flat = stage.flat()
    answers = Ask({**_told(stage, flat), **user_values})
    if per_ampere := Turn.of(flat, answers, stage.axis_kind.exerts).per_ampere:
        return "A", 1 / per_ampere
    if of_output := flat.get("drive.force_per_output"):
        return DRIVE_OUTPUT, 1 / of_output
    return stage.axis_kind.unit("N"), 1.0


def _told(stage: Stage, flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return the answers that `friso init --from` kept in the stage file.

    An uncertain answer counts by the centre of its range.
    """
    fields = stage.numeric_keys()
    kept = {name: flat[key] for name in TOLD if (key := f"drive.{name}") in flat}
    return {
        name: value if isinstance(value, str) else f"{value!r} {fields[f'drive.{name}'].unit}"
        for name, value in kept.items()
    }


def _not_held(flat: Mapping[str, Any], held: frozenset[str]) -> tuple[str, ...]:
    """Return the keys of [controller] that the parameters of a drive cannot hold.

    `held` are the names of the keys that the parameters hold. A filter counts once. Values of 0 and mere choices are
    left out.
    """
    before = f"{CONTROLLER}."
    names = [key.removeprefix(before) for key, value in flat.items() if key.startswith(before) and value]
    numbers = [name for name in names if name not in held and not isinstance(flat[before + name], str)]
    parts = [".".join(name.split(".")[:2]) for name in numbers]  # all keys of a filter count as the filter
    return tuple(dict.fromkeys(before + part for part in parts if part not in held))
