"""Run a stage with its real drive many times at once, and record what the drive would log.

The surroundings are included. `friso simulate` gets its time response from here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.axis import axis_of
from friso.engine.allowance import checked_rtol
from friso.engine.arrays import STATISTICS, Batch, Status
from friso.engine.batch import RunOptions, checked_interval, options_of, prepare, run_batch, time_axis, usual_interval
from friso.engine.kernel import Kernel, empty_results, kernel
from friso.equations.as_built import COMMANDED, NEUTRAL, READING, AsBuilt, whole_samples
from friso.equations.conditions import LEVELS, anywhere
from friso.equations.motion import value
from friso.equations.roles import Role
from friso.errors import InputError
from friso.hunting.measures import BANDS, Measures, SampledSolver, bands_of, measure_traces
from friso.stage import Stage
from friso.stage.rig import Floor
from friso.version import VERSION
from friso.virtual_rig.settings import RigSettings, settings
from friso.virtual_rig.task import SAMPLE_TIME, TABLE_MARGIN, MoveTask, own_motion, tables

if TYPE_CHECKING:
    import xarray as xr


METHOD = "Rodas4"
"""Method of integration; a step is at most one sample long."""


SENSOR = int.from_bytes(b"sensor")
"""Seed offset for the noise of the sensor between cart and stage."""


@dataclass(frozen=True)
class RecordedRuns:
    """Runs and their records, every `interval` [s].

    `numbers` are the numbers of the runs. `logged` are the signals that the drive knows, `true` the real motion, by the
    names of the roles of a log: SI, shape (runs, n), NaN after a failure. `statuses` tell of failures, shape (runs,);
    `statistics` are those of the solver; `outputs` are all signals of the equations, if asked for. `begun` [N] is the
    force with which the controllers begin, shape (runs,).

    All signals are those at the sample's instant, but "force" is the one that the drive commands from it, however late
    it acts. Where it acts at the next sample's instant, the motor's force among the outputs is the one just after the
    step of the command.
    """

    numbers: np.ndarray
    interval: float
    logged: Mapping[str, np.ndarray]
    true: Mapping[str, np.ndarray]
    statuses: np.ndarray
    statistics: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    outputs: Mapping[str, np.ndarray] | None = None
    begun: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def time(self) -> np.ndarray:
        """Return the times of the samples [s], shape (n,)."""
        return np.arange(self.logged["position"].shape[1]) * self.interval


def as_built_keys(stage: Stage, changes: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return a stage with a complete drive as flat keys such as drive.delay, with SI values.

    Properties that the file does not state are ideal. `changes` are SI numbers, or arrays with one for each run.
    """
    return with_complete_drive(stage.flat(changes))


def with_complete_drive(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return a stage, given as flat keys, with missing keys of the drive at their ideal values."""
    flat = anywhere(flat)
    flat.setdefault("drive.sample_time", SAMPLE_TIME)
    flat = {**NEUTRAL, **flat, "drive.integrator_reset": flat.get("drive.integrator_reset", False) * 1.0}
    flat["drive.late"] = flat["drive.delay"] - whole_samples(flat) * flat["drive.sample_time"]
    flat["drive.late"] *= flat["drive.late"] > 1e-9 * flat["drive.sample_time"]
    return flat


def run(
    stage: Stage,
    task: MoveTask,
    seeds: Sequence[int],
    interval: float,
    changes: Mapping[str, Any] | None = None,
    threads: int | None = None,
) -> Iterator[RecordedRuns]:
    """Run a stage with its real drive on a task several times, once for each seed of its noise.

    Signals are logged every `interval` [s], a whole number of samples. `changes` are flat keys to SI numbers, or to
    arrays with one number for each run, as in a sweep or for machines drawn at random. The runs come chunk by chunk,
    and are equal for any number of threads. Raises InputError for an interval that does not fit the samples, and for a
    [rail] along which this friction law does not vary.
    """
    yield from run_flat(as_built_keys(stage, changes), stage.floor, task, seeds, interval, threads)


SAMPLE_MEMORY = 2.5e8  # [B]
"""Memory for the samples of the runs in progress. Larger machines gain nothing from more."""


def run_flat(
    flat: Mapping[str, Any],
    floor: Floor | None,
    task: MoveTask,
    seeds: Sequence[int],
    interval: float,
    threads: int | None = None,
    outputs: bool = False,
) -> Iterator[RecordedRuns]:
    """Run stages with a complete drive on a task, once for each seed, on a floor that may shake.

    The stages are given as flat keys to SI numbers, or arrays with one for each run. Signals are logged every
    `interval` [s]; the runs come chunk by chunk. With `outputs`, all signals of the equations are recorded, not only
    those that the drive and a sensor see. Raises InputError for an interval, a delay or a [rail] that does not fit.
    """
    _check(flat, interval)
    first_run = {key: value[0] if np.ndim(value) else value for key, value in flat.items()}
    form = AsBuilt.of(first_run)
    shape = kernel(replace(form, structure=replace(form.structure, reference=task.form)), method=METHOD)
    count = int(np.ceil(task.duration / interval * (1 - 1e-12)))
    chunk = max(8, int(SAMPLE_MEMORY / (8 * count * len(shape.full_state))))
    for first in range(0, len(seeds), chunk):
        numbers = np.arange(first, min(first + chunk, len(seeds)))
        part = {key: value[numbers] if np.ndim(value) else value for key, value in flat.items()}
        part["drive.seed"] = np.asarray(seeds)[numbers].astype(float)
        yield _recorded(shape, part, floor, task.of_runs(numbers), numbers, (interval, count, threads), outputs)


MOST_DELAY_SAMPLES = 64
"""Largest delay in samples. Longer delays take memory for every sample of every run."""


def _check(flat: Mapping[str, Any], interval: float) -> None:
    """Check the sampling interval, the delay and the rail of a run.

    Raises InputError for an interval that is no whole number of samples, for a delay of too many, and for a rail along
    which nothing of the friction law varies.
    """
    varied = flat["friction.model"] == "none" or any(f"friction.{level}" in flat for level in LEVELS)
    if "rail.seed" in flat and not varied:
        actual = f'a [rail], but friction "{flat["friction.model"]}" without a static or Coulomb level to vary along it'
        raise InputError("rail", actual, "no [rail], or a law with such a level", 'model = "lugre"')
    if whole_samples(flat) > MOST_DELAY_SAMPLES:
        actual = f"{flat['drive.delay']:g} s, {whole_samples(flat)} samples of {flat['drive.sample_time']:g} s"
        raise InputError("drive.delay", actual, f"at most {MOST_DELAY_SAMPLES} samples", 'delay = "100 us"')
    samples = interval / flat["drive.sample_time"]
    if samples < 1 - 1e-9 or abs(samples - round(samples)) > 1e-6:
        step = flat["drive.sample_time"]
        expected = f"a whole number of samples of the drive, {step:g} s each"
        raise InputError("interval", f"{interval:g} s", expected, f"{max(1, round(samples)) * step:g} s")


STEPS_PER_SAMPLE = 200
"""Largest mean number of steps per sample. Runs that need more chatter, and would never end."""


def _recorded(
    shape: Kernel,
    flat: dict[str, Any],
    floor: Floor | None,
    task: MoveTask,
    numbers: np.ndarray,
    timing: tuple[float, int, int | None],
    with_outputs: bool,
) -> RecordedRuns:
    """Run a task on stages with their drive, and return the signals that the drive records.

    `numbers` are the numbers of the runs. `timing` has the interval of the samples [s], the number of samples, and the
    number of threads. All signals of the equations are added if `with_outputs`.
    """
    interval, count, threads = timing
    seeds = flat["drive.seed"].astype(np.int64)
    low, high = task.span
    motion = {
        "motion.kind": "step",
        "motion.size": (high - low) or TABLE_MARGIN,
        "motion.duration": task.duration,
    }
    options = RunOptions(
        rtol=settings.rig_rtol, bands=(np.inf, np.inf), record_from=np.inf, least_swing=np.inf, interval=interval,
        budget=int(STEPS_PER_SAMPLE * task.duration / np.min(flat["drive.sample_time"])),
    )  # fmt: skip
    pieces = task.pieces.reshape(-1, *task.pieces.shape[-2:])
    values = shape.values(flat | motion, len(seeds))
    held = shape.steady_at_rest(flat | motion, pieces[:, 0, 1] + task.displacement, len(seeds), task.displacement)
    batch = prepare(shape, flat | motion, len(seeds), options, shape.settled_at(values, held, len(seeds)))
    end = np.zeros((len(pieces), 1, pieces.shape[2]))
    last = (count - 1) * interval + 2 * np.max(flat["drive.sample_time"])  # the last sample has acted by then
    end[:, 0, 0] = max(task.duration, last)
    batch = batch._replace(
        segments=np.concatenate([pieces, end], axis=1),
        windows=np.full(len(seeds), -1),
        tables=tables(flat, floor, task, [int(seed) for seed in seeds]),
    )
    results = empty_results(len(seeds), 1, count, shape.sample_size)
    run_batch(shape, batch, options_of(options), results, threads)
    logged, true = _signals(shape, results.samples, flat, task, seeds, interval)
    begun = np.broadcast_to(held.force, (len(seeds),))
    recorded = RecordedRuns(numbers, interval, logged, true, results.statuses, results.statistics, begun=begun)
    if not with_outputs:
        return recorded
    outputs = [_outputs(shape, results.samples[k], values, batch, interval, k) for k in range(len(seeds))]
    return replace(recorded, outputs={name: np.array([one[name] for one in outputs]) for name in shape.outputs})


def _outputs(
    shape: Kernel, samples: np.ndarray, values: list[np.ndarray], batch: Batch, interval: float, number: int
) -> dict[str, np.ndarray]:
    """Return all signals of a run from its samples, by name, each of shape (samples,).

    `number` is the index of the run in the batch, and `interval` [s] the time between samples.
    """
    time, states = np.arange(len(samples)) * interval, samples[:, : len(shape.full_state)].T
    rows = batch.segments[min(number, len(batch.segments) - 1)]
    active = rows[np.searchsorted(rows[:, 0], time * (1 + 1e-12), side="right") - 1]
    over, at = batch.tables, [shape.cart_position, shape.cart_position, shape.position]
    grid, places, times = (part[min(number, len(part) - 1)] for part in (over.grid, over.places, over.times))
    looked_up = [_interpolated(table, (states[x] - grid[0]) * grid[1]) for table, x in zip(places, at, strict=True)]
    looked_up += [_interpolated(table, time * over.per_second[0]) for table in times]
    inputs = np.vstack([active[:, 1:].T, states[len(shape.states) :], *looked_up])
    elapsed, parameters = time - active[:, 0], [value[number] for value in values]
    modes = shape.modes(states, elapsed, inputs, parameters)
    outputs = shape.module.outputs(states[: len(shape.states)], modes, elapsed, inputs, parameters)
    return {
        name: np.broadcast_to(np.asarray(output, dtype=float), time.shape)
        for name, output in zip(shape.outputs, outputs, strict=True)
    }


def _interpolated(table: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Interpolate an evenly spaced table at places, counted in the table's points.

    The result has the shape of `place`. Beyond its ends the table keeps its end values.
    """
    return np.interp(place, np.arange(len(table)), table)


def _signals(
    shape: Kernel, samples: np.ndarray, flat: Mapping[str, Any], task: MoveTask, seeds: np.ndarray, interval: float
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return the signals that the drive logs, and the true ones, by role, shape (runs, n) each.

    `samples`, shape (runs, n, states), are taken every `interval` [s]. `seeds` are those of the runs' noise.
    """
    time = np.arange(samples.shape[1]) * interval
    position, computed = samples[:, :, shape.position], samples[:, :, len(shape.full_state) :]
    reading, commanded = (computed[:, :, shape.held.index(name)] for name in (READING, COMMANDED))
    logged = {
        "reference": np.broadcast_to(reference(task, time), position.shape),
        "position": reading,
        "force": commanded,
    }
    if task.injected.size and not task.unknown:
        logged["disturbance"] = np.broadcast_to(task.injected_at(time), logged["force"].shape)
    true = {"position": position, "velocity": samples[:, :, shape.velocity]}
    if shape.cart_position != shape.position:
        cart = true["cart_position"] = samples[:, :, shape.cart_position]
        true["cart_velocity"] = samples[:, :, shape.cart_velocity]
        gap = position - cart
        sensors = (np.random.Generator(np.random.Philox(key=[int(seed), SENSOR])) for seed in seeds)
        noise = np.array([sensor.standard_normal(len(time)) for sensor in sensors])
        logged["relative_position"] = gap + np.reshape(flat.get("drive.relative_noise", 0.0), (-1, 1)) * noise
    true |= {shape.full_state[i]: samples[:, :, i] for i in shape.having(Role.BRISTLE)}
    return logged, true


def reference(task: MoveTask, time: np.ndarray) -> np.ndarray:
    """Return the reference [m] at times [s], shape (n,), or (runs, n) for different moves."""
    if task.pieces.ndim > 2:
        return np.array([reference(replace(task, pieces=pieces), time) for pieces in task.pieces])
    rows = task.pieces[np.searchsorted(task.pieces[:, 0], time * (1 + 1e-12), side="right") - 1]
    return value(task.form, rows, time - rows[:, 0])


def failures(recorded: RecordedRuns) -> list[tuple[int, str]]:
    """Return number and reason of each failed run."""
    failed = recorded.statuses != Status.DONE
    return [
        (int(n), Status(int(s)).text) for n, s in zip(recorded.numbers[failed], recorded.statuses[failed], strict=True)
    ]


LOGGED = {"position": ("measured_position", "m", "position that the drive reads"), "force": ("command", "N", "command")}
"""Name, unit and label of each signal that the drive logs besides the true motion."""


def response(stage: Stage, rtol: float | None = None, sample_time: float | None = None, seed: int = 0) -> xr.Dataset:
    """Run a stage's own motion on its real drive, and return its time response.

    Variables over `time` [s] are those of `friso.engine.batch`, the encoder reading and the command. Samples
    coincide with the drive's; by default there are some twenty thousand. Noise is drawn from `seed`. Raises InputError
    for a sample time that is not a multiple of the drive's.
    """
    flat = as_built_keys(stage)
    settings = RigSettings.current()
    drive, duration = flat["drive.sample_time"], flat["motion.duration"]
    usual = max(1, round(usual_interval(duration) / drive)) * drive
    interval = usual if sample_time is None else checked_interval(sample_time, duration)
    tight = nullcontext() if rtol is None else replace(settings, rig_rtol=checked_rtol(rtol)).in_use()
    if (share := interval / drive) < 1 - 1e-9 or abs(share - round(share)) > 1e-6:
        expected = f"a whole number of samples of the drive, {drive:g} s each"
        raise InputError("sample_time", f"{interval:g} s", expected, f"{max(1, round(share)) * drive:g} s")
    with tight:
        (recorded,) = run_flat(flat, stage.floor, own_motion(stage), [seed], interval, outputs=True)
    return _dataset(stage, flat, recorded, settings.rig_rtol if rtol is None else rtol)


def measured_recording(flat: Any, recorded: RecordedRuns, bands: tuple[float, float] = BANDS) -> Measures:
    """Measure recorded runs of stages, given as flat keys: swing, settling into the `bands` [m], outcome and more.

    Where a measure needs the force, it is the one that the drive commanded.
    """
    attempted, rejected = (
        recorded.statistics[:, STATISTICS.index(name)].astype(np.int64) for name in ("attempted", "rejected")
    )
    deviation = recorded.true["position"] - recorded.logged["reference"]
    solver = SampledSolver(recorded.statuses, attempted, rejected)
    return measure_traces(flat, recorded.time, deviation, recorded.logged["force"], solver, bands)


def measured_response(stage: Stage, response: xr.Dataset) -> Measures:
    """Measure the run in a `response` of a stage: swing, settling, outcome and more."""
    time, status = response["time"].to_numpy(), {one.text: one for one in Status}[response.attrs["status"]]
    deviation = (response["position"] - response["reference"]).to_numpy()[None]
    counts = (np.array([value]) for value in (status, response.attrs["steps"], response.attrs["rejected"]))
    flat, command = stage.flat(), response["command"].to_numpy()[None]
    return measure_traces(flat, time, deviation, command, SampledSolver(*counts), bands_of(flat))


def _dataset(stage: Stage, flat: dict[str, Any], recorded: RecordedRuns, rtol: float) -> xr.Dataset:
    """Return the signals of a recorded run over time as a dataset, with units, names and status.

    `rtol` is the solver's relative tolerance, which is stored as an attribute.
    """
    import xarray as xr

    from friso.engine.kernel import kernel

    kind, shape = axis_of(flat), kernel(AsBuilt.of(flat), method=METHOD)
    assert recorded.outputs is not None
    variables: dict[str, Any] = {
        name: ("time", recorded.outputs[name][0], {"units": kind.unit(unit), "long_name": label})
        for name, (unit, label) in shape.outputs.items()
    }
    for signal, (name, unit, label) in LOGGED.items():
        variables[name] = ("time", recorded.logged[signal][0], {"units": kind.unit(unit), "long_name": label})
    statistics = dict(zip(STATISTICS, recorded.statistics[0], strict=True))
    attrs = {
        "name": stage.name,
        "stage": stage.to_toml(),
        "friso": VERSION,
        "rtol": rtol,
        "status": Status(int(recorded.statuses[0])).text,
        "steps": int(statistics["attempted"]),
        "rejected": int(statistics["rejected"]),
        "as_built": 1,
    }
    return stage.axis_kind.with_units(xr.Dataset(variables, coords=time_axis(recorded.time), attrs=attrs))
