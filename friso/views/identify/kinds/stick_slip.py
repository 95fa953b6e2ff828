"""How stick-slip is shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from friso.identify.experiments.stick_slip import StickSlip
from friso.identify.kind import Source
from friso.identify.logs.log import Log
from friso.views.drawing.figure import GREY, INK, Axis, Figure, Markers, Panel, Series
from friso.views.drawing.prefixes import range_with_unit
from friso.views.identify.estimates import estimate_document
from friso.views.identify.kind_view import TIME, WAYS, Facts, KindView
from friso.views.identify.numbers import with_interval


def _facts(it: StickSlip) -> Facts:
    facts = [
        ("Static friction", with_interval(it.static)),
        ("Forward", with_interval(it.forward)),
        ("Backward", with_interval(it.backward)),
        ("Break-away force as measured, forward", with_interval(it.break_away_forward)),
        ("Break-away force as measured, backward", with_interval(it.break_away_backward)),
        ("Force common to both directions", with_interval(it.offset)),
        ("Stiffness of the joint", with_interval(it.stiffness)),
        ("Slips", str(len(it.times))),
    ]
    if len(it.times):
        facts.append(("Break-away forces, 5 % to 95 % of the slips", range_with_unit(*it.spread, "N")))
    return tuple(facts)


def _numbers(it: StickSlip) -> dict[str, Any]:
    several = {
        "static": it.static,
        "forward": it.forward,
        "backward": it.backward,
        "break_away_forward": it.break_away_forward,
        "break_away_backward": it.break_away_backward,
        "offset": it.offset,
        "stiffness": it.stiffness,
    }
    told = {name: estimate_document(each) for name, each in several.items()}
    return {**told, "slips": len(it.times), "spread_n": list(it.spread), "warnings": list(it.warnings)}


def _figures(it: StickSlip, logs: Sequence[Source], name: str) -> list[Figure]:
    """Force on the cart with its peaks, and the cart's speed, over time."""
    (log,) = logs
    assert isinstance(log, Log)
    pull = Series(log.time, _broken(it.pull, log), "force on the cart", GREY, width=1.0)
    peaks = tuple(
        Markers(it.times[chosen], way * it.forces[chosen], f"break-away, {word}", WAYS[word], "triangle")
        for word, way, chosen in (("forward", 1, it.directions > 0), ("backward", -1, it.directions < 0))
        if chosen.any()
    )
    speed = Series(log.time, _broken(it.cart_velocity, log), "", INK, width=0.9)
    time = replace(TIME, limits=(float(log.time[0]), float(log.time[-1])))
    panels = (
        Panel("", time, Axis("Force on the cart", "N"), (pull,), peaks),
        Panel("", time, Axis("Velocity of the cart", "m/s"), (speed,)),
    )
    caption = (
        "While the cart sticks, the force on it grows; at the peak it breaks away, and its velocity shows a spike. "
        f"Static friction: {with_interval(it.static)}."
    )
    return [Figure(f"{name}_slips", "Stick-slip", caption, panels)]


def _broken(values: np.ndarray, log: Log) -> np.ndarray:
    """A signal of shape (n,) whose line breaks at the gaps of a log: without the last sample before each."""
    broken = values.astype(float)
    broken[[part.stop - 1 for part in log.segments[:-1]]] = np.nan
    return broken


VIEW = KindView[StickSlip]("Stick-slip", _facts, _numbers, _figures)
