"""Where hunting cycles may be: fixed points of the return map, and of the way there and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.rest import wait
from friso.hunting.cycle.return_map import ReturnMap, trace_returns
from friso.hunting.cycle.settings import OrbitSettings


@dataclass(frozen=True)
class Guess:
    """A distance [m] at which each stage sticks, again and again, and the time [s] of its return, both of shape
    (count,); NaN where there is none."""

    distances: np.ndarray
    times: np.ndarray

    @property
    def numbers(self) -> np.ndarray:
        """The numbers of the stages that have one."""
        return np.flatnonzero(np.isfinite(self.times))


def symmetric_guess(stages: Ensemble, positive: ReturnMap, rtol: float) -> Guess:
    """The largest distance from which a stage lands as far on the other side, the map falling through the diagonal."""
    settings = OrbitSettings.current()
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
    """The distance from which a stage comes back to where it was, by way of one that differs by a share of at least
    `apart`. Of several it is that for which the two differ least if apart is 0, else that for which they differ most.

    `positive` and `negative` are the maps of the stages that stick on the positive and on the negative side.
    """
    settings = OrbitSettings.current()
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
    """The distance that is its own end, of those whose numbers are in `goes`; if there is none, the one that is almost:
    near a fold both lie between two points of the map. With `apart` neither where the map passes its symmetric fixed
    point, or comes near that: it almost comes back there whenever a flip is near."""
    rise, side = end - start, np.zeros(len(start) + 1)
    side[goes] = np.sign(far - start)[goes] if apart else 1.0
    crosses = np.flatnonzero((side[:-2] * side[1:-1] > 0) & (rise[:-1] * rise[1:] <= 0))
    if crosses.size:
        differ = np.abs(np.log(far[crosses] / start[crosses]))
        i = crosses[differ.argmax() if apart else differ.argmin()]
        return float(np.interp(0.0, *_ascending(rise[i : i + 2], start[i : i + 2])))
    change = np.abs(np.log(end[goes] / start[goes]))
    if not goes.size or change.min() >= OrbitSettings.current().almost_return_log:
        return None
    nearest = goes[change.argmin()]
    towards = nearest + int(side[nearest])  # the symmetric fixed point
    return float(start[nearest]) if not apart or side[towards] == side[nearest] else None


def _ascending(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    order = np.argsort(x)
    return x[order], y[order]


def _falling(distances: np.ndarray, rise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The neighbouring distances between which a function falls through zero, the last such; NaN where none are."""
    falls = (rise[:, :-1] > 0) & (rise[:, 1:] <= 0)
    last = falls.shape[1] - 1 - falls[:, ::-1].argmax(axis=1)
    rows = np.arange(len(rise))
    none = ~falls.any(axis=1)
    return np.where(none, np.nan, distances[rows, last]), np.where(none, np.nan, distances[rows, last + 1])


def _crossing(distances: np.ndarray, rise: np.ndarray) -> np.ndarray:
    """Where a function falls through zero, between two of the distances."""
    low, high = _falling(distances, rise)
    above, below = _interpolated(low, distances, rise), _interpolated(high, distances, rise)
    return low + (high - low) * above / (above - below)


def _interpolated(at: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Straight between the points x, y (count, points), at one place each (count,)."""
    return np.array([np.interp(*row) for row in zip(at, x, y, strict=True)])
