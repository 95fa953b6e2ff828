"""Run many stages of one structure at once, or one stage with a dense record.

Runs are prepared in NumPy. Each core then computes several at once, one per lane of a vector register. Results come
chunk by chunk.

Stages that follow one log run sample by sample.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.axis import axis_of
from friso.engine.allowance import checked_rtol, current_allowance
from friso.engine.arrays import STATISTICS, Batch, BatchOptions, Results, Status, new_queue
from friso.engine.kernel import Kernel, columns, empty_results, kernel
from friso.engine.machine_code import LANES
from friso.engine.side_by_side import cores_to_use, current_flag, go_on, results_of
from friso.equations import motion
from friso.equations.motion import moved_on
from friso.equations.structure import structure
from friso.errors import InputError
from friso.stage import Stage
from friso.version import VERSION

if TYPE_CHECKING:
    import xarray as xr


FIRST_TURNING_POINTS = 512
"""Turning points stored for a run at first; runs with more are repeated with more room."""


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
    room: int = FIRST_TURNING_POINTS
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


FIRST_STEP = 1e-3  # [1/natural frequencies]
"""First step, also after a corner of the reference. A longer one may be rejected many times; a shorter one costs
some steps."""

LONGEST_STEP_SHARE = 1 / 200  # [of the duration]
"""Longest step. A longer one could pass over an event."""


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
    first_steps = np.ascontiguousarray(FIRST_STEP / rates)
    longest = np.broadcast_to(LONGEST_STEP_SHARE * segments[:, -1, 0], (runs,)).copy()
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


MOST_TURNING_POINTS = 1 << 20
"""Most turning points of a run, limited by memory."""


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
    if room >= MOST_TURNING_POINTS:
        results.statuses[crowded] = Status.FULL
        results.turn_counts[crowded] = room
        crowded[:] = False
    if not crowded.any():
        yield Runs(numbers, results)
        return
    if not crowded.all():
        yield Runs(numbers[~crowded], Results(*(array[~crowded] for array in results)))
    del results, batch
    repeated, fewer = numbers[crowded], max(1, options.chunk * FIRST_TURNING_POINTS // (4 * room))
    for first in range(0, len(repeated), fewer):
        yield from _run_with_room(kernel, flat, repeated[first : first + fewer], 4 * room, options, starts)


REPEATED_BUDGET_FACTOR = 2
"""Factor on the step budget of a run that is repeated because it used up its budget. With a smaller one, runs are
repeated too often."""


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
        if steps < REPEATED_BUDGET_FACTOR * before:
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


@dataclass(frozen=True)
class Inputs:
    """Inputs of driven runs: reference [m], shape (n,), and force on the stage [N].

    The force has the shape (n,), or (runs, n) for individual forces, and adds to the controller's. Reference and force
    are sampled every `sample_time` [s]. The velocity at each sample is the central difference of the reference, and
    linear between samples. The force is linear too, or constant if `held`, as in a sampled drive.
    """

    reference: np.ndarray
    force: np.ndarray
    sample_time: float
    held: bool = True

    @property
    def velocity(self) -> np.ndarray:
        """Return the velocity of the reference at the samples [m/s], shape (n,)."""
        return np.gradient(self.reference, self.sample_time)

    @property
    def segments(self) -> np.ndarray:
        """Return the pieces of the reference, with the force, for the engine: (forces, n + 1, 6).

        There is one piece per sample, and one for the end. `forces` is 1 for a common force.
        """
        n, force = len(self.reference), np.atleast_2d(self.force)
        rows = np.zeros((len(force), n + 1, 6))
        rows[:, :, 0] = np.arange(n + 1) * self.sample_time
        rows[:, :-1, 1], rows[:, :-1, 4] = self.reference, force
        rows[:, :-1, 2] = self.velocity
        rows[:, :-2, 3] = np.diff(rows[0, :-1, 2]) / self.sample_time
        if not self.held:
            rows[:, :-2, 5] = np.diff(force) / self.sample_time
        return rows


@dataclass(frozen=True)
class DrivenRuns:
    """States at the samples, (runs, n, states), and numbers held in between, (runs, n, held).

    `numbers` are the numbers of the runs, and `statuses` their outcomes.
    """

    numbers: np.ndarray
    states: np.ndarray
    held: np.ndarray
    statuses: np.ndarray


DRIVEN_STEPS_PER_SAMPLE = 200
"""Steps that a run along a log may take per sample on average. A run that needs more chatters."""

DRIVEN_SAMPLES = 4e6  # [samples]
"""Samples of all runs along logs that are computed at once, limited by memory."""

DRIVEN_RUNS = (16, 256)
"""Fewest and most runs along logs that are computed at once."""


def run_driven(
    kernel: Kernel, flat: Mapping[str, Any], runs: int, inputs: Inputs, starts: np.ndarray, rtol: float = 1e-5
) -> Iterator[DrivenRuns]:
    """Run stages that follow the log `inputs`, from the states `starts`, in chunks.

    `flat` has the keys of the stages, of one structure, with SI numbers or arrays of shape (runs,); `starts` has the
    shape (runs, kept). The states of a failed run are NaN from the failure on, and the run has its status.
    """
    count, shared = len(inputs.reference), inputs.segments if np.ndim(inputs.force) == 1 else None
    options = RunOptions(
        rtol=rtol,
        bands=(0.0, 0.0),
        record_from=np.inf,
        least_swing=np.inf,
        budget=DRIVEN_STEPS_PER_SAMPLE * count,
    )
    size = float(np.abs(inputs.reference - starts[0, kernel.position]).max())
    settings = options_of(replace(options, interval=inputs.sample_time))
    at_once = int(np.clip(DRIVEN_SAMPLES / count, *DRIVEN_RUNS))
    for first in range(0, runs, at_once):
        numbers = np.arange(first, min(first + at_once, runs))
        batch = prepare(kernel, _as_motion(flat, numbers, inputs, size), len(numbers), options, starts[numbers])
        periods = np.full(len(numbers), inputs.sample_time)
        batch = batch._replace(
            segments=replace(inputs, force=inputs.force[numbers]).segments if shared is None else shared,
            first_steps=periods,
            longest=periods,
            windows=np.full(len(numbers), -1),
        )
        results = empty_results(len(numbers), 1, count + 1, len(kernel.full_state))
        run_batch(kernel, batch, settings, results, options.threads)
        states, held = np.split(results.samples, [len(kernel.states)], axis=2)
        yield DrivenRuns(numbers, states[:, :-1], held[:, 1:], results.statuses)


def _as_motion(flat: Mapping[str, Any], numbers: np.ndarray, inputs: Inputs, size: float) -> dict[str, Any]:
    """Return the keys of the numbered stages, with a motion as long as the log.

    The motion is a step of a `size` [m], by which the equations are scaled.
    """
    part = {key: value[numbers] if np.ndim(value) else value for key, value in flat.items()}
    duration = len(inputs.reference) * inputs.sample_time
    return part | {"motion.kind": "step", "motion.size": size, "motion.duration": duration}


SIMULATION_RTOL = 1e-9
"""Default tolerance. A force limit that winds up, and contacts, multiply errors by up to 1e7."""


def simulate(stage: Stage, rtol: float = SIMULATION_RTOL, sample_time: float | None = None) -> xr.Dataset:
    """Simulate a stage's own motion, and return its time response.

    Variables over `time` [s] are, as far as the stage has them:

    - reference, position, velocity and error;
    - force and its shares (the controller's terms);
    - cart position and velocity;
    - joint deflection and force;
    - friction force and bristle deflection.

    The extrema of position minus reference are over `turning_point`. Each variable has `units`, those of the stage's
    kind of axis, and a `long_name`. `attrs` hold the stage as TOML text, rtol, status, steps and rejected steps.
    `sample_time` [s] is by default a 20 000th of the duration; samples are interpolated between the solver's steps. A
    run that fails has NaN from there on, and the reason in `status`. Raises InputError for a sample time or a tolerance
    that is not usable.
    """
    flat = stage.flat()
    duration = flat["motion.duration"]
    interval = usual_interval(duration) if sample_time is None else checked_interval(sample_time, duration)
    shape = kernel(structure(flat))
    (runs,) = run_chunks(shape, flat, 1, RunOptions(rtol=checked_rtol(rtol), interval=interval))
    time = np.arange(runs.results.samples.shape[1]) * interval
    return _dataset(stage, shape, flat, runs, time, rtol)


SAMPLES_BY_DEFAULT = 20_000
"""Sampling intervals of a run for which no sample time is given: enough to see each peak of a swing."""


def usual_interval(duration: float) -> float:
    """Return the interval between samples [s] of a run of a duration [s] for which none is given."""
    return duration / SAMPLES_BY_DEFAULT


MOST_SAMPLES = 20_000_000
"""Most sampling intervals of a run, whose states and outputs take a few gigabytes."""


def checked_interval(interval: float, duration: float) -> float:
    """Return the interval between samples [s] if a run of this duration [s] can have it.

    Raises InputError if the run would have too many samples, or none.
    """
    least = duration / MOST_SAMPLES
    if not least <= interval <= duration:
        text, expected = f"{interval:g} s", f"from {least:g} s to the duration, {duration:g} s"
        raise InputError("sample_time", text, expected, "1 ms")
    return interval


def sampled_outputs(shape: Kernel, flat: dict[str, Any], states: np.ndarray, time: np.ndarray) -> list[np.ndarray]:
    """Return the model's outputs, such as forces, at times [s], each of shape (samples,).

    They are computed from states, shape (states, samples). `flat` has the stage's keys in SI.
    """
    parameters = [v[0] for v in shape.values({**flat, "motion.size": motion.size(flat)}, 1)]
    rows = motion.pieces(flat, 1)[0]
    active = rows[np.searchsorted(rows[:, 0], time, side="right") - 1]
    elapsed, reference = time - active[:, 0], active[:, 1:].T
    modes = shape.modes(states, elapsed, reference, parameters)
    outputs = shape.module.outputs(states, modes, elapsed, reference, parameters)
    return [np.broadcast_to(np.asarray(output, dtype=float), time.shape) for output in outputs]


def output_variables(shape: Kernel, flat: dict[str, Any], states: np.ndarray, time: np.ndarray) -> dict[str, Any]:
    """Return the model's outputs, such as forces, as variables over "time", with their units.

    They are computed from states, shape (states, samples), at the times [s]. `flat` has the stage's keys in SI.
    """
    arrays, kind = sampled_outputs(shape, flat, states, time), axis_of(flat)
    return {
        name: ("time", array, {"units": kind.unit(unit), "long_name": label})
        for (name, (unit, label)), array in zip(shape.outputs.items(), arrays, strict=True)
    }


def time_axis(time: np.ndarray) -> dict[str, Any]:
    """Return the coordinate "time" [s]."""
    return {"time": ("time", time, {"units": "s", "long_name": "time"})}


def _dataset(
    stage: Stage, shape: Kernel, flat: dict[str, Any], runs: Runs, time: np.ndarray, rtol: float
) -> xr.Dataset:
    """Return the signals of a run as a dataset over time, with units, names and its status."""
    import xarray as xr

    results = runs.results
    variables = output_variables(shape, flat, results.samples[0].T, time)
    turns = slice(0, int(results.turn_counts[0]))
    label = "turning points of position - reference"
    variables["turning_time"] = (
        "turning_point",
        results.turn_times[0, turns],
        {"units": "s", "long_name": f"times of the {label}"},
    )
    variables["turning_deviation"] = (
        "turning_point",
        results.turn_values[0, turns],
        {"units": "m", "long_name": label},
    )
    response = xr.Dataset(
        variables,
        coords=time_axis(time),
        attrs={
            "name": stage.name,
            "stage": stage.to_toml(),
            "friso": VERSION,
            "rtol": rtol,
            "status": Status(int(results.statuses[0])).text,
            "steps": int(runs.statistic("attempted")[0]),
            "rejected": int(runs.statistic("rejected")[0]),
        },
    )
    return stage.axis_kind.with_units(response)
