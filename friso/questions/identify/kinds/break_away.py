"""Show the results of break-away ramps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from friso.identification.experiments.break_away import BreakAway
from friso.identification.kind import Source
from friso.questions.identify.estimates import estimates_document
from friso.questions.identify.kind_view import AREA, WAYS, Facts, KindView
from friso.questions.identify.numbers import with_interval
from friso.shown.documents import entries
from friso.shown.drawing.figure import Axis, Band, Figure, Limit, Markers, Panel
from friso.shown.drawing.palette import INK
from friso.shown.drawing.prefixes import range_with_unit


def _facts(result: BreakAway) -> Facts:
    """List static friction, overall and by direction, with number and force rates of the ramps."""
    facts = [
        ("Static friction", with_interval(result.static)),
        ("Forward", with_interval(result.forward)),
        ("Backward", with_interval(result.backward)),
        ("Ramps", str(len(result.ramps.times))),
    ]
    if len(rates := result.ramps.rates):
        facts.append(("Force rates", range_with_unit(float(rates.min()), float(rates.max()), "N/s")))
    return tuple(facts)


def _numbers(result: BreakAway) -> dict[str, Any]:
    """Return static friction with all ramps, for the document."""
    estimates = estimates_document(result, "static", "forward", "backward")
    readings = entries(result.ramps, "forces_n", "rates_n_per_s", "directions")
    return {**estimates, **readings, **entries(result, "warnings")}


def _figures(result: BreakAway, logs: Sequence[Source], name: str) -> list[Figure]:
    """Draw the break-away force over the force rate; nothing without ramps."""
    ramps = result.ramps
    if not len(ramps.times):
        return []
    points = tuple(
        Markers(ramps.rates[chosen], ramps.forces[chosen], word, WAYS[word])
        for word, chosen in (("forward", ramps.directions > 0), ("backward", ramps.directions < 0))
        if chosen.any()
    )
    low, high = float(ramps.rates.min()) / 1.3, float(ramps.rates.max()) * 1.3
    bands, limits = (), ()
    if np.isfinite([result.static.low, result.static.high]).all():
        ends = np.array([low, high])
        bands = (
            Band(ends, np.full(2, result.static.low), np.full(2, result.static.high), "static friction, 95 %", AREA),
        )
    if result.static.determined:
        limits = (Limit((result.static.value,), "", INK),)
    panel = Panel(
        "",
        Axis("Force rate", "N/s", (low, high), log=True),
        Axis("Break-away force", "N"),
        (),
        points,
        limits,
        bands=bands,
    )
    caption = f"One point per ramp from rest. Static friction from the slowest ramps: {with_interval(result.static)}."
    return [Figure(f"{name}_rates", "Break-away force over force rate", caption, (panel,))]


VIEW = KindView[BreakAway]("Break-away ramps", _facts, _numbers, _figures)
