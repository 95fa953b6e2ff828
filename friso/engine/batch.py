"""Run many stages of one structure, and return the results chunk by chunk.

Runs are prepared in NumPy. Each core then computes several at once, one per lane of a vector register.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from friso.engine.allowance import current_allowance
from friso.engine.arrays import STATISTICS, Batch, BatchOptions, Results, Status, new_queue
from friso.engine.kernel import Kernel, columns, empty_results
from friso.engine.layout import LANES
from friso.engine.overtaken import current_flag, go_on
from friso.engine.settings import room_settings, step_settings
from friso.engine.side_by_side import cores_to_use, results_of
from friso.equations import motion
from friso.equations.reference import moved_on


@dataclass(frozen=True)
class RunOptions:
    """Options of runs.

    - `rtol`: relative tolerance; `bands` [m]: the two bands of settling.
    - `window`: start of the window for extremes, as a fraction of the run.
    - `record_from` [s]: time from which turning points are kept, at most half of the run; `room`: how many, at first.
    - `least_swing` [m]: smallest swing between two turning points, one number or one per run, below which legs of a
      zigzag are skipped.
    - `interval` [s]: between samples (None: no samples).
    - `budget`: most steps of a run; `threads`: how many (None: as many as there are cores to use).
    - `chunk`: most runs that are prepared at once.
    - `cancel`: a flag, shape (1,); once another thread sets it, no further run begins.
    """

    rtol: float = 1e-6
    bands: tuple[float, float] = (1e-6, 1e-5)
    window: float = 0.75
    record_from: float = 0.0
    least_swing: float | np.ndarray = 0.0
    room: int = field(default_factory=lambda: room_settings.first_turning_points)
    interval: float | None = None
    budget: int = 2_000_000
    threads: int | None = None
    chunk: int = 2048
    cancel: np.ndarray | None = None


@dataclass(frozen=True)
class Runs:
    """Results of some runs, with the numbers of the runs."""

    numbers: np.ndarray
    results: Results

    def statistic(self, name: str) -> np.ndarray:
        """Return one column of `STATISTICS`, shape (runs,)."""
        return self.results.statistics[:, STATISTICS.index(name)]

    def part(self, flat: Mapping[str, Any]) -> dict[str, Any]:
        """Select the keys of the stages of these runs: `flat` has keys with SI numbers or arrays."""
        return part_of(flat, self.numbers)


def part_of(flat: Mapping[str, Any], numbers: np.ndarray) -> dict[str, Any]:
    """Select the stages with these numbers from a mapping of keys to SI numbers or arrays."""
    return {key: value[numbers] if np.ndim(value) else value for key, value in flat.items()}


def run_chunks(
    kernel: Kernel, flat: Mapping[str, Any], runs: int, options: RunOptions, starts: np.ndarray | None = None
) -> Iterator[Runs]:
    """Run `runs` stages of one structure, in chunks.

    `flat` has the stages' keys, such as "friction.static", with SI numbers or arrays of shape (runs,). Stages start at
    rest, displaced as the motion says, or from the states `starts`, shape (runs, states). In `starts`, modes with
    memory may follow the states; otherwise they are derived from the states. In a chunk, runs with many turning points
    come last. Results do not depend on how many runs are computed at once. A failed run has a status; the others go on.
    Raises Exhausted if an allowance does not suffice (see `friso.engine.allowance`).
    """
    for first in range(0, runs, options.chunk):
        numbers = np.arange(first, min(first + options.chunk, runs))
        yield from _run_with_room(kernel, flat, numbers, options.room, options, starts)


def prepare(
    kernel: Kernel, flat: Mapping[str, Any], runs: int, options: RunOptions, starts: np.ndarray | None = None
) -> Batch:
    """Make the input of the compiled code for the runs of one chunk.

    Runs begin in the states `starts`, or as the motion says. `flat` has the stages' keys in SI.
    """
    values = kernel.values({**flat, "motion.size": motion.size(flat)}, runs)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        constants = columns(kernel.module.constants(values), runs)
        rates = columns(kernel.module.rate(values), runs)[:, 0]
    scales = kernel.scales(values, runs)
    segments, windows = _segments(flat, runs, options.window)
    windows = np.broadcast_to(windows, (runs,)).copy()
    starts = _starts(kernel, flat, runs) if starts is None else np.ascontiguousarray(starts, dtype=float)
    starts = kernel.with_modes(starts, segments[:, 0, 1:].T, values)
    modes = np.ascontiguousarray(kernel.modes(starts.T, 0.0, segments[:, 0, 1:].T, values).T)
    first_steps = np.ascontiguousarray(step_settings.first_step / rates)
    longest = np.broadcast_to(step_settings.longest_step_share * segments[:, -1, 0], (runs,)).copy()
    clocks = columns(kernel.module.clock(values), runs) if kernel.layout.clocked else np.zeros((1, 2))
    least = np.full(runs, options.least_swing, dtype=float)
    tolerances = options.rtol * scales
    return Batch(constants, starts, tolerances, modes, first_steps, longest, segments, windows, clocks, least)


def _starts(kernel: Kernel, flat: Mapping[str, Any], runs: int) -> np.ndarray:
    """Return the initial states of stages from rest, (runs, states), displaced as the motion says."""
    place = motion.initial_displacement(flat)
    return kernel.at_rest({**flat, "motion.size": motion.size(flat)}, place, runs, place)


def _segments(flat: Mapping[str, Any], runs: int, window: float) -> tuple[np.ndarray, np.ndarray]:
    """Return pieces of the reference, cut at the start of the window and at the end of the run.

    The window is the time over which extremes are taken; it begins after the fraction `window` of the run. Pieces that
    begin after the end are left out. The second result is the number of the piece that opens the window. Runs with the
    same motion share one row. If the reference stands or moves evenly in the end, the window lies after its last
    corner.
    """
    runs = runs if motion.varies(flat) else 1
    pieces = motion.pieces(flat, runs)
    end = np.broadcast_to(np.asarray(flat["motion.duration"], dtype=float), (runs,))
    pieces[:, :, 0] = np.minimum(pieces[:, :, 0], end[:, None])
    corner = np.where(motion.at_rest(motion.form_of(flat), pieces[:, -1], 2), pieces[:, -1, 0], 0.0)
    start = motion.last_part(window, end, corner)
    rows = np.arange(runs)
    windows = (pieces[:, :, 0] <= start[:, None]).sum(axis=1)
    before = pieces[rows, windows - 1]
    at_window = moved_on(motion.form_of(flat), before, start - before[:, 0])
    at_window[:, 0] = start
    segments = np.zeros((runs, pieces.shape[1] + 2, pieces.shape[2]))
    places = np.arange(pieces.shape[1])
    shifted = places[None, :] + (places[None, :] >= windows[:, None])
    segments[rows[:, None], shifted] = pieces
    segments[rows, windows] = at_window
    segments[:, -1, 0] = end
    return segments, windows.astype(np.int64)


def _run_with_room(
    kernel: Kernel,
    flat: Mapping[str, Any],
    numbers: np.ndarray,
    room: int,
    options: RunOptions,
    starts: np.ndarray | None,
) -> Iterator[Runs]:
    """Run the numbered runs from their `starts`, with `room` for turning points.

    Runs with too many turning points are repeated, fewer at a time, with more room for each. Without `starts`, runs
    begin as their motions say.
    """
    part = part_of(flat, numbers)
    least = options.least_swing
    part_options = replace(options, least_swing=least[numbers]) if isinstance(least, np.ndarray) else options
    batch = prepare(kernel, part, len(numbers), part_options, None if starts is None else starts[numbers])
    samples = 0
    if options.interval is not None:
        samples = int(np.max(part["motion.duration"]) / options.interval * (1 + 1e-12)) + 1
    results = empty_results(len(numbers), room, samples, kernel.sample_size)
    _run_within_allowance(kernel, batch, options, results)
    crowded = results.turn_counts > room
    if room >= room_settings.most_turning_points:
        results.statuses[crowded] = Status.FULL
        results.turn_counts[crowded] = room
        crowded[:] = False
    if not crowded.any():
        yield Runs(numbers, results)
        return
    if not crowded.all():
        yield Runs(numbers[~crowded], Results(*(array[~crowded] for array in results)))
    del results, batch
    repeated, fewer = numbers[crowded], max(1, options.chunk * room_settings.first_turning_points // (4 * room))
    for first in range(0, len(repeated), fewer):
        yield from _run_with_room(kernel, flat, repeated[first : first + fewer], 4 * room, options, starts)


def _run_within_allowance(kernel: Kernel, batch: Batch, options: RunOptions, results: Results) -> None:
    """Run a batch within the allowance of work, if there is one.

    Each run gets an equal part of the remaining steps. The few runs that need more are repeated with the steps that the
    others left. Raises Exhausted if a repetition would hardly allow more steps than the run before.
    """
    allowance = current_allowance()
    if allowance is None:
        run_batch(kernel, batch, options_of(options), results, options.threads)
        return
    which, part, steps = np.arange(len(batch.starts)), results, 0
    while which.size:
        before, steps = steps, int(min(options.budget, allowance.most_steps(len(which), kernel.work)))
        if steps < room_settings.repeated_budget_factor * before:
            allowance.exhaust()
        run_batch(kernel, _batch_of(batch, which), options_of(replace(options, budget=steps)), part, options.threads)
        allowance.charge(part.statistics[:, STATISTICS.index("attempted")], kernel.work)
        if part is not results:
            for column, rows in zip(results, part, strict=True):
                column[which] = rows
        which = which[(part.statuses == Status.BUDGET) & (steps < options.budget)]
        part = _empty_like(results, len(which))


def _batch_of(batch: Batch, which: np.ndarray) -> Batch:
    """Return a batch with only the numbered runs; values common to all runs stay."""
    if len(which) == len(batch.starts):
        return batch
    own = {
        name: array[which]
        for name, array in batch._asdict().items()
        if isinstance(array, np.ndarray) and len(array) == len(batch.starts)
    }
    return batch._replace(**own)


def _empty_like(results: Results, runs: int) -> Results:
    """Return empty results for `runs` runs, with as much room as the given results."""
    return empty_results(runs, results.turn_times.shape[1], *results.samples.shape[1:])


def options_of(options: RunOptions) -> BatchOptions:
    """Return the options that the compiled code needs."""
    return BatchOptions(
        rtol=float(options.rtol),
        budget=float(options.budget),
        inner=float(options.bands[0]),
        outer=float(options.bands[1]),
        record_from=float(options.record_from),
        interval=float(options.interval or np.inf),
        cancel=current_flag() if options.cancel is None else options.cancel,
    )


def run_batch(kernel: Kernel, batch: Batch, settings: BatchOptions, results: Results, threads: int | None) -> None:
    """Compute the runs of a batch in threads, which take them from a queue, and fill `results`.

    The threads do without the interpreter's lock. Raises Overtaken if nobody waits for the runs any more.
    """
    go_on()
    workers = min(threads or cores_to_use(), -(-len(batch.starts) // LANES))
    arguments = (new_queue(), batch, settings, results)
    if workers == 1:
        kernel.run(*arguments)
        go_on()
        return
    with ThreadPoolExecutor(workers) as pool:
        try:
            results_of([pool.submit(kernel.run, *arguments) for _ in range(workers)])
        except BaseException:
            settings.cancel[0] = 1
            raise
    go_on()
