"""Show the results of stick-slip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from friso.identification.experiments.stick_slip import StickSlip
from friso.identification.kind import Source
from friso.identification.logs.log import Log
from friso.questions.identify.estimates import estimates_document
from friso.questions.identify.kind_view import TIME, WAYS, Facts, KindView
from friso.questions.identify.numbers import with_interval
from friso.shown.documents import entries
from friso.shown.drawing.figure import Axis, Figure, Markers, Panel, Series
from friso.shown.drawing.palette import GREY, INK
from friso.shown.drawing.prefixes import range_with_unit


def _facts(result: StickSlip) -> Facts:
    """List static friction, break-away forces and the joint's stiffness."""
    facts = [
        ("Static friction", with_interval(result.static)),
        ("Forward", with_interval(result.forward)),
        ("Backward", with_interval(result.backward)),
        ("Break-away force as measured, forward", with_interval(result.break_away_forward)),
        ("Break-away force as measured, backward", with_interval(result.break_away_backward)),
        ("Force common to both directions", with_interval(result.offset)),
        ("Stiffness of the joint", with_interval(result.stiffness)),
        ("Slips", str(len(result.times))),
    ]
    if len(result.times):
        facts.append(("Break-away forces, 5 % to 95 % of the slips", range_with_unit(*result.spread, "N")))
    return tuple(facts)


def _numbers(result: StickSlip) -> dict[str, Any]:
    """Return static friction with all slips, for the document."""
    sides = estimates_document(result, "forward", "backward", "break_away_forward", "break_away_backward")
    estimates = estimates_document(result, "static", "offset", "stiffness")
    return {**sides, **estimates, "slips": len(result.times), **entries(result, "spread_n", "warnings")}


def _figures(result: StickSlip, logs: Sequence[Source], name: str) -> list[Figure]:
    """Draw the force on the cart with its peaks, and the cart's speed, over time."""
    (log,) = logs
    assert isinstance(log, Log)
    pull = Series(log.time, _broken(result.pull, log), "force on the cart", GREY, width=1.0)
    peaks = tuple(
        Markers(result.times[chosen], sign * result.forces[chosen], f"break-away, {word}", WAYS[word], "triangle")
        for word, sign, chosen in (("forward", 1, result.directions > 0), ("backward", -1, result.directions < 0))
        if chosen.any()
    )
    speed = Series(log.time, _broken(result.cart_velocity, log), "", INK, width=0.9)
    time = replace(TIME, limits=(float(log.time[0]), float(log.time[-1])))
    panels = (
        Panel("", time, Axis("Force on the cart", "N"), (pull,), peaks),
        Panel("", time, Axis("Velocity of the cart", "m/s"), (speed,)),
    )
    caption = (
        "While the cart sticks, the force on it grows; at the peak it breaks away, and its velocity shows a spike. "
        f"Static friction: {with_interval(result.static)}."
    )
    return [Figure(f"{name}_slips", "Stick-slip", caption, panels)]


def _broken(values: np.ndarray, log: Log) -> np.ndarray:
    """Break the line of a signal of shape (n,) at the gaps of a log.

    The last sample before each gap becomes NaN.
    """
    broken = values.astype(float)
    broken[[part.stop - 1 for part in log.segments[:-1]]] = np.nan
    return broken


VIEW = KindView[StickSlip]("Stick-slip", _facts, _numbers, _figures)
