"""A dimensioned drawing of a leaf-spring mechanism, to scale, as SVG.

Two views after ISO 128, first angle: from the side (x to the right, z up) and below it from above (x to the right, y
up). Clamps are schematic; the stage is drawn as the block of its mass and moments of inertia.
"""

from __future__ import annotations

import math

import numpy as np

from friso.leaf_springs.mechanism import Mechanism
from friso.questions.flexure import svg
from friso.questions.flexure.layout import (
    CLAMP_OVERHANG,
    CLAMP_THICKNESS,
    SCALES,
    SHEET_WIDTH,
    STOP_HEIGHT,
    TITLE_BLOCK_HEIGHT,
    UPPER_MARGIN,
    PaperDrawing,
    block_size,
)

LEAST_LENGTH = 1e-6
"""Lengths on paper [mm] below this are treated as 0."""


def drawing_svg(mechanism: Mechanism, stroke: float, *, title: str = "", material: str = "") -> str:
    """Return the drawing of a mechanism as SVG, at the largest scale that fits the sheet.

    `stroke` [m] is the gap to the limiter on each side.
    """
    fitting = next(
        (candidate for candidate in (PaperDrawing(mechanism, stroke, scale) for scale in SCALES) if candidate.fits),
        None,
    )
    drawing = fitting or PaperDrawing(mechanism, stroke, SCALES[-1])
    label = f"Leaf springs{': ' if title else ''}{title}"
    parts = [
        *_side_view(drawing),
        *_top_view(drawing),
        *_marks(drawing),
        *_legend(drawing),
        *_title_block(drawing, title, material),
    ]
    return svg.sheet(SHEET_WIDTH, drawing.height, label, parts)


def _side_view(drawing: PaperDrawing) -> list[str]:
    """Return the view from the side: leaves, clamps, stops and dimensions."""
    mechanism = drawing.mechanism
    start, end = drawing.x0, drawing.x0 + drawing.size(mechanism.length)
    row = drawing.size(mechanism.depth) / 2
    parts = [svg.words((5, drawing.z0 - drawing.spans[1][1] - UPPER_MARGIN + 5), "From the side (x–z)", bold=True)]
    parts += _block(drawing, 1, drawing.z0)
    for offset in mechanism.offsets:
        height = drawing.z0 - drawing.size(offset)
        parts += [svg.path(_bent(drawing, height, side), "dashed") for side in (-1, 1)]
        parts.append(svg.box((start, height - drawing.leaf / 2), (end, height + drawing.leaf / 2), "thin", "#222222"))
    clamps = ((start - CLAMP_THICKNESS, start), (end, end + CLAMP_THICKNESS))
    parts += [
        svg.box(
            (x1, drawing.z0 - row - CLAMP_OVERHANG), (x2, drawing.z0 + row + CLAMP_OVERHANG), fill="url(#leaf-hatch)"
        )
        for x1, x2 in clamps
    ]
    parts += [
        word for side in (-1, 1) for word in _stop(drawing, end, drawing.z0 + side * (row + CLAMP_OVERHANG), side)
    ]
    return parts + _side_dimensions(drawing, start, end, row)


def _bent(drawing: PaperDrawing, height: float, side: int) -> list[svg.SheetPoint]:
    """Return the middle line of a leaf that is deflected by the stroke, on paper.

    `height` is the height of the leaf's clamp, and `side` (1 or -1) the direction. Both ends of the line are parallel.
    """
    s = np.linspace(0, 1, 33)
    x, z = (
        drawing.x0 + s * drawing.size(drawing.mechanism.length),
        height - side * drawing.travel * (3 * s**2 - 2 * s**3),
    )
    return list(zip(x.tolist(), z.tolist(), strict=True))


def _stop(drawing: PaperDrawing, end: float, edge: float, side: int) -> list[str]:
    """Return a stop of the limiter, which belongs to the cart.

    The stop lies one stroke away from the stage's clamp, to the `side` 1 or -1. The clamp's `edge` and the leaf's `end`
    are on paper.
    """
    near, far = edge + side * drawing.travel, edge + side * (drawing.travel + STOP_HEIGHT)
    return [svg.box((end, near), (end + CLAMP_THICKNESS, far), fill="url(#leaf-hatch)")]


def _side_dimensions(drawing: PaperDrawing, start: float, end: float, row: float) -> list[str]:
    """Return the dimensions and notes of the view from the side.

    `start` and `end` are the leaf ends on paper, and `row` is half the height of all leaves.
    """
    mechanism, left = drawing.mechanism, drawing.x0 + drawing.spans[0][0]
    below = drawing.z0 - drawing.spans[1][0]
    top = drawing.z0 - row
    parts = svg.across(start, end, below + 6, drawing.z0 + row + CLAMP_OVERHANG, _mm(mechanism.length))
    parts += svg.upwards(
        top, top + drawing.size(mechanism.spacing), left - 6, start - CLAMP_THICKNESS, _mm(mechanism.spacing)
    )
    if mechanism.leaves > 2:
        count = int(mechanism.leaves) - 1
        total = f"{count} x {_mm(mechanism.spacing)} = {_mm(mechanism.depth)}"
        text = total if svg.fits(total, 2 * row) else _mm(mechanism.depth)
        parts += svg.upwards(top, drawing.z0 + row, left - 13, start - CLAMP_THICKNESS, text)
    tip = (start + 0.15 * (end - start), top - drawing.leaf / 2)
    note = [f"{mechanism.leaves:g} leaves, thickness {_mm(mechanism.thickness)}"]
    parts += svg.leader(tip, (tip[0] + 3, drawing.z0 - drawing.spans[1][1] - 4), note)
    edge, beside = drawing.z0 + row + CLAMP_OVERHANG, end + CLAMP_THICKNESS + 3
    parts += svg.upwards(edge, edge + drawing.travel, beside, end + CLAMP_THICKNESS, "")
    parts.append(
        svg.words_over(
            (beside + 2, edge + drawing.travel / 2 + 1), f"±{_mm(drawing.stroke)} stroke, gap to the limiter"
        )
    )
    parts.append(svg.words((start - CLAMP_THICKNESS / 2, drawing.z0 - row - CLAMP_OVERHANG - 1.5), "cart", "middle"))
    return parts + _axes(drawing.z0 - drawing.spans[1][0] + 6, "z") + _stage_note(drawing)


def _stage_note(drawing: PaperDrawing) -> list[str]:
    """Return the note that names the stage, with its mass and size."""
    (_, right), (low, high) = drawing.block[0], drawing.block[1]
    tip = (
        drawing.x0 + min(right, drawing.spans[0][1]),
        drawing.z0 - min(low / 4 + 3 * high / 4, drawing.spans[1][1] - 4),
    )
    knee = (drawing.x0 + drawing.spans[0][1] + 4, tip[1] - 5)
    size = " x ".join(f"{1e3 * edge:.3g}" for edge in block_size(drawing.mechanism))
    return svg.leader(
        tip, knee, [f"stage, {drawing.mechanism.body.mass:.4g} kg", "as a block of its", "moments of inertia:", size]
    )


def _block(drawing: PaperDrawing, view: int, middle: float) -> list[str]:
    """Return the stage as a block in the view from the side (1) or from above (2).

    `middle` is the height on paper of the view's origin. Parts without room on the sheet are cut off.
    """
    (x1, x2), (low, high) = drawing.block[0], drawing.block[view]
    (left, right), (bottom, top) = drawing.spans[0], drawing.spans[view]
    cut = max(x1, left), min(x2, right), max(low, bottom), min(high, top)
    near, far, under, over = drawing.x0 + cut[0], drawing.x0 + cut[1], middle - cut[2], middle - cut[3]
    edges = [
        (x1 >= left - LEAST_LENGTH, [(near, under), (near, over)]),
        (x2 <= right + LEAST_LENGTH, [(far, under), (far, over)]),
        (low >= bottom - LEAST_LENGTH, [(near, under), (far, under)]),
        (high <= top + LEAST_LENGTH, [(near, over), (far, over)]),
    ]
    fill = svg.area((near, under), (far, over), "#f1f1f1")
    return [fill, *(svg.path(ends, "phantom") for inside, ends in edges if inside)]


def _top_view(drawing: PaperDrawing) -> list[str]:
    """Return the view from above: the outline of the leaves, clamps and dimensions."""
    mechanism = drawing.mechanism
    start, end, half = drawing.x0, drawing.x0 + drawing.size(mechanism.length), drawing.size(mechanism.width) / 2
    left = drawing.x0 + drawing.spans[0][0]
    parts = [svg.words((5, drawing.y0 - drawing.spans[2][1] - UPPER_MARGIN + 9), "From above (x–y)", bold=True)]
    parts += _block(drawing, 2, drawing.y0)
    parts.append(svg.area((start, drawing.y0 - half), (end, drawing.y0 + half), "#0072B2", 0.18))
    parts.append(svg.box((start, drawing.y0 - half), (end, drawing.y0 + half)))
    clamps = ((start - CLAMP_THICKNESS, start), (end, end + CLAMP_THICKNESS))
    parts += [
        svg.box(
            (x1, drawing.y0 - half - CLAMP_OVERHANG), (x2, drawing.y0 + half + CLAMP_OVERHANG), fill="url(#leaf-hatch)"
        )
        for x1, x2 in clamps
    ]
    parts.append(svg.path([(left - 2, drawing.y0), (drawing.x0 + drawing.spans[0][1] + 2, drawing.y0)], "centre"))
    parts += svg.upwards(drawing.y0 - half, drawing.y0 + half, left - 6, start - CLAMP_THICKNESS, _mm(mechanism.width))
    parts += [svg.words((start - CLAMP_THICKNESS / 2, drawing.y0 - half - CLAMP_OVERHANG - 1.5), "cart", "middle")]
    parts += [svg.words((end + CLAMP_THICKNESS / 2, drawing.y0 - half - CLAMP_OVERHANG - 1.5), "stage", "middle")]
    return parts + _axes(drawing.y0 - drawing.spans[2][0] + 6, "y")


def _axes(y: float, up: str) -> list[str]:
    """Return the two axes of a view, at its lower left: x to the right, and the one named `up`."""
    corner = (9.0, y)
    parts = [
        svg.path([(9.0, y - 8), corner, (17.0, y)], "thin"),
        svg.arrow((17.0, y), (1, 0)),
        svg.arrow((9.0, y - 8), (0, -1)),
    ]
    return [*parts, svg.words((18.2, y + 1), "x"), svg.words((8.0, y - 9.2), up)]


def _marks(drawing: PaperDrawing) -> list[str]:
    """Return the marks of actuator, sensor and centre of mass in both views."""
    parts = []
    for view, up in ((drawing.side, 2), (drawing.top, 1)):
        places = {letter: view(point[0], point[up]) for letter, point in drawing.points.items()}
        parts += _centre_mark(places["C"])
        parts += _push_mark(places["A"], up == 2)
        x, y = places["S"]
        parts.append(svg.path([(x, y - 1.3), (x + 1.3, y), (x, y + 1.3), (x - 1.3, y)], "thin", "#D55E00", closed=True))
        for (x, y), letters in _together({letter: places[letter] for letter in "AS"}).items():
            parts.append(svg.words_over((x + 2.4, y - 1.8), ", ".join(letters), bold=True))
        parts.append(svg.words_over((places["C"][0] + 2.2, places["C"][1] + 4.2), "C", bold=True))
    return parts


def _together(places: dict[str, svg.SheetPoint]) -> dict[svg.SheetPoint, list[str]]:
    """Group the letters of marks by where they stand; marks close together share one point."""
    groups: dict[svg.SheetPoint, list[str]] = {}
    for letter, place in places.items():
        near = next((group for group in groups if math.dist(group, place) < 2 * svg.TEXT_HEIGHT), place)
        groups.setdefault(near, []).append(letter)
    return groups


def _centre_mark(at: svg.SheetPoint) -> list[str]:
    """Return the symbol of a centre of mass."""
    x, y = at
    quarters = [f"M {x:.2f} {y:.2f} h {s * 1.7} a 1.7 1.7 0 0 1 {-s * 1.7} {s * 1.7} Z" for s in (1, -1)]
    return [svg.circle(at, 1.7, "#ffffff"), f'<path d="{" ".join(quarters)}" fill="#222222"/>']


def _push_mark(at: svg.SheetPoint, sideways: bool) -> list[str]:
    """Return the symbol of the actuator: arrows if seen `sideways`, else a tip seen end-on."""
    if not sideways:
        return [svg.circle(at, 2.2), svg.circle(at, 0.4, "#222222")]
    x, y = at
    line = svg.path([(x, y - 6), (x, y + 6)], "push")
    return [line, svg.arrow((x, y - 6.5), (0, -1), "#D55E00"), svg.arrow((x, y + 6.5), (0, 1), "#D55E00")]


def _legend(drawing: PaperDrawing) -> list[str]:
    """Return the legend: the meaning of the letters, and parts that are not to scale."""
    names = {"A": "actuation along z", "S": "sensor", "C": "centre of mass"}
    texts = [
        f"{k} {names[k]} ({', '.join(_mm(coordinate) for coordinate in point)})" for k, point in drawing.points.items()
    ]
    faults = ["clamps"]
    if drawing.leaf > drawing.size(drawing.mechanism.thickness):
        faults.append("thickness of the leaves")
    if drawing.travel > drawing.size(drawing.stroke):
        faults.append(f"stroke ({drawing.travel / drawing.size(drawing.stroke):.2g} times as large)")
    lines = [
        " · ".join(texts),
        "x, y, z from the middle between the clamps at the cart · dashed: at the stroke",
        f"Not to scale: {', '.join(faults)}.",
    ]
    return [svg.words((5, drawing.foot + 4 + 4.5 * k), line, size=2.8) for k, line in enumerate(lines)]


def _title_block(drawing: PaperDrawing, title: str, material: str) -> list[str]:
    """Return the title block: material, sizes and scale."""
    mechanism, top, split = drawing.mechanism, drawing.height - TITLE_BLOCK_HEIGHT - 5, 138.0
    material_line = f"E {mechanism.young / 1e9:.4g} GPa, ν {mechanism.poisson:g}, {mechanism.density:.4g} kg/m³"
    strength = f"yield {mechanism.yield_strength / 1e6:.4g} MPa"
    if math.isfinite(mechanism.fatigue):
        strength += f", fatigue {mechanism.fatigue / 1e6:.4g} MPa"
    size = f"{_mm(mechanism.length)} x {_mm(mechanism.width)} x {_mm(mechanism.thickness)}"
    lines = [
        f"{mechanism.leaves:g} leaf springs {size}, length between the clamps",
        f"Material: {material or 'as follows'}",
        f"{material_line}, {strength}",
    ]
    room = split - 9
    parts = [
        svg.box((5, top), (SHEET_WIDTH - 5, top + TITLE_BLOCK_HEIGHT)),
        svg.path([(split, top), (split, top + TITLE_BLOCK_HEIGHT)]),
    ]
    parts.append(svg.words((8, top + 6), svg.clipped(title or "Leaf springs", room, 3.8), size=3.8, bold=True))
    parts += [svg.words((8, top + 12 + 5 * k), svg.clipped(line, room, 2.8), size=2.8) for k, line in enumerate(lines)]
    ratio = f"{drawing.scale:g}:1" if drawing.scale >= 1 else f"1:{1 / drawing.scale:g}"
    parts.append(svg.words((split + 3, top + 6), f"Scale {ratio}", size=3.8, bold=True))
    parts.append(svg.words((split + 3, top + 11), "all dimensions in mm", size=2.8))
    return parts + _scale_bar(drawing, (split + 3, top + 17))


def _scale_bar(drawing: PaperDrawing, at: svg.SheetPoint) -> list[str]:
    """Return a bar of a round length, which stays true if the sheet is printed at another size."""
    length = max(
        nice
        for power in range(-3, 4)
        for nice in (10.0**power, 2 * 10.0**power, 5 * 10.0**power)
        if nice * drawing.scale <= 50
    )
    x, y, half = *at, length * drawing.scale / 2
    parts = [
        svg.box((x, y), (x + half, y + 1.6), "thin", "#222222"),
        svg.box((x + half, y), (x + 2 * half, y + 1.6), "thin"),
    ]
    return [
        *parts,
        svg.words((x, y + 5), "0", size=2.6),
        svg.words((x + 2 * half, y + 5), f"{length:g} mm", "end", size=2.6),
    ]


def _mm(length: float) -> str:
    """Write a length [m] in millimetres."""
    return f"{1e3 * float(length):.4g}"
