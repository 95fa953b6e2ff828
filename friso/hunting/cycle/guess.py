"""Guess limit cycles: fixed points of the return map over half a period or a whole one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.rest import wait
from friso.hunting.cycle.return_map import ReturnMap, trace_returns
from friso.hunting.cycle.settings import settings


@dataclass(frozen=True)
class Guess:
    """A guess of each cycle: the sticking distance [m] and the time [s] of its return.

    Both have the shape (count,), NaN for no guess.
    """

    distances: np.ndarray
    times: np.ndarray

    @property
    def numbers(self) -> np.ndarray:
        """Return the numbers of the stages with a guess."""
        return np.flatnonzero(np.isfinite(self.times))


def symmetric_guess(stages: Ensemble, positive: ReturnMap, rtol: float) -> Guess:
    """Guess the symmetric cycle from the return map `positive` of stages on the positive side.

    It is the largest distance from which a stage lands equally far on the other side. There the return map falls
    through its diagonal.
    """
    low, high = _falling(positive.distances, positive.returns - positive.distances)
    numbers = np.flatnonzero(np.isfinite(low))
    distances, times = np.full(stages.count, np.nan), np.full(stages.count, np.nan)
    if numbers.size:
        subset = stages.take(numbers)
        between = np.linspace(low[numbers], high[numbers], settings.refined_distances, axis=1)
        finer = trace_returns(subset, between, rtol, 1.0)
        distances[numbers] = root = _crossing(finer.distances, finer.returns - finer.distances)
        times[numbers] = _interpolated(root, finer.distances, finer.times) + settings.unwinding_wait_share * wait(
            subset, root
        )
    return Guess(distances, times)


def whole_guess(stages: Ensemble, positive: ReturnMap, negative: ReturnMap, apart: float = 0.0) -> Guess:
    """Guess the cycle over a whole period: a sticking distance that recurs after two swings.

    After one swing the stage sticks on the other side, at a distance that differs by a fraction of more than `apart`.
    Of several guesses, the one with the smallest difference is taken if `apart` is 0, else the one with the largest.
    `positive` and `negative` are the return maps of stages that stick on the positive and on the negative side.
    """
    guess = Guess(np.full(stages.count, np.nan), np.full(stages.count, np.nan))
    for k in range(stages.count):
        start, far = positive.distances[k], positive.returns[k]
        end = np.interp(far, negative.distances[k], negative.returns[k], left=0.0)
        goes = np.flatnonzero((np.abs(far - start) > apart * start) & (far > 0) & (end > 0))
        at = _comes_back(start, far, end, goes, apart)
        if at is not None:
            middle = np.interp(at, start, far)
            flights = np.interp(at, start, positive.times[k]) + np.interp(
                middle, negative.distances[k], negative.times[k]
            )
            waits = wait(stages.take(np.array([k, k])), np.array([at, middle]))
            guess.distances[k], guess.times[k] = at, flights + settings.unwinding_wait_share * waits.sum()
    return guess


def _comes_back(start: np.ndarray, far: np.ndarray, end: np.ndarray, goes: np.ndarray, apart: float) -> float | None:
    """Return a sticking distance [m] that recurs after two swings; None if there is none.

    From the distances `start` a stage swings to stick at `far`, and then at `end` [m], each of shape (points,). Only
    the distances numbered `goes` count. If none recurs, the one that almost does is taken: near a fold both fixed
    points lie between two points of the map. With `apart`, distances near the symmetric fixed point are left out,
    because the map almost returns there whenever a flip is near.
    """
    rise, side = end - start, np.zeros(len(start) + 1)
    side[goes] = np.sign(far - start)[goes] if apart else 1.0
    crosses = np.flatnonzero((side[:-2] * side[1:-1] > 0) & (rise[:-1] * rise[1:] <= 0))
    if crosses.size:
        differ = np.abs(np.log(far[crosses] / start[crosses]))
        i = crosses[differ.argmax() if apart else differ.argmin()]
        return float(np.interp(0.0, *_ascending(rise[i : i + 2], start[i : i + 2])))
    change = np.abs(np.log(end[goes] / start[goes]))
    if not goes.size or change.min() >= settings.almost_return_log:
        return None
    nearest = goes[change.argmin()]
    towards = nearest + int(side[nearest])  # the side on which the symmetric fixed point lies
    return float(start[nearest]) if not apart or side[towards] == side[nearest] else None


def _ascending(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    order = np.argsort(x)
    return x[order], y[order]


def _falling(distances: np.ndarray, rise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the last two neighbouring distances between which `rise` falls through zero.

    `distances` and `rise` have the shape (count, points). Both results are NaN if there are none.
    """
    falls = (rise[:, :-1] > 0) & (rise[:, 1:] <= 0)
    last = falls.shape[1] - 1 - falls[:, ::-1].argmax(axis=1)
    rows = np.arange(len(rise))
    none = ~falls.any(axis=1)
    return np.where(none, np.nan, distances[rows, last]), np.where(none, np.nan, distances[rows, last + 1])


def _crossing(distances: np.ndarray, rise: np.ndarray) -> np.ndarray:
    """Return the last distance at which `rise` falls through zero, shape (count,).

    It is interpolated linearly between two distances. `distances` and `rise` have the shape (count, points).
    """
    low, high = _falling(distances, rise)
    above, below = _interpolated(low, distances, rise), _interpolated(high, distances, rise)
    return low + (high - low) * above / (above - below)


def _interpolated(at: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Interpolate linearly between the points x, y (count, points), at one x each, (count,)."""
    return np.array([np.interp(*row) for row in zip(at, x, y, strict=True)])
