"""Measure many runs at once, from their turning points and statistics.

Packages outside `friso.hunting` may import from this module.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.engine.arrays import Status
from friso.engine.batch import RunOptions, Runs, run_chunks
from friso.engine.kernel import kernel
from friso.equations.motion import Stand, ends_evenly, last_corner, last_part, stands
from friso.equations.structure import structure
from friso.hunting.criteria.run_outcome import (
    REST_BAND,
    End,
    end_of_traces,
    last_outside,
    outcomes,
    settling_in_the_end,
    settling_of_runs,
    settling_of_traces,
    swings_on,
)
from friso.hunting.turning import (
    COUNTED_AFTER,
    LAST_HALF,
    LAST_QUARTER,
    LEAST_VALLEY_DEPTH,
    Turns,
    scan_turning_points,
    zigzag,
)
from friso.stage import Stage
from friso.stage.controllers import dead_band

__all__ = [
    "BANDS",
    "LAST_HALF",
    "LAST_QUARTER",
    "RESOLVED",
    "Measures",
    "SampledSolver",
    "Turns",
    "bands_of",
    "measure_runs",
    "measure_traces",
    "measured_run",
    "measuring_options",
    "run_ends",
    "scan_turning_points",
    "swing_of",
    "turns_of",
    "zigzag",
]

BANDS = (1e-6, REST_BAND)
"""Bands about the reference into which a stage settles [m], unless stage or machine ask for wider ones."""


def bands_of(flat: Mapping[str, Any]) -> tuple[float, float]:
    """Return the two bands [m] into which stages settle, the wider one last.

    They are `BANDS`, with the stage's own tolerance as the first; but neither is finer than that, than a step of the
    encoder, or than an error at which the controller exerts no force. `flat` has the stages' keys in SI; of arrays the
    largest value counts.
    """
    fine, step = flat.get("tolerance.within", BANDS[0]), flat.get("drive.encoder_resolution", 0.0)
    fine = max(float(np.max(size)) for size in (fine, step, dead_band(flat)))
    return fine, max(BANDS[1], fine)


RESOLVED = LEAST_VALLEY_DEPTH / 4
"""Size [m] below which swings are skipped when turning points are stored; peaks, periods and outcomes need larger
ones."""


@dataclass(frozen=True)
class Measures:
    """Numbers and words that describe runs, each of shape (runs,).

    - `peaks`: the thesis's peak count; `distinct_peaks`: count of distinct peaks (see
      `friso.hunting.criteria.peak_count`).
    - `peak_to_peak` [m], `offset` [m] of the middle between the extremes, and `period` [s] of the last quarter (NaN: no
      swing, or one that dies out).
    - `settling_time` [s]: until the deviation stays within each of `bands`, wherever the reference stands;
      `in_the_end`: at the last of these places (NaN: not within the run; see `friso.hunting.criteria.run_outcome`).
    - `outcome`: words of `friso.hunting.criteria.run_outcome`.
    - `largest_force` [N]: of the actuator.
    - `status`, `steps` attempted and `rejected`: of the solver.
    - `turns`: which turning points are counted peaks, shape (runs, room).
    - `bands` [m]: about the reference, into which the runs settle; within the wider one they rest.

    A run that was not completed has no peaks, and NaN for the other numbers on its motion.
    """

    peaks: np.ndarray
    distinct_peaks: np.ndarray
    peak_to_peak: np.ndarray
    offset: np.ndarray
    period: np.ndarray
    settling_time: tuple[np.ndarray, np.ndarray]
    in_the_end: tuple[np.ndarray, np.ndarray]
    outcome: np.ndarray
    largest_force: np.ndarray
    status: np.ndarray
    steps: np.ndarray
    rejected: np.ndarray
    turns: np.ndarray
    bands: tuple[float, float] = BANDS


def measuring_options(
    rtol: float,
    threads: int | None = None,
    cancel: np.ndarray | None = None,
    bands: tuple[float, float] = BANDS,
) -> RunOptions:
    """Return the options for runs that are to be measured, with the relative tolerance `rtol`.

    `threads` bounds the threads of runs, and setting `cancel` stops them. Turning points are kept from a little before
    the first that may count. The runs settle into `bands` [m].
    """
    return RunOptions(
        rtol=rtol,
        bands=bands,
        window=LAST_QUARTER,
        record_from=0.8 * COUNTED_AFTER,
        least_swing=RESOLVED,
        threads=threads,
        cancel=cancel,
    )


def corner_of(flat: Mapping[str, Any]) -> np.ndarray | float:
    """Return the time [s] of the references' last corner, from which they stand or move evenly.

    The result is 0 if a reference neither stands nor moves at constant velocity in the end. `flat` has the stages' keys
    in SI.
    """
    return np.asarray(last_corner(flat)) if ends_evenly(flat) else 0.0


def turns_of(runs: Runs, corner: np.ndarray | float = 0.0) -> Turns:
    """Scan the turning points of runs whose references stand from the time `corner` [s] on."""
    results = runs.results
    room = max(1, int(results.turn_counts.max(initial=0)))
    times, values = results.turn_times[:, :room], results.turn_values[:, :room]
    return scan_turning_points(times, values, results.turn_counts, swing_of(runs), runs.statistic("ended"), corner)


def swing_of(runs: Runs) -> np.ndarray:
    """Return the peak-to-peak deviation [m] over the final window of runs, (runs,).

    `RunOptions` defines the window.
    """
    return runs.statistic("deviation_max") - runs.statistic("deviation_min")


def run_ends(runs: Runs, turns: Turns, outside: str) -> End:
    """Describe how a chunk of runs ends; `outside` names their band, "inner" or "outer".

    `turns` are the results of scanning their turning points.
    """
    return End(
        completed=np.equal(runs.results.statuses, Status.DONE),
        swing=swing_of(runs),
        earlier=turns.earlier,
        period=turns.period,
        turned=turns.turned,
        outside=runs.statistic(f"{outside}_exit"),
        ended=runs.statistic("ended"),
    )


def measure_runs(flat: Mapping[str, Any], runs: Runs, bands: tuple[float, float] = BANDS) -> Measures:
    """Measure a chunk of runs.

    `flat` has the keys of their stages in SI, with arrays of one entry per run. `bands` [m] are those of the runs'
    options.
    """
    results = runs.results
    ended, turns = runs.statistic("ended"), turns_of(runs, corner_of(flat))
    passing = np.nan_to_num(turns.period) / 2  # a cycle that crosses the reference as the run ends has not settled
    in_the_end, settling = [], []
    for band in ("inner", "outer"):
        stays = runs.statistic(f"{band}_exit") + passing < ended
        for column, times in ((in_the_end, settling_in_the_end), (settling, settling_of_runs)):
            after = times(flat, runs, band)
            column.append(np.where(stays & np.isfinite(after), after, np.nan))
    done, end = results.statuses == Status.DONE, run_ends(runs, turns, "outer")

    def finished(array: np.ndarray) -> np.ndarray:
        """Replace the entries of an array, (runs,), by NaN where the run was not completed."""
        return np.where(done, array, np.nan)

    return Measures(
        peaks=np.where(done, turns.peaks.sum(axis=1), 0),
        distinct_peaks=np.where(done, turns.distinct.sum(axis=1), 0),
        peak_to_peak=finished(swing_of(runs)),
        offset=finished((runs.statistic("deviation_max") + runs.statistic("deviation_min")) / 2),
        period=finished(np.where(swings_on(end, 0.0), turns.period, np.nan)),
        settling_time=(finished(settling[0]), finished(settling[1])),
        in_the_end=(finished(in_the_end[0]), finished(in_the_end[1])),
        outcome=outcomes(end, bands[1], passing),
        largest_force=finished(runs.statistic("force_peak")),
        status=results.statuses,
        steps=runs.statistic("attempted").astype(np.int64),
        rejected=runs.statistic("rejected").astype(np.int64),
        turns=turns.peaks,
        bands=bands,
    )


@np.errstate(all="ignore")  # runs that fail leave infinities and NaN behind
def measure_traces(
    flat: Mapping[str, Any],
    time: np.ndarray,
    deviation: np.ndarray,
    force: np.ndarray,
    solver: SampledSolver,
    bands: tuple[float, float] = BANDS,
) -> Measures:
    """Measure sampled runs, such as those of a drive as built.

    `flat` has the stages' keys in SI. Deviations [m] and forces [N] have the shape (runs, n), the times [s] (n,).
    `solver` says which runs were completed, and `bands` [m] are those into which they settle.
    """
    done, places = solver.status == Status.DONE, [*stands(flat)]
    end = end_of_traces(time, deviation, bands[1], done, corner_of(flat))
    last = time >= last_part(LAST_QUARTER, end.ended, corner_of(flat))[:, None]
    late = np.where(last, deviation, deviation[:, -1:])
    samples, swings = np.full(len(deviation), len(time)), np.nan_to_num(end.swing)
    values = np.ascontiguousarray(deviation)
    turns = scan_turning_points(np.tile(time, (len(deviation), 1)), values, samples, swings, end.ended)
    passing = np.nan_to_num(turns.period) / 2
    stays = [last_outside(time, deviation, band) + passing < time[-1] for band in bands]

    def settled(where: list[Stand], number: int) -> np.ndarray:
        """Return the longest settling time [s] at some places of the reference, (runs,).

        `number` chooses the band. The time is NaN where a run does not settle.
        """
        times = np.zeros(len(deviation))
        for run, row in enumerate(deviation[:, None]):
            own = [Stand(*(np.ravel(part)[min(run, np.size(part) - 1)] for part in place)) for place in where]
            times[run] = settling_of_traces(own, time, row, bands[number])[0]
        return np.where(done & stays[number] & np.isfinite(times), times, np.nan)

    return Measures(
        peaks=np.where(done, turns.peaks.sum(axis=1), 0),
        distinct_peaks=np.where(done, turns.distinct.sum(axis=1), 0),
        peak_to_peak=np.where(done, end.swing, np.nan),
        offset=np.where(done, (late.max(axis=1) + late.min(axis=1)) / 2, np.nan),
        period=np.where(done & swings_on(end, 0.0), turns.period, np.nan),
        settling_time=(settled(places, 0), settled(places, 1)),
        in_the_end=(settled(places[-1:], 0), settled(places[-1:], 1)),
        outcome=outcomes(end, bands[1], passing),
        largest_force=np.where(done, np.abs(force).max(axis=1), np.nan),
        status=solver.status,
        steps=solver.steps,
        rejected=solver.rejected,
        turns=turns.peaks,
        bands=bands,
    )


@dataclass(frozen=True)
class SampledSolver:
    """The solver's report on sampled runs: status, steps attempted and rejected, (runs,)."""

    status: np.ndarray
    steps: np.ndarray
    rejected: np.ndarray


def measured_run(stage: Stage, rtol: float = 1e-6) -> Measures:
    """Run a stage's motion and measure it, arrays of shape (1,).

    The turning points of the solver's run count, not those of a sampled response. Raises ValueError for a tolerance
    that is not usable.
    """
    flat, bands = stage.flat(), bands_of(stage.flat())
    (runs,) = run_chunks(kernel(structure(flat)), flat, 1, measuring_options(rtol, bands=bands))
    return measure_runs(flat, runs, bands)
