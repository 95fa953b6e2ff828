"""Draw the figures of an experiment of the rig."""

from __future__ import annotations

from friso.questions.rig.outcome_view import view_of
from friso.shown.drawing.figure import Figure
from friso.studies.rig.outcome import Outcome


def rig_figures(outcome: Outcome) -> list[Figure]:
    """Return the figures of an experiment, arranged as in the thesis."""
    return view_of(outcome.experiment).figures(outcome)
