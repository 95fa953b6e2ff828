"""State how far and how finely friso searches for hunting."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SearchLimits:
    """Range and steps of a search for hunting, for messages that quote them.

    Bandwidths are searched from `lowest_bandwidth` to `highest_bandwidth`, in units of the stage's own. Steps per
    factor of ten are `steps_to_edge` where an edge is looked for, and `steps_beyond` where hunting may come back.
    Windows narrower than a step may be missed. Static friction is searched up to `most_friction` times the stage's own,
    and down to its inverse, or to Coulomb friction. Advice stays `edge_distance`, a factor, away from an edge, because
    machines differ and searches may miss a window. A window is narrow if its ends differ by less than the factor
    `narrow_window`. Moves are drawn between `move_shares` of the acceleration, and of
    the acceleration time, in the stage file.
    """

    lowest_bandwidth: float = 0.25
    highest_bandwidth: float = 10.0
    steps_to_edge: int = 20
    steps_beyond: int = 10
    edge_distance: float = 1.2
    narrow_window: float = 1.01
    most_friction: float = 3.0
    move_shares: tuple[float, float] = (0.1, 2.0)


SEARCH_LIMITS = SearchLimits()

MORE_WORK = "more work than a check may"
"""Words of every message on what was given up for lack of work; beside them a check names the commands that go on."""
