"""Show how much small motion on the rig reveals of the bearing's bristles."""

from __future__ import annotations

from typing import Any

from friso.identification.experiments.presliding import Presliding
from friso.quantities import percent
from friso.questions.identify.kinds.presliding import presliding_caption, presliding_panels
from friso.questions.identify.numbers import with_interval
from friso.questions.rig.outcome_view import OutcomeView
from friso.shown.drawing.figure import Axis, Figure, Panel, Series
from friso.shown.drawing.palette import BLUE
from friso.shown.drawing.prefixes import with_unit
from friso.studies.rig.experiments.presliding import LOOP_AMPLITUDES, Bristles
from friso.studies.rig.outcome import Outcome

LOOP_ROWS = 4
"""Number of rows of loops in the figure."""


def sentences(outcome: Outcome) -> list[str]:
    """Say which stiffness and damping of the bristles each place shows, beside the true values."""
    result: Bristles = outcome.result
    lines = [f"Place {number}: {_place(place)}." for number, place in enumerate(result.by_place, start=1)]
    stiffness, damping = with_unit(result.stiffness, "N/m", 4), with_unit(result.damping, "N*s/m", 4)
    loops = (
        f"{len(result.loops)} loops of force over displacement, to {percent(LOOP_AMPLITUDES[0])} up to "
        f"{percent(LOOP_AMPLITUDES[-1])} of "
        "static friction, tell friction laws apart."
    )
    return [*lines, f"True bristles: stiffness {stiffness}, damping {damping}.", loops]


def _place(result: Presliding) -> str:
    """Write stiffness and damping of the bristles, and the mass, as identified at one place."""
    estimates = {"stiffness": result.stiffness, "damping": result.damping, "moving mass": result.mass}
    return "; ".join(
        f"{words} {with_interval(estimate)}" if estimate.determined else f"{words} not shown ({estimate.reason})"
        for words, estimate in estimates.items()
    )


def figures(outcome: Outcome) -> list[Figure]:
    """Draw force and model at the first place that shows the bristles, and the loops."""
    bristles: Bristles = outcome.result
    result = next((place for place in bristles.by_place if len(place.model)), None)
    small = [] if result is None else [_small(result, outcome)]
    return [*small, _loops(bristles, outcome)]


def _small(result: Presliding, outcome: Outcome) -> Figure:
    """Draw small motion before sliding, with the model of mass and bristles."""
    title = "Small motion before sliding"
    return Figure(
        "rig_presliding", title, presliding_caption(result), presliding_panels(result), subject=outcome.stage.name
    )


def _loops(bristles: Bristles, outcome: Outcome) -> Figure:
    """Draw force over displacement, from the smallest loop to the largest."""
    panels = []
    for share, log in zip(LOOP_AMPLITUDES, bristles.loops, strict=True):
        displacement = log.logged["position"] - log.logged["position"][:1]
        line = Series(displacement, log.logged["force"], "", BLUE, width=1.0)
        title = f"To {percent(share)} of static friction"
        panels.append(Panel(title, Axis("Displacement", "m"), Axis("Force", "N"), (line,)))
    caption = "Commanded force over displacement at one place, four turns each. One far wider than others broke away."
    columns = len(LOOP_AMPLITUDES) // LOOP_ROWS
    return Figure(
        "rig_presliding_loops", "Loops before sliding", caption, tuple(panels), columns, subject=outcome.stage.name
    )


def numbers(outcome: Outcome) -> dict[str, Any]:
    """Return the results for the JSON document."""
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
    return {
        "places": places,
        "true_stiffness_n_per_m": bristles.stiffness,
        "true_damping_n_s_per_m": bristles.damping,
        "loops_share_of_static": [*LOOP_AMPLITUDES],
    }


VIEW = OutcomeView(sentences, figures, numbers)
