"""Measures of many runs at once, from their turning points and statistics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.engine.arrays import Status
from friso.engine.batch import Options, Runs
from friso.equations.motion import last_corner
from friso.hunting.peaks import COUNTED_ABOVE, COUNTED_AFTER, SWING, WINDOW, scan

__all__ = ["BANDS", "COUNTED_ABOVE", "COUNTED_AFTER", "WINDOW", "Measures", "measure", "options"]

BANDS = (1e-6, 1e-5)
"""Bands about the reference into which a stage settles [m]."""


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
        """By the peak count "hunts", else "settles", or "transient" if the deviation still swings at the end (a run
        too short for the count, or a reference that moves); "failed" where the run was not completed."""
        swinging = np.isnan(self.settling_time[1]) & (self.peak_to_peak > COUNTED_ABOVE)
        words = np.where(self.peaks > 0, "hunts", np.where(swinging, "transient", "settles"))
        return np.where(self.status == Status.DONE, words, "failed")


def options(rtol: float, threads: int | None = None, cancel: np.ndarray | None = None) -> Options:
    """How to run for these measures; turning points are kept from a little before the first that may count."""
    return Options(
        rtol=rtol,
        bands=BANDS,
        window=WINDOW,
        record_from=0.8 * COUNTED_AFTER,
        least_swing=SWING / 4,  # peaks and periods look at larger ones only
        threads=threads,
        cancel=cancel,
    )


def measure(flat: Mapping[str, Any], runs: Runs) -> Measures:
    """The measures of a chunk of runs of the stages `flat`, arrays of which have one entry per run of the chunk."""
    results = runs.results
    count = len(results.statuses)
    room = max(1, int(results.turn_counts.max(initial=0)))
    times, values = results.turn_times[:, :room], results.turn_values[:, :room]
    ended = runs.statistic("ended")
    corner = np.broadcast_to(last_corner(flat), (count,))
    amplitude = runs.statistic("deviation_max") - runs.statistic("deviation_min")
    turns, period = scan(times, values, results.turn_counts, amplitude, ended)
    exits = (runs.statistic("inner_exit"), runs.statistic("outer_exit"))
    passing = np.nan_to_num(period) / 2  # a cycle that crosses the reference as the run ends has not settled
    inner, outer = (np.where(e + passing < ended, np.maximum(e - corner, 0.0), np.nan) for e in exits)
    done = results.statuses == Status.DONE

    def finished(array: np.ndarray) -> np.ndarray:
        return np.where(done, array, np.nan)

    return Measures(
        peaks=np.where(done, turns.sum(axis=1), 0),
        peak_to_peak=finished(amplitude),
        period=finished(period),
        settling_time=(finished(inner), finished(outer)),
        largest_force=finished(runs.statistic("force_peak")),
        status=results.statuses,
        steps=runs.statistic("attempted").astype(np.int64),
        rejected=runs.statistic("rejected").astype(np.int64),
        turns=turns,
    )
