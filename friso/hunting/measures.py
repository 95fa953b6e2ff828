"""Measures of many runs at once, from their turning points and statistics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.engine.arrays import Status
from friso.engine.batch import Options, Runs
from friso.equations.motion import last_corner
from friso.hunting.peaks import COUNTED_ABOVE, COUNTED_AFTER, counted_peaks

__all__ = ["BANDS", "COUNTED_ABOVE", "COUNTED_AFTER", "WINDOW", "Measures", "measure", "options", "periods"]

BANDS = (1e-6, 1e-5)
"""Bands about the reference into which a stage settles [m]."""

WINDOW = 0.75
"""Share of the run after which amplitude and period are taken."""


@dataclass(frozen=True)
class Measures:
    """Measures of runs, each of shape (runs,): peak count, peak-to-peak amplitude [m] and period [s] over the last
    quarter (NaN: no cycle), time [s] from the last corner of the reference until the deviation stays within each of
    `BANDS` (NaN: not within the run), largest actuator force [N]; status, and steps attempted and rejected. `turns`
    tells which turning points are counted peaks, shape (runs, room)."""

    peaks: np.ndarray
    peak_to_peak: np.ndarray
    period: np.ndarray
    settling_time: tuple[np.ndarray, np.ndarray]
    largest_force: np.ndarray
    status: np.ndarray
    steps: np.ndarray
    rejected: np.ndarray
    turns: np.ndarray

    @property
    def verdict(self) -> np.ndarray:
        """ "hunts" or "settles" by the peak count, "failed" where the run was not completed."""
        words = np.where(self.peaks > 0, "hunts", "settles")
        return np.where(self.status == Status.DONE, words, "failed")


def options(flat: Mapping[str, Any], rtol: float, threads: int | None = None) -> Options:
    """How to run for these measures, keeping no turning points that none of them needs."""
    half = float(np.min(flat["motion.duration"])) / 2
    return Options(rtol=rtol, bands=BANDS, window=WINDOW, record_from=min(COUNTED_AFTER, half), threads=threads)


def measure(flat: Mapping[str, Any], runs: Runs) -> Measures:
    """The measures of a chunk of runs of the stages `flat`, arrays of which have one entry per run of the chunk."""
    results = runs.results
    count = len(results.statuses)
    room = max(1, int(results.turn_counts.max(initial=0)))
    times, values = results.turn_times[:, :room], results.turn_values[:, :room]
    ended = runs.statistic("ended")
    corner = np.broadcast_to(last_corner(flat), (count,))
    amplitude = runs.statistic("deviation_max") - runs.statistic("deviation_min")
    turns = counted_peaks(times, values, results.turn_counts)
    exits = (runs.statistic("inner_exit"), runs.statistic("outer_exit"))
    inner, outer = (np.where(e < ended, np.maximum(e - corner, 0.0), np.nan) for e in exits)
    done = results.statuses == Status.DONE

    def finished(array: np.ndarray) -> np.ndarray:
        return np.where(done, array, np.nan)

    return Measures(
        peaks=turns.sum(axis=1),
        peak_to_peak=finished(amplitude),
        period=finished(periods(times, values, results.turn_counts, amplitude, ended)),
        settling_time=(finished(inner), finished(outer)),
        largest_force=runs.statistic("force_peak"),
        status=results.statuses,
        steps=runs.statistic("attempted").astype(np.int64),
        rejected=runs.statistic("rejected").astype(np.int64),
        turns=turns,
    )


def periods(
    times: np.ndarray, values: np.ndarray, counts: np.ndarray, amplitude: np.ndarray, ended: np.ndarray
) -> np.ndarray:
    """Mean time between the cycle's maxima (or minima) in the last quarter [s], NaN where there is no cycle.

    An extremum belongs to the cycle if the deviation swings by half the peak-to-peak `amplitude` [m] before the next
    one of the other kind, so that ringing on top of a cycle does not count. A cycle longer than the last quarter is
    looked for in the last half. `ended` [s] is the end of each run.
    """
    found = np.full(len(counts), np.nan)
    for j in np.flatnonzero(amplitude > BANDS[0]):
        time, value = times[j, : counts[j]], values[j, : counts[j]]
        for share in (WINDOW, 0.5):
            late = time >= share * ended[j]
            found[j] = _mean_spacing(time[late], value[late], amplitude[j] / 2)
            if np.isfinite(found[j]):
                break
    return found


def _mean_spacing(times: np.ndarray, values: np.ndarray, swing: float) -> float:
    """Mean spacing of the maxima, or else the minima, of a zigzag whose legs are at least `swing` [m]."""
    extrema: dict[int, list[float]] = {1: [], -1: []}
    way, best = 0, 0
    for k in range(1, len(values)):
        leg = values[k] - values[best]
        if way != 0 and leg * way > 0:
            best = k
        elif abs(leg) >= swing:
            if way != 0:
                extrema[way].append(times[best])
            way, best = int(np.sign(leg)), k
    spaced = next((each for each in extrema.values() if len(each) > 1), None)
    return float(np.diff(spaced).mean()) if spaced else float("nan")
