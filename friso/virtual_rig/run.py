"""Runs of a stage with its drive as built, in lanes, and what the drive would log of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.engine.arrays import Status
from friso.engine.batch import RunOptions, options_of, prepare, run_batch
from friso.engine.kernel import Kernel, empty_results, kernel
from friso.equations.as_built import COMMANDED, NEUTRAL, READING, AsBuilt, whole_samples
from friso.equations.conditions import LEVELS, anywhere
from friso.equations.reference import value
from friso.equations.roles import Role, Steady
from friso.errors import InputError
from friso.stage import Stage
from friso.virtual_rig.settings import RigSettings
from friso.virtual_rig.surroundings import tables
from friso.virtual_rig.task import SAMPLE_TIME, MoveTask

METHOD = "Rodas4"
"""Relative tolerance and method: a step is at most a sample long."""


SENSOR = int.from_bytes(b"sensor")
"""Which of a seed's random numbers the sensor between cart and stage takes."""


@dataclass(frozen=True)
class RecordedRuns:
    """Numbers of the runs and their records, every `interval` [s].

    `logged` are the signals that the drive knows, `true` what really moves, by the names of the roles of a log: SI,
    shape (runs, n), NaN after a failure; `statuses` tell of failures, shape (runs,). Where the delay is no whole number
    of samples, `true` and the relative position stand at the instant of the force, that fraction of a sample later.
    """

    numbers: np.ndarray
    interval: float
    logged: Mapping[str, np.ndarray]
    true: Mapping[str, np.ndarray]
    statuses: np.ndarray

    @property
    def time(self) -> np.ndarray:
        """Times of the samples [s], shape (n,)."""
        return np.arange(self.logged["position"].shape[1]) * self.interval


def as_built_keys(stage: Stage, changes: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the flat keys of a stage with a complete drive: what it does not tell is ideal.
    `changes` are SI numbers, or arrays with one for each run."""
    flat = anywhere(stage.flat(changes))
    flat.setdefault("drive.sample_time", SAMPLE_TIME)
    flat = {**NEUTRAL, **flat, "drive.integrator_reset": float(flat.get("drive.integrator_reset", False))}
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
    """Run a stage several times, each with noise of its own seed, logged every `interval` [s],
    a whole number of samples.

    `changes` are flat keys to SI numbers, or arrays of one for each run: of a sweep, or of machines drawn at random.
    The runs come chunk by chunk; they are the same for any number of threads. Raises InputError for an interval that
    does not fit the samples, and for a [rail] along which this law does not vary.
    """
    settings = RigSettings.current()
    flat = as_built_keys(stage, changes)
    _check(flat, interval)
    first_run = {key: value[0] if np.ndim(value) else value for key, value in flat.items()}
    form = AsBuilt.of(first_run)
    shape = kernel(replace(form, structure=replace(form.structure, reference=task.form)), method=METHOD)
    count = int(np.ceil(task.duration / interval * (1 - 1e-12)))
    chunk = max(8, int(settings.sample_memory / (8 * count * len(shape.full_state))))
    for first in range(0, len(seeds), chunk):
        numbers = np.arange(first, min(first + chunk, len(seeds)))
        part = {key: value[numbers] if np.ndim(value) else value for key, value in flat.items()}
        yield _recorded(shape, part, stage, task, np.asarray(seeds)[numbers], numbers, (interval, count, threads))


def _check(flat: Mapping[str, Any], interval: float) -> None:
    """Check the sampling interval, the delay and the rail of a run.

    Raises InputError for an interval that is no whole number of samples, for a delay of too many, and for a rail along
    which nothing of the friction law varies.
    """
    settings = RigSettings.current()
    if (
        "rail.seed" in flat
        and flat["friction.model"] != "none"
        and not any(f"friction.{level}" in flat for level in LEVELS)
    ):
        actual = f'a [rail], but friction "{flat["friction.model"]}" without a static or Coulomb level to vary along it'
        raise InputError("rail", actual, "no [rail], or a law with such a level", 'model = "lugre"')
    if whole_samples(flat) > settings.most_delay_samples:
        actual = f"{flat['drive.delay']:g} s, {whole_samples(flat)} samples of {flat['drive.sample_time']:g} s"
        raise InputError("drive.delay", actual, f"at most {settings.most_delay_samples} samples", 'delay = "100 us"')
    samples = interval / flat["drive.sample_time"]
    if samples < 1 - 1e-9 or abs(samples - round(samples)) > 1e-6:
        expected = f"a whole number of samples of the drive, {flat['drive.sample_time']:g} s each"
        raise InputError(
            "interval", f"{interval:g} s", expected, f"{max(1, round(samples)) * flat['drive.sample_time']:g} s"
        )


def _recorded(
    shape: Kernel,
    flat: dict[str, Any],
    stage: Stage,
    task: MoveTask,
    seeds: np.ndarray,
    numbers: np.ndarray,
    timing: tuple[float, int, int | None],
) -> RecordedRuns:
    """Run moves on the virtual rig, and return the signals that the drive records."""
    settings = RigSettings.current()
    interval, count, threads = timing
    flat = {**flat, "drive.seed": seeds.astype(float)}
    low, high = task.span
    motion = {
        "motion.kind": "step",
        "motion.size": (high - low) or settings.table_margin,
        "motion.duration": task.duration,
    }
    options = RunOptions(
        rtol=settings.rig_rtol, bands=(np.inf, np.inf), record_from=np.inf, least_swing=np.inf, interval=interval,
        budget=int(settings.steps_per_sample * task.duration / flat["drive.sample_time"]),
    )  # fmt: skip
    at_rest = Steady(-task.displacement, float(task.pieces[0, 1]) + task.displacement)
    starts = shape.unwound_at(shape.values(flat | motion, len(seeds)), at_rest, len(seeds))
    batch = prepare(shape, flat | motion, len(seeds), options, starts)
    end = np.zeros(task.pieces.shape[1])
    end[0] = task.duration
    batch = batch._replace(
        segments=np.vstack([task.pieces, end])[None],
        windows=np.full(len(seeds), -1),
        tables=tables(flat, stage.floor, task, [int(seed) for seed in seeds]),
    )
    results = empty_results(len(seeds), 1, count, len(shape.full_state))
    run_batch(shape, batch, options_of(options), results, threads)
    return RecordedRuns(
        numbers, interval, *_signals(shape, results.samples, flat, task, seeds, interval), results.statuses
    )


def _signals(
    shape: Kernel, samples: np.ndarray, flat: Mapping[str, Any], task: MoveTask, seeds: np.ndarray, interval: float
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return the signals that the drive logs, and the true ones."""
    time = np.arange(samples.shape[1]) * interval
    position, reading, commanded = (
        samples[:, :, i] for i in (shape.position, shape.full_state.index(READING), shape.full_state.index(COMMANDED))
    )
    logged = {
        "reference": np.broadcast_to(reference(task, time), position.shape),
        "position": reading,
        "force": commanded,
    }
    if len(task.injected) and not task.unknown:
        places = np.arange(len(task.injected)) * task.injected_each
        logged["disturbance"] = np.broadcast_to(
            np.interp(time, places, task.injected, right=0.0), logged["force"].shape
        )
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
    """Return the reference [m] at times [s]."""
    rows = task.pieces[np.searchsorted(task.pieces[:, 0], time * (1 + 1e-12), side="right") - 1]
    since = time - rows[:, 0]
    return value(task.form, rows, since)


def failures(recorded: RecordedRuns) -> list[tuple[int, str]]:
    """Return numbers of the runs that failed, and why."""
    failed = recorded.statuses != Status.DONE
    return [
        (int(n), Status(int(s)).text) for n, s in zip(recorded.numbers[failed], recorded.statuses[failed], strict=True)
    ]
