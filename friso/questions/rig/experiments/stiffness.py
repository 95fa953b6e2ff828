"""Show how much position steps on the rig reveal of the joint's stiffness (thesis, Fig. 19)."""

from __future__ import annotations

from typing import Any

from friso.questions.rig.outcome_view import OutcomeView
from friso.shown.drawing.figure import Axis, Figure, Panel, Series
from friso.shown.drawing.palette import BLUE, LIGHT, VERMILLION
from friso.shown.drawing.prefixes import range_with_unit, with_unit
from friso.studies.rig.experiments.stiffness import Stiffness
from friso.studies.rig.outcome import Outcome


def sentences(outcome: Outcome) -> list[str]:
    """Say which joint stiffness the steps give, beside the true one."""
    result: Stiffness = outcome.result
    read = result.steps.stiffness
    if not read.determined:
        return [f"The steps do not show the joint's stiffness: {read.reason}."]
    lines = [
        f"The steps give a joint stiffness of {with_unit(read.value, 'N/m', 4)} (95 %: "
        f"{range_with_unit(read.low, read.high, 'N/m', 4)}); the true value is {with_unit(result.true, 'N/m', 4)}."
    ]
    if result.motor_constant_ratio != 1:
        lines.append(
            f"The motor gives {result.motor_constant_ratio:g} times the assumed force; that alone would make the "
            f"stiffness read {with_unit(result.apparent, 'N/m', 4)}."
        )
    return lines


def figures(outcome: Outcome) -> list[Figure]:
    """Draw position and force over time in the experiment with position steps."""
    result: Stiffness = outcome.result
    (log,) = outcome.logs
    time, seconds = result.steps.time, Axis("Time", "s")
    panels = (
        Panel(
            "",
            seconds,
            Axis("Position", "m"),
            (
                Series(time, log.logged["position"], "measured", BLUE),
                Series(time, log.logged["reference"], "reference", VERMILLION, "dashed", 1.0),
            ),
        ),
        Panel(
            "",
            seconds,
            Axis("Force", "N"),
            (
                Series(time, log.logged["force"], "commanded", LIGHT, width=0.8),
                Series(time, result.steps.force, "low-passed", BLUE),
            ),
        ),
    )
    caption = "Position steps with the cart fixed; the differences of the settled levels give the stiffness."
    return [Figure("rig_stiffness", "Joint stiffness by steps", caption, panels, subject=outcome.stage.name)]


def numbers(outcome: Outcome) -> dict[str, Any]:
    """Return the results for the JSON document."""
    result: Stiffness = outcome.result
    read = result.steps.stiffness
    return {
        "stiffness_n_per_m": read.value,
        "interval_n_per_m": [read.low, read.high],
        "true_n_per_m": result.true,
        "motor_constant_ratio": result.motor_constant_ratio,
        "apparent_n_per_m": result.apparent,
    }


VIEW = OutcomeView(sentences, figures, numbers)
