"""The window of points in which an answer holds: each number varied by itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.remedies.search import Search

POINTS = 16
"""Values of each number that are tried."""


@dataclass(frozen=True)
class VariableWindow:
    """From `low` to `high` of a variable of a remedy (SI, or factors), all else being as tuned, machines meet the goal;
    whether it goes on to the end of the range that was searched, `open_below` and `open_above`."""

    name: str
    low: float
    high: float
    open_below: bool
    open_above: bool


def windows(search: Search, shares: np.ndarray) -> tuple[VariableWindow, ...]:
    """The windows about points, shape (variables,), by moves and margins of the machines of the search."""
    variables = search.remedy.variables
    grid = np.linspace(0, 1, POINTS)
    listed = []
    for number, variable in enumerate(variables):
        places = np.union1d(grid, shares[[number]])
        tried = np.repeat(shares[None], len(places), axis=0)
        tried[:, number] = places
        broken = ~search.measured(tried).meets(search.goal)
        at = int(np.searchsorted(places, shares[number]))
        below, above = np.flatnonzero(broken[:at]), np.flatnonzero(broken[at:])
        first = int(below[-1]) + 1 if below.size else 0
        last = at + int(above[0]) - 1 if above.size else len(places) - 1
        low, high = variable.at(places[[first, max(first, last)]])
        listed.append(VariableWindow(variable.name, float(low), float(high), not below.size, not above.size))
    return tuple(listed)
