"""Peaks and periods of runs from their turning points, as plain loops over runs.

A few runs are scanned by this module as it stands. For many, `friso.hunting.peaks` has it compiled, all of this file
with every function in machine code, so it uses numbers and arrays only.
"""

import numpy as np

COUNTED_AFTER = 10.0
"""Time after which peaks count [s] (thesis, Sec. 3.2.2)."""

COUNTED_ABOVE = 1e-4
"""Height above the reference from which peaks count [m] (thesis, Sec. 3.2.2)."""

APART = 0.5
"""Time by which peaks are apart [s] (thesis, Sec. 3.2.2)."""

SWING = 1e-6
"""Swing below which a turning point is none [m]: a stage stuck off its reference turns by rounding alone."""

WINDOW = 0.75
"""Share of the run after which amplitude and period are taken."""


def zigzag(values, count, least, kinds):
    """Tell the extrema of a zigzag through the turning points `values` whose legs are at least `least`: 1 for its
    maxima, -1 for its minima, 0 for the others. A first and last turning point that end such a leg are among them."""
    kinds[:count] = 0
    way, high, low = 0, 0, 0
    for k in range(1, count):
        if values[k] > values[high]:
            high = k
        if values[k] < values[low]:
            low = k
        if way >= 0 and values[high] - values[k] >= least:
            kinds[high] = 1
            way, low = -1, k
        elif way <= 0 and values[k] - values[low] >= least:
            kinds[low] = -1
            way, high = 1, k
    if way > 0:
        kinds[high] = 1
    elif way < 0:
        kinds[low] = -1


def keep_tallest(times, values, count, kinds, peaks):
    """Mark the counted peaks: of maxima late and tall enough but less than `APART` from each other the tallest stays
    (as MATLAB's findpeaks does with MinPeakDistance)."""
    for k in range(count):
        if times[k] < COUNTED_AFTER or values[k] <= COUNTED_ABOVE:
            kinds[k] = 0
    while True:
        tallest = -1
        for k in range(count):
            if kinds[k] == 1 and (tallest < 0 or values[k] > values[tallest]):
                tallest = k
        if tallest < 0:
            return
        peaks[tallest] = True
        for k in range(count):
            if abs(times[k] - times[tallest]) < APART:
                kinds[k] = 0


def mean_period(times, count, kinds, ended):
    """Mean time between the cycle's maxima, or else minima, in the last quarter [s], NaN without a cycle; of a cycle
    longer than that, the last two of the last half."""
    last = -1  # its swing is not over yet
    for k in range(count):
        if kinds[k] != 0:
            last = k
    for share in (WINDOW, 0.5):
        for kind in (1, -1):
            found, first, before, latest = 0, 0.0, 0.0, 0.0
            for k in range(count):
                if kinds[k] == kind and k != last and times[k] >= share * ended:
                    if found == 0:
                        first = times[k]
                    before, latest = latest, times[k]
                    found += 1
            if found > 1:
                return (latest - first) / (found - 1) if share == WINDOW else latest - before
    return np.nan


def run(times, values, counts, amplitude, ended, peaks, period):
    """Fill `peaks`, shape (runs, room), and `period`, shape (runs,); see `friso.hunting.peaks.scan`."""
    kinds = np.zeros(times.shape[1], np.int64)
    for j in range(counts.size):
        count = counts[j]
        period[j] = np.nan
        tall = False
        for k in range(count):
            if times[j, k] >= COUNTED_AFTER and values[j, k] > COUNTED_ABOVE:
                tall = True
        if tall:
            zigzag(values[j], count, SWING, kinds)
            keep_tallest(times[j], values[j], count, kinds, peaks[j])
        if amplitude[j] > SWING:
            zigzag(values[j], count, amplitude[j] / 2, kinds)
            period[j] = mean_period(times[j], count, kinds, ended[j])
