"""The thesis's peak count: a number of a run, and no verdict.

The rule (Fix, Univ. of Twente, Sec. 3.2.2): maxima of the stage position after 10 s, higher than 0.1 mm above the
reference, 0.5 s apart, the tallest kept first, as MATLAB's findpeaks does it. It counts a transient that is long enough
as well as a cycle, and nothing of a cycle below 0.1 mm. `friso.sweep` and `friso.check` call it `peaks`; turning points
less than 0.25 um from each other are passed over there.

A maximum need not be much of one. A stage that breaks away halfway back springs forward by half a micrometre first, and
the rule counts that as it counts the swing itself; with the noise of an encoder on it, a stage that stands 0.2 mm off
its reference has two peaks a second. Distinct peaks are counted by the same rule, but of maxima alone from which the
deviation falls by 1 um on both sides before it rises higher: our addition, for logs of a drive (`friso rig`, `friso
compare`) and for the maps of the thesis (`friso reproduce`), whose trends are those of swings.
"""

from __future__ import annotations

import numpy as np

from friso.hunting.turning import APART, COUNTED_ABOVE, COUNTED_AFTER, DISTINCT
from friso.hunting.turns import scan

__all__ = [
    "APART",
    "COUNTED_ABOVE",
    "COUNTED_AFTER",
    "CRITERION",
    "DISTINCT",
    "DISTINCT_CRITERION",
    "counted_peaks",
    "distinct_peaks",
]

CRITERION = "peak count of the thesis: maxima after 10 s, higher than 0.1 mm, 0.5 s apart, the tallest kept first"

DISTINCT_CRITERION = f"{CRITERION}; of maxima with valleys of 1 um or more on both sides"


def counted_peaks(times: np.ndarray, values: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Which turning points (or samples) of runs are counted peaks, shape (runs, room); sums over rows are the counts.

    `times` [s] and `values` [m] of position minus reference have the shape (runs, room) and are valid up to `counts`,
    shape (runs,).
    """
    nothing = np.zeros(len(counts))
    return scan(times, values, counts, nothing, nothing).peaks


def distinct_peaks(times: np.ndarray, values: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """The same of distinct peaks alone, whose valleys on both sides are at least `DISTINCT` deep."""
    nothing = np.zeros(len(counts))
    return scan(times, values, counts, nothing, nothing).distinct
