"""Machines drawn at random, and their logs: the known truth that identification is tried on, in tests and benchmark.

Ranges are wide but realistic, about the thesis's rig (Table 2) and smaller and larger stages like it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.integrate import cumulative_trapezoid

import friso
from friso.engine.batch import run_driven
from friso.identification.logs.log import Log
from friso.identification.output_error.problem import RUN_TOLERANCE, loop_problem
from friso.identification.readings.common import record

FIXED = 1e9
"""Mass [kg] of a cart that is held: it does not move."""

STEP, STEPS, STANDS = 0.3e-3, (1, 1, -1, -1, 1, -1), 2.0
"""Size of a position step [m] (Sec. 4.2.2), the ways of the steps, and how long each stands [s]."""

MOVES = ((0.2, 1.0), (1.2, -1.0), (2.4, 0.5), (3.4, -0.5), (4.6, 0.2), (5.6, -0.2), (6.8, 0.02), (8.4, -0.02))
"""Times [s] at which moves begin, and their speeds over the highest: quick ones, and slow ones that may hunt."""

CREEP_TIME = 15.0
"""Duration of a slow ramp [s]."""

PULLS = (1e-3, 3e-3, 1e-2)
"""Speeds [m/s] of the references that pull a stage until it breaks away."""

SLOW = 0.1
"""Share of the highest speed up to which a move is slow."""

CRUISE, MOVE_TIME, FINE = 0.3, 10.0, 4
"""Time [s] of constant speed in each move (of the slow ones four times as long), length of the whole log [s], and
steps of the reference per sample of the log."""


@dataclass(frozen=True)
class Machine:
    """A true stage with its measurement errors.

    They are the standard deviations of noise and the steps of digits for lengths [m] and forces [N], the sample time
    [s], and the source of noise.
    """

    truth: friso.Stage
    length_noise: float
    length_digit: float
    force_noise: float
    force_digit: float
    sample_time: float
    rng: np.random.Generator

    @property
    def flat(self) -> dict:
        return self.truth.flat()

    @property
    def jointed(self) -> bool:
        return self.truth.joint is not None

    @property
    def guess(self) -> friso.Stage:
        """Return what the owner knows: structure, controller and mass ratio, but not the friction."""
        flat = self.flat
        coulomb = 0.6 * flat["friction.coulomb"]
        numbers = {key: 1.3 * flat[key] for key in ("masses.cart", "masses.stage") if key in flat}
        numbers |= {"friction.static": coulomb, "friction.coulomb": coulomb, "friction.viscous": coulomb}
        numbers |= {"friction.stribeck_velocity": 1e-3, "friction.bristle_stiffness": coulomb / 5e-6}
        numbers["friction.bristle_damping"] = float(np.sqrt(coulomb / 5e-6 * sum(_masses(flat))))
        numbers["controller.tuned_mass"] = flat.get("controller.tuned_mass", sum(_masses(flat)))
        if self.jointed:
            numbers["joint.stiffness"] = 0.7 * flat["joint.stiffness"]
        return self.truth.with_numbers(numbers, ["bias"])

    def log(self, name: str, stage: friso.Stage, bare: bool = False) -> Log:
        """The log of a run of a stage like this one, with noise and digits unless `bare`."""
        run = friso.simulate(stage, 1e-7, self.sample_time, continuous=True)
        roles = ("reference", "position", "force", *(("cart_position",) if self.jointed else ()))
        signals = {role: np.array(run[role].values) for role in roles}
        return self.measured(record(name, self.sample_time, **signals), bare)

    def followed(self, name: str, reference: np.ndarray, bare: bool = False) -> Log:
        """The log of this stage on a reference [m] given `FINE` times per sample, with noise and digits unless
        `bare`."""
        step, flat = self.sample_time / FINE, self.flat
        inputs = record(name, step, reference=reference, position=0 * reference, force=0 * reference)
        problem = loop_problem(flat, inputs, inputs.segments[0], ())
        result = problem.record(np.zeros(0))
        signals = {"reference": reference, "position": result.position, "force": result.force}
        if self.jointed:
            starts = np.zeros((1, len(problem.kernel.full_state)))
            tolerance = RUN_TOLERANCE
            (runs,) = run_driven(problem.kernel, flat, 1, problem.inputs, starts, tolerance)
            signals["cart_position"] = runs.states[0, :, problem.kernel.states.index("cart_position")]
        return self.measured(record(name, self.sample_time, **{k: v[::FINE] for k, v in signals.items()}), bare)

    def measured(self, log: Log, bare: bool = False) -> Log:
        """Return a log with noise and digits; the reference is exact."""
        signals = {
            role: values if bare or role in ("reference", "disturbance") else self._digits(values, role == "force")
            for role, values in log.signals.items()
        }
        return replace(log, signals=signals)

    def _digits(self, values: np.ndarray, force: bool) -> np.ndarray:
        noise, digit = (self.force_noise, self.force_digit) if force else (self.length_noise, self.length_digit)
        return np.round((values + noise * self.rng.standard_normal(len(values))) / digit) * digit


def drawn(seed: int, jointed: bool) -> Machine:
    """A machine drawn at random, a rigid one or one with a joint."""
    rng = np.random.default_rng((seed, jointed))
    mass = _log(rng, 0.5, 10.0)
    coulomb = mass * _log(rng, 0.2, 2.0)
    top, ramp = _log(rng, 0.1, 1.0), _log(rng, 0.03, 0.15)
    bristle = coulomb / _log(rng, 2e-6, 2e-5)
    tables: dict = {
        "masses": {"cart": f"{mass} kg"},
        "friction": {
            "model": "lugre",
            "static": f"{coulomb * rng.uniform(1.1, 3.0)} N",
            "coulomb": f"{coulomb} N",
            "stribeck_velocity": f"{_log(rng, 5e-4, 5e-3)} m/s",
            "stribeck_exponent": 2,
            "bristle_stiffness": f"{bristle} N/m",
            "bristle_damping": f"{2 * rng.uniform(0.3, 1.0) * np.sqrt(bristle * mass)} N*s/m",
            "viscous": f"{coulomb * _log(rng, 0.1, 1.0) / top} N*s/m",
        },
        "bias": {"cart": f"{coulomb * rng.uniform(-0.2, 0.2)} N"},
        "controller": {"kind": "pid", "crossover": f"{_log(rng, 5.0, 30.0)} Hz", "alpha": 0.1, "beta": 2},
        "motion": {
            "kind": "there_and_back",
            "acceleration": f"{top / ramp} m/s^2",
            "acceleration_time": f"{ramp} s",
            "return_at": "1 s",
            "duration": "2 s",
        },
    }
    if jointed:
        share = rng.uniform(0.2, 0.5)
        tables["masses"] = {"cart": f"{mass * (1 - share)} kg", "stage": f"{mass * share} kg"}
        stiffness = mass * share * (2 * np.pi * _log(rng, 6.0, 20.0)) ** 2
        damping = 2 * rng.uniform(0.01, 0.05) * np.sqrt(stiffness * mass * share)
        tables["joint"] = {"stiffness": f"{stiffness} N/m", "damping": f"{damping} N*s/m", "stroke": "1 m"}
        tables["joint"] |= {"limiter_stiffness": "2e7 N/m", "limiter_damping": "100 N*s/m"}
    length = _log(rng, 2e-8, 5e-7)
    force = (mass * top / ramp + coulomb) * _log(rng, 1e-3, 2e-2)
    digits = length * rng.uniform(0.5, 3), force * rng.uniform(0.2, 2)
    stage = friso.Stage(name=f"machine {seed}", **tables)
    return Machine(stage, length, digits[0], force, digits[1], float(rng.choice([5e-4, 1e-3, 2e-3])), rng)


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    """Drawn evenly over the logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _masses(flat: dict) -> list[float]:
    return [flat[key] for key in ("masses.cart", "masses.stage") if key in flat]


def moved(stage: friso.Stage, **motion: str) -> friso.Stage:
    """The stage with another kind of motion."""
    return friso.Stage(**{**stage.as_written(), "motion": motion})


def moves(machine: Machine, bare: bool = False) -> Log:
    """Moves there and back of 10 s, quick and slow ones, and what follows them: settling, creep, or hunting."""
    flat = machine.flat
    top, ramp = flat["motion.acceleration"] * flat["motion.acceleration_time"], flat["motion.acceleration_time"]
    step = machine.sample_time / FINE
    time = np.arange(round(MOVE_TIME / step)) * step
    velocity = np.zeros(len(time))
    for start, share in MOVES:
        cruise = CRUISE if abs(share) > SLOW else 4 * CRUISE
        corners = start + np.array([0.0, ramp, ramp + cruise, 2 * ramp + cruise])
        velocity += np.interp(time, corners, [0.0, share * top, share * top, 0.0])
    return machine.followed("moves", cumulative_trapezoid(velocity, dx=step, initial=0.0), bare)


def steps(machine: Machine, bare: bool = False) -> Log:
    """Steps of the position with the cart held. That is linear, so the response to all steps is the sum of those to
    each."""
    held = machine.truth.replace({"masses.cart": f"{FIXED} kg", "controller.tuned_mass": f"{_tuned(machine)} kg"})
    length = STANDS * (len(STEPS) + 1)
    one = machine.log("steps", moved(held, kind="step", size=f"{STEP} m", duration=f"{length} s"), True)
    count, signals = round(STANDS / machine.sample_time), {}
    for role in ("reference", "position", "force"):
        total = np.zeros(count * (len(STEPS) + 1))
        for number, way in enumerate(STEPS, start=1):
            total[number * count :] += way * one[role][: len(total) - number * count]
        signals[role] = total
    return machine.measured(record("steps", machine.sample_time, **signals), bare)


def _tuned(machine: Machine) -> float:
    return sum(_masses(machine.flat))


def ramps(machine: Machine, stage: friso.Stage, speeds: Iterable[float], way: float, bare: bool = False) -> Log:
    """Constant speeds [m/s] of the reference over a way [m], one after the other, each from rest in its own segment."""
    logs = [
        machine.log("ramps", moved(stage, kind="ramp", velocity=f"{speed} m/s", duration=f"{way / abs(speed)} s"), bare)
        for speed in speeds
    ]
    return joined(logs)


def joined(logs: Sequence[Log]) -> Log:
    """Several logs as one, each of their segments apart."""
    lengths = [part.stop - part.start for log in logs for part in log.segments]
    signals = {role: np.concatenate([log[role] for log in logs]) for role in logs[0].signals}
    parts = tuple(slice(int(a), int(b)) for a, b in pairwise(np.cumsum([0, *lengths])))
    return replace(record(logs[0].name, logs[0].sample_time, **signals), segments=parts)


def creeping(machine: Machine, bare: bool = False) -> Log:
    """Slow ramps of a stage on its joint, forward and backward: the cart sticks and slips."""
    stage = machine.truth.replace({"controller.tuned_mass": f"{_tuned(machine)} kg"})
    speed = 0.3 * machine.flat["friction.stribeck_velocity"]
    return ramps(machine, stage, (speed, -speed), speed * CREEP_TIME, bare)


def break_aways(machine: Machine, bare: bool = False) -> Log:
    """Slow ramps of a reference that a weak controller follows: the force rises until the stage breaks away, again and
    again, at force rates that span more than a decade."""
    flat = machine.flat
    gains = {"kind": "pid", "kp": f"{flat['friction.static'] / 2e-3} N/m", "kd": "0 N*s/m", "ki": "0 N/(m*s)"}
    stage = friso.Stage(**{**machine.truth.as_written(), "controller": gains})
    logs = [ramps(machine, stage, (speed, -speed), 0.012, bare) for speed in PULLS]
    return joined(logs)


def speeds(machine: Machine, bare: bool = False) -> Log:
    """Constant speeds in either direction, from well above the Stribeck velocity to the machine's highest."""
    flat = machine.flat
    top = flat["motion.acceleration"] * flat["motion.acceleration_time"]
    slowest = max(4 * flat["friction.stribeck_velocity"], top / 10)
    every = np.geomspace(slowest, 1.5 * top, 4)
    return joined([ramps(machine, machine.truth, (speed, -speed), 1.5 * speed, bare) for speed in every])


def shaken(machine: Machine, bare: bool = False) -> Log:
    """A periodic reference (a multisine with random phases, ten periods of 1 s) that moves the stage well beyond its
    bristles."""
    flat, step = machine.flat, machine.sample_time / FINE
    time = np.arange(round(MOVE_TIME / step)) * step
    crossover = flat["controller.crossover"]
    lines = np.arange(2, round(4 * crossover))
    phases = machine.rng.uniform(0, 2 * np.pi, len(lines))
    reference = np.sum(np.sin(2 * np.pi * lines[:, None] * time + phases[:, None]) / lines[:, None], axis=0)
    top = flat["motion.acceleration"] * flat["motion.acceleration_time"]
    return machine.followed("shaken", reference * top / float(np.abs(np.gradient(reference, step)).max()), bare)
