"""Linear systems against the engine: small disturbances of a stage that rests or slides, simulated and computed."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import least_squares

import friso
from friso.engine.arrays import Status
from friso.engine.batch import RunOptions, run_chunks, sampled_outputs
from friso.engine.kernel import Kernel, kernel
from friso.equations.structure import structure
from friso.frequency.loops import closed_loop, operating_point
from friso.frequency.system import Members, member
from friso.stage import Stage

HELD = {"motion.kind": "hold"}
THERE = ("motion.acceleration", "motion.acceleration_time", "motion.return_at")
SLIGHT = {"joint.stroke": "0.1 um"}  # a limiter that is touched by a force far below friction
SHORT = {"joint.stroke": "0.1 mm"}  # one that is touched by sliding friction
LONG = {"joint.stroke": "2 mm"}  # one that no friction force touches

CASES = {
    "stuck": ({}, member()),
    "stuck-touched": (SLIGHT, member(touched=True)),
    "locked, stuck": ({"joint.locked": True}, member()),
    "sliding": ({}, member(0.05)),
    "sliding-touched": (SHORT, member(0.05, touched=True)),
    "locked, sliding": ({"joint.locked": True}, member(0.05)),
    "creeping": (LONG, member(5e-5)),
    "in the Stribeck range": (LONG, member(1e-3)),
    "locked, in the Stribeck range": ({"joint.locked": True}, member(1e-3)),
}


PUSH = 1e-7
"""Velocity that disturbs the stage [m/s]: it moves by nanometres, far less than bristles bend, far more than errors."""


@dataclass(frozen=True)
class Steady:
    """A stage in a steady motion: its flat keys, kernel, and the states at the start."""

    flat: dict
    kernel: Kernel
    start: np.ndarray
    member: Members

    def run(self, starts: np.ndarray, duration: float, interval: float) -> tuple[np.ndarray, np.ndarray]:
        """States over time from each start, shape (runs, samples, states), and the times [s]."""
        options = RunOptions(rtol=1e-11, interval=interval)
        flat = {**self.flat, "motion.duration": duration}
        (runs,) = run_chunks(self.kernel, flat, len(starts), options, starts)
        assert (runs.results.statuses == Status.DONE).all()
        return runs.results.samples, np.arange(runs.results.samples.shape[1]) * interval


def steady(rig: Stage, name: str) -> Steady:
    changes, member = CASES[name]
    speed = float(member.speed[0])
    motion = {"motion.kind": "ramp", "motion.velocity": f"{speed} m/s"} if speed else HELD
    flat = rig.replace({**dict.fromkeys(THERE), **motion, "motion.duration": "10 s", **changes}).flat()
    shape = kernel(structure(flat))
    start = np.array([speed if state.endswith("velocity") else 0.0 for state in shape.states])
    internal = operating_point(flat, member)
    start[shape.states.index("bristle_deflection")] = internal["bristle_deflection"][0]
    return Steady(flat, shape, balanced(flat, shape, start, member), member)


def balanced(flat: dict, shape: Kernel, start: np.ndarray, member: Members) -> np.ndarray:
    """The start with joint, parasitic mass and controller such that nothing accelerates."""
    free = [shape.states.index(name) for name in ("cart_position", "parasitic_position", "integral")]
    parameters = [v[0] for v in shape.values({**flat, "motion.size": 1.0}, 1)]
    speed = float(member.speed[0])
    touched, stuck = bool(member.touched[0]), not member.speed[0]
    if stuck and touched:  # the bristles bear what just touches the limiter
        gap = flat["joint.stroke"] * (1 + 1e-3)
        start = start.copy()
        start[free[0]] = -gap
        force = flat["joint.stiffness"] * gap + flat["joint.limiter_stiffness"] * (gap - flat["joint.stroke"])
        start[shape.states.index("bristle_deflection")] = force / flat["friction.bristle_stiffness"]
    modes = [{"forward": 1.0, "stroke_ahead": float(touched)}.get(kink, 0.0) for kink in shape.kinks]

    def accelerations(values: np.ndarray) -> np.ndarray:
        x = start.copy()
        x[free] += values * sizes
        rates = np.array(shape.module.right_hand_side(x, modes, 0.0, [0.0, speed, 0.0], parameters), dtype=float)
        return rates[[i for i, state in enumerate(shape.states) if state.endswith("velocity")]]

    sizes = np.array([1e-4, 1e-6, 1e-3])
    solution = least_squares(accelerations, np.zeros(3), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert np.abs(solution.fun).max() < 1e-8
    start = start.copy()
    start[free] += solution.x * sizes
    return start


@pytest.mark.cases(first=5)
@pytest.mark.parametrize("name", CASES)
def test_a_small_disturbance_goes_the_linear_way(rig: Stage, name: str) -> None:
    """The difference of two runs against the matrix exponential, and whether it dies out or grows."""
    base = steady(rig, name)
    system = closed_loop(base.flat, base.member)
    poles = np.linalg.eigvals(system.a[0])
    growth = poles.real.max()
    duration = 0.4 if growth < 0 else 5 / growth
    push = np.zeros(len(base.start))
    push[base.kernel.states.index("velocity")] = 1e-2 * PUSH if name == "stuck-touched" else PUSH
    samples, time = base.run(np.stack([base.start, base.start + push]), duration, duration / 200)
    moved = (samples[1] - samples[0])[:, base.kernel.states.index("position")]
    first = np.array([push[base.kernel.states.index(state)] for state in system.states])
    linear = np.array([(expm(system.a[0] * t) @ first)[system.states.index("position")] for t in time])
    assert moved == pytest.approx(linear, abs=0.02 * np.abs(linear).max())
    cart = np.abs(samples[1] - samples[0])[:, base.kernel.states.index("cart_velocity")]
    assert (cart[-40:].max() < cart[:100].max()) == (growth < 0)


@pytest.mark.cases(first=2)
@pytest.mark.parametrize("name", ["stuck", "sliding", "sliding-touched", "locked, sliding"])
def test_frequency_response_of_a_simulated_impulse(rig: Stage, name: str) -> None:
    """Plant and loop as they would be measured: position and force after an impulse on the stage, transformed."""
    base = steady(rig, name)
    push = np.zeros(len(base.start))
    push[base.kernel.states.index("velocity")] = PUSH
    impulse = PUSH * (base.flat["masses.stage"] - base.flat["parasitic.mass"])
    samples, time = base.run(np.stack([base.start, base.start + push]), 6.0, 5e-5)
    seen = [sampled_outputs(base.kernel, base.flat, states.T, time) for states in samples]
    names = list(base.kernel.outputs)
    position, force = (seen[1][names.index(n)] - seen[0][names.index(n)] for n in ("position", "force"))
    frequencies = np.array([2.0, 5.0, 8.0, 12.0, 20.0, 60.0, 150.0, 290.0])
    turning = np.exp(-2j * np.pi * frequencies[:, None] * time)
    moved, answered = (np.trapezoid(turning * signal, time, axis=1) for signal in (position, force))
    stage = rig.replace({**CASES[name][0]})
    plant, loop = (friso.linear(stage, base.member, part) for part in ("plant", "open"))
    row = plant.output_labels.index("stage")
    for k, frequency in enumerate(frequencies):
        s = 2j * np.pi * frequency
        assert moved[k] / (impulse + answered[k]) == pytest.approx(plant(s)[row, 0], rel=0.02)
        assert -answered[k] / (impulse + answered[k]) == pytest.approx(loop(s), rel=0.02)
