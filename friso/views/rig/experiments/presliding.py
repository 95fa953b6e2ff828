"""What small motion on the rig shows of the bearing's bristles."""

from __future__ import annotations

from typing import Any

from friso.identification.experiments.presliding import Presliding
from friso.studies.rig.experiments.presliding import Bristles
from friso.studies.rig.outcome import Outcome
from friso.views.drawing.figure import Figure
from friso.views.drawing.prefixes import with_unit
from friso.views.identify.kinds.presliding import presliding_caption, presliding_panels
from friso.views.identify.numbers import with_interval
from friso.views.rig.outcome_view import OutcomeView


def sentences(outcome: Outcome) -> list[str]:
    """The results in sentences."""
    result: Bristles = outcome.result
    lines = [f"Place {number}: {_place(place)}." for number, place in enumerate(result.by_place, start=1)]
    stiffness, damping = with_unit(result.stiffness, "N/m", 4), with_unit(result.damping, "N*s/m", 4)
    return [*lines, f"True bristles: stiffness {stiffness}, damping {damping}."]


def _place(result: Presliding) -> str:
    estimates = {"stiffness": result.stiffness, "damping": result.damping, "moving mass": result.mass}
    return "; ".join(
        f"{words} {with_interval(estimate)}" if estimate.determined else f"{words} not shown ({estimate.reason})"
        for words, estimate in estimates.items()
    )


def figures(outcome: Outcome) -> list[Figure]:
    """Force and model at the first place that shows the bristles."""
    bristles: Bristles = outcome.result
    result = next((place for place in bristles.by_place if len(place.model)), None)
    if result is None:
        return []
    title = "Small motion before sliding"
    return [
        Figure(
            "rig_presliding", title, presliding_caption(result), presliding_panels(result), subject=outcome.stage.name
        )
    ]


def numbers(outcome: Outcome) -> dict[str, Any]:
    """As JSON."""
    bristles: Bristles = outcome.result
    places = [
        {
            "stiffness_n_per_m": [result.stiffness.value, result.stiffness.low, result.stiffness.high],
            "damping_n_s_per_m": [result.damping.value, result.damping.low, result.damping.high],
            "mass_kg": [result.mass.value, result.mass.low, result.mass.high],
            "unexplained": result.unexplained,
        }
        for result in bristles.by_place
    ]
    return {"places": places, "true_stiffness_n_per_m": bristles.stiffness, "true_damping_n_s_per_m": bristles.damping}


VIEW = OutcomeView(sentences, figures, numbers)
