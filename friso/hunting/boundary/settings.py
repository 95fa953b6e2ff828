"""Settings of the search for meetings of curves."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class MeetingSettings(Settings):
    """Settings of the search for meetings of curves of the edge of hunting.

    The range of either key is one unit.
    """

    crossing_refinements: int = setting(8, "")
    """Most refinements of a crossing. Afterwards it stays where the straight lines between points cross."""

    crossing_precision: float = setting(1e-6, "ranges")
    """Last step of a refinement, far below the decimals shown."""

    crossing_reach: float = setting(0.05, "ranges")
    """Farthest move of a refinement, equal to the longest step of a curve. Farther off lies another crossing."""

    chord_along: float = setting(0.7, "")
    """Least alignment of a step with a curve for the step to show the curve's direction."""

    end_distance: float = setting(0.02, "ranges")
    """Largest gap between the end of a lost curve and the curve that it ends on."""

    together_distance: float = setting(0.005, "ranges")
    """Distance within which two curves run together; straight lines between points stray this far."""

    together_length: float = setting(0.05, "ranges")
    """Shortest stretch over which two curves run together. Curves that cross at more than six degrees part sooner."""

    same_cycle_log: float = setting(0.05, "")
    """Largest difference in interpolated log amplitude and log period between points of one cycle."""


meeting_settings = MeetingSettings.live()
