"""Show how much slow motion on the rig reveals of static friction (thesis, Fig. 20)."""

from __future__ import annotations

from typing import Any

import numpy as np

from friso.questions.rig.outcome_view import OutcomeView
from friso.shown.drawing.figure import Array, Axis, Band, Figure, Markers, Panel, Series
from friso.shown.drawing.palette import BLUE, GREEN, INK, VERMILLION
from friso.shown.drawing.prefixes import range_with_unit, with_unit
from friso.studies.rig.experiments.stiction import SPEED_MULTIPLES, Stiction
from friso.studies.rig.outcome import Outcome


def sentences(outcome: Outcome) -> list[str]:
    """Say at which forces the cart breaks away, beside the true static friction."""
    result: Stiction = outcome.result
    forces, within = result.forces, rails_within_interval(result)
    rails = len(result.by_rail)
    truth = range_with_unit(float(result.true.min()), float(result.true.max()), "N")
    if not len(forces):
        return [
            f"The cart does not slip on any of {rails} stretches of rail; the true static friction there is {truth}."
        ]
    return [
        f"At {with_unit(result.speed, 'm/s')} and {with_unit(SPEED_MULTIPLES[1] * result.speed, 'm/s')} the cart "
        "breaks away "
        f"{len(forces)} times on {rails} stretches of rail, at "
        f"{range_with_unit(float(forces.min()), float(forces.max()), 'N')}.",
        f"The true static friction there is {truth}; its mean along the travel lies within the 95 % interval on "
        f"{int(within.sum())} of {rails}.",
    ]


def rails_within_interval(result: Stiction) -> np.ndarray:
    """Tell on which rails the estimated interval contains the true static friction, (rails,).

    The true value is the middle between the least and the greatest friction on the rail.
    """
    middles = result.true.mean(axis=1)
    return np.array([slips.static.holds(middle) for slips, middle in zip(result.by_rail, middles, strict=True)])


def figures(outcome: Outcome) -> list[Figure]:
    """Draw the motion over time on the first rail, and the break-away forces on all rails."""
    result: Stiction = outcome.result
    log, first = outcome.logs[0], result.by_rail[0]
    time: Array = np.arange(len(first.pull), dtype=np.float64) * log.interval
    seconds = Axis("Time", "s")
    reference, start = log.logged["reference"], log.logged["reference"][0]
    panels = (
        Panel(
            "",
            seconds,
            Axis("Position", "m"),
            (
                Series(time, log.logged["position"] - start, "measured", BLUE),
                Series(time, reference - start, "reference", VERMILLION, "dashed", 1.0),
            ),
        ),
        Panel(
            "",
            seconds,
            Axis("Relative position", "m"),
            (Series(time, log.logged["relative_position"], "", GREEN, width=1.0),),
            (Markers(first.times, first.directions * first.deflections, "break-away", INK),),
        ),
        Panel("", seconds, Axis("Cart velocity", "m/s"), (Series(time, first.cart_velocity, "", BLUE, width=1.0),)),
    )
    caption = "The joint deflects while the cart sticks; at each peak the cart breaks away, and its velocity spikes."
    typical = Figure("rig_stiction", "Slow motion with stick-slip", caption, panels, subject=outcome.stage.name)
    return [typical, _rails(result, outcome.stage.name)]


def _rails(result: Stiction, subject: str) -> Figure:
    """Draw the break-away forces of each rail, over the range of its true static friction."""
    numbers_ = np.arange(1.0, len(result.by_rail) + 1)
    rows = np.concatenate([np.full(len(slips.forces), n) for n, slips in zip(numbers_, result.by_rail, strict=True)])
    truth = Band(numbers_, result.true[:, 0], result.true[:, 1], "true static friction along the travel", "#cfdfee")
    top = 1.1 * max(float(result.true.max()), float(result.forces.max(initial=0.0)))
    panel = Panel(
        "",
        Axis("Stretch of rail", "", (0.5, len(numbers_) + 0.5), step=1.0),
        Axis("Break-away force", "N", (0.0, top)),
        markers=(Markers(rows, result.forces, "read at a slip", INK),),
        bands=(truth,),
    )
    caption = "At a finite force rate the cart breaks away slightly before its static friction is reached."
    return Figure("rig_stiction_rails", "Break-away along the rail", caption, (panel,), subject=subject)


def numbers(outcome: Outcome) -> dict[str, Any]:
    """Return the results for the JSON document."""
    result: Stiction = outcome.result
    rows = [
        {
            "static_n": slips.static.value,
            "interval_n": [slips.static.low, slips.static.high],
            "break_away_n": slips.forces.tolist(),
            "true_range_n": true.tolist(),
        }
        for slips, true in zip(result.by_rail, result.true, strict=True)
    ]
    return {"speed_m_per_s": result.speed, "rails": rows}


VIEW = OutcomeView(sentences, figures, numbers)
