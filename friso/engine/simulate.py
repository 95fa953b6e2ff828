"""Simulate one run of a stage as a time response."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from friso.axis import axis_of
from friso.engine.arrays import Status
from friso.engine.batch import RunOptions, Runs, run_chunks
from friso.engine.kernel import Kernel, kernel
from friso.engine.settings import room_settings
from friso.engine.tolerance import checked_rtol
from friso.equations import motion
from friso.equations.structure import structure
from friso.errors import InputError
from friso.stage import Stage
from friso.version import VERSION

if TYPE_CHECKING:
    import xarray as xr

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


def usual_interval(duration: float) -> float:
    """Return the interval between samples [s] of a run of a duration [s] for which none is given."""
    return duration / room_settings.samples_by_default


def checked_interval(interval: float, duration: float) -> float:
    """Return the interval between samples [s] if a run of this duration [s] can have it.

    Raises InputError if the run would have too many samples, or none.
    """
    least = duration / room_settings.most_samples
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
