"""Draw a leaf-spring mechanism to scale, from the side and from above, with its dimensions."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from friso.leaf_springs.mechanism import Mechanism
from friso.shown.drawing.figure import (
    BLUE,
    GREY,
    INK,
    LIGHT,
    VERMILLION,
    Area,
    Axis,
    Figure,
    Lettering,
    Markers,
    Panel,
    Series,
)

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
