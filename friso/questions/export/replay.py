"""Run a stage as built, and keep what its controller read and commanded at each sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import sympy as sp

from friso.drives.program import (
    ACCELERATION,
    DIRECTION,
    JERK,
    MOTOR_POSITION,
    PER_NEWTON,
    POSITION,
    REFERENCE,
    VELOCITY,
    Program,
)
from friso.drives.target import Vector
from friso.engine.simd_math import gaussian, quantised, sine
from friso.equations.as_built import VELOCITY_SEED_OFFSET
from friso.equations.component import TIME
from friso.equations.motion import declared
from friso.errors import InputError
from friso.stage import Stage
from friso.virtual_rig.run import failures, run_flat
from friso.virtual_rig.task import MoveTask, own_motion


def replayed(stage: Stage, flat: Mapping[str, Any], program: Program, samples: int) -> Vector:
    """Return the first samples of a stage's own motion as its drive runs it.

    `flat` has the stage with a complete drive. Raises InputError for a run that fails.
    """
    task, period = own_motion(stage), program.period
    duration = min(task.duration, samples * period)
    begun = task.pieces[:, 0] < duration
    task = replace(task, pieces=task.pieces[begun], duration=duration)
    (recorded,) = run_flat({**flat}, stage.floor, task, [0], period, outputs=True)
    if failed := failures(recorded):
        raise InputError("STAGE", f"a run as built that fails ({failed[0][1]})", "a stage that friso simulate can run")
    assert recorded.outputs is not None
    time = recorded.time
    rows = task.pieces[np.searchsorted(task.pieces[:, 0], time * (1 + 1e-12), side="right") - 1]
    true, motor = recorded.true["position"][0], recorded.true["position"][0]
    seen: dict[Any, np.ndarray] = {**_reference(task, rows, time), POSITION: recorded.logged["position"][0]}
    if MOTOR_POSITION in program.inputs:
        motor = recorded.outputs[f"{flat['encoder.velocity']}_position"][0]
        seen[MOTOR_POSITION] = _read(flat, motor)
    place, per_newton = float(task.pieces[0, 1]), flat[str(PER_NEWTON)]
    begun_at = {REFERENCE: place, POSITION: float(true[0]), MOTOR_POSITION: float(motor[0])}
    start = {str(one): begun_at.get(one, 0.0) for one in program.inputs}
    start["output"] = float(recorded.begun[0]) * per_newton + 0.0
    inputs = {str(one): seen[one] + 0.0 for one in program.inputs}
    return Vector(start, inputs, recorded.logged["force"][0] * per_newton + 0.0, true)


def _read(flat: Mapping[str, Any], positions: np.ndarray) -> np.ndarray:
    """Return what the encoder of the velocity reads at positions [m], shape (n,), with its noise and digits."""
    digit = np.float64(flat["drive.encoder_resolution"])
    with np.errstate(all="ignore"):  # whole numbers overflow on purpose, and without digits there is a division by 0
        noise = [gaussian(float(VELOCITY_SEED_OFFSET), float(k)) for k in range(len(positions))]
        noisy = positions + flat["drive.encoder_noise"] * np.array(noise)
        return np.array([quantised(one, digit) for one in noisy])


def _reference(task: MoveTask, rows: np.ndarray, time: np.ndarray) -> dict[sp.Symbol, np.ndarray]:
    """Return the reference and its derivatives at times [s], shape (n,), within its pieces, `rows`, by input.

    They are computed as the engine does, which has a sine of its own.
    """
    course = declared(task.form)
    wanted = {
        REFERENCE: course.position,
        VELOCITY: course.velocity,
        ACCELERATION: course.acceleration,
        JERK: course.jerk,
        DIRECTION: course.direction,
    }
    computed = sp.lambdify([TIME, *course.inputs], [*wanted.values()], [{"sine": sine}, "numpy"])
    values = computed(time - rows[:, 0], *rows[:, 1:].T)
    return {one: np.broadcast_to(value, time.shape) for one, value in zip(wanted, values, strict=True)}
