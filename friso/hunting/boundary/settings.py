"""Settings of the boundary of hunting: how cycles, and the curves on which they change, are followed."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class MeetingSettings(Settings):
    """Where curves of the edge of hunting meet. The range of either key is one unit."""

    crossing_refinements: int = setting(
        8, "", "A crossing that is not refined in so many steps is where straight lines between points cross."
    )
    crossing_precision: float = setting(
        1e-6, "ranges", "The last step of a refinement: far below the digits shown; a smaller one costs another step."
    )
    crossing_reach: float = setting(
        0.05, "ranges", "Farther than the longest step of a curve a refinement would find another crossing."
    )
    chord_along: float = setting(
        0.7, "", "A step to another point of a curve tells its direction if it is mostly along it, else where it lies."
    )
    end_distance: float = setting(
        0.02, "ranges", "A curve that is lost stops up to two first steps short of what it ends on; farther is another."
    )
    together_distance: float = setting(
        0.005, "ranges", "Straight lines between points stray so far from a curve; curves farther apart are two."
    )
    together_points: int = setting(
        3, "", "Two curves that cross have fewer points near each other; those that are one have more."
    )
    same_cycle_log: float = setting(
        0.05, "", "Logarithms of amplitude and period between points are off by less; other cycles differ by more."
    )
