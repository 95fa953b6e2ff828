"""How far and how finely friso searches for hunting."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SearchLimits:
    """What a search for hunting covers, for words that quote it.

    Bandwidths are searched from `lowest_bandwidth` to `highest_bandwidth`, in units of that of a stage, in so many
    steps to a factor of ten: `steps_to_edge` where an edge is looked for, `steps_beyond` where something may attract
    again (windows narrower than a step may be missed). Static friction is searched up to `most_friction` times that of
    the stage, and down to the same share of it, or to Coulomb friction. Advice keeps off an edge by the factor
    `edge_distance`: machines differ, and searches may miss some. Moves are drawn between `move_shares` of the
    acceleration, and of the acceleration time, of the stage file.
    """

    lowest_bandwidth: float = 0.25
    highest_bandwidth: float = 10.0
    steps_to_edge: int = 20
    steps_beyond: int = 10
    edge_distance: float = 1.2
    most_friction: float = 3.0
    move_shares: tuple[float, float] = (0.1, 2.0)


SEARCH_LIMITS = SearchLimits()
