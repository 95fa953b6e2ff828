"""Settings of the figures of a boundary, with a reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class BoundaryFigureSettings(Settings):
    """Settings of the figures of a boundary."""

    axis_beyond: float = setting(0.15, "")
    """How far an axis goes on beyond the last cycle, as a share of what has cycles. It shows that none is there."""


boundary_figure_settings = BoundaryFigureSettings.live()
