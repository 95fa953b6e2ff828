"""The thesis's hunting metric (Sec. 3.2.2): maxima of the stage position late in the run, tall and well apart."""

from __future__ import annotations

import numpy as np

COUNTED_AFTER = 10.0
"""Time after which peaks count [s] (thesis, Sec. 3.2.2)."""

COUNTED_ABOVE = 1e-4
"""Height above the reference from which peaks count [m] (thesis, Sec. 3.2.2)."""

APART = 0.5
"""Time by which peaks are apart [s] (thesis, Sec. 3.2.2)."""


def counted_peaks(times: np.ndarray, values: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Which turning points are peaks: maxima later and higher than the limits, the tallest kept first.

    `times` [s] and `values` [m], of position minus reference, have shape (runs, room) and are valid up to `counts`
    (runs,). The result has their shape; its row sums are the peak counts. Of peaks less than `APART` from each
    other the tallest stays (as MATLAB's findpeaks does with MinPeakDistance).
    """
    there = np.arange(times.shape[1]) < counts[:, None]
    known = np.where(there, values, -np.inf)
    before = np.pad(known, ((0, 0), (1, 0)), constant_values=-np.inf)[:, :-1]
    after = np.pad(known, ((0, 0), (0, 1)), constant_values=-np.inf)[:, 1:]
    left = there & (known > before) & (known > after) & (times >= COUNTED_AFTER) & (known > COUNTED_ABOVE)
    peaks = np.zeros_like(left)
    active = np.flatnonzero(left.any(axis=1))
    while active.size:
        tallest = np.argmax(np.where(left[active], known[active], -np.inf), axis=1)
        peaks[active, tallest] = True
        left[active] &= np.abs(times[active] - times[active, tallest][:, None]) >= APART
        active = active[left[active].any(axis=1)]
    return peaks
