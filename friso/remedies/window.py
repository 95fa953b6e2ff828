"""The window of points in which an answer holds: each number varied by itself."""

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
    """From `low` to `high` of a variable of a remedy (SI, or factors), all else being as tuned, machines meet the goal;
    whether it goes on to the end of the range that was searched, `open_below` and `open_above`."""

    name: str
    low: float
    high: float
    open_below: bool
    open_above: bool


def windows(search: Search, shares: np.ndarray) -> tuple[VariableWindow, ...]:
    """The windows about points, shape (variables,), by moves and margins of the machines of the search: on a grid, then
    their ends by halving what lies between them and the next value that was tried; and then as far as nothing attracts
    these machines at the ends. None where the points themselves do not meet the goal on these machines, or where that
    takes too much work."""
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
    """Halve what lies between the last places that do and the next, which do not, (variables, 2), at some of the ends:
    `ends` are numbers of variables and sides (n, 2)."""
    settings = RemedySettings.current()
    rows, sides = ends.T
    for _ in range(settings.window_halvings if len(ends) else 0):
        middle = (inside[rows, sides] + outside[rows, sides]) / 2
        good = does(rows, middle)
        inside[rows[good], sides[good]], outside[rows[~good], sides[~good]] = middle[good], middle[~good]


def _meets(search: Search, shares: np.ndarray, numbers: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Whether points meet the goal, by moves and margins, with one variable each, that of a number (n,), at another
    place (n,)."""
    return search.measured(_moved(shares, numbers, places)).meets(search.goal)


def _clear(search: Search, shares: np.ndarray, numbers: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Whether nothing attracts the machines with such points."""
    if not len(places):
        return np.ones(0, bool)
    survey = attraction(search.remedy, _moved(shares, numbers, places), search.machines, search.goal)
    return np.asarray(survey.clear.mean(axis=1) >= search.goal.share)


def _moved(shares: np.ndarray, numbers: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Points with one variable each, that of a number (n,), at another place (n,)."""
    tried = np.repeat(shares[None], len(places), axis=0)
    tried[np.arange(len(places)), numbers] = places
    return tried
