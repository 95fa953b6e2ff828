"""Place the parts of a leaf-spring drawing on paper, at a scale."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from friso.leaf_springs.mechanism import Mechanism
from friso.questions.flexure.svg import SheetPoint

SHEET_WIDTH, VIEWS_HEIGHT = 210.0, 202.0
"""Width of the sheet (A4 upright), and height available for the two views [mm]."""

LEFT_MARGIN, RIGHT_MARGIN = 30.0, 50.0
"""Margins left and right of the views, for dimensions and notes [mm]."""

UPPER_MARGIN, LOWER_MARGIN = 15.0, 15.0
"""Margins above a view, for heading and note, and below, for dimensions [mm]."""

CLAMP_THICKNESS, CLAMP_OVERHANG, STOP_HEIGHT = 6.0, 5.0, 4.0
"""Clamp thickness, overhang of a clamp beyond the leaves, and height of a limiter stop [mm]."""

LEAST_LEAF, LEAST_STROKE = 0.5, 1.6
"""Least drawn thickness of a leaf, and least drawn stroke [mm]."""

BLOCK_OVERHANG = 10.0
"""Largest overhang of the stage's block above and below all other parts [mm]; the rest of the block is cut off."""

SCALES = tuple(factor * 10.0**power for power in range(3, -4, -1) for factor in (5, 2, 1))
"""Scales of ISO 5455: 5:1, 2:1, 1:1, 1:2, 1:5 and so on."""

TITLE_BLOCK_HEIGHT = 26.0
"""Height of the title block [mm]."""


def block_size(mechanism: Mechanism) -> tuple[float, float, float]:
    """Return the edges [m] along x, y, z of the block with the stage's mass and inertia.

    An edge that the moments of inertia do not allow is 0.
    """
    x, y, z = (6 * float(moment) / float(mechanism.body.mass) for moment in mechanism.body.inertia)
    return math.sqrt(max(0.0, y + z - x)), math.sqrt(max(0.0, x + z - y)), math.sqrt(max(0.0, x + y - z))


@dataclass(frozen=True)
class PaperDrawing:
    """A mechanism on paper at a scale.

    Points and lengths are in paper millimetres, with y downwards. `stroke` is in metres [m].
    """

    mechanism: Mechanism
    stroke: float
    scale: float

    @property
    def fits(self) -> bool:
        """Tell whether the drawing fits the sheet at this scale."""
        (left, right), tall = self.core, sum(high - low for low, high in self.spans[1:])
        return (
            LEFT_MARGIN + right - left + RIGHT_MARGIN <= SHEET_WIDTH - 10
            and tall + 2 * (UPPER_MARGIN + LOWER_MARGIN) <= VIEWS_HEIGHT
        )

    @property
    def travel(self) -> float:
        """Return the stroke as drawn [mm]."""
        return max(LEAST_STROKE, self.size(self.stroke))

    @property
    def leaf(self) -> float:
        """Return the thickness of a leaf as drawn [mm]."""
        return max(LEAST_LEAF, self.size(self.mechanism.thickness))

    @property
    def points(self) -> dict[str, tuple[float, float, float]]:
        """Return the marked points [m] by their letters."""
        mechanism = self.mechanism
        places = {"A": mechanism.actuation, "S": mechanism.sensor, "C": mechanism.body.centre}
        return {letter: tuple(float(coordinate) for coordinate in place) for letter, place in places.items()}  # type: ignore[misc]

    @cached_property
    def block(self) -> tuple[tuple[float, float], ...]:
        """Return both ends of the stage's block along x, z and y, from the origin [mm on paper]."""
        centre, edges = self.mechanism.body.centre, block_size(self.mechanism)
        return tuple((self.size(centre[k] - edges[k] / 2), self.size(centre[k] + edges[k] / 2)) for k in (0, 2, 1))

    @property
    def core(self) -> tuple[float, float]:
        """Return both ends, along x, of the parts that must be visible [mm on paper].

        These parts are leaves, clamps and marked points.
        """
        marked = [self.size(point[0]) for point in self.points.values()]
        return min(-CLAMP_THICKNESS, *marked), max(self.size(self.mechanism.length) + CLAMP_THICKNESS, *marked)

    @cached_property
    def spans(self) -> tuple[tuple[float, float], ...]:
        """Return both ends of the views along x, z and y, from the origin [mm on paper].

        The views show all parts that must be visible, and as much of the stage's block as there is room for.
        """
        low, high = self.core
        room = SHEET_WIDTH - 10 - LEFT_MARGIN - RIGHT_MARGIN - (high - low)
        left = max(0.0, min(low - self.block[0][0], room / 3))
        right = max(0.0, min(self.block[0][1] - high, room - left))
        row = self.size(self.mechanism.depth) / 2 + CLAMP_OVERHANG + self.travel + STOP_HEIGHT
        across = self.size(self.mechanism.width) / 2 + CLAMP_OVERHANG
        return (low - left, high + right), self._upwards(row, 2), self._upwards(across, 1)

    def _upwards(self, half: float, axis: int) -> tuple[float, float]:
        """Return how far a view reaches along `axis` (1: y, 2: z), below and above its origin [mm].

        The view holds the length `half` to both sides, the marked points, and a part of the stage's block.
        """
        marked = [self.size(point[axis]) for point in self.points.values()]
        low, high = min(-half, *marked), max(half, *marked)
        bottom, top = self.block[3 - axis]
        return min(low, max(bottom, low - BLOCK_OVERHANG)), max(high, min(top, high + BLOCK_OVERHANG))

    def size(self, length: float) -> float:
        """Convert a length [m] to paper millimetres."""
        return 1e3 * float(length) * self.scale

    @property
    def x0(self) -> float:
        """Return where x = 0 lies on paper [mm]; the views stand centred between the notes."""
        left, right = self.spans[0]
        return LEFT_MARGIN + 5 - left + max(0.0, (SHEET_WIDTH - 10 - LEFT_MARGIN - RIGHT_MARGIN - (right - left)) / 2)

    @property
    def z0(self) -> float:
        """Return where z = 0 lies on paper [mm], in the view from the side."""
        return 5 + UPPER_MARGIN + self.spans[1][1]

    @property
    def y0(self) -> float:
        """Return where y = 0 lies on paper [mm], in the view from above."""
        return self.z0 - self.spans[1][0] + LOWER_MARGIN + UPPER_MARGIN + self.spans[2][1]

    @property
    def foot(self) -> float:
        """Return how far down the sheet the legend begins [mm]."""
        return self.y0 - self.spans[2][0] + LOWER_MARGIN

    @property
    def height(self) -> float:
        """Return the height of the sheet [mm]."""
        return self.foot + 23 + TITLE_BLOCK_HEIGHT

    def side(self, x: float, z: float) -> SheetPoint:
        """Convert a point [m] to paper coordinates in the view from the side."""
        return self.x0 + self.size(x), self.z0 - self.size(z)

    def top(self, x: float, y: float) -> SheetPoint:
        """Convert a point [m] to paper coordinates in the view from above."""
        return self.x0 + self.size(x), self.y0 - self.size(y)
