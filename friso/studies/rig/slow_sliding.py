"""Run slow sliding with a locked joint, so slow that no controller holds a constant speed.

At such speeds friction falls steeply. Short, finely logged passes follow those of `many_speeds`, at speeds at the limit
of steady motion: the motion swings through the whole falling branch of the friction curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from friso.equations.conditions import anywhere, level_under_conditions
from friso.equations.rail import friction_factors
from friso.identification.experiments.slow_sliding import MassOnBristles, SlowSliding, stribeck_from_slow_sliding
from friso.identification.readings.at_bearing import machine_between
from friso.identification.readings.passes import passes
from friso.stage import Stage
from friso.stage.transmission import moving_mass
from friso.studies.rig.many_speeds import controller_speeds
from friso.studies.rig.outcome import RigLog, rig_log
from friso.studies.rig.sizes import interval, pace, travel
from friso.virtual_rig.run import as_built_keys, run
from friso.virtual_rig.task import legs

UNSTEADY, STEADY, PLACES = 2, 1, 8
"""Numbers of speeds and places.

UNSTEADY is the number of the fastest speeds that were not steady, and STEADY that of the slowest that were. PLACES is
the number of places along the travel, because each log shows the friction of a few millimetres.
"""

APART = 4
"""Number of speeds skipped at a time, from the lowest on, if motion was steady at all speeds."""

POINTS = 500
"""Number of points along a way at which its mean friction is computed."""

LASTS, STANDS, SAMPLES = 3.0, 1.0, 1000.0
"""Periods of the stage's crossover for which each speed lasts, and for the stand before.

SAMPLES are those of the log per period. On the thesis's rig these are 0.4 s, 0.125 s and 0.1 ms.
"""


@dataclass(frozen=True)
class Slow:
    """Log of slow sliding at a place, and its evaluation with true mass and bristles.

    `true` has the true mean Coulomb and static friction [N] over the log's way, shape (2,).
    """

    log: RigLog
    result: SlowSliding
    true: np.ndarray


def slow_sliding(stage: Stage, passed: Sequence[RigLog], seed: int) -> tuple[Slow, ...]:
    """Run slow sliding of a stage, and evaluate its logs; the joint is locked, if there is one.

    `passed` are the logs of passes at many speeds.
    """
    return tuple(Slow(log, _analysed(log), _true(log)) for log in slow_sliding_logs(stage, passed, seed))


def slow_sliding_logs(stage: Stage, passed: Sequence[RigLog], seed: int) -> tuple[RigLog, ...]:
    """Return logs of slow sliding, one for each place.

    `passed` are the logs of passes at many speeds, which decide the speeds. There are none if friction lacks bristles
    or a Stribeck curve, or if no loop was stable.
    """
    speeds, quick = _edge(passed), passed[0].stage
    falling_bristles = {"friction.bristle_stiffness", "friction.stribeck_velocity"} <= quick.flat().keys()
    if not falling_bristles or all(run_passes.failure for run_passes in passed):
        return ()
    period = 1 / pace(stage)
    parts = [(0.0, STANDS * period), *((float(sign * speed), LASTS * period) for speed in speeds for sign in (1, -1))]
    logs = []
    for number, low in enumerate(np.linspace(*travel(stage), PLACES)):
        (recorded,) = run(quick, legs(low, parts), [seed + number], interval(quick, period / SAMPLES))
        logs.append(rig_log(recorded, 0, f"slow_sliding_{number + 1}", "slow-sliding", quick, seed + number))
    return tuple(logs)


def _edge(passed: Sequence[RigLog]) -> np.ndarray:
    """Return rising speeds [m/s] on both sides of the limit of steady motion.

    `passed` are the logs of passes at many speeds. If all passes were steady, some of the lowest speeds are returned.
    """
    speeds = controller_speeds(passed[0].stage)
    unsteady = {
        int(np.argmin(np.abs(np.log(speeds / abs(stretch.velocity)))))
        for log in passed
        if not log.failure
        for stretch in passes(log.log)
        if not stretch.steady
    }
    if not unsteady:
        return speeds[::APART][: UNSTEADY + STEADY]
    fastest = max(unsteady)
    return speeds[max(fastest + 1 - UNSTEADY, 0) : fastest + 1 + STEADY]


def _analysed(log: RigLog) -> SlowSliding:
    flat = as_built_keys(log.stage)
    stiffness, damping = flat["friction.bristle_stiffness"], flat.get("friction.bristle_damping", 0.0)
    mass, exponent = moving_mass(log.stage.flat()), flat["friction.stribeck_exponent"]
    bristles = MassOnBristles((mass, 0.0), (stiffness, 0.0), (damping, 0.0), exponent)
    return stribeck_from_slow_sliding(log.log, machine_between(flat), bristles)


def _true(log: RigLog) -> np.ndarray:
    places = log.true.get("cart_position", log.true["position"])
    places_between = np.linspace(places.min(), places.max(), POINTS) if len(places) else np.full(1, np.nan)
    flat = anywhere(log.stage.flat())
    levels = [level_under_conditions(flat, name) for name in ("coulomb", "static")]
    return levels * friction_factors(flat, places_between).mean(axis=1)[::-1]
