"""Compute the return map of hunting.

The map takes the distance at which a stage sticks to how far it then swings to the other side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.rest import stuck, wait
from friso.hunting.cycle.settings import settings
from friso.hunting.cycle.swings import swings


@dataclass(frozen=True)
class ReturnMap:
    """Return map of each stage from one side of the reference, shape (count, points).

    `distances` [m], ascending, are the first sticking positions. `returns` [m] are the next ones on the other side:
    negative for a stage that stops short, 0 for one that does not break away. `times` [s] are the durations.
    """

    distances: np.ndarray
    returns: np.ndarray
    times: np.ndarray


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def return_map(stages: Ensemble, rtol: float, side: float = 1.0) -> ReturnMap:
    """Compute the map of stages that stick on one side, 1 or -1, of their reference.

    The map is finer where a stage may land as far off as it started.
    """
    coarse = np.geomspace(*settings.map_range, settings.map_points)[None, :] * stages.length[:, None]
    first = trace_returns(stages, coarse, rtol, side)
    gain = np.argmax(first.returns / first.distances, axis=1)
    rows = np.arange(stages.count)
    low, high = (first.distances[rows, np.clip(gain + step, 0, settings.map_points - 1)] for step in (-1, 1))
    finer = np.geomspace(low, high, settings.map_points // 2 + 2, axis=1)[:, 1:-1]
    second = trace_returns(stages, finer, rtol, side)
    parts = (np.hstack(pair) for pair in zip(_columns(first), _columns(second), strict=True))
    distances, returns, times = parts
    order = np.argsort(distances, axis=1)
    return ReturnMap(*(np.take_along_axis(part, order, axis=1) for part in (distances, returns, times)))


def _columns(return_map: ReturnMap) -> tuple[np.ndarray, ...]:
    return return_map.distances, return_map.returns, return_map.times


def trace_returns(stages: Ensemble, distances: np.ndarray, rtol: float, side: float) -> ReturnMap:
    """Release every stage from each distance [m], (count, points), and measure its first swing.

    Distances ascend; `side` is 1 or -1, the side of the reference from which stages start.
    """
    shape = distances.shape
    several = stages.take(np.repeat(np.arange(stages.count), shape[1]))
    starts = stuck(several, side * distances.ravel())
    durations = settings.breakaway_waits * wait(several, distances.ravel()) + settings.flight_time / several.number(
        "rate"
    )
    first = swings(several, starts, durations, 1, rtol)
    returns, times = (np.nan_to_num(part).reshape(shape) for part in (-side * first.values, first.times))
    return ReturnMap(distances, returns, times)
