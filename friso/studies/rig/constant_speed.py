"""Force at constant speed along the rail (thesis, Sec. 4.2.3, Fig. 21), what it does not show, and what more speeds
do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.frequency.friction import steady_force
from friso.identify.experiments import FrictionPosition, FrictionVelocity, friction_position, friction_velocity
from friso.rig.rail import friction_factors
from friso.rig.run import run
from friso.rig.task import legs
from friso.stage import Stage
from friso.studies.rig.outcome import Outcome, Progress, RigLog, rig_log
from friso.studies.rig.sizes import freed, interval, locked, moving_mass, pace, travel

WAY = 5 / 3
"""Way over that of the stage's own motion: 150 mm for 90 mm (Sec. 4.2.3)."""

DURATIONS = (480.0, 120.0)
"""Periods of the crossover that the way takes: 2.5 and 10 mm/s on the thesis's rig."""

MANY = tuple(float(periods) for periods in np.geomspace(480.0, 20.0, 10))
"""The same for ten speeds, 2.5 to 60 mm/s: our choice."""

STANDS, SAMPLES = 16.0, 62.5
"""Periods for which the reference stands between passes, and samples of the log per period (2 ms): our choice."""


@dataclass(frozen=True)
class Passes:
    """What a log shows with the joint as `name` says: along the place, and against the velocity; and the dynamic
    friction at the two speeds as it truly is on average over the way [N], shape (2,)."""

    name: str
    log: RigLog
    place: FrictionPosition
    velocity: FrictionVelocity
    true: np.ndarray


@dataclass(frozen=True)
class ManySpeeds:
    """What passes at many speeds with the joint locked show, and the dynamic friction at the magnitudes of their
    velocities as it truly is on average over the way [N], shape (passes,)."""

    log: RigLog
    velocity: FrictionVelocity
    true: np.ndarray


@dataclass(frozen=True)
class ConstantSpeed:
    """The two speeds [m/s] of the thesis, the passes at them with the joint free and locked, and those at many."""

    speeds: tuple[float, ...]
    cases: tuple[Passes, ...]
    many: ManySpeeds


def run_experiment(stage: Stage, seed: int, progress: Progress) -> Outcome:
    """Passes at two speeds there and back, the joint free and locked, and at many with it locked. Raises StageError
    for a stage without joint."""
    cases = []
    for number, (name, each) in enumerate((("free", freed(stage)), ("locked", locked(stage)))):
        progress(number, 3, f"constant speed, joint {name}")
        cases.append(_passes(name, each, seed))
    progress(2, 3, "many speeds, joint locked")
    log = passes_log("many_speeds", locked(stage), seed, MANY)
    velocity = friction_velocity(log.log, moving_mass(stage))
    many = ManySpeeds(log, velocity, _true(log, np.abs(velocity.velocities)))
    progress(3, 3, "")
    logs = (*(each.log for each in cases), log)
    return Outcome("constant-speed", stage, seed, logs, ConstantSpeed(speeds(stage), tuple(cases), many))


def speeds(stage: Stage) -> tuple[float, ...]:
    """The speeds [m/s], the slow one first."""
    low, high = travel(stage)
    return tuple(WAY * (high - low) * pace(stage) / periods for periods in DURATIONS)


def passes_log(name: str, stage: Stage, seed: int, durations: tuple[float, ...]) -> RigLog:
    """The log of passes there and back, which take these `durations` in periods of the crossover."""
    low, high = travel(stage)
    way, period, parts = WAY * (high - low), 1 / pace(stage), [(0.0, STANDS / pace(stage))]
    for periods in durations:
        for sign in (1.0, -1.0):
            parts += [(sign * way / (periods * period), periods * period), (0.0, STANDS * period)]
    (recorded,) = run(stage, legs(low, parts), [seed], interval(stage, period / SAMPLES))
    return rig_log(recorded, 0, name, "constant-speed", stage, seed)


def _passes(name: str, stage: Stage, seed: int) -> Passes:
    log, mass = passes_log(name, stage, seed, DURATIONS), moving_mass(stage)
    place = friction_position(log.log, mass, pace(stage))
    return Passes(name, log, place, friction_velocity(log.log, mass), _true(log, np.array(speeds(stage))))


def _true(log: RigLog, velocities: np.ndarray) -> np.ndarray:
    """Mean dynamic friction [N] at velocities [m/s], over the places where the cart went."""
    flat, places = log.stage.flat(), log.true["cart_position"]
    factors = friction_factors(flat, np.linspace(places.min(), places.max(), 1000)).mean(axis=1)
    levels = zip(("friction.static", "friction.coulomb"), factors, strict=True)
    along = {key: flat[key] * factor for key, factor in levels if key in flat}
    return steady_force({**flat, **along}, velocities, forward=True)
