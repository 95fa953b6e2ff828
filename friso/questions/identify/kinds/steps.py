"""Show the results of position steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from friso.identification.experiments.steps import StepStiffness
from friso.identification.kind import Source
from friso.questions.identify.estimates import estimates_document
from friso.questions.identify.kind_view import AREA, TIME, Facts, KindView
from friso.questions.identify.numbers import with_interval
from friso.shown.documents import entries
from friso.shown.drawing.figure import Axis, Band, Figure, Markers, Panel, Series
from friso.shown.drawing.palette import BLUE, INK


def _facts(result: StepStiffness) -> Facts:
    """List the stiffness of all steps, up and down, and the hysteresis."""
    return (
        ("Joint stiffness", with_interval(result.stiffness)),
        ("Steps up", with_interval(result.up)),
        ("Steps down", with_interval(result.down)),
        ("Hysteresis", with_interval(result.hysteresis)),
        ("Settled windows", str(len(result.windows))),
    )


def _sentences(result: StepStiffness) -> tuple[str, ...]:
    """Say whether the cart moved; empty if that was not measured."""
    fixed = {True: "The cart stood still.", False: "The cart moved.", None: ""}[result.cart_fixed]
    return (fixed,) if fixed else ()


def _numbers(result: StepStiffness) -> dict[str, Any]:
    """Return the stiffness, and the times at rest from which it follows, for the document."""
    windows = [
        {**entries(window, "force_n"), "start_s": window.start, "end_s": window.end, "deflection_m": window.position}
        for window in result.windows
    ]
    estimates = estimates_document(result, "stiffness", "up", "down", "hysteresis")
    return {**estimates, "windows": windows, **entries(result, "cart_fixed", "warnings")}


def _figures(result: StepStiffness, logs: Sequence[Source], name: str) -> list[Figure]:
    """Draw deflection and force over time with the settled windows, and force over deflection."""
    panels = []
    for quantity, unit, values in (("Deflection", "m", result.position), ("Force", "N", result.force)):
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
            for i, w in enumerate(result.windows)
        )
        line = Series(result.time, values, quantity.lower() + ("" if unit == "m" else ", low-passed"), INK, width=1.0)
        panels.append(Panel("", TIME, Axis(quantity, unit, (low - room, high + room)), (line,), bands=bands))
    caption = "Shaded: settled windows, of which the means are used."
    figures = [Figure(f"{name}_record", "Steps of the position", caption, tuple(panels))]
    if len(result.windows) < 2:
        return figures
    x, y = np.array([[w.position, w.force] for w in result.windows]).T
    lines = ()
    if result.stiffness.determined:
        ends = np.array([x.min(), x.max()])
        line = y.mean() + result.stiffness.value * (ends - x.mean())
        lines = (Series(ends, line, f"stiffness {with_interval(result.stiffness)}", BLUE),)
    points = Markers(x, y, "settled windows", INK)
    panel = Panel("", Axis("Deflection", "m"), Axis("Force", "N"), lines, (points,))
    caption = f"Means of the settled windows. Hysteresis: {with_interval(result.hysteresis)}."
    return [*figures, Figure(f"{name}_stiffness", "Force over deflection", caption, (panel,))]


VIEW = KindView[StepStiffness]("Position steps", _facts, _numbers, _figures, sentences=_sentences)
