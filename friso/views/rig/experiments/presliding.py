"""What small motion on the rig shows of the bearing's bristles."""

from __future__ import annotations

from typing import Any

from friso.identify.experiments.presliding import Presliding
from friso.studies.rig.experiments.presliding import Bristles
from friso.studies.rig.outcome import Outcome
from friso.views.drawing.figure import Figure
from friso.views.drawing.prefixes import with_unit
from friso.views.identify.kinds.presliding import presliding_caption, presliding_panels
from friso.views.identify.numbers import with_interval
from friso.views.rig.outcome_view import OutcomeView


def sentences(outcome: Outcome) -> list[str]:
    """What was found."""
    result: Bristles = outcome.result
    said = [f"Place {number}: {_place(each)}." for number, each in enumerate(result.found, start=1)]
    stiffness, damping = with_unit(result.stiffness, "N/m", 4), with_unit(result.damping, "N*s/m", 4)
    return [*said, f"True bristles: stiffness {stiffness}, damping {damping}."]


def _place(result: Presliding) -> str:
    shown = {"stiffness": result.stiffness, "damping": result.damping, "moving mass": result.mass}
    return "; ".join(
        f"{words} {with_interval(each)}" if each.shown else f"{words} not shown ({each.reason})"
        for words, each in shown.items()
    )


def figures(outcome: Outcome) -> list[Figure]:
    """Force and model at the first place that shows the bristles."""
    found: Bristles = outcome.result
    result = next((each for each in found.found if len(each.model)), None)
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
    found: Bristles = outcome.result
    places = [
        {
            "stiffness_n_per_m": [result.stiffness.value, result.stiffness.low, result.stiffness.high],
            "damping_n_s_per_m": [result.damping.value, result.damping.low, result.damping.high],
            "mass_kg": [result.mass.value, result.mass.low, result.mass.high],
            "unexplained": result.unexplained,
        }
        for result in found.found
    ]
    return {"places": places, "true_stiffness_n_per_m": found.stiffness, "true_damping_n_s_per_m": found.damping}


VIEW = OutcomeView(sentences, figures, numbers)
