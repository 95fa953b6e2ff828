"""The thesis's peak count: a number of a run, and no verdict.

The rule (Fix, Univ. of Twente, Sec. 3.2.2): maxima of the stage position after 10 s, higher than 0.1 mm above the
reference, 0.5 s apart, the tallest kept first, as MATLAB's findpeaks does it. It counts a transient that is long enough
as well as a cycle, and nothing of a cycle below 0.1 mm. `friso.sweep` and `friso.check` call it `peaks`; turning points
less than 0.25 um from each other are passed over there.

A maximum need not be much of one. A stage that breaks away halfway back springs forward by half a micrometre first, and
the rule counts that as it counts the swing itself; with the noise of an encoder on it, a stage that stands 0.2 mm off
its reference has two peaks a second. Distinct peaks are counted by the same rule, but of maxima alone from which the
deviation falls by 1 um on both sides before it rises higher: our addition, for logs of a drive (`friso rig`, `friso
compare`). `friso reproduce` judges the maps of the thesis by its own count, without it.
"""

from __future__ import annotations

import numpy as np

from friso.hunting.turning import COUNTED_ABOVE, COUNTED_AFTER, DISTINCT, SEPARATION
from friso.hunting.turns import scan_turning_points

__all__ = [
    "COUNTED_ABOVE",
    "COUNTED_AFTER",
    "DISTINCT",
    "DISTINCT_CRITERION",
    "PEAK_CRITERION",
    "PEAK_RULE",
    "SEPARATION",
    "counted_peaks",
    "distinct_peaks",
    "peaks_in_traces",
]

PEAK_RULE = f"after {COUNTED_AFTER:g} s, higher than {1e3 * COUNTED_ABOVE:g} mm, {SEPARATION:g} s apart"
"""Which maxima count."""

PEAK_CRITERION = f"peak count of the thesis: maxima {PEAK_RULE}, the tallest kept first"

DISTINCT_CRITERION = f"{PEAK_CRITERION}; of maxima with valleys of {1e6 * DISTINCT:g} um or more on both sides"


def counted_peaks(times: np.ndarray, values: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Which turning points (or samples) of runs are counted peaks, shape (runs, room); sums over rows are the counts.

    `times` [s] and `values` [m] of position minus reference have the shape (runs, room) and are valid up to `counts`,
    shape (runs,).
    """
    nothing = np.zeros(len(counts))
    return scan_turning_points(times, values, counts, nothing, nothing).peaks


def distinct_peaks(times: np.ndarray, values: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Which turning points of runs are distinct peaks, shape (runs, room): counted peaks whose valleys on both sides
    are at least `DISTINCT` deep. `times` [s] and `values` [m] of position minus reference have the shape (runs, room)
    and are valid up to `counts`, shape (runs,)."""
    nothing = np.zeros(len(counts))
    return scan_turning_points(times, values, counts, nothing, nothing).distinct


def peaks_in_traces(time: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """How many distinct peaks sampled runs have, shape (runs,): deviations [m], shape (runs, n), over times [s], shape
    (n,).

    From a peak the deviation falls on both sides: where a trace ends on its way up, its highest sample is none.
    """
    counting = time >= min(0.8 * COUNTED_AFTER, time[-1] / 2)  # what is long before the first that may count is idle
    values = np.ascontiguousarray(deviation[:, counting])
    counts = _until_last_fall(values)
    return distinct_peaks(np.tile(time[counting], (len(values), 1)), values, counts).sum(axis=1)


def _until_last_fall(values: np.ndarray) -> np.ndarray:
    """How many samples of each row there are until the end of the last fall by `DISTINCT`; 0 where nothing falls."""
    ahead = np.minimum.accumulate(values[:, ::-1], axis=1)[:, ::-1]
    falls = values - ahead >= DISTINCT
    last = values.shape[1] - 1 - falls[:, ::-1].argmax(axis=1)
    following = np.where(np.arange(values.shape[1]) >= last[:, None], values, np.inf)
    return np.where(falls.any(axis=1), following.argmin(axis=1) + 1, 0)
