"""Run many stages that follow one log, sample by sample."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.engine.batch import RunOptions, options_of, prepare, run_batch
from friso.engine.kernel import Kernel, empty_results
from friso.engine.settings import room_settings


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
        budget=room_settings.driven_steps_per_sample * count,
    )
    size = float(np.abs(inputs.reference - starts[0, kernel.position]).max())
    settings = options_of(replace(options, interval=inputs.sample_time))
    at_once = int(np.clip(room_settings.driven_samples / count, *room_settings.driven_runs))
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
