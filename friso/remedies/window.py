"""Find the range of each number in which an answer holds, all others as tuned."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from friso.engine.allowance import Exhausted, allowance
from friso.remedies.search import Search
from friso.remedies.settings import RemedySettings
from friso.remedies.trials import attraction


@dataclass(frozen=True)
class VariableWindow:
    """The range from `low` to `high` of a variable in which machines meet the goal.

    Its ends are in SI, or factors. All else is as tuned. `open_below` and `open_above` tell that the range reaches an
    end of the search.
    """

    name: str
    low: float
    high: float
    open_below: bool
    open_above: bool


def windows(search: Search, shares: np.ndarray) -> tuple[VariableWindow, ...]:
    """Return the windows around a point, shape (variables,), on the machines of the search.

    Moves and margins are tried on a grid, and the ends are refined by bisection. The ends are then drawn in until
    nothing attracts the machines there. Returns None if the point itself misses the goal on these machines, or takes
    too much work.
    """
    settings = RemedySettings.current()
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
    _halve(inside, outside, np.argwhere(np.isfinite(outside)), partial(_meets, search, shares))
    try:
        with allowance(settings.search_work):
            ends = np.argwhere(inside != shares[:, None])
            attracted = ends[~_clear(search, shares, ends[:, 0], inside[*ends.T])]
            outside[*attracted.T], inside[*attracted.T] = inside[*attracted.T], shares[attracted[:, 0]]
            _halve(inside, outside, attracted, partial(_clear, search, shares))
    except Exhausted:
        return ()
    ends_of = [[float(value) for value in variable.at(row)] for variable, row in zip(variables, inside, strict=True)]
    return tuple(
        VariableWindow(variable.name, low, high, *np.isnan(row).tolist())
        for variable, (low, high), row in zip(variables, ends_of, outside, strict=True)
    )


def _halve(
    inside: np.ndarray, outside: np.ndarray, ends: np.ndarray, does: Callable[[np.ndarray, np.ndarray], np.ndarray]
) -> None:
    """Bisect between the last places that work and the next ones that do not, (variables, 2).

    `ends` selects some of the ends by numbers of variables and sides, (n, 2).
    """
    settings = RemedySettings.current()
    rows, sides = ends.T
    for _ in range(settings.window_halvings if len(ends) else 0):
        middle = (inside[rows, sides] + outside[rows, sides]) / 2
        good = does(rows, middle)
        inside[rows[good], sides[good]], outside[rows[~good], sides[~good]] = middle[good], middle[~good]


def _meets(search: Search, shares: np.ndarray, numbers: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Tell whether points meet the goal by moves and margins if one variable each is moved.

    `numbers` (n,) select the variables, and `places` (n,) are their new shares.
    """
    return search.measured(_moved(shares, numbers, places)).meets(search.goal)


def _clear(search: Search, shares: np.ndarray, numbers: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Tell whether nothing attracts the machines at points with one variable each moved."""
    if not len(places):
        return np.ones(0, bool)
    survey = attraction(search.remedy, _moved(shares, numbers, places), search.machines, search.goal)
    return np.asarray(survey.clear.mean(axis=1) >= search.goal.share)


def _moved(shares: np.ndarray, numbers: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return points with one variable each, of a number (n,), moved to another place (n,)."""
    tried = np.repeat(shares[None], len(places), axis=0)
    tried[np.arange(len(places)), numbers] = places
    return tried
