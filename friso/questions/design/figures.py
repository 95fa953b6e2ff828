"""Draw a design: Pareto front, modes, map of moves, margins over damping, and settling times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from friso.design_method.method import Design, UnfinishedDesign
from friso.design_method.requirements import Candidate, Confirmed
from friso.design_method.verification import Corners, MachineOutcomes
from friso.frequency.bode import COMFORTABLE_MARGIN, Range
from friso.materials import materials
from friso.questions.design.words import hertz, limit_name, size, stiffest, view
from friso.questions.flexure.figures import drawing_figure, modes_figure
from friso.questions.flexure.words import newtons_per
from friso.questions.map.words import QUIET
from friso.shown.drawing.drawable import cell_edges
from friso.shown.drawing.figure import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    VERMILLION,
    Array,
    Axis,
    Band,
    Category,
    Dash,
    Figure,
    Limit,
    Map,
    Markers,
    Panel,
    Series,
)
from friso.shown.text import listed

CHOSEN = "#e3001b"
"""Colour of the chosen design's marker, equal to the evaluation point's colour in maps."""

WIDE_RATIO, FEW_SHARE = 30.0, 0.01
"""Conditions for a logarithmic axis of settling times.

The axis is logarithmic if the longest time exceeds `WIDE_RATIO` times the quantile `FEW_SHARE`.
"""

DISTRIBUTION_POINTS = 401
"""Number of points of a distribution."""

CATEGORIES = (Category("rests in all corners", QUIET), Category("run failed", INK))


WORSE = ("#f7dcc4", VERMILLION)
"""Colours from few corners to all: pale to that of hunting on every map."""


def design_figures(design: Design | UnfinishedDesign) -> tuple[Figure, ...]:
    """Return all figures in the order in which they are read; none of an unfinished design."""
    if isinstance(design, UnfinishedDesign):
        return ()
    choice = design.fitted.choice
    modes = replace(modes_figure(choice.beams), name="design_modes")
    data = materials()[choice.geometry.sheet.material]
    leaves = drawing_figure(choice.beams.mechanism, design.fitted.task.stroke, f"{data.name}, {data.grade}")
    drawing = replace(leaves, name="design_drawing")
    figures = (_map(design), _front(design), drawing, modes, window_figure(design), _damping(design), _settling(design))
    return tuple(replace(figure, subject=design.stage.name) for figure in figures)


def _front(design: Design) -> Figure:
    """Draw the Pareto front: the first frequency that disturbs control, over drive stiffness."""
    choice, task, safety = design.fitted.choice, design.fitted.task, design.spec.safety
    multiple, stiffest = safety.parasitic, task.friction / (safety.breakaway * task.stroke)
    good = [confirmation for confirmation in design.confirmed if not confirmation.failure]
    failed = [confirmation.candidate for confirmation in design.confirmed if confirmation.failure]
    points = [
        Markers(*_points(good), "by beams", BLUE),
        *([Markers(*_points(failed), "beams failed", VERMILLION, "cross")] if failed else []),
        Markers(
            choice.beams.drive[:1] / 1e3, np.array([choice.frequency]), "chosen, by the beam model", CHOSEN, "target"
        ),
    ]
    limits = (
        Limit((multiple * design.controller.crossover,), f"{multiple:g} times the crossover chosen", INK),
        Limit((multiple * design.spec.limit,), f"{multiple:g} times {limit_name(design)}", ORANGE),
    )
    axes = Axis("Drive stiffness", "N/mm", prefixed=False), Axis("First interfering frequency", "Hz")
    line = Series(*_points(design.candidates), "front, by the closed forms", GREY, width=1.8)
    sheets = sorted(
        {candidate.geometry.sheet for candidate in design.candidates},
        key=lambda sheet: (sheet.thickness, sheet.leaves),
    )
    kinds = [f"{sheet.leaves:g} leaves of {size(sheet.thickness)} mm {sheet.material}" for sheet in sheets]
    caption = (
        "Pareto front: no leaves meeting all requirements are both softer and higher in their first interfering "
        "frequency. The front ends on the right where the cart would break away within the stroke, at "
        f"{newtons_per(stiffest, 'mm')}, or where space or available thicknesses end. On this front: "
        f"{listed(kinds, 'and')}."
    )
    panel = Panel("", *axes, (line,), tuple(points), limits)
    return Figure("design_front", "Pareto front of leaf springs", caption, (panel,))


def _points(several: Sequence[Candidate | Confirmed]) -> tuple[Array, Array]:
    """Return the stiffness [N/mm] and the frequency [Hz] of several leaf springs, as two arrays.

    The numbers are by closed forms for a `Candidate`, and by beams for a `Confirmed` one.
    """
    stiffness = np.array([candidate.stiffness / 1e3 for candidate in several])
    return stiffness, np.array([candidate.frequency for candidate in several])


def _map(design: Design) -> Figure:
    """Draw over crossover and stroke in which fraction of corners moves do not come to rest.

    Corners are the extremes of friction and masses.
    """
    hunting_map, crossover, stroke = design.map, design.controller.crossover, design.fitted.task.stroke
    codes = np.where(np.isnan(hunting_map.share), 1.0, np.where(hunting_map.share == 0, 0.0, np.nan))
    percents = np.where(np.isnan(codes), 100 * hunting_map.share, np.nan)
    strokes, shade = 1e3 * hunting_map.strokes, ("Corners not in position", "%", (0.0, 100.0))
    field = Map(hunting_map.crossovers, strokes, percents, *shade, categories=CATEGORIES, codes=codes, ramp=WORSE)
    right, up = _reach(hunting_map.crossovers), _reach(strokes)
    edge, limit = design.edges.highest, design.spec.limit
    lines: list[tuple[float, str, Dash]] = [
        (edge, f"edge of hunting at {size(stroke)} mm: {hertz(edge)}", "dashed"),
        (limit, f"{limit_name(design)}: {hertz(limit)}", "solid"),
    ]
    upright = [
        Series(np.full(2, at), np.array(up), label, INK, dash, 1.8)
        for at, label, dash in lines
        if right[0] < at < right[1]
    ]
    point = Markers(np.array([crossover]), np.array([1e3 * stroke]), "chosen", CHOSEN, "target")
    axes = Axis("Crossover", "Hz", right, log=True), Axis("Stroke", "mm", up, log=True, prefixed=False)
    panel = Panel("", *axes, tuple(upright), (point,), maps=(field,))
    caption = (
        f"The share of the {design.edges.population.count} corners of friction and masses in which the stage is not in "
        "position a quarter of a minute after a typical move: it swings, or creeps too slowly to "
        "settle. Drive stiffness as chosen."
    )
    return Figure("design_map", "Where moves do not come to rest, over crossover and stroke", caption, (panel,))


def _reach(centres: Array) -> tuple[float, float]:
    """Return the lower and upper end of a logarithmic axis of cells with these `centres`."""
    edges = cell_edges(centres, log=True)
    return float(edges[0]), float(edges[-1])


def _damping(design: Design) -> Figure:
    """Draw the least modulus margin over joint damping."""
    damping = design.controller.damping
    line = Series(damping.tried, damping.margins, "least modulus margin", BLUE)
    points = (
        Markers(damping.tried, damping.margins, "", BLUE),
        Markers(damping.tried[:1], damping.margins[:1], "as designed", CHOSEN, "target"),
    )
    limit = Limit((COMFORTABLE_MARGIN,), f"wanted: {COMFORTABLE_MARGIN:g}", INK)
    x = Axis("Joint damping", "N*s/m", log=bool(damping.tried[0] > 0), prefixed=False)
    top = 1.1 * max(float(damping.margins.max()), COMFORTABLE_MARGIN)
    panel = Panel("", x, Axis("Modulus margin", "", (0.0, top)), (line,), points, (limit,))
    caption = (
        "The smallest margin over all settled states if damping were added to the joint; 0 where one of them is "
        "unstable."
    )
    return Figure("design_damping", "Margin over joint damping", caption, (panel,))


def _settling(design: Design) -> Figure:
    """Draw the cumulative distributions of the settling time, with the joint free and locked."""
    free, locked = design.verification.free, design.verification.locked
    cases = ((free, "joint free", BLUE), (locked, "joint locked", ORANGE))
    lines = [Series(*_distribution(outcome), name, colour, width=1.8) for outcome, name, colour in cases]
    specified = design.spec.position.settling_time
    if specified is not None:
        lines.append(Series(np.full(2, float(specified)), np.array([0.0, 100.0]), "specified", INK, "dashed", 1.2))
    times = np.concatenate([line.x for line in lines])
    low, high = float(np.quantile(times, FEW_SHARE)), float(times.max())
    wide = high > WIDE_RATIO * low
    x = Axis("Settling time", "s", (0.8 * low if wide else 0.0, 1.05 * high), log=wide)
    panel = Panel(
        "", x, Axis("Moves in position", "%", (0.0, 102.0)), tuple(lines), limits=(Limit((95.0,), "95 %", GREEN),)
    )
    caption = (
        f"The share of the {free.tried} simulated moves that are in position to stay, over the time since the last "
        f"corner of the reference; {locked.tried} of the same machines with the joint locked. If a curve ends below "
        "100 %, the remaining moves do not come to rest."
    )
    return Figure("design_settling", "Settling times", caption, (panel,))


def _distribution(outcome: MachineOutcomes) -> tuple[Array, Array]:
    """Return settling times [s] in ascending order, and the moves settled by each of them [%]."""
    times = np.sort(np.maximum(outcome.settling[outcome.completed & np.isfinite(outcome.settling)], 1e-6))
    if not times.size:
        return np.array([1e-6]), np.array([np.nan])
    picked = np.unique(np.linspace(0, len(times) - 1, DISTRIBUTION_POINTS).round().astype(int))
    return times[picked], 100.0 * (picked + 1) / outcome.tried


HUNTS, CLOSE, ALLOWED = "#eba27a", "#f6ddc0", "#a5d8c4"
"""Colours of forbidden values, of values that lack their safety factor, and of allowed values."""

HALF_BAR = 0.32
"""Half the height of a bar, relative to the height of its row."""

EDGES = "#7a3300"
"""Colour of edges of hunting in corners."""


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
        f"{COMFORTABLE_MARGIN:g}. Isolator, without: where the machine hunts with and without it; dots mark the edges "
        "in the "
        "corners of friction and masses; all but the highest are approximate."
    )
    return Figure("design_window", "The window for the crossover", caption, (panel,))


def _bars(ranges: list[Range], visible: Range, row: int, label: str, colour: str) -> list[Band]:
    """Return bars in a row of the figure, for the parts of `ranges` that are in view."""
    clipped = [(max(low, visible[0]), min(high, visible[1])) for low, high in ranges]
    return [
        Band(np.array(ends), np.full(2, row - HALF_BAR), np.full(2, row + HALF_BAR), label, colour)
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
