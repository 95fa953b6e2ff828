"""Find the range of each number in which an answer holds, all others staying as tuned."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from friso.engine.allowance import Exhausted, allowance
from friso.remedies.search import Search
from friso.remedies.settings import settings


@dataclass(frozen=True)
class VariableWindow:
    """Range of a variable around its tuned `value`, in which machines meet the goal.

    The range is from `low` to `high`. These and `value` are in SI, or factors on the bandwidth. All other variables
    stay as tuned. `open_below` and `open_above` are true if the range reaches an end of the search.
    """

    name: str
    low: float
    value: float
    high: float
    open_below: bool
    open_above: bool


def windows(search: Search, shares: np.ndarray) -> tuple[VariableWindow, ...]:
    """Return in which range each variable works, the others staying at a point, (variables,).

    Moves and margins are tried on a grid on the machines of the search. The ends are refined by bisection, then drawn
    in until enough surveyed machines do not hunt there. The result is empty if the point itself misses the goal on
    these machines, or if this takes too much work.
    """
    variables, grid = search.remedy.variables, np.linspace(0, 1, settings.window_points)
    inside, outside = np.empty((len(variables), 2)), np.full((len(variables), 2), np.nan)
    for number in range(len(variables)):
        places = np.union1d(grid, shares[[number]])
        broken = ~_meets(search, shares, np.full(len(places), number), places)
        at = int(np.searchsorted(places, shares[number]))
        if broken[at]:
            return ()
        below, above = np.flatnonzero(broken[:at]), np.flatnonzero(broken[at:])
        first = int(below[-1]) + 1 if below.size else 0
        last = at + int(above[0]) - 1 if above.size else len(places) - 1
        inside[number] = places[[first, last]]
        if below.size:
            outside[number, 0] = places[first - 1]
        if above.size:
            outside[number, 1] = places[last + 1]
    _halve(
        inside, outside, np.argwhere(np.isfinite(outside)), partial(_meets, search, shares), settings.window_halvings
    )
    try:
        with allowance(settings.search_work):
            ends = np.argwhere(inside != shares[:, None])
            attracted = ends[~_clear(search, shares, ends[:, 0], inside[*ends.T])]
            outside[*attracted.T], inside[*attracted.T] = inside[*attracted.T], shares[attracted[:, 0]]
            _halve(inside, outside, attracted, partial(_clear, search, shares), settings.surveyed_halvings)
    except Exhausted:
        return ()
    listed = []
    for number, variable in enumerate(variables):
        places = np.array([inside[number, 0], shares[number], inside[number, 1]])
        low, value, high = search.remedy.values(_moved(shares, np.full(3, number), places))[:, number].tolist()
        listed.append(VariableWindow(variable.name, low, value, high, *np.isnan(outside[number]).tolist()))
    return tuple(listed)


def _halve(
    inside: np.ndarray,
    outside: np.ndarray,
    ends: np.ndarray,
    does: Callable[[np.ndarray, np.ndarray], np.ndarray],
    halvings: int,
) -> None:
    """Bisect between coordinates `inside` that work and `outside` that do not, changing both.

    Both have shape (variables, 2), for a lower and an upper end. `ends` selects the ends to refine by indices of
    variable and side, (n, 2), and `halvings` is how often. `does` takes indices of variables and coordinates, both
    (n,), and returns which work.
    """
    rows, sides = ends.T
    for _ in range(halvings if len(ends) else 0):
        middle = (inside[rows, sides] + outside[rows, sides]) / 2
        good = does(rows, middle)
        inside[rows[good], sides[good]], outside[rows[~good], sides[~good]] = middle[good], middle[~good]


def _meets(search: Search, shares: np.ndarray, numbers: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Tell which points meet the goal by moves and margins, shape (n,).

    Each is a copy of the point `shares` with one variable moved. `numbers` (n,) are the indices of the variables, and
    `places` (n,) their new coordinates from 0 to 1.
    """
    worst = settings.worst_time  # points that break a constraint cost more
    return search.measured(_moved(shares, numbers, places), worst).meets(search.goal)


def _clear(search: Search, shares: np.ndarray, numbers: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Tell at which points enough surveyed machines do not hunt (`Search.clear`), shape (n,).

    Each is a copy of the point `shares` with one variable moved. `numbers` (n,) are the indices of the variables, and
    `places` (n,) their new coordinates from 0 to 1.
    """
    if not len(places):
        return np.ones(0, bool)
    return search.clear(_moved(shares, numbers, places))


def _moved(shares: np.ndarray, numbers: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return copies of a point, each with variable `numbers[k]` moved to coordinate `places[k]`."""
    tried = np.repeat(shares[None], len(places), axis=0)
    tried[np.arange(len(places)), numbers] = places
    return tried
