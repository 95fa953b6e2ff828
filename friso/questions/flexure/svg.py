"""Write the strokes of a technical drawing as SVG: lines, texts, dimensions, leaders.

All lengths are paper millimetres, with y downwards.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from xml.sax.saxutils import escape, quoteattr

from friso.escapes import escaped

SheetPoint = tuple[float, float]

TEXT_HEIGHT = 3.0
"""Height of letters [mm]."""

ARROW_LENGTH = 2.4
"""Length of an arrowhead [mm]."""

NOTE_LINE = 2.0
"""Length of the level part of the line of a note [mm]."""

EXTENSION_OVERHANG = 1.5
"""Length of an extension line beyond the dimension line [mm]."""

LETTER_ASPECT = 0.6
"""Conservative ratio of a letter's width to its height."""

LINES = {
    "outline": 'stroke="#222222" stroke-width="0.5"',
    "thin": 'stroke="#222222" stroke-width="0.18"',
    "push": 'stroke="#D55E00" stroke-width="0.5"',
    "dashed": 'stroke="#0072B2" stroke-width="0.3" stroke-dasharray="2.4 1.2"',
    "phantom": 'stroke="#767676" stroke-width="0.25" stroke-dasharray="6 1 1 1 1 1"',
    "centre": 'stroke="#767676" stroke-width="0.18" stroke-dasharray="6 1.2 1 1.2"',
}
"""Kinds of lines, after ISO 128: edges, dimensions, actuation, other positions of moving parts, parts that are only
indicated, axes of symmetry."""

HATCH = (
    '<defs><pattern id="leaf-hatch" width="1.6" height="1.6" patternUnits="userSpaceOnUse" '
    'patternTransform="rotate(45)"><rect width="1.6" height="1.6" fill="#ffffff"/>'
    '<line x1="0" y1="0" x2="0" y2="1.6" stroke="#767676" stroke-width="0.3"/></pattern></defs>'
)


def sheet(width: float, height: float, label: str, parts: Iterable[str]) -> str:
    """Return the drawing as SVG, `width` by `height` [mm]; screen readers read the `label`."""
    size = f'width="{_n(width)}mm" height="{_n(height)}mm" viewBox="0 0 {_n(width)} {_n(height)}"'
    paper = f'<rect width="{_n(width)}" height="{_n(height)}" fill="#ffffff"/>'
    body = "\n".join([f"<title>{escape(label)}</title>", HATCH, paper, *parts])
    font = "font-family=\"'DejaVu Sans', Arial, sans-serif\""
    return escaped(f'<svg xmlns="http://www.w3.org/2000/svg" {size} {font} role="img">\n{body}\n</svg>\n')


def path(points: Iterable[SheetPoint], kind: str = "outline", fill: str = "none", closed: bool = False) -> str:
    """Return a line through points; `closed` joins its ends, and `fill` is its colour inside.

    `kind` names the width and dashes of the line (`LINES`).
    """
    corners = " L ".join(f"{_n(x)} {_n(y)}" for x, y in points)
    return f'<path d="M {corners}{" Z" if closed else ""}" fill={quoteattr(fill)} {LINES[kind]}/>'


def box(corner: SheetPoint, other: SheetPoint, kind: str = "outline", fill: str = "none") -> str:
    """Return a rectangle between opposite corners; `kind` is that of its lines (`LINES`)."""
    (x1, y1), (x2, y2) = corner, other
    return path([(x1, y1), (x2, y1), (x2, y2), (x1, y2)], kind, fill, closed=True)


def area(corner: SheetPoint, other: SheetPoint, fill: str, opacity: float = 1.0) -> str:
    """Return a filled rectangle between opposite corners, without a line around it."""
    (x1, y1), (x2, y2) = corner, other
    corners = " L ".join(f"{_n(x)} {_n(y)}" for x, y in ((x1, y1), (x2, y1), (x2, y2), (x1, y2)))
    return f'<path d="M {corners} Z" fill="{fill}" fill-opacity="{_n(opacity)}"/>'


def circle(centre: SheetPoint, radius: float, fill: str = "none") -> str:
    """Return a circle with a thin line."""
    return f'<circle cx="{_n(centre[0])}" cy="{_n(centre[1])}" r="{_n(radius)}" fill="{fill}" {LINES["thin"]}/>'


def words(
    at: SheetPoint,
    text: str,
    anchor: str = "start",
    size: float = TEXT_HEIGHT,
    bold: bool = False,
    upright: bool = False,
) -> str:
    """Return a text whose baseline goes through `at`; an `upright` text is read from the right.

    `anchor` says which part of the text stands at this point: "start", "middle" or "end".
    """
    x, y = _n(at[0]), _n(at[1])
    turn = f' transform="rotate(-90 {x} {y})"' if upright else ""
    weight = ' font-weight="bold"' if bold else ""
    style = f'font-size="{_n(size)}" text-anchor="{anchor}" fill="#222222"{weight}{turn}'
    return f'<text x="{x}" y="{y}" {style}>{escape(text)}</text>'


def words_over(at: SheetPoint, text: str, bold: bool = False) -> str:
    """Return a text with a white margin, to be read over lines."""
    plain = words(at, text, bold=bold)
    around = 'aria-hidden="true" stroke="#ffffff" stroke-width="0.8" stroke-linejoin="round"'
    return plain.replace("<text ", f"<text {around} ", 1) + plain


def fits(text: str, room: float) -> bool:
    """Tell whether a text fits into a length [mm]."""
    return LETTER_ASPECT * TEXT_HEIGHT * len(text) + 1 < room


def clipped(text: str, width: float, size: float = TEXT_HEIGHT) -> str:
    """Return a text, shortened if it does not fit into the width [mm]."""
    most = int(width / (LETTER_ASPECT * size))
    return text if len(text) <= most else f"{text[: most - 1].rstrip()}…"


def arrow(tip: SheetPoint, towards: SheetPoint, fill: str = "#222222") -> str:
    """Return an arrowhead at `tip` that points in the direction `towards`."""
    size = math.hypot(*towards)
    dx, dy = towards[0] / size * ARROW_LENGTH, towards[1] / size * ARROW_LENGTH
    (x, y), slim = tip, 0.17
    corners = [(x, y), (x - dx - slim * dy, y - dy + slim * dx), (x - dx + slim * dy, y - dy - slim * dx)]
    return path(corners, "thin", fill, closed=True)


def across(x1: float, x2: float, y: float, edge: float, text: str) -> list[str]:
    """Return a horizontal dimension at height y from x1 to x2, with extension lines from `edge`.

    A text too long to stand between the arrows is placed beside them.
    """
    parts = [_extension((x, edge), (x, y)) for x in (x1, x2)]
    parts += _arrows((x1, y), (x2, y), (1.0, 0.0))
    if fits(text, x2 - x1):
        return [*parts, words(((x1 + x2) / 2, y - 0.9), text, "middle")]
    return [*parts, words((x2 + ARROW_LENGTH + 3, y - 0.9), text)]


def upwards(y1: float, y2: float, x: float, edge: float, text: str) -> list[str]:
    """Return a vertical dimension at x from y1 to y2, with extension lines from `edge`.

    Its text is read from the right.
    """
    parts = [_extension((edge, y), (x, y)) for y in (y1, y2)]
    parts += _arrows((x, y1), (x, y2), (0.0, 1.0))
    if fits(text, y2 - y1):
        return [*parts, words((x - 0.9, (y1 + y2) / 2), text, "middle", upright=True)]
    return [*parts, words((x - 0.9, y1 - ARROW_LENGTH - 2), text, upright=True)]


def leader(tip: SheetPoint, knee: SheetPoint, lines: list[str]) -> list[str]:
    """Return a note whose line ends in an arrow at `tip`.

    From the knee the line continues level to the right.
    """
    end = (knee[0] + NOTE_LINE, knee[1])
    parts = [path([tip, knee, end], "thin"), arrow(tip, (tip[0] - knee[0], tip[1] - knee[1]))]
    return parts + [
        words((end[0] + 0.8, end[1] + TEXT_HEIGHT * (0.35 + 1.35 * k)), line) for k, line in enumerate(lines)
    ]


def _arrows(start: SheetPoint, end: SheetPoint, direction: SheetPoint) -> list[str]:
    """Return a dimension line with arrows at both ends.

    The arrows point inwards from outside if there is no room between the ends. `direction` leads from start to end.
    """
    back = (-direction[0], -direction[1])
    if math.dist(start, end) > 3 * ARROW_LENGTH:
        return [path([start, end], "thin"), arrow(start, back), arrow(end, direction)]
    tail = 2 * ARROW_LENGTH
    outer = [
        (start[0] - tail * direction[0], start[1] - tail * direction[1]),
        (end[0] + tail * direction[0], end[1] + tail * direction[1]),
    ]
    return [path(outer, "thin"), arrow(start, direction), arrow(end, back)]


def _extension(edge: SheetPoint, at: SheetPoint) -> str:
    """Return a line from near an edge to slightly beyond the dimension line."""
    size = math.dist(edge, at) or 1.0
    dx, dy = (at[0] - edge[0]) / size, (at[1] - edge[1]) / size
    return path(
        [(edge[0] + 0.8 * dx, edge[1] + 0.8 * dy), (at[0] + EXTENSION_OVERHANG * dx, at[1] + EXTENSION_OVERHANG * dy)],
        "thin",
    )


def _n(value: float) -> str:
    """Write a coordinate to a hundredth of a millimetre."""
    return f"{value:.2f}".rstrip("0").rstrip(".")
