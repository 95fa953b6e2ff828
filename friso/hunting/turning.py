"""Find turning points of runs: peaks, period, and how far the position swings over the last half.

The scan is plain loops over runs. A few runs are scanned as Python. For many, the loops are compiled
(`friso.hunting.build`, `friso.engine.scalar_code`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from friso.engine.building import built_entries
from friso.engine.cache import CodeRequest, code_digest
from friso.engine.machine_code import ArrayKind, Loops, load_object
from friso.equations import motion
from friso.hunting.settings import check_settings

_FLAT, _SQUARE = ArrayKind("float64", 1), ArrayKind("float64", 2)
_COUNTS, _MARKS = ArrayKind("int64", 1), ArrayKind("bool", 2)
KINDS = (_SQUARE, _SQUARE, _COUNTS, _FLAT, _FLAT, _FLAT, _COUNTS, _MARKS, _MARKS, _FLAT, _FLAT, _FLAT)
"""Kinds of the arguments of `friso.hunting.turning.run`, in their order."""


@dataclass(frozen=True)
class Turns:
    """Results from the turning points of runs.

    `peaks` and `distinct` mark counted and distinct peaks, shape (runs, room) (see
    `friso.hunting.criteria.peak_count`). All others have the shape (runs,): the `period` of the swing [s] (NaN: none),
    the time of the last turn, `turned` [s] (-inf: never), and the peak-to-peak deviation of the last half of the run,
    `earlier` [m] (see `friso.hunting.criteria.run_outcome`).
    """

    peaks: np.ndarray
    distinct: np.ndarray
    period: np.ndarray
    turned: np.ndarray
    earlier: np.ndarray


def scan_turning_points(
    times: np.ndarray,
    values: np.ndarray,
    counts: np.ndarray,
    swing: np.ndarray,
    ended: np.ndarray,
    corner: np.ndarray | float = 0.0,
) -> Turns:
    """Scan the turning points of runs for peaks, period and last turn.

    `times` [s] and `values` [m] of position minus reference have the shape (runs, room), valid up to `counts`, shape
    (runs,). `swing` [m], shape (runs,), is the peak-to-peak deviation of the last quarter. Legs of at least half of it
    make the period, so that ringing on top does not count. `ended` [s], shape (runs,), is the end of each run, and
    `corner` [s] the last time at which its reference moved.
    """
    runs = len(counts)
    since = motion.last_part(LAST_HALF, ended, corner)
    arrays = tuple(map(np.ascontiguousarray, (times, values, counts, swing, ended, since)))
    kinds = np.zeros(times.shape[1], np.int64)
    peaks, distinct = (np.zeros(times.shape, np.bool_) for _ in range(2))
    period, turned, earlier = (np.empty(runs) for _ in range(3))
    scan_runs: Callable[..., None] = run if counts.sum() < check_settings.compiled_from_points else _compiled()
    scan_runs(*arrays, kinds, peaks, distinct, period, turned, earlier)
    return Turns(peaks, distinct, period, turned, earlier)


@cache
def _compiled() -> Loops:
    """Return the loops over turning points as machine code, built once on a machine."""
    version = code_digest("hunting/turning.py", "hunting/build.py")
    (entry,) = built_entries(
        [CodeRequest(f"turning points {version}", "loops over turning points", "friso.hunting.build")]
    )
    return Loops(load_object(entry.code, ["run"])["run"], KINDS)


COUNTED_AFTER = 10.0
"""Time after which peaks count [s] (thesis, Sec. 3.2.2)."""

COUNTED_ABOVE = 1e-4
"""Height above the reference from which peaks count [m] (thesis, Sec. 3.2.2)."""

LEAST_PEAK_SEPARATION = 0.5
"""Shortest time between counted peaks [s] (thesis, Sec. 3.2.2)."""

LEAST_VALLEY_DEPTH = 1e-6
"""Least depth [m] of the valleys on both sides of a distinct peak, friso's choice. Shallower ripple is noise of the
solver or of an encoder."""

LAST_QUARTER, LAST_HALF = 0.75, 0.5
"""Fractions of the run after which its last quarter and its last half begin."""


def clear(kinds, count):
    """Set the marks `kinds` of the first `count` turning points to 0."""
    for k in range(count):
        kinds[k] = 0


def maxima(values, count, kinds):
    """Mark the local maxima among the first `count` values with 1 in `kinds`, all others with 0.

    The first point of a level stretch stands for all of it. The ends count as maxima if they are higher than their
    neighbours; turning points usually are.
    """
    clear(kinds, count)
    k = 0
    while k < count:
        last = k
        while last + 1 < count and values[last + 1] == values[k]:
            last += 1
        rises = k == 0 or values[k - 1] < values[k]
        falls = last == count - 1 or values[last + 1] < values[k]
        single = k == 0 and last == count - 1
        if rises and falls and not single:
            kinds[k] = 1
        k = last + 1


def zigzag(values, count, least, kinds):
    """Mark in `kinds` the extrema of a zigzag through `values` with legs of at least `least`.

    Maxima get 1, minima -1, all others 0. A first and a last turning point that end such a leg are included.
    """
    clear(kinds, count)
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
    """Mark counted peaks: late and tall maxima, of which the tallest within `LEAST_PEAK_SEPARATION` counts.

    Maxima are marked in `kinds`, which is overwritten. MATLAB's findpeaks does so with MinPeakDistance.
    """
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
            if abs(times[k] - times[tallest]) < LEAST_PEAK_SEPARATION:
                kinds[k] = 0


def mean_period(times, count, kinds, ended):
    """Return the mean time [s] between maxima in the last quarter, or else between minima.

    Extrema are marked in `kinds` (1, -1), and the run ended at `ended` [s]. Maxima and minima alternate; the last
    extremum is left out, because that swing is not over yet. A slower swing gives the time between the last two extrema
    of a kind in the last half. The result is NaN if there are no two of a kind.
    """
    last = -1  # the last swing is not over yet
    for k in range(count):
        if kinds[k] != 0:
            last = k
    for share in (LAST_QUARTER, LAST_HALF):
        for kind in (1, -1):
            number, first, before, latest = 0, 0.0, 0.0, 0.0
            for k in range(count):
                if kinds[k] == kind and k != last and times[k] >= share * ended:
                    if number == 0:
                        first = times[k]
                    before, latest = latest, times[k]
                    number += 1
            if number > 1:
                return (latest - first) / (number - 1) if share == LAST_QUARTER else latest - before
    return np.nan


def span(times, values, count, since):
    """Return the peak-to-peak range [m] of the turning points after the time `since` [s]."""
    low, high = np.inf, -np.inf
    for k in range(count):
        if times[k] >= since:
            low, high = min(low, values[k]), max(high, values[k])
    return max(high - low, 0.0)


def last_turn(times, count, kinds):
    """Return the time of the last extremum marked in `kinds` [s], -inf without one."""
    last = -np.inf
    for k in range(count):
        if kinds[k] != 0:
            last = times[k]
    return last


def run(times, values, counts, swing, ended, since, kinds, peaks, distinct, period, turned, earlier):
    """Scan turning points of runs for peaks, period, last turn and earlier swing.

    The results fill `peaks` and `distinct`, (runs, room), and `period`, `turned` and `earlier`, (runs,). Results and
    arguments are as in `friso.hunting.turning.scan_turning_points`; `since` [s] is where the last half begins. `kinds`,
    shape (room,), is room for marks.
    """
    for j in range(counts.size):
        count = counts[j]
        period[j], turned[j] = np.nan, -np.inf
        earlier[j] = max(swing[j], span(times[j], values[j], count, since[j]))
        tall = False
        for k in range(count):
            if times[j, k] >= COUNTED_AFTER and values[j, k] > COUNTED_ABOVE:
                tall = True
        if tall:
            maxima(values[j], count, kinds)
            keep_tallest(times[j], values[j], count, kinds, peaks[j])
            zigzag(values[j], count, LEAST_VALLEY_DEPTH, kinds)
            keep_tallest(times[j], values[j], count, kinds, distinct[j])
        if swing[j] > LEAST_VALLEY_DEPTH:
            zigzag(values[j], count, swing[j] / 2, kinds)
            period[j] = mean_period(times[j], count, kinds, ended[j])
            turned[j] = last_turn(times[j], count, kinds)
