"""Guess limit cycles from the map of stages that start at rest.

The return map takes the distance at which a stage sticks to how far it then swings to the other side. Guesses are its
fixed points over half a period or a whole one.

Swings are found from the turning points about the reference, of many runs at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.engine.arrays import Results
from friso.hunting.cycle.ensemble import Ensemble, done, stuck, wait


@dataclass(frozen=True)
class Swings:
    """First swings of runs: turning points `values` [m] and their `times` [s], (runs, swings).

    Entries after the last swing are NaN.
    """

    values: np.ndarray
    times: np.ndarray


SWING_LEG_SHARE = 0.5  # [of the distance]
"""Smallest leg of the zigzag that counts as a swing. Smaller legs are ringing of a stage that sticks."""


def swings(stages: Ensemble, starts: np.ndarray, durations: np.ndarray, most: int, rtol: float) -> Swings:
    """Return the first `most` swings of stages that start at rest; a failed run has none.

    Stages start from states (count, states) and run for durations [s] (count,). A turning point counts once the stage
    has come back by a fraction of its start's distance, or the run is over.
    """
    position = starts[:, stages.kernel.position]
    legs = SWING_LEG_SHARE * np.abs(position)
    results = stages.run(starts, durations, rtol, least_swing=0.1 * legs)
    runs, room = results.turn_values.shape
    held = (np.arange(room) < results.turn_counts[:, None]) & done(results)[:, None]
    values = np.hstack([position[:, None], np.where(held, results.turn_values, np.nan)])
    times = np.hstack([np.zeros((runs, 1)), results.turn_times])
    return _zigzag(values, times, legs, np.sign(position), most)


def last_swings(results: Results, legs: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Return where [m] and when [s] runs turned last, (runs, most), the last swing last.

    Columns before the first swing are NaN. Moves from one turn to the next shorter than `legs` [m], (runs,), do not
    count, nor does the swing in which a run ends.
    """
    runs, room = results.turn_values.shape
    held = (np.arange(room) < results.turn_counts[:, None]) & done(results)[:, None]
    values = np.where(held, results.turn_values, np.nan)
    side = np.sign(values[:, 1] - values[:, 0]) if room > 1 else np.ones(runs)
    extrema = _zigzag(values, results.turn_times, legs, np.where(side == 0, 1.0, side), room)
    count = np.isfinite(extrema.values).sum(axis=1) - 1
    which = count[:, None] - most + np.arange(most)
    inside = which >= 0
    rows, places = np.arange(runs)[:, None], np.where(inside, which, 0)
    at, when = (np.where(inside, column[rows, places], np.nan) for column in (extrema.values, extrema.times))
    return at, when


def _zigzag(values: np.ndarray, times: np.ndarray, least: np.ndarray, side: np.ndarray, most: int) -> Swings:
    """Find the turning points of zigzags whose legs are at least `least` [m] long, (runs,).

    At most `most` are returned for each run, after the first. `values` [m] and `times` [s] have the shape (runs,
    points). `side` is 1 or -1 for runs that start on that side.
    """
    runs = len(values)
    rows = np.arange(runs)
    extrema = Swings(np.full((runs, most + 1), np.nan), np.full((runs, most + 1), np.nan))
    count, sign = np.zeros(runs, np.int64), side.copy()  # sign: side of the next extremum
    best, when = values[:, 0].copy(), times[:, 0].copy()
    for value, time in zip(values.T[1:], times.T[1:], strict=True):
        turned = (sign * (best - value) >= least) & (count <= most)
        extrema.values[rows[turned], count[turned]] = best[turned]
        extrema.times[rows[turned], count[turned]] = when[turned]
        count[turned] += 1
        sign = np.where(turned, -sign, sign)
        farther = turned | (sign * (value - best) > 0)
        best, when = np.where(farther, value, best), np.where(farther, time, when)
    last = (count > 0) & (count <= most)
    extrema.values[rows[last], count[last]], extrema.times[rows[last], count[last]] = best[last], when[last]
    return Swings(extrema.values[:, 1:], extrema.times[:, 1:])


@dataclass(frozen=True)
class ReturnMap:
    """Return map of each stage from one side of the reference, shape (count, points).

    `distances` [m], ascending, are the first sticking positions. `returns` [m] are the next ones on the other side:
    negative for a stage that stops short, 0 for one that does not break away. `times` [s] are the durations.
    """

    distances: np.ndarray
    returns: np.ndarray
    times: np.ndarray


MAP_RANGE = (0.02, 2.0)  # [deflections at break-away]
"""Range of a return map. From nearer a stage creeps home; from farther off it does not stick."""

MAP_POINTS = 32
"""Points of a return map before refinement. Fixed points closer than a step are missed."""


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def return_map(stages: Ensemble, rtol: float, side: float = 1.0) -> ReturnMap:
    """Compute the map of stages that stick on one side, 1 or -1, of their reference.

    The map is finer where a stage may land as far off as it started.
    """
    coarse = np.geomspace(*MAP_RANGE, MAP_POINTS)[None, :] * stages.length[:, None]
    first = trace_returns(stages, coarse, rtol, side)
    gain = np.argmax(first.returns / first.distances, axis=1)
    rows = np.arange(stages.count)
    low, high = (first.distances[rows, np.clip(gain + step, 0, MAP_POINTS - 1)] for step in (-1, 1))
    finer = np.geomspace(low, high, MAP_POINTS // 2 + 2, axis=1)[:, 1:-1]
    second = trace_returns(stages, finer, rtol, side)
    parts = (np.hstack(pair) for pair in zip(_columns(first), _columns(second), strict=True))
    distances, returns, times = parts
    order = np.argsort(distances, axis=1)
    return ReturnMap(*(np.take_along_axis(part, order, axis=1) for part in (distances, returns, times)))


def _columns(return_map: ReturnMap) -> tuple[np.ndarray, ...]:
    return return_map.distances, return_map.returns, return_map.times


BREAKAWAY_WAITS = 2.0  # [waits]
"""Longest wait for break-away. A stage that takes longer creeps home."""

FLIGHT_TIME = 60.0  # [1/natural frequencies]
"""Longest crossing of a stage to the other side. One that takes longer creeps."""


def trace_returns(stages: Ensemble, distances: np.ndarray, rtol: float, side: float) -> ReturnMap:
    """Release every stage from each distance [m], (count, points), and measure its first swing.

    Distances ascend; `side` is 1 or -1, the side of the reference from which stages start.
    """
    shape = distances.shape
    several = stages.take(np.repeat(np.arange(stages.count), shape[1]))
    starts = stuck(several, side * distances.ravel())
    durations = BREAKAWAY_WAITS * wait(several, distances.ravel()) + FLIGHT_TIME / several.number("rate")
    first = swings(several, starts, durations, 1, rtol)
    returns, times = (np.nan_to_num(part).reshape(shape) for part in (-side * first.values, first.times))
    return ReturnMap(distances, returns, times)


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


REFINED_DISTANCES = 8
"""Distances on which a fixed point of the map is narrowed down before Newton's method begins."""

UNWINDING_WAIT_SHARE = 0.4  # [waits]
"""Time from a stop until the actuator only balances constant forces, as a fraction of the wait."""


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
        between = np.linspace(low[numbers], high[numbers], REFINED_DISTANCES, axis=1)
        finer = trace_returns(subset, between, rtol, 1.0)
        distances[numbers] = root = _crossing(finer.distances, finer.returns - finer.distances)
        times[numbers] = _interpolated(root, finer.distances, finer.times) + UNWINDING_WAIT_SHARE * wait(subset, root)
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
            guess.distances[k], guess.times[k] = at, flights + UNWINDING_WAIT_SHARE * waits.sum()
    return guess


ALMOST_RETURN_LOG = 0.03
"""Largest error of a return that serves as the guess of a cycle."""


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
    if not goes.size or change.min() >= ALMOST_RETURN_LOG:
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
