"""Settings of the figures of a boundary, with a reason for each.

Settings of the picture of a map, with a reason for each.
"""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class BoundaryFigureSettings(Settings):
    """Settings of the figures of a boundary."""

    axis_beyond: float = setting(0.15, "")
    """How far an axis goes on beyond the last cycle, as a share of what has cycles. It shows that none is there."""


boundary_figure_settings = BoundaryFigureSettings.live()


@dataclass(frozen=True)
class MapSettings(Settings):
    """Settings of the words in the regions of a map of verdicts."""

    letter_width: float = setting(0.012, "")
    """Width of a letter as a share of the panel. Bold capitals of a page's panel take as much."""

    line_height: float = setting(0.05, "")
    """Height of a line of words as a share of the panel. Lines of a page's panel take as much."""

    room_of_words: float = setting(0.55, "")
    """Distance of words from the edge of their region, by their own size. With 0.5, their middles touch it."""


map_settings = MapSettings.live()
