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
    found: Bristles = outcome.result
    said = [f"Place {number}: {_place(each)}." for number, each in enumerate(found.found, start=1)]
    stiffness, damping = with_unit(found.stiffness, "N/m", 4), with_unit(found.damping, "N*s/m", 4)
    return [*said, f"The true values of the bristles are {stiffness} and {damping}."]


def _place(it: Presliding) -> str:
    shown = {"stiffness": it.stiffness, "damping": it.damping, "moving mass": it.mass}
    return "; ".join(
        f"{words} {with_interval(each)}" if each.shown else f"{words} not shown ({each.reason})"
        for words, each in shown.items()
    )


def figures(outcome: Outcome) -> list[Figure]:
    """Force and model at the first place that shows the bristles."""
    found: Bristles = outcome.result
    it = next((each for each in found.found if len(each.model)), None)
    if it is None:
        return []
    title = "Small motion before sliding"
    return [Figure("rig_presliding", title, presliding_caption(it), presliding_panels(it), subject=outcome.stage.name)]


def numbers(outcome: Outcome) -> dict[str, Any]:
    """As JSON."""
    found: Bristles = outcome.result
    places = [
        {
            "stiffness_n_per_m": [it.stiffness.value, it.stiffness.low, it.stiffness.high],
            "damping_n_s_per_m": [it.damping.value, it.damping.low, it.damping.high],
            "mass_kg": [it.mass.value, it.mass.low, it.mass.high],
            "unexplained": it.unexplained,
        }
        for it in found.found
    ]
    return {"places": places, "true_stiffness_n_per_m": found.stiffness, "true_damping_n_s_per_m": found.damping}


VIEW = OutcomeView(sentences, figures, numbers)
