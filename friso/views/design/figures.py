"""The figures of a design: Pareto front, modes, hunting map, margins over damping, settling times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from friso.design.choice import Confirmed
from friso.design.front import Candidate
from friso.design.method import Design
from friso.design.verification import Outcome
from friso.frequency.crossover import WANTED
from friso.views.design.window_figure import window_figure
from friso.views.design.words import hertz, size
from friso.views.drawing.drawable import cell_edges
from friso.views.drawing.figure import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    VERMILLION,
    Array,
    Axis,
    Dash,
    Figure,
    Kind,
    Limit,
    Map,
    Markers,
    Panel,
    Series,
)
from friso.views.drawing.prefixes import listed
from friso.views.flexure.modes import modes_figure
from friso.views.flexure.table import newtons_per
from friso.views.map.words import QUIET

CHOSEN = "#e3001b"
"""The marker of what was chosen, as that of an evaluation point in maps."""

WIDE, FEW = 30.0, 0.01
"""Settling times more than so many times as long as the share of the shortest are drawn on a logarithmic axis."""

SHARES = 401
"""Points of a distribution."""

KINDS = (Kind("settles in all corners", QUIET), Kind("run failed", INK))


def design_figures(found: Design) -> tuple[Figure, ...]:
    """All figures, in the order in which they are read."""
    figures = (_map(found), _front(found), _modes(found), window_figure(found), _damping(found), _settling(found))
    return tuple(replace(figure, subject=found.stage.name) for figure in figures)


def _front(found: Design) -> Figure:
    """Drive stiffness against first interfering frequency."""
    choice, multiple = found.fitted.choice, found.spec.safety.parasitic
    good = [each for each in found.confirmed if not each.failure]
    failed = [each.candidate for each in found.confirmed if each.failure]
    points = [
        Markers(*_points(good), "by beams", BLUE),
        *([Markers(*_points(failed), "beams failed", VERMILLION, "cross")] if failed else []),
        Markers(choice.beams.drive[:1] / 1e3, np.array([choice.frequency]), "chosen, by beams", CHOSEN, "target"),
    ]
    limits = (
        Limit((multiple * found.controller.crossover,), f"{multiple:g} times the crossover chosen", INK),
        Limit((multiple * found.spec.limit,), f"{multiple:g} times the machine's limit", ORANGE),
    )
    axes = Axis("Drive stiffness", "N/mm", prefixed=False), Axis("First interfering frequency", "Hz")
    line = Series(*_points(found.candidates), "front, by closed forms", GREY, width=1.8)
    sheets = sorted({each.geometry.sheet for each in found.candidates}, key=lambda each: (each.thickness, each.leaves))
    kinds = [f"{each.leaves:g} leaves of {size(each.thickness)} mm {each.material}" for each in sheets]
    caption = (
        "The best that can be built: no leaves within all requirements are both softer and have a higher first "
        "interfering frequency. It ends on the right where the cart would break away inside the stroke, at "
        f"{newtons_per(_stiffest(found), 'mm')}, or where space or sheets end. On this front: {listed(kinds, 'and')}."
    )
    panel = Panel("", *axes, (line,), tuple(points), limits)
    return Figure("design_front", "Pareto front of leaf springs", caption, (panel,))


def _stiffest(found: Design) -> float:
    """The drive stiffness [N/m] from which the cart breaks away inside the stroke."""
    task = found.fitted.task
    return task.friction / (found.spec.safety.breakaway * task.stroke)


def _points(several: Sequence[Candidate | Confirmed]) -> tuple[Array, Array]:
    """Stiffness [N/mm] and frequency [Hz] of candidates, by closed forms or beams."""
    return np.array([each.stiffness / 1e3 for each in several]), np.array([each.frequency for each in several])


def _modes(found: Design) -> Figure:
    return replace(modes_figure(found.fitted.choice.beams), name="design_modes")


def _map(found: Design) -> Figure:
    """Hunting over crossover and stroke."""
    it, crossover, stroke = found.map, found.controller.crossover, found.fitted.task.stroke
    codes = np.where(np.isnan(it.share), 1.0, np.where(it.share == 0, 0.0, np.nan))
    percents = np.where(np.isnan(codes), 100 * it.share, np.nan)
    strokes, shade = 1e3 * it.strokes, ("Corners not in position", "%", (0.0, 100.0))
    field = Map(it.crossovers, strokes, percents, *shade, kinds=KINDS, codes=codes)
    right, up = _reach(it.crossovers), _reach(strokes)
    edge, limit = found.edges.highest, found.spec.limit
    lines: list[tuple[float, str, Dash]] = [
        (edge, f"edge of hunting at {size(stroke)} mm: {hertz(edge)}", "dashed"),
        (limit, f"machine's limit: {hertz(limit)}", "solid"),
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
        f"The share of the {found.edges.population.count} corners of friction and masses in which the stage is not in "
        "position a quarter of a minute after a typical move: it hunts, or creeps so slowly that it may as well. Drive "
        "stiffness as chosen."
    )
    return Figure("design_map", "Hunting over crossover and stroke", caption, (panel,))


def _reach(centres: Array) -> tuple[float, float]:
    """The outer edges of cells around logarithmic centres."""
    edges = cell_edges(centres, log=True)
    return float(edges[0]), float(edges[-1])


def _damping(found: Design) -> Figure:
    """The least modulus margin over joint damping."""
    it = found.controller.damping
    line = Series(it.tried, it.margins, "least modulus margin", BLUE)
    points = (
        Markers(it.tried, it.margins, "", BLUE),
        Markers(it.tried[:1], it.margins[:1], "as designed", CHOSEN, "target"),
    )
    limit = Limit((WANTED,), f"wanted: {WANTED:g}", INK)
    x = Axis("Joint damping", "N*s/m", log=bool(it.tried[0] > 0), prefixed=False)
    top = 1.1 * max(float(it.margins.max()), WANTED)
    panel = Panel("", x, Axis("Modulus margin", "", (0.0, top)), (line,), points, (limit,))
    caption = "The least of all settled states, if damping were added to the joint; 0 where one is not stable."
    return Figure("design_damping", "Margin over joint damping", caption, (panel,))


def _settling(found: Design) -> Figure:
    """Cumulative distributions of the settling time."""
    free, locked = found.verification.free, found.verification.locked
    cases = ((free, "joint free", BLUE), (locked, "joint locked", ORANGE))
    lines = [Series(*_distribution(each), name, colour, width=1.8) for each, name, colour in cases]
    wanted = found.spec.position.settling_time
    if wanted is not None:
        lines.append(Series(np.full(2, float(wanted)), np.array([0.0, 100.0]), "specified", INK, "dashed", 1.2))
    times = np.concatenate([each.x for each in lines])
    low, high = float(np.quantile(times, FEW)), float(times.max())
    wide = high > WIDE * low
    x = Axis("Settling time", "s", (0.8 * low if wide else 0.0, 1.05 * high), log=wide)
    panel = Panel(
        "", x, Axis("Moves in position", "%", (0.0, 102.0)), tuple(lines), limits=(Limit((95.0,), "95 %", GREEN),)
    )
    caption = (
        f"The share of the {free.tried} simulated moves that are in position for good, over the time since the last "
        "corner of the reference; the same machines with the joint free and locked. A curve that ends below 100 %: the "
        "others hunt."
    )
    return Figure("design_settling", "Settling times", caption, (panel,))


def _distribution(it: Outcome) -> tuple[Array, Array]:
    """Settling times [s] and the shares of the moves [%] that have settled by then."""
    times = np.sort(np.maximum(it.settling[it.completed & np.isfinite(it.settling)], 1e-6))
    if not times.size:
        return np.array([1e-6]), np.array([np.nan])
    picked = np.unique(np.linspace(0, len(times) - 1, SHARES).round().astype(int))
    return times[picked], 100.0 * (picked + 1) / it.tried
