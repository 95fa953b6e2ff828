"""Stages that follow a log: the sampled drive against a twin in plain Python, the continuous one against `simulate`."""

import numpy as np
import pytest
from plain_axis import DRAG, KI, KP, MASS, TIME, plain_axis

from friso.engine.batch import Inputs, run_driven, simulate
from friso.engine.kernel import kernel
from friso.equations.imposed import Driven
from friso.equations.structure import structure
from friso.stage import Stage

KD, LIMIT = 120.0, 5.0


def axis(**changes: str) -> Stage:
    motion = {"kind": "hold", "duration": "1 s"}
    return plain_axis(KD, LIMIT, motion, sample_time=f"{TIME} s", velocity_samples=2).replace(changes)


def run(stage: Stage, inputs: Inputs, samples: int, rtol: float = 1e-9):
    flat = stage.flat()
    shape = kernel(Driven(structure(flat), samples))
    starts = np.zeros((1, len(shape.full_state)))
    (runs,) = run_driven(shape, flat, 1, inputs, starts, rtol)
    assert runs.statuses[0] == 1
    return shape, runs


def twin(reference: np.ndarray, extra: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position and force at the samples: the controller step by step, the mass moved exactly under a held force."""
    decay = np.exp(-DRAG / MASS * TIME)
    x = v = integral = 0.0
    past, position, force = [0.0, 0.0], [], []
    for r, d in zip(reference, extra, strict=True):
        demand = KP * (r - x) - KD * (x - past[1]) / (2 * TIME)
        new = integral + TIME * (r - x)
        command = demand + KI * new
        integral = integral if (command > LIMIT and r > x) or (command < -LIMIT and r < x) else new
        u = np.clip(demand + KI * integral, -LIMIT, LIMIT)
        position.append(x)
        force.append(u)
        past = [x, past[0]]
        steady = (u + d) / DRAG
        x += steady * TIME + (v - steady) * MASS / DRAG * (1 - decay)
        v = steady + (v - steady) * decay
    return np.array(position), np.array(force)


def test_sampled_drive_is_that_of_plain_python():
    time = np.arange(1500) * TIME
    reference = np.where(time > 0.1, 2e-3, 0.0) + 1e-3 * np.sin(9 * time)
    extra = np.where((time > 0.8) & (time < 0.85), 3.0, 0.0)
    shape, runs = run(axis(), Inputs(reference, extra, TIME), 2)
    position, force = twin(reference, extra)
    assert np.abs(force).max() == LIMIT  # the limit is met, and left again
    assert runs.states[0, :, 0] == pytest.approx(position, abs=1e-9)
    assert runs.held[0, :, shape.held.index("held_force")] == pytest.approx(force, abs=1e-5)


def test_sampled_drive_approaches_the_continuous_one_in_the_first_order():
    errors = []
    for halvings in range(4):
        step = TIME / 2**halvings
        time = np.arange(round(0.2 / step)) * step
        inputs = Inputs(1e-4 * np.sin(40 * time), np.zeros_like(time), step)
        sampled = axis(**{"drive.sample_time": f"{step} s"})
        (_, fine), (_, smooth) = (run(sampled, inputs, samples) for samples in (2, 0))
        errors.append(abs(fine.states[0, -1, 0] - smooth.states[0, -1, 0]))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders[-1] == pytest.approx(1, abs=0.1)


def test_following_a_constant_is_the_step_response():
    stage = axis(**{"motion.kind": "step", "motion.size": "1 mm", "motion.duration": "0.5 s"})
    reference = simulate(stage, 1e-8, TIME)
    _, runs = run(stage, Inputs(np.full(500, 1e-3), np.zeros(500), TIME), 0, 1e-8)
    assert runs.states[0, :, 0] == pytest.approx(reference.position.values[:500], abs=1e-9)


def test_a_held_force_accelerates_the_mass():
    stage = axis(**{"controller.kp": "1e-9 N/m", "controller.kd": "1e-9 N*s/m", "controller.ki": "1e-9 N/(m*s)"})
    _, runs = run(stage, Inputs(np.full(200, 1e-3), np.full(200, 2.0), TIME), 0)
    time = np.arange(200) * TIME
    expected = 2 / DRAG * (time - MASS / DRAG * (1 - np.exp(-DRAG / MASS * time)))
    assert runs.states[0, :, 0] == pytest.approx(expected, abs=1e-8)
