"""Evaluate leaf springs by both models at one stroke."""

from __future__ import annotations

from dataclasses import dataclass

from friso.leaf_springs.beams import BeamFailure, beams
from friso.leaf_springs.closed_model import closed_form_model
from friso.leaf_springs.evaluation import Evaluation
from friso.leaf_springs.mechanism import Mechanism
from friso.stage import Stage

BEAMS, CLOSED = "Beams", "Closed forms"
"""Names of the models."""


@dataclass(frozen=True)
class BothModels:
    """The leaf springs of a stage at a stroke, by closed forms and by beams.

    `beams` is None where the beam model has no solution; `failure` gives the reason.
    """

    stage: Stage
    closed: Evaluation
    beams: Evaluation | None
    failure: str = ""

    @property
    def best(self) -> Evaluation:
        """Return the more exact evaluation: beams, if they have a solution."""
        return self.beams or self.closed

    @property
    def models(self) -> dict[str, Evaluation]:
        """Return the evaluations by the name of the model."""
        models = {} if self.beams is None else {BEAMS: self.beams}
        return {**models, CLOSED: self.closed}

    @property
    def mechanism(self) -> Mechanism:
        """Return the mechanism that was evaluated."""
        return self.closed.mechanism


def both_models(stage: Stage, mechanism: Mechanism, stroke: float) -> BothModels:
    """Evaluate the leaf springs of a stage at a stroke [m].

    If the beam model fails, the result has the reason.
    """
    simple = closed_form_model(mechanism, stroke)
    try:
        return BothModels(stage, simple, beams(mechanism, stroke))
    except BeamFailure as failure:
        return BothModels(stage, simple, None, str(failure))
