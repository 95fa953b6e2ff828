"""Friction force at constant speed along the rail.

Thesis, Sec. 4.2.3, Fig. 21. More speeds than the thesis's two show friction over velocity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.identification.readings.friction_position import FrictionPosition, friction_position
from friso.identification.readings.friction_velocity import FrictionVelocity, friction_velocity
from friso.progress import Progress
from friso.stage import Stage
from friso.stage.tables import moving_mass
from friso.studies.rig.many_speeds import (
    SAMPLES_PER_PERIOD,
    STANDING_TIME,
    ManySpeeds,
    Slow,
    many_speeds,
    mean_friction,
    slow_sliding,
)
from friso.studies.rig.outcome import (
    Outcome,
    RigLog,
    freed,
    interval,
    locked_stage,
    longest_travel,
    pace,
    rig_log,
    stopped,
    travel,
)
from friso.virtual_rig.run import run
from friso.virtual_rig.task import legs

PASS_DURATIONS = (480.0, 120.0)
"""Durations of the two passes in periods of the crossover. On the thesis's rig they give 2.5 and 10 mm/s."""


@dataclass(frozen=True)
class Passes:
    """Results of passes at constant speed along the rail, with the joint "free" or "locked".

    Fields are the log, and friction over position and over velocity. `true` is the true mean dynamic friction [N] over
    the way, at the two speeds, shape (2,).
    """

    name: str
    log: RigLog
    place: FrictionPosition
    velocity: FrictionVelocity
    true: np.ndarray


@dataclass(frozen=True)
class ConstantSpeedResult:
    """Results of the experiment at constant speed.

    `speeds` [m/s] are the two speeds of the thesis, and `cases` the passes at these speeds with the joint free and
    locked. `many` are passes at many speeds. `slow` is the slow sliding, empty if friction has no bristles.
    """

    speeds: tuple[float, ...]
    cases: tuple[Passes, ...]
    many: ManySpeeds
    slow: tuple[Slow, ...]


def run_experiment(stage: Stage, seed: int, progress: Progress) -> Outcome:
    """Run passes at two speeds with the joint free and locked, then many speeds with it locked.

    Slow sliding follows, also with the joint locked. Raises InputError for a stage without joint.
    """
    cases = []
    for number, (name, machine) in enumerate((("free", freed(stage)), ("locked", locked_stage(stage)))):
        progress(number, 4, f"constant speed, joint {name}")
        cases.append(_passes(name, machine, seed))
    progress(2, 4, "many speeds, joint locked, faster controller")
    many = many_speeds(locked_stage(stage), seed)
    progress(3, 4, "slow sliding, joint locked")
    slow = slow_sliding(locked_stage(stage), [place.log for place in many.places], seed)
    progress(4, 4, "")
    logs = tuple(recorded.log for recorded in (*cases, *many.places, *slow))
    return Outcome(
        "constant-speed", stage, seed, logs, ConstantSpeedResult(pass_speeds(stage), tuple(cases), many, slow)
    )


def pass_speeds(stage: Stage) -> tuple[float, ...]:
    """Return the two speeds [m/s] of the thesis for a stage, the slow one first."""
    return tuple(longest_travel(stage) * pace(stage) / periods for periods in PASS_DURATIONS)


def _passes(name: str, stage: Stage, seed: int) -> Passes:
    log, mass = passes_log(name, stage, seed), moving_mass(stage.flat())
    cart = log.true["cart_position"]
    if not len(cart):
        raise stopped(log)
    place = friction_position(log.log, mass, pace(stage))
    true = mean_friction(stage, np.array(pass_speeds(stage)), np.linspace(cart.min(), cart.max(), 1000))
    return Passes(name, log, place, friction_velocity(log.log, mass), true)


def passes_log(name: str, stage: Stage, seed: int) -> RigLog:
    """Return the log of passes to and fro at both speeds of the thesis.

    `name` says whether the joint of the stage is free or locked.
    """
    period, parts = 1 / pace(stage), [(0.0, STANDING_TIME / pace(stage))]
    for speed, periods in zip(pass_speeds(stage), PASS_DURATIONS, strict=True):
        for velocity in (speed, -speed):
            parts += [(velocity, periods * period), (0.0, STANDING_TIME * period)]
    task = legs(travel(stage)[0], parts)
    (recorded,) = run(stage, task, [seed], interval(stage, period / SAMPLES_PER_PERIOD))
    return rig_log(recorded, 0, name, "constant-speed", stage, seed)
