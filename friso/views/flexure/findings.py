"""A mechanism as both models see it, at one stroke: what `friso flexure` prints and draws."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from friso.flexure.evaluation import Evaluation, Mode
from friso.flexure.mechanism import Mechanism
from friso.stage import Stage
from friso.views.drawing.figure import BLUE, ORANGE

BEAMS, CLOSED = "Beams", "Closed forms"
COLOURS = {BEAMS: BLUE, CLOSED: ORANGE}


@dataclass(frozen=True)
class Found:
    """The leaf springs of a stage at a stroke by closed forms and by beams; None with the reason in `failure` where
    the beams found no answer."""

    stage: Stage
    closed: Evaluation
    beams: Evaluation | None
    failure: str = ""

    @property
    def best(self) -> Evaluation:
        """The one whose figures count."""
        return self.beams or self.closed

    @property
    def models(self) -> dict[str, Evaluation]:
        """What there is, by the name of its column."""
        models = {} if self.beams is None else {BEAMS: self.beams}
        return {**models, CLOSED: self.closed}

    @property
    def mechanism(self) -> Mechanism:
        return self.closed.mechanism


def interferes(evaluation: Evaluation, mode: Mode) -> bool:
    """Whether a mode disturbs control: all but the drive mode, on which control works, may."""
    return mode.interferes and mode is not evaluation.modes[0]


def named_modes(evaluation: Evaluation) -> dict[str, Mode]:
    """The modes by name, in their order; namesakes beyond the first are counted."""
    seen: Counter[str] = Counter()
    named = {}
    for mode in evaluation.modes:
        seen[mode.name] += 1
        named[mode.name if seen[mode.name] == 1 else f"{mode.name} ({seen[mode.name]})"] = mode
    return named
