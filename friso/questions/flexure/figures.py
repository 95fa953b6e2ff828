"""Draw leaf springs: to scale, with their stiffness over the deflection, and their modes.

The drawing shows the mechanism from the side and from above, with its dimensions. Force and support stiffness are drawn
over the deflection.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from friso.leaf_springs.beams import BEAMS, CLOSED, BothModels
from friso.leaf_springs.mechanism import Evaluation, Mechanism, Mode
from friso.materials import materials
from friso.shown.drawing.figure import (
    BLUE,
    GREY,
    INK,
    LIGHT,
    ORANGE,
    VERMILLION,
    Area,
    Array,
    Axis,
    Dash,
    Figure,
    Lettering,
    Markers,
    Panel,
    Series,
)
from friso.shown.text import with_unit

CLAMP_SHARE, MARGIN_SHARE = 0.05, 0.12
"""Length of a clamp, and margin around the drawing, in lengths of a leaf."""

POINTS = {"A": "actuation, along z", "S": "sensor", "C": "centre of mass"}
"""Marked points by their letters."""

Corner = tuple[float, float]


def block_size(mechanism: Mechanism) -> tuple[float, float, float]:
    """Return the edges [m] along x, y, z of the block with the stage's mass and inertia.

    An edge that the moments of inertia do not allow is 0.
    """
    x, y, z = (6 * float(moment) / float(mechanism.body.mass) for moment in mechanism.body.inertia)
    return math.sqrt(max(0.0, y + z - x)), math.sqrt(max(0.0, x + z - y)), math.sqrt(max(0.0, x + y - z))


def drawing_figure(mechanism: Mechanism, stroke: float, material: str = "") -> Figure:
    """Return the drawing of a mechanism; `stroke` [m] is the gap to the limiter on each side."""
    size = " x ".join(_mm(edge) for edge in (mechanism.length, mechanism.width, mechanism.thickness))
    strength = f"yield {mechanism.yield_strength / 1e6:.4g} MPa"
    if math.isfinite(mechanism.fatigue):
        strength += f", fatigue {mechanism.fatigue / 1e6:.4g} MPa"
    block = " x ".join(_mm(edge) for edge in block_size(mechanism))
    caption = (
        f"{mechanism.leaves:g} leaf springs {size} mm between their clamps, {_mm(mechanism.spacing)} mm apart; stroke "
        f"{_mm(stroke)} mm to each side (dashed). {material or 'Material'}: E {mechanism.young / 1e9:.4g} GPa, ν "
        f"{mechanism.poisson:g}, {mechanism.density:.4g} kg/m³, {strength}. Stage: {mechanism.body.mass:.4g} kg, as a "
        f"block of its moments of inertia, {block} mm. x, y, z from the middle between the clamps at the cart: "
        f"{_points(mechanism)}. Not to scale: the clamps."
    )
    panels = (_side_view(mechanism, stroke), _top_view(mechanism))
    return Figure("flexure_drawing", "Leaf springs", caption, panels)


def _side_view(mechanism: Mechanism, stroke: float) -> Panel:
    """Return the view from the side: leaves, straight and deflected by the stroke, clamps and stage."""
    share = np.linspace(0.0, 1.0, 33)
    x, bend = float(mechanism.length) * share, stroke * (3 * share**2 - 2 * share**3)
    lines = [
        Series(x, offset + side * bend, "", BLUE, "dashed", 0.8) for offset in mechanism.offsets for side in (-1, 1)
    ]
    lines += [Series(x, np.full(x.size, float(offset)), "", INK, width=1.6) for offset in mechanism.offsets]
    row = float(mechanism.depth) / 2 + CLAMP_SHARE * float(mechanism.length)
    return _view("From the side", "z", mechanism, 2, row, max(row, float(mechanism.depth) / 2 + stroke), lines)


def _top_view(mechanism: Mechanism) -> Panel:
    """Return the view from above: the outline of the leaves, clamps and stage."""
    half, length = float(mechanism.width) / 2, float(mechanism.length)
    outline = _ring((0.0, -half), (length, half), INK)
    return _view("From above", "y", mechanism, 1, half + CLAMP_SHARE * length, half, [outline])


def _view(
    title: str, up: str, mechanism: Mechanism, axis: int, clamp: float, reach: float, lines: Sequence[Series]
) -> Panel:
    """Return a view with x to the right and the `axis` (1: y, 2: z), named `up`, upwards.

    Clamps reach `clamp` [m] to both sides, and what is drawn by `lines` reaches `reach` [m].
    """
    length, centre = float(mechanism.length), mechanism.body.centre
    thick = CLAMP_SHARE * length
    edges = block_size(mechanism)
    corners = [(float(centre[k]) - edges[k] / 2, float(centre[k]) + edges[k] / 2) for k in (0, axis)]
    (left, right), (low, high) = corners
    places = {"A": mechanism.actuation, "S": mechanism.sensor, "C": centre}
    marks = {letter: (float(place[0]), float(place[axis])) for letter, place in places.items()}
    hatched = [_area((-thick, -clamp), (0.0, clamp), GREY), _area((length, -clamp), (length + thick, clamp), GREY)]
    xs = [-thick, length + thick, left, right, *(x for x, _ in marks.values())]
    ys = [-clamp, clamp, -reach, reach, low, high, *(y for _, y in marks.values())]
    spots, margin = np.array([*marks.values()]), MARGIN_SHARE * length
    words = [
        Lettering(-thick / 2, clamp, "cart", INK, "above"),
        Lettering(length + thick / 2, clamp, "stage", INK, "above"),
        *(Lettering(*place, letters, VERMILLION, "left") for place, letters in _lettered(marks, margin).items()),
    ]
    return Panel(
        title,
        Axis("x", "m", (min(xs) - margin, max(xs) + margin)),
        Axis(up, "m", (min(ys) - margin, max(ys) + margin)),
        (_ring((left, low), (right, high), LIGHT), *lines),
        (Markers(spots[:, 0], spots[:, 1], "", VERMILLION, "target"),),
        equal=True,
        areas=tuple(hatched),
        words=tuple(words),
    )


def _lettered(marks: dict[str, Corner], near: float) -> dict[Corner, str]:
    """Return the letters of marks by where they stand; marks within `near` [m] of each other share a place."""
    letters: dict[Corner, str] = {}
    for letter, place in marks.items():
        at = next((other for other in letters if math.dist(other, place) < near), place)
        letters[at] = f"{letters[at]}, {letter}" if at in letters else letter
    return letters


def _points(mechanism: Mechanism) -> str:
    """Write what the letters mean, with the places of the points in millimetres."""
    places = {"A": mechanism.actuation, "S": mechanism.sensor, "C": mechanism.body.centre}
    return "; ".join(f"{k} {POINTS[k]} ({', '.join(_mm(one) for one in place)})" for k, place in places.items())


def _ring(low: Corner, high: Corner, colour: str) -> Series:
    """Return the outline of a box between two of its corners [m]."""
    return Series(
        np.array([low[0], high[0], high[0], low[0], low[0]]),
        np.array([low[1], low[1], high[1], high[1], low[1]]),
        "",
        colour,
        width=1.0,
    )


def _area(low: Corner, high: Corner, colour: str) -> Area:
    """Return a hatched box between two of its corners [m]."""
    ring = _ring(low, high, colour)
    return Area(ring.x, ring.y, colour, hatched=True)


def _mm(length: float) -> str:
    """Write a length [m] in millimetres."""
    return f"{1e3 * float(length):.4g}"


COLOURS = {BEAMS: BLUE, CLOSED: ORANGE}
DASHES: dict[str, Dash] = {CLOSED: "dashed"}
"""Dashes by model: closed forms are dashed, so that both models are visible where they agree."""

Smooth = Callable[[Array, Array, Array], Array]
"""Function that interpolates: from positions, values there, and other positions, it returns the values at these."""

LINE_POINTS = 101
"""Number of deflections along a drawn line."""


def flexure_figures(flexure: BothModels) -> tuple[Figure, ...]:
    """Return all figures in the order in which they are read."""
    data = materials().get(str(flexure.stage.flat().get("flexure.material")))
    drawing = drawing_figure(flexure.mechanism, flexure.best.stroke, f"{data.name}, {data.grade}" if data else "")
    figures = (drawing, _force(flexure), _support(flexure), modes_figure(flexure.best))
    return tuple(replace(figure, subject=flexure.stage.name) for figure in figures)


def _force(flexure: BothModels) -> Figure:
    """Draw the force over the deflection, by both models."""
    reach, steepness = flexure.best.stroke, float(flexure.best.drive[0])
    ends = np.array([0.0, reach])
    straight = Series(ends, steepness * ends, "initial stiffness", GREY, "dotted", 1.2)
    lines, points = _lines(flexure, lambda evaluation: evaluation.forces, _odd)
    panel = Panel("", _deflection(flexure), Axis("Force", "N"), (*lines, straight), (points,))
    caption = (
        "The force that holds the stage deflected, the same in both directions, while it is otherwise free to shift "
        "and turn. The closed forms have a single stiffness; the beams stiffen at large deflections. Dots: computed."
    )
    return Figure("flexure_force", "Force over the stroke", caption, (panel,))


def _support(flexure: BothModels) -> Figure:
    """Draw the support stiffness over the deflection, by both models.

    One panel is for forces along the leaves, the other for forces along their width.
    """
    panels = (
        _supports(flexure, "Along the leaves (x)", lambda evaluation: evaluation.support_x / 1e6),
        _supports(flexure, "Along their width (y)", lambda evaluation: evaluation.support_y / 1e6),
    )
    caption = (
        "The stiffness of the leaves against forces across the motion, at the middle of their ends and with all else "
        "held: it falls as they bend, which is the price of the stroke."
    )
    return Figure("flexure_support", "Support stiffness over the deflection", caption, panels, columns=2)


def _supports(flexure: BothModels, title: str, of: Callable[[Evaluation], Array]) -> Panel:
    """Return the panel of one support stiffness [N/µm], which `of` reads from an evaluation.

    The stiffness is equal for deflections to both sides.
    """
    lines, points = _lines(flexure, of, _even_falling)
    top = 1.1 * max(float(line.y.max()) for line in lines)
    axis = Axis("Stiffness", "N/µm", (0.0, top), prefixed=False)
    return Panel(title, _deflection(flexure), axis, lines, (points,))


def _lines(
    flexure: BothModels, of: Callable[[Evaluation], Array], smooth: Smooth
) -> tuple[tuple[Series, ...], Markers]:
    """Return a quantity over the deflection as a line for each model, and the best one's points.

    `of` reads the quantity from an evaluation, and `smooth` interpolates it between deflections.
    """
    fine = np.linspace(0.0, flexure.best.stroke, LINE_POINTS)
    lines = tuple(
        Series(
            fine,
            smooth(evaluation.deflections, of(evaluation), fine),
            name,
            COLOURS[name],
            DASHES.get(name, "solid"),
            1.8,
        )
        for name, evaluation in flexure.models.items()
    )
    best = next(iter(flexure.models))
    return lines, Markers(flexure.best.deflections, of(flexure.best), "", COLOURS[best])


def _odd(x: Array, y: Array, at: Array) -> Array:
    """Interpolate an odd function y(x), sampled at x from 0 upwards, at `at` by a cubic spline."""
    return _spline(np.concatenate([-x[:0:-1], x]), np.concatenate([-y[:0:-1], y]), at)


def _even_falling(x: Array, y: Array, at: Array) -> Array:
    """Interpolate a stiffness y that is even in x, at `at`.

    The inverse is interpolated, since it grows about as the square of x.
    """
    return 1 / _spline(np.concatenate([-x[:0:-1], x]), 1 / np.concatenate([y[:0:-1], y]), at)


def _spline(x: Array, y: Array, at: Array) -> Array:
    """Interpolate y(x) at `at` by a cubic spline."""
    from scipy.interpolate import CubicSpline  # 0.3 s to import

    return CubicSpline(x, y)(at)


def _deflection(flexure: BothModels) -> Axis:
    """Return the axis of the deflection up to the stroke."""
    return Axis("Deflection", "m", (0.0, flexure.best.stroke))


DRAWN_MODES = 8
"""Number of modes drawn."""

DRAWN_AMPLITUDE = 0.16
"""Amplitude of the largest motion, relative to the size of the picture."""

PICTURE_ASPECT = 1.45
"""Width of a picture over its height."""

LEAST_ENERGY_SHARE = 0.5
"""Smallest fraction of a mode's energy in the drawn shape for the mode to be drawn."""

LEAST_SHOWN_SHARE = 0.9
"""Smallest fraction of a mode's motion that a view must show to be chosen."""

LEAF_POINTS = 65
"""Number of points along a drawn leaf."""

VIEWS = {"from the side": (0, 2), "from above": (0, 1), "along the leaves": (1, 2)}
"""The two axes of each view, in order of preference."""


@dataclass(frozen=True)
class Shape:
    """Lines on the mechanism: their points [m] at rest, shape (n, 3), and how a mode moves them."""

    rest: Array
    moved: Array


def modes_figure(evaluation: Evaluation) -> Figure:
    """Draw the first modes, one panel each."""
    modes = [
        mode
        for mode in evaluation.modes
        if mode.interferes or drawable_share(evaluation.mechanism, mode) > LEAST_ENERGY_SHARE
    ][:DRAWN_MODES]
    panels = tuple(_panel(evaluation.mechanism, mode, mode is evaluation.modes[0] or mode.interferes) for mode in modes)
    caption = (
        "The first modes with the cart held and the leaves straight, enlarged to be visible. Grey: at rest. The stage "
        "is "
        "drawn as the block of its mass and moments of inertia. A mode that actuator and sensor both see limits the "
        "crossover. Torsion of the leaves about their middle lines is not drawn."
    )
    return Figure("flexure_modes", "Modes", caption, panels, columns=2)


def _panel(mechanism: Mechanism, mode: Mode, visible: bool) -> Panel:
    """Return the panel of one mode, with the motion enlarged so that it can be seen.

    `visible` is true if actuator and sensor both see the mode, which sets colour and label.
    """
    view = best_view(mechanism, mode)
    axes = VIEWS[view]
    shapes = [*_leaves(mechanism, mode, axes), _block(mechanism, mode, axes)]
    corners = np.concatenate([shape.rest[:, axes] for shape in shapes])
    low, high = corners.min(axis=0), corners.max(axis=0)
    largest = max(float(np.abs(shape.moved[:, axes]).max()) for shape in shapes)
    size = float(np.max(high - low))
    gain = DRAWN_AMPLITUDE * size / largest
    colour, label = (VERMILLION, "seen by actuator and sensor") if visible else (BLUE, "not seen by both")
    rest = _polyline([shape.rest[:, axes] for shape in shapes])
    moved = _polyline([(shape.rest + gain * shape.moved)[:, axes] for shape in shapes])
    lines = (Series(*rest, f"at rest, {view}", LIGHT, width=1.6), Series(*moved, label, colour, width=1.6))
    x, y = _limits(low - DRAWN_AMPLITUDE * size * 1.1, high + DRAWN_AMPLITUDE * size * 1.1)
    title = f"{mode.name}, {with_unit(mode.frequency, 'Hz')}"
    return Panel(title, Axis("xyz"[axes[0]], "m", x), Axis("xyz"[axes[1]], "m", y), lines, equal=True)


def best_view(mechanism: Mechanism, mode: Mode) -> str:
    """Return the name of the first view that shows nearly all of a mode's motion.

    If there is none, the view that shows most of the motion is taken.
    """
    everything = np.concatenate([mode.leaves.reshape(-1, 3), _corners_moved(mechanism, mode)])
    shares = np.sum(everything**2, axis=0) / max(float(np.sum(everything**2)), np.finfo(float).tiny)
    spans = {view: float(sum(shares[axis] for axis in axes)) for view, axes in VIEWS.items()}
    return next((view for view, share in spans.items() if share > LEAST_SHOWN_SHARE), max(spans, key=spans.__getitem__))


def drawable_share(mechanism: Mechanism, mode: Mode) -> float:
    """Return the fraction of a mode's kinetic energy that its picture shows.

    The picture shows the motion of the stage and of the middle lines of the leaves. The rest is torsion of the leaves.
    """
    speed = _rigid(mechanism, mode, _centre(mechanism)[None, :])[0]
    stage = mechanism.body.mass * np.sum(speed**2) + np.sum(
        np.array(mechanism.body.inertia, dtype=float) * mode.stage[3:] ** 2
    )
    middle = (mode.leaves[:, 1:] ** 2 + mode.leaves[:, :-1] ** 2).mean(axis=1) / 2
    return float(stage + mechanism.leaf_mass * np.sum(middle))


def _corners_moved(mechanism: Mechanism, mode: Mode) -> Array:
    """Return the displacements of the eight corners of the stage's block in a mode, (8, 3)."""
    signs = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
    return _rigid(mechanism, mode, _centre(mechanism) + signs * np.array(block_size(mechanism)) / 2)


def _centre(mechanism: Mechanism) -> Array:
    """Return the stage's centre of mass [m]."""
    return np.array([float(coordinate) for coordinate in mechanism.body.centre])


def _rigid(mechanism: Mechanism, mode: Mode, points: Array) -> Array:
    """Return the displacements, in a mode, of points [m] of the stage; both of shape (n, 3)."""
    arm = points - np.array([float(mechanism.length), 0.0, 0.0])
    return mode.stage[:3] + np.cross(mode.stage[3:], arm)


def _block(mechanism: Mechanism, mode: Mode, axes: tuple[int, int]) -> Shape:
    """Return the outline of the stage, at rest and moved, in the plane of two `axes`.

    The plane goes through the stage's centre of mass.
    """
    half = np.array(block_size(mechanism)) / 2
    rest = np.tile(_centre(mechanism), (5, 1))
    for axis, signs in zip(axes, ((-1, 1, 1, -1, -1), (-1, -1, 1, 1, -1)), strict=True):
        rest[:, axis] += half[axis] * np.array(signs)
    return Shape(rest, _rigid(mechanism, mode, rest))


def _leaves(mechanism: Mechanism, mode: Mode, axes: tuple[int, int]) -> list[Shape]:
    """Return the lines of the leaves in a view, at rest and moved.

    Leaves are middle lines if seen from the side, outlines from above, and cross-sections along their length.
    """
    draw = {(0, 2): _middle, (0, 1): _outline, (1, 2): _sections}[axes]
    return [
        shape
        for k, offset in enumerate(mechanism.offsets)
        for shape in draw(mechanism, mode, mode.leaves[k], float(offset))
    ]


def _middle(mechanism: Mechanism, mode: Mode, leaf: Array, offset: float) -> list[Shape]:
    """Return the middle line of a leaf at rest and moved; `offset` is the leaf's height z [m]."""
    x, leaf = _smooth(mechanism, leaf)
    return [Shape(np.stack([x, np.zeros_like(x), np.full_like(x, offset)], axis=1), leaf)]


def _outline(mechanism: Mechanism, mode: Mode, leaf: Array, offset: float) -> list[Shape]:
    """Return the outline of a leaf from above: both long edges and both ends.

    `offset` is the leaf's height z [m]. Cross-sections turn as the middle line does.
    """
    x, leaf = _smooth(mechanism, leaf)
    turn = np.gradient(leaf[:, 1], x)
    turn -= turn[0]  # the rest at the clamp is shear, nearly constant along the leaf
    sides = []
    for y in (-mechanism.width / 2, mechanism.width / 2):
        rest = np.stack([x, np.full_like(x, y), np.full_like(x, offset)], axis=1)
        sides.append((rest, leaf + np.stack([-y * turn, 0 * turn, 0 * turn], axis=1)))
    around = [np.concatenate([first, second[::-1], first[:1]]) for first, second in zip(*sides, strict=True)]
    return [Shape(*around)]


def _smooth(mechanism: Mechanism, leaf: Array) -> tuple[Array, Array]:
    """Interpolate a leaf's displacements by a cubic spline, for a smooth line.

    Returns the positions along the leaf [m], and the displacement at each.
    """
    reported, fine = (np.linspace(0.0, float(mechanism.length), count) for count in (len(leaf), LEAF_POINTS))
    return fine, _spline(reported, leaf, fine)


def _sections(mechanism: Mechanism, mode: Mode, leaf: Array, offset: float) -> list[Shape]:
    """Return a few cross-sections of a leaf between cart and stage, at rest and moved.

    `offset` is the leaf's height z [m]. Along the leaf, sections turn by an evenly growing part of the turn of the
    stage.
    """
    shapes = []
    for k in np.linspace(0, len(leaf) - 1, 5).astype(int):
        share = k / (len(leaf) - 1)
        ends = np.array(
            [[share * float(mechanism.length), y, offset] for y in (-mechanism.width / 2, mechanism.width / 2)]
        )
        lift = share * mode.stage[3] * ends[:, 1]
        shapes.append(Shape(ends, leaf[k] + np.stack([0 * lift, 0 * lift, lift], axis=1)))
    return shapes


def _polyline(lines: list[Array]) -> tuple[Array, Array]:
    """Join lines, each of shape (n, 2), into one with gaps between them; return its x and y."""
    gap = np.full((1, 2), np.nan)
    points = np.concatenate([part for line in lines for part in (line, gap)])
    return points[:, 0], points[:, 1]


def _limits(low: Array, high: Array) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the limits of both axes around a drawing that lies between `low` and `high`, (2,).

    The aspect ratio of the panel is the usual one.
    """
    width, height = high - low
    middle = (low + high) / 2
    half = np.array([max(width, PICTURE_ASPECT * height), max(height, width / PICTURE_ASPECT)]) / 2
    (x1, y1), (x2, y2) = middle - half, middle + half
    return (float(x1), float(x2)), (float(y1), float(y2))
