"""Find the swings of many runs at once, from the turning points about the reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.engine.arrays import Results
from friso.hunting.cycle.ensemble import Ensemble, done
from friso.hunting.cycle.settings import settings


@dataclass(frozen=True)
class Swings:
    """First swings of runs: turning points `values` [m] and their `times` [s], (runs, swings).

    Entries after the last swing are NaN.
    """

    values: np.ndarray
    times: np.ndarray


def swings(stages: Ensemble, starts: np.ndarray, durations: np.ndarray, most: int, rtol: float) -> Swings:
    """Return the first `most` swings of stages that start at rest; a failed run has none.

    Stages start from states (count, states) and run for durations [s] (count,). A turning point counts once the stage
    has come back by a fraction of its start's distance, or the run is over.
    """
    position = starts[:, stages.kernel.position]
    legs = settings.swing_leg_share * np.abs(position)
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
