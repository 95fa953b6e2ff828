"""How break-away ramps are shown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from friso.identify.experiments.break_away import BreakAway
from friso.identify.kind import Source
from friso.views.drawing.figure import INK, Axis, Band, Figure, Limit, Markers, Panel
from friso.views.drawing.prefixes import range_with_unit
from friso.views.identify.estimates import estimate_document
from friso.views.identify.kind_view import AREA, WAYS, Facts, KindView
from friso.views.identify.numbers import with_interval


def _facts(it: BreakAway) -> Facts:
    facts = [
        ("Static friction", with_interval(it.static)),
        ("Forward", with_interval(it.forward)),
        ("Backward", with_interval(it.backward)),
        ("Ramps", str(len(it.times))),
    ]
    if len(it.rates):
        facts.append(("Force rates", range_with_unit(float(it.rates.min()), float(it.rates.max()), "N/s")))
    return tuple(facts)


def _numbers(it: BreakAway) -> dict[str, Any]:
    several = {"static": it.static, "forward": it.forward, "backward": it.backward}
    told = {name: estimate_document(each) for name, each in several.items()}
    ramps = {"forces_n": it.forces, "rates_n_per_s": it.rates, "directions": it.directions}
    return {**told, **ramps, "warnings": list(it.warnings)}


def _figures(it: BreakAway, logs: Sequence[Source], name: str) -> list[Figure]:
    """Break-away force over force rate."""
    if not len(it.times):
        return []
    points = tuple(
        Markers(it.rates[chosen], it.forces[chosen], word, WAYS[word])
        for word, chosen in (("forward", it.directions > 0), ("backward", it.directions < 0))
        if chosen.any()
    )
    low, high = float(it.rates.min()) / 1.3, float(it.rates.max()) * 1.3
    bands, limits = (), ()
    if np.isfinite([it.static.low, it.static.high]).all():
        ends = np.array([low, high])
        bands = (Band(ends, np.full(2, it.static.low), np.full(2, it.static.high), "static friction, 95 %", AREA),)
    if it.static.shown:
        limits = (Limit((it.static.value,), "", INK),)
    panel = Panel(
        "",
        Axis("Force rate", "N/s", (low, high), log=True),
        Axis("Break-away force", "N"),
        (),
        points,
        limits,
        bands=bands,
    )
    caption = f"Each ramp from rest. Static friction, as of the slowest ramps: {with_interval(it.static)}."
    return [Figure(f"{name}_rates", "Break-away force over force rate", caption, (panel,))]


VIEW = KindView[BreakAway]("Break-away ramps", _facts, _numbers, _figures)
