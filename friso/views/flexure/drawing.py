"""A dimensioned drawing of a leaf-spring mechanism, to scale, as SVG.

Two views after ISO 128, first angle: from the side (x to the right, z up) and below it from above (x to the right, y
up). Clamps are schematic; the stage is drawn as the block of its mass and moments of inertia.
"""

from __future__ import annotations

import math

import numpy as np

from friso.flexure.mechanism import Mechanism
from friso.views.flexure.layout import ABOVE, CLAMP, FOOT, RIM, SCALES, STOP, WIDTH, Drawing, block_size
from friso.views.flexure.svg import (
    TEXT,
    Point,
    across,
    area,
    arrow,
    box,
    circle,
    clipped,
    fits,
    leader,
    path,
    sheet,
    upwards,
    words,
    words_over,
)

CLOSE = 1e-6
"""Lengths on paper that are none [mm]."""


def drawing_svg(mechanism: Mechanism, stroke: float, *, title: str = "", material: str = "") -> str:
    """The drawing of a mechanism with its stroke [m], which is the gap to the limiter on each side."""
    drawn = next((each for each in (Drawing(mechanism, stroke, scale) for scale in SCALES) if each.fits), None)
    it = drawn or Drawing(mechanism, stroke, SCALES[-1])
    label = f"Leaf springs{': ' if title else ''}{title}"
    parts = [*_side_view(it), *_top_view(it), *_marks(it), *_legend(it), *_title_block(it, title, material)]
    return sheet(WIDTH, it.height, label, parts)


def _side_view(it: Drawing) -> list[str]:
    own = it.mechanism
    start, end = it.x0, it.x0 + it.size(own.length)
    row = it.size(own.depth) / 2
    parts = [words((5, it.z0 - it.spans[1][1] - ABOVE + 5), "From the side (x–z)", bold=True)]
    parts += _block(it, 1, it.z0)
    for offset in own.offsets:
        height = it.z0 - it.size(offset)
        parts += [path(_bent(it, height, side), "dashed") for side in (-1, 1)]
        parts.append(box((start, height - it.leaf / 2), (end, height + it.leaf / 2), "thin", "#222222"))
    clamps = ((start - CLAMP, start), (end, end + CLAMP))
    parts += [box((x1, it.z0 - row - RIM), (x2, it.z0 + row + RIM), fill="url(#leaf-hatch)") for x1, x2 in clamps]
    parts += [word for side in (-1, 1) for word in _stop(it, end, it.z0 + side * (row + RIM), side)]
    return parts + _side_dimensions(it, start, end, row)


def _bent(it: Drawing, height: float, side: int) -> list[Point]:
    """A leaf at the stroke, its ends parallel."""
    s = np.linspace(0, 1, 33)
    x, z = it.x0 + s * it.size(it.mechanism.length), height - side * it.travel * (3 * s**2 - 2 * s**3)
    return list(zip(x.tolist(), z.tolist(), strict=True))


def _stop(it: Drawing, end: float, edge: float, side: int) -> list[str]:
    """A stop of the limiter, the travel away from the stage's clamp; it belongs to the cart."""
    near, far = edge + side * it.travel, edge + side * (it.travel + STOP)
    return [box((end, near), (end + CLAMP, far), fill="url(#leaf-hatch)")]


def _side_dimensions(it: Drawing, start: float, end: float, row: float) -> list[str]:
    own, left = it.mechanism, it.x0 + it.spans[0][0]
    below = it.z0 - it.spans[1][0]
    top = it.z0 - row
    parts = across(start, end, below + 6, it.z0 + row + RIM, _mm(own.length))
    parts += upwards(top, top + it.size(own.spacing), left - 6, start - CLAMP, _mm(own.spacing))
    if own.leaves > 2:
        count = int(own.leaves) - 1
        total = f"{count} x {_mm(own.spacing)} = {_mm(own.depth)}"
        text = total if fits(total, 2 * row) else _mm(own.depth)
        parts += upwards(top, it.z0 + row, left - 13, start - CLAMP, text)
    tip = (start + 0.15 * (end - start), top - it.leaf / 2)
    note = [f"{own.leaves:g} leaves, thickness {_mm(own.thickness)}"]
    parts += leader(tip, (tip[0] + 3, it.z0 - it.spans[1][1] - 4), note)
    edge, beside = it.z0 + row + RIM, end + CLAMP + 3
    parts += upwards(edge, edge + it.travel, beside, end + CLAMP, "")
    parts.append(words_over((beside + 2, edge + it.travel / 2 + 1), f"±{_mm(it.stroke)} stroke, gap to the limiter"))
    parts.append(words((start - CLAMP / 2, it.z0 - row - RIM - 1.5), "cart", "middle"))
    return parts + _axes(it.z0 - it.spans[1][0] + 6, "z") + _stage_note(it)


def _stage_note(it: Drawing) -> list[str]:
    """Which part is the stage."""
    (_, right), (low, high) = it.block[0], it.block[1]
    tip = it.x0 + min(right, it.spans[0][1]), it.z0 - min(low / 4 + 3 * high / 4, it.spans[1][1] - 4)
    knee = (it.x0 + it.spans[0][1] + 4, tip[1] - 5)
    size = " x ".join(f"{1e3 * edge:.3g}" for edge in block_size(it.mechanism))
    return leader(
        tip, knee, [f"stage, {it.mechanism.body.mass:.4g} kg", "as a block of its", "moments of inertia:", size]
    )


def _block(it: Drawing, view: int, middle: float) -> list[str]:
    """The stage as a block in the view from the side (1) or from above (2); what has no room is cut off."""
    (x1, x2), (low, high) = it.block[0], it.block[view]
    (left, right), (bottom, top) = it.spans[0], it.spans[view]
    cut = max(x1, left), min(x2, right), max(low, bottom), min(high, top)
    near, far, under, over = it.x0 + cut[0], it.x0 + cut[1], middle - cut[2], middle - cut[3]
    edges = [
        (x1 >= left - CLOSE, [(near, under), (near, over)]),
        (x2 <= right + CLOSE, [(far, under), (far, over)]),
        (low >= bottom - CLOSE, [(near, under), (far, under)]),
        (high <= top + CLOSE, [(near, over), (far, over)]),
    ]
    fill = area((near, under), (far, over), "#f1f1f1")
    return [fill, *(path(ends, "phantom") for whole, ends in edges if whole)]


def _top_view(it: Drawing) -> list[str]:
    own = it.mechanism
    start, end, half = it.x0, it.x0 + it.size(own.length), it.size(own.width) / 2
    left = it.x0 + it.spans[0][0]
    parts = [words((5, it.y0 - it.spans[2][1] - ABOVE + 9), "From above (x–y)", bold=True)]
    parts += _block(it, 2, it.y0)
    parts.append(area((start, it.y0 - half), (end, it.y0 + half), "#0072B2", 0.18))
    parts.append(box((start, it.y0 - half), (end, it.y0 + half)))
    clamps = ((start - CLAMP, start), (end, end + CLAMP))
    parts += [box((x1, it.y0 - half - RIM), (x2, it.y0 + half + RIM), fill="url(#leaf-hatch)") for x1, x2 in clamps]
    parts.append(path([(left - 2, it.y0), (it.x0 + it.spans[0][1] + 2, it.y0)], "centre"))
    parts += upwards(it.y0 - half, it.y0 + half, left - 6, start - CLAMP, _mm(own.width))
    parts += [words((start - CLAMP / 2, it.y0 - half - RIM - 1.5), "cart", "middle")]
    parts += [words((end + CLAMP / 2, it.y0 - half - RIM - 1.5), "stage", "middle")]
    return parts + _axes(it.y0 - it.spans[2][0] + 6, "y")


def _axes(y: float, up: str) -> list[str]:
    """The two directions of a view, at its lower left."""
    corner = (9.0, y)
    parts = [path([(9.0, y - 8), corner, (17.0, y)], "thin"), arrow((17.0, y), (1, 0)), arrow((9.0, y - 8), (0, -1))]
    return [*parts, words((18.2, y + 1), "x"), words((8.0, y - 9.2), up)]


def _marks(it: Drawing) -> list[str]:
    """Where the actuator pushes, the sensor looks and the centre of mass is, in both views."""
    parts = []
    for view, up in ((it.side, 2), (it.top, 1)):
        places = {letter: view(point[0], point[up]) for letter, point in it.points.items()}
        parts += _centre_mark(places["C"])
        parts += _push_mark(places["A"], up == 2)
        x, y = places["S"]
        parts.append(path([(x, y - 1.3), (x + 1.3, y), (x, y + 1.3), (x - 1.3, y)], "thin", "#D55E00", closed=True))
        for (x, y), letters in _together({letter: places[letter] for letter in "AS"}).items():
            parts.append(words_over((x + 2.4, y - 1.8), ", ".join(letters), bold=True))
        parts.append(words_over((places["C"][0] + 2.2, places["C"][1] + 4.2), "C", bold=True))
    return parts


def _together(places: dict[str, Point]) -> dict[Point, list[str]]:
    """Letters by place, those that would cover each other at one."""
    groups: dict[Point, list[str]] = {}
    for letter, place in places.items():
        near = next((known for known in groups if math.dist(known, place) < 2 * TEXT), place)
        groups.setdefault(near, []).append(letter)
    return groups


def _centre_mark(at: Point) -> list[str]:
    x, y = at
    quarters = [f"M {x:.2f} {y:.2f} h {s * 1.7} a 1.7 1.7 0 0 1 {-s * 1.7} {s * 1.7} Z" for s in (1, -1)]
    return [circle(at, 1.7, "#ffffff"), f'<path d="{" ".join(quarters)}" fill="#222222"/>']


def _push_mark(at: Point, sideways: bool) -> list[str]:
    """Arrows along the motion; in the view along it, the tip of one."""
    if not sideways:
        return [circle(at, 2.2), circle(at, 0.4, "#222222")]
    x, y = at
    line = path([(x, y - 6), (x, y + 6)], "push")
    return [line, arrow((x, y - 6.5), (0, -1), "#D55E00"), arrow((x, y + 6.5), (0, 1), "#D55E00")]


def _legend(it: Drawing) -> list[str]:
    """What the letters mean and what is not to scale."""
    names = {"A": "actuation along z", "S": "sensor", "C": "centre of mass"}
    texts = [f"{k} {names[k]} ({', '.join(_mm(each) for each in point)})" for k, point in it.points.items()]
    faults = ["clamps"]
    if it.leaf > it.size(it.mechanism.thickness):
        faults.append("thickness of the leaves")
    if it.travel > it.size(it.stroke):
        faults.append(f"stroke ({it.travel / it.size(it.stroke):.2g} times as large)")
    lines = [
        " · ".join(texts),
        "x, y, z from the middle between the clamps at the cart · dashed: at the stroke",
        f"Not to scale: {', '.join(faults)}.",
    ]
    return [words((5, it.foot + 4 + 4.5 * k), line, size=2.8) for k, line in enumerate(lines)]


def _title_block(it: Drawing, title: str, material: str) -> list[str]:
    own, top, split = it.mechanism, it.height - FOOT - 5, 138.0
    stuff = f"E {own.young / 1e9:.4g} GPa, ν {own.poisson:g}, {own.density:.4g} kg/m³"
    strength = f"yield {own.yield_strength / 1e6:.4g} MPa"
    if math.isfinite(own.fatigue):
        strength += f", fatigue {own.fatigue / 1e6:.4g} MPa"
    size = f"{_mm(own.length)} x {_mm(own.width)} x {_mm(own.thickness)}"
    lines = [
        f"{own.leaves:g} leaf springs {size}, length between the clamps",
        f"Material: {material or 'as follows'}",
        f"{stuff}, {strength}",
    ]
    room = split - 9
    parts = [box((5, top), (WIDTH - 5, top + FOOT)), path([(split, top), (split, top + FOOT)])]
    parts.append(words((8, top + 6), clipped(title or "Leaf springs", room, 3.8), size=3.8, bold=True))
    parts += [words((8, top + 12 + 5 * k), clipped(line, room, 2.8), size=2.8) for k, line in enumerate(lines)]
    ratio = f"{it.scale:g}:1" if it.scale >= 1 else f"1:{1 / it.scale:g}"
    parts.append(words((split + 3, top + 6), f"Scale {ratio}", size=3.8, bold=True))
    parts.append(words((split + 3, top + 11), "all dimensions in mm", size=2.8))
    return parts + _scale_bar(it, (split + 3, top + 17))


def _scale_bar(it: Drawing, at: Point) -> list[str]:
    """A bar of a round length, in halves; it stays true where the sheet is printed at another size."""
    length = max(
        each
        for power in range(-3, 4)
        for each in (10.0**power, 2 * 10.0**power, 5 * 10.0**power)
        if each * it.scale <= 50
    )
    x, y, half = *at, length * it.scale / 2
    parts = [box((x, y), (x + half, y + 1.6), "thin", "#222222"), box((x + half, y), (x + 2 * half, y + 1.6), "thin")]
    return [*parts, words((x, y + 5), "0", size=2.6), words((x + 2 * half, y + 5), f"{length:g} mm", "end", size=2.6)]


def _mm(length: float) -> str:
    """A length [m] as a number on the drawing."""
    return f"{1e3 * float(length):.4g}"
