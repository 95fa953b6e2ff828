"""The thesis's hunting metric (Sec. 3.2.2): maxima of the stage position late in the run, tall and well apart."""

from __future__ import annotations

import numpy as np

COUNTED_AFTER = 10.0
"""Time after which peaks count [s] (thesis, Sec. 3.2.2)."""

COUNTED_ABOVE = 1e-4
"""Height above the reference from which peaks count [m] (thesis, Sec. 3.2.2)."""

APART = 0.5
"""Time by which peaks are apart [s] (thesis, Sec. 3.2.2)."""

SWING = 1e-6
"""Swing below which a turning point is none [m]: a stage stuck off its reference turns by rounding alone."""


def swings(values: np.ndarray, least: float) -> tuple[list[int], list[int]]:
    """Indices of the maxima and of the minima of a zigzag through turning points `values` whose legs are at least
    `least`; a first and last turning point that end such a leg are among them."""
    extrema: tuple[list[int], list[int]] = ([], [])
    way, high, low = 0, 0, 0
    for k in range(1, len(values)):
        if values[k] > values[high]:
            high = k
        if values[k] < values[low]:
            low = k
        if way >= 0 and values[high] - values[k] >= least:
            extrema[0].append(high)
            way, low = -1, k
        elif way <= 0 and values[k] - values[low] >= least:
            extrema[1].append(low)
            way, high = 1, k
    if way > 0:
        extrema[0].append(high)
    elif way < 0:
        extrema[1].append(low)
    return extrema


def counted_peaks(times: np.ndarray, values: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Which turning points are peaks: maxima later and higher than the limits, the tallest kept first.

    `times` [s] and `values` [m], of position minus reference, have shape (runs, room) and are valid up to `counts`
    (runs,). The result has their shape; its row sums are the peak counts. Of peaks less than `APART` from each
    other the tallest stays (as MATLAB's findpeaks does with MinPeakDistance).
    """
    there = np.arange(times.shape[1]) < counts[:, None]
    tall = there & (times >= COUNTED_AFTER) & (values > COUNTED_ABOVE)
    peaks = np.zeros_like(tall)
    for j in np.flatnonzero(tall.any(axis=1)):
        maxima, _ = swings(values[j, : counts[j]], SWING)
        left = np.array([k for k in maxima if tall[j, k]], dtype=int)
        while left.size:
            tallest = left[np.argmax(values[j, left])]
            peaks[j, tallest] = True
            left = left[np.abs(times[j, left] - times[j, tallest]) >= APART]
    return peaks
