"""How position steps are shown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from friso.identify.experiments.steps import StepStiffness
from friso.identify.kind import Source
from friso.views.drawing.figure import BLUE, INK, Axis, Band, Figure, Markers, Panel, Series
from friso.views.identify.estimates import estimate_document
from friso.views.identify.kind_view import AREA, TIME, Facts, KindView
from friso.views.identify.numbers import with_interval


def _facts(it: StepStiffness) -> Facts:
    return (
        ("Joint stiffness", with_interval(it.stiffness)),
        ("Steps up", with_interval(it.up)),
        ("Steps down", with_interval(it.down)),
        ("Hysteresis", with_interval(it.hysteresis)),
        ("Settled windows", str(len(it.windows))),
    )


def _sentences(it: StepStiffness) -> tuple[str, ...]:
    """Whether the cart moved, where that was measured."""
    fixed = {True: "The cart stood still.", False: "The cart moved.", None: ""}[it.cart_fixed]
    return (fixed,) if fixed else ()


def _numbers(it: StepStiffness) -> dict[str, Any]:
    windows = [{"start_s": w.start, "end_s": w.end, "deflection_m": w.position, "force_n": w.force} for w in it.windows]
    several = {"stiffness": it.stiffness, "up": it.up, "down": it.down, "hysteresis": it.hysteresis}
    told = {name: estimate_document(each) for name, each in several.items()}
    return {**told, "windows": windows, "cart_fixed": it.cart_fixed, "warnings": list(it.warnings)}


def _figures(it: StepStiffness, logs: Sequence[Source], name: str) -> list[Figure]:
    """Deflection and force over time with the settled windows, and the one over the other."""
    panels = []
    for quantity, unit, values in (("Deflection", "m", it.position), ("Force", "N", it.force)):
        low, high = float(values.min()), float(values.max())
        room = 0.06 * (high - low)
        bands = tuple(
            Band(
                np.array([w.start, w.end]),
                np.full(2, low - room),
                np.full(2, high + room),
                "settled" if i == 0 else "",
                AREA,
            )
            for i, w in enumerate(it.windows)
        )
        line = Series(it.time, values, quantity.lower() + ("" if unit == "m" else ", low-passed"), INK, width=1.0)
        panels.append(Panel("", TIME, Axis(quantity, unit, (low - room, high + room)), (line,), bands=bands))
    caption = "Shaded: where both had settled, and their means were taken."
    figures = [Figure(f"{name}_record", "Steps of the position", caption, tuple(panels))]
    if len(it.windows) < 2:
        return figures
    x, y = np.array([[w.position, w.force] for w in it.windows]).T
    lines = ()
    if it.stiffness.shown:
        ends = np.array([x.min(), x.max()])
        line = y.mean() + it.stiffness.value * (ends - x.mean())
        lines = (Series(ends, line, f"stiffness {with_interval(it.stiffness)}", BLUE),)
    points = Markers(x, y, "settled windows", INK)
    panel = Panel("", Axis("Deflection", "m"), Axis("Force", "N"), lines, (points,))
    caption = f"Means of the settled windows. Hysteresis: {with_interval(it.hysteresis)}."
    return [*figures, Figure(f"{name}_stiffness", "Force over deflection", caption, (panel,))]


VIEW = KindView[StepStiffness]("Position steps", _facts, _numbers, _figures, sentences=_sentences)
