"""Detect whether swings repeat themselves: after how many swings, and after what time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.hunting.attractors.settings import settings
from friso.hunting.rows import ArrayRows


@dataclass(frozen=True)
class Recurrence(ArrayRows):
    """Whether and how runs repeat themselves, arrays of shape (runs,).

    - `swings`: smallest number of swings after which a run repeats (0: it does not); `time` [s]: how long they take.
    - `better`, `better_time` [s]: likewise for a larger number of swings that repeats much more closely, if there is
      one.
    - `size` [m]: peak-to-peak deviation, about its `middle` [m]; `deviation`: error of the repetition after `better`
      swings, over `size`.
    - `earlier`: this error, computed some swings earlier (NaN: too few swings).
    - `mean` [m]: mean size of single swings.

    Times and errors are NaN for a run that does not repeat.
    """

    swings: np.ndarray
    time: np.ndarray
    better: np.ndarray
    better_time: np.ndarray
    size: np.ndarray
    deviation: np.ndarray
    earlier: np.ndarray
    mean: np.ndarray
    middle: np.ndarray


@np.errstate(all="ignore")  # swings that a run does not have are NaN
def recurrence(values: np.ndarray, times: np.ndarray, mirrored: np.ndarray) -> Recurrence:
    """Detect how the last swings of runs repeat.

    `values` [m] and `times` [s] are the turning points, shape (runs, swings), the last in the last column, NaN before
    the first. Where `mirrored`, shape (runs,), a motion may also repeat as its mirror image, after an odd number of
    swings.
    """
    runs, room = values.shape
    legs = np.abs(np.diff(values, axis=1))
    mean = np.nansum(legs, axis=1) / np.maximum(np.isfinite(legs).sum(axis=1), 1)
    finite = np.isfinite(values)
    high = np.max(values, axis=1, initial=-np.inf, where=finite)
    low = np.min(values, axis=1, initial=np.inf, where=finite)
    size, middle = high - low, (high + low) / 2
    swings, better = np.zeros(runs, np.int64), np.zeros(runs, np.int64)
    time, better_time, least, earlier = (np.full(runs, np.nan) for _ in range(4))
    for n in range(1, settings.most_repeating_swings + 1):
        compared = _compared(n)
        if room < compared + n:
            break
        deviations = _deviation(values, n, room) / size
        takes = (times[:, room - compared :] - times[:, room - compared - n : room - n]).mean(axis=1)
        same = (deviations <= settings.repeated_swing_share) & (mirrored | (n % 2 == 0))
        first = same & (swings == 0)
        swings[first], time[first] = n, takes[first]
        closer = first | (same & (deviations < settings.closer_repetition_share * least))
        better[closer], better_time[closer], least[closer] = n, takes[closer], deviations[closer]
        if room - settings.compared_swings >= compared + n:
            earlier[closer] = (_deviation(values, n, room - settings.compared_swings) / size)[closer]
    return Recurrence(swings, time, better, better_time, np.where(size > 0, size, 0.0), least, earlier, mean, middle)


def _deviation(values: np.ndarray, swings: int, end: int) -> np.ndarray:
    """Return how far the last turning points are from those `swings` earlier [m], shape (runs,).

    After an odd number of swings they are compared with mirror images. `values` [m], shape (runs, swings), are the
    turning points. The last are those before column `end`, and the largest difference counts.
    """
    compared = _compared(swings)
    last, before = values[:, end - compared : end], values[:, end - compared - swings : end - swings]
    return np.asarray(np.abs(last - (-1) ** swings * before).max(axis=1))


def _compared(swings: int) -> int:
    """Return how many swings to compare with earlier ones to detect a repetition after `swings`."""
    return max(swings, 4)
