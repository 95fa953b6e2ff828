"""Draw the window of the crossover: where the machine hunts, and what bounds the crossover."""

from __future__ import annotations

import numpy as np

from friso.design_method.method import Design
from friso.design_method.population import Corners
from friso.frequency.crossover import WANTED, Range
from friso.questions.design.window import stiffest, view
from friso.questions.design.words import hertz
from friso.shown.drawing.figure import Axis, Band, Figure, Markers, Panel, Series

HUNTS, CLOSE, ALLOWED = "#eba27a", "#f6ddc0", "#a5d8c4"
"""Colours of forbidden values, of values that lack their safety factor, and of allowed values."""

HALF = 0.32
"""Half the height of a bar, relative to the height of its row."""

CHOSEN, EDGES = "#e3001b", "#7a3300"


def window_figure(design: Design) -> Figure:
    """Draw bars over the crossover: which crossovers are allowed, and at which stages hunt.

    The rows are the machine's limit, the leaf springs, the modulus margin, and hunting with and without the isolator.
    """
    visible = view(design)
    factor, multiple = design.spec.safety.hunting, design.spec.safety.parasitic
    allowed = [
        ("machine", [(0.0, design.spec.limit)]),
        ("leaves", [(0.0, stiffest(design))]),
        ("margin", list(design.fitted.comfortable)),
    ]
    hunting = [("isolator", design.edges), ("without", design.without)]
    rows = [name for name, _ in (*allowed, *hunting)][::-1]
    bands = []
    for name, ranges in allowed:
        bands += _bars(ranges, visible, rows.index(name), "allowed", ALLOWED)
    for name, corners in hunting:
        top = corners.highest if corners.hunts else 0.0
        bands += _bars([(0.0, top)], visible, rows.index(name), "hunts in some corner", HUNTS)
        bands += _bars([(top, factor * top)], visible, rows.index(name), f"within the safety factor {factor:g}", CLOSE)
    line = Series(
        np.full(2, design.controller.crossover), np.array([-0.5, len(rows) - 0.5]), "chosen", CHOSEN, width=2.0
    )
    points = _corners([(rows.index(name), corners) for name, corners in hunting], visible)
    axes = Axis("Crossover", "Hz", visible, log=True), Axis("", "", (-0.5, len(rows) - 0.5), words=tuple(rows))
    panel = Panel("", *axes, (line,), (points,), bands=_named_once(bands))
    caption = (
        f"What bounds the crossover, and the chosen one, {hertz(design.controller.crossover)}. Machine: its limit. "
        f"Leaves: the highest first interfering frequency of the front over {multiple:g}. Margin: modulus margin above "
        f"{WANTED:g}. Isolator, without: where the machine hunts with and without it; dots mark the edges in the "
        "corners of friction and masses; all but the highest are approximate."
    )
    return Figure("design_window", "The window for the crossover", caption, (panel,))


def _bars(ranges: list[Range], visible: Range, row: int, label: str, colour: str) -> list[Band]:
    """Return bars in a row of the figure, for the parts of `ranges` that are in view."""
    clipped = [(max(low, visible[0]), min(high, visible[1])) for low, high in ranges]
    return [
        Band(np.array(ends), np.full(2, row - HALF), np.full(2, row + HALF), label, colour)
        for ends in clipped
        if ends[0] < ends[1]
    ]


def _named_once(bands: list[Band]) -> tuple[Band, ...]:
    """Keep the label of only the first bar of each name, for the legend."""
    labels: set[str] = set()
    named = []
    for band in bands:
        named.append(Band(band.x, band.low, band.high, "" if band.label in labels else band.label, band.colour))
        labels.add(band.label)
    return tuple(named)


def _corners(rows: list[tuple[int, Corners]], visible: Range) -> Markers:
    """Return marks at the edges of hunting in view, one for each corner of friction and masses."""
    edges_of_rows = [
        (row, corners.edges[(corners.edges > visible[0]) & (corners.edges < visible[1])]) for row, corners in rows
    ]
    x = np.concatenate([edges for _, edges in edges_of_rows])
    y = np.concatenate([np.full(len(edges), float(row)) for row, edges in edges_of_rows])
    return Markers(x, y, "edge in a corner", EDGES, "circle")
