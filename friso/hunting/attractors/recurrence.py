"""Whether swings repeat themselves: after how many of them, and after what time."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

MOST = 12
"""Swings after which a motion has to repeat itself at most."""

SAME = 0.03
"""Share of the largest swing by which one that repeats another may differ: runs at usual tolerances scatter by half of
it where a stage swings by far less than it is displaced by the break-away force."""

EARLIER = 16
"""Swings before the last ones, to see whether a motion approaches what it repeats."""

CLOSER = 0.2
"""Share of the error after fewer swings that there is after more if the motion repeats itself after these."""


@dataclass(frozen=True)
class Recurrence:
    """Of runs, arrays of shape (runs,): the least number of swings after which each repeats itself, `swings` (0: it
    does not), and the number after which it does so best, `better`; the times that these take, `time` and
    `better_time` [s]; peak to peak, `size` [m], the share of that by which it fails to repeat itself, `deviation`;
    and the mean size of single swings, `mean` [m]."""

    swings: np.ndarray
    time: np.ndarray
    better: np.ndarray
    better_time: np.ndarray
    size: np.ndarray
    deviation: np.ndarray
    earlier: np.ndarray
    mean: np.ndarray

    def take(self, numbers: np.ndarray) -> Recurrence:
        """Those of the runs with these numbers."""
        return Recurrence(*(getattr(self, field.name)[numbers] for field in fields(self)))


@np.errstate(all="ignore")  # swings that a run does not have are NaN
def recurrence(values: np.ndarray, times: np.ndarray, mirrored: np.ndarray) -> Recurrence:
    """How the swings of runs end: where they turn [m] and when [s], shape (runs, swings), the last in the last column,
    NaN before the first. Where `mirrored`, shape (runs,), a motion may repeat as its mirror image, after an odd number
    of swings; else it cannot."""
    runs, room = values.shape
    legs = np.abs(np.diff(values, axis=1))
    mean = np.nansum(legs, axis=1) / np.maximum(np.isfinite(legs).sum(axis=1), 1)
    finite = np.isfinite(values)
    size = np.max(values, axis=1, initial=-np.inf, where=finite) - np.min(values, axis=1, initial=np.inf, where=finite)
    swings, better = np.zeros(runs, np.int64), np.zeros(runs, np.int64)
    time, better_time, least, earlier = (np.full(runs, np.nan) for _ in range(4))
    for n in range(1, MOST + 1):
        compared = _compared(n)
        if room < compared + n:
            break
        deviations = _deviation(values, n, room) / size
        takes = (times[:, room - compared :] - times[:, room - compared - n : room - n]).mean(axis=1)
        same = (deviations <= SAME) & (mirrored | (n % 2 == 0))
        first = same & (swings == 0)
        swings[first], time[first] = n, takes[first]
        closer = first | (same & (deviations < CLOSER * least))
        better[closer], better_time[closer], least[closer] = n, takes[closer], deviations[closer]
        if room - EARLIER >= compared + n:
            earlier[closer] = (_deviation(values, n, room - EARLIER) / size)[closer]
    return Recurrence(swings, time, better, better_time, np.where(size > 0, size, 0.0), least, earlier, mean)


def _deviation(values: np.ndarray, swings: int, end: int) -> np.ndarray:
    """By how much swings up to a number fail to repeat what was some swings before [m], shape (runs,)."""
    compared = _compared(swings)
    last, before = values[:, end - compared : end], values[:, end - compared - swings : end - swings]
    return np.asarray(np.abs(last - (-1) ** swings * before).max(axis=1))


def _compared(swings: int) -> int:
    """How many swings have to repeat what was some swings before."""
    return max(swings, 4)
