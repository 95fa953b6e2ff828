"""The gains of a stage for whoever types them into a drive."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from friso.drives.conversions import MOTOR_CONSTANT, TRAVEL, Conversion, conversions
from friso.drives.drawing import drawing
from friso.drives.format import FORMATS, ParameterFormat
from friso.drives.questions import Answers, refuse_open
from friso.errors import InputError
from friso.quantities import quoted
from friso.stage import Stage


@dataclass(frozen=True)
class Gains:
    """The gains of a stage: its loop drawn, its gains in the units of drives, and, for a kind of drive (None: for
    none), its parameters by name and how a file holds them."""

    stage: Stage
    drawing: str
    conversions: tuple[Conversion, ...]
    kind: ParameterFormat | None = None
    parameters: Mapping[str, float] | None = None

    @property
    def text(self) -> str:
        """The parameters as a file holds them."""
        return self.kind.text(self.parameters) if self.kind and self.parameters else ""


def gains_of(stage: Stage, told: Mapping[str, Any], to: str | None = None) -> Gains:
    """The gains of a stage, also as the parameters of the kind of drive `to`. Raises InputError for a controller that
    the drive does not have, and for all that is still to be said, together."""
    flat = stage.flat()
    answers = Answers(told)
    kind = None if to is None else FORMATS[FORMATS.checked(to, "--to", "--to {}")]
    known = {TRAVEL, MOTOR_CONSTANT}
    if kind is not None:
        open_questions = kind.questions_back(flat, answers)
        known |= {question.key for question in kind.questions_back(flat, Answers({}))}
    for key in told:
        if key not in known:
            raise InputError("--set", quoted(key), f"a key of the stage, or one of {', '.join(sorted(known))}")
    if kind is None:
        return Gains(stage, drawing(flat), conversions(flat, answers))
    refuse_open(open_questions, f"--to {to}")
    parameters = kind.parameters(flat, answers)
    return Gains(stage, drawing(flat), conversions(flat, answers), kind, parameters)
