"""Count peaks of a run as the thesis does: a number, and no verdict.

The rule (Fix, Univ. of Twente, Sec. 3.2.2) counts maxima of the stage position after 10 s, more than 0.1 mm above the
reference and 0.5 s apart. The tallest are kept first, as MATLAB's findpeaks does. So a long transient counts like a
cycle, and a cycle below 0.1 mm does not count. `friso.sweep` and `friso.check` call the number `peaks`; there, turning
points less than 0.25 um from each other are skipped.

The rule counts every small bump as well. A stage that breaks away halfway back first springs forward by half a
micrometre, which counts like the swing itself. With encoder noise, a stage that stands 0.2 mm off its reference has two
peaks a second. Distinct peaks follow the rule too, but the deviation must fall by 1 um on both sides before it rises
higher. This is our addition, for logs of a drive (`friso rig`, `friso compare`). `friso reproduce` judges the maps of
the thesis by the thesis's own count, without the addition.
"""

from __future__ import annotations

import numpy as np

from friso.hunting.turning import (
    COUNTED_ABOVE,
    COUNTED_AFTER,
    LEAST_PEAK_SEPARATION,
    LEAST_VALLEY_DEPTH,
    scan_turning_points,
)

__all__ = [
    "COUNTED_ABOVE",
    "COUNTED_AFTER",
    "DISTINCT_CRITERION",
    "LEAST_PEAK_SEPARATION",
    "LEAST_VALLEY_DEPTH",
    "PEAK_CRITERION",
    "PEAK_RULE",
    "counted_peaks",
    "distinct_peaks",
    "peaks_in_traces",
]

PEAK_RULE = f"after {COUNTED_AFTER:g} s, higher than {1e3 * COUNTED_ABOVE:g} mm, {LEAST_PEAK_SEPARATION:g} s apart"
"""Rule for maxima that count."""

PEAK_CRITERION = f"peak count of the thesis: maxima {PEAK_RULE}, the tallest kept first"

DISTINCT_CRITERION = (
    f"{PEAK_CRITERION}; of maxima with valleys of {1e6 * LEAST_VALLEY_DEPTH:g} um or more on both sides"
)


def counted_peaks(times: np.ndarray, values: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Mark the counted peaks among turning points or samples, shape (runs, room).

    The sum over a row is the peak count of its run. `times` [s] and `values` [m] of position minus reference have the
    shape (runs, room). The number of valid entries in each row is in `counts`, shape (runs,).
    """
    nothing = np.zeros(len(counts))
    return scan_turning_points(times, values, counts, nothing, nothing).peaks


def distinct_peaks(times: np.ndarray, values: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Mark the distinct peaks, shape (runs, room).

    They are counted peaks with valleys at least `LEAST_VALLEY_DEPTH` deep on both sides. `times` [s] and `values` [m]
    of position minus reference have the shape (runs, room). The number of valid entries in each row is in `counts`,
    shape (runs,).
    """
    nothing = np.zeros(len(counts))
    return scan_turning_points(times, values, counts, nothing, nothing).distinct


def peaks_in_traces(time: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """Count the distinct peaks of sampled runs, shape (runs,).

    The deviations [m] have the shape (runs, n), the times [s] (n,). From a peak the deviation falls on both sides, so
    the highest sample of a trace that ends on its way up does not count.
    """
    # the samples long before the first peak that counts are idle
    counting = time >= min(0.8 * COUNTED_AFTER, time[-1] / 2)
    values = np.ascontiguousarray(deviation[:, counting])
    counts = _until_last_fall(values)
    return distinct_peaks(np.tile(time[counting], (len(values), 1)), values, counts).sum(axis=1)


def _until_last_fall(values: np.ndarray) -> np.ndarray:
    """Count each row's samples up to the end of its last fall by `LEAST_VALLEY_DEPTH`, (runs,), or 0."""
    ahead = np.minimum.accumulate(values[:, ::-1], axis=1)[:, ::-1]
    falls = values - ahead >= LEAST_VALLEY_DEPTH
    last = values.shape[1] - 1 - falls[:, ::-1].argmax(axis=1)
    following = np.where(np.arange(values.shape[1]) >= last[:, None], values, np.inf)
    return np.where(falls.any(axis=1), following.argmin(axis=1) + 1, 0)
