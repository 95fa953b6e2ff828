"""Run passes at many speeds with a locked joint: the whole curve of friction over velocity.

Where friction falls with speed a slow loop sticks and slips, so its passes show no steady friction. A faster controller
damps more, so a few crossovers are tried, and the fastest one at which most passes are steady is taken. All passes
cover one stretch of the rail, so that they differ in speed and not in place. Fast passes begin before the stretch and
end behind it, if necessary beyond the stage's own travel, because the rig's rail has no ends.

Slow sliding follows where no controller holds a constant speed, and friction falls steeply. Short, finely logged passes
at speeds at the limit of steady motion swing through the whole falling branch of the friction curve.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.equations.conditions import anywhere, level_under_conditions
from friso.equations.rail import friction_factors
from friso.frequency.system import steady_force
from friso.identification.experiments.slow_sliding import MassOnBristles, SlowSliding, stribeck_from_slow_sliding
from friso.identification.readings.at_bearing import machine_between
from friso.identification.readings.friction_velocity import FrictionVelocity, friction_velocity
from friso.identification.readings.motion_events import passes
from friso.stage import Stage
from friso.stage.tables import moving_mass
from friso.virtual_rig.run import as_built_keys, run
from friso.virtual_rig.task import legs
from friso_thesis.studies.rig.outcome import RigLog, interval, longest_travel, pace, quicker, rig_log, travel

FASTER_CROSSOVERS = (4.0, 3.0, 2.0, 1.5, 1.0)
"""Crossovers over the stage's own that are tried in turn (friso's choice)."""

SPEED_COUNT, SPEED_RATIO = 14, 500.0
"""Number of speeds, and ratio of highest to lowest: 0.48 to 240 mm/s on the thesis's rig, at four times its crossover.
"""

CURVE_POINTS = 200
"""Number of points of the true curve."""

SHORTEST_WAY = 20.0
"""Periods of the crossover for the longest way at the highest speed."""

STEADY_PASS_SHARE = 0.5
"""Least fraction of steady passes at an accepted crossover."""

SHARED_STRETCH, SHARED_PLACES = 1 / 8, 3
"""Stretch that all passes cover, as a fraction of the longest, and number of places along the travel (friso's
choice)."""

STANDING_TIME, SAMPLES_PER_PERIOD = 16.0, 62.5
"""Periods of the crossover for which the reference stands between passes, and samples of the log per period of the
stage's own crossover (2 ms)."""


@dataclass(frozen=True)
class PlaceOnRail:
    """Passes at many speeds over one stretch of the rail.

    Fields are the log, and `velocity`, its friction over velocity. `true` is the true mean friction [N] over the
    stretch, with a cable's drag, at `speeds` [m/s], both of shape (n,).
    """

    log: RigLog
    velocity: FrictionVelocity
    speeds: np.ndarray
    true: np.ndarray

    @property
    def friction(self) -> np.ndarray:
        """Return the friction [N] of the steady passes, shape (passes,), without constant forces.

        A constant force, such as the pull of a cable, does not turn with the motion.
        """
        bias = self.velocity.bias.value if self.velocity.bias.determined else 0.0
        return np.abs(self.velocity.forces - bias)


@dataclass(frozen=True)
class ManySpeeds:
    """The crossover [Hz] of the passes, and their results at each place."""

    crossover: float
    places: tuple[PlaceOnRail, ...]


def many_speeds(stage: Stage, seed: int) -> ManySpeeds:
    """Run passes at many speeds, and return their results at each place.

    The stage's joint is locked, or there is none.
    """
    logs, places = many_speeds_logs(stage, seed), []
    for log, begin in zip(logs, _begins(stage), strict=True):
        velocity = friction_velocity(log.log, moving_mass(stage.flat()))
        low, *_, high = controller_speeds(log.stage)
        speeds = np.geomspace(low, high, CURVE_POINTS)
        ends = velocity.places if len(velocity.velocities) else (begin, begin + SHARED_STRETCH * longest_travel(stage))
        drag = log.stage.flat().get("cable.drag", 0.0)
        true = mean_friction(log.stage, speeds, np.linspace(*ends, 1000)) + drag * speeds
        places.append(PlaceOnRail(log, velocity, speeds, true))
    return ManySpeeds(pace(logs[0].stage), tuple(places))


def many_speeds_logs(stage: Stage, seed: int) -> tuple[RigLog, ...]:
    """Return logs of passes at the fastest crossover at which most are steady, one per place.

    If there is no such crossover, the one with the most steady passes is taken.
    """
    tried = []
    for factor in FASTER_CROSSOVERS:
        quick = stage.with_numbers(quicker(stage, factor))
        logs = tuple(_log(quick, pace(stage), n, low, seed + n) for n, low in enumerate(_begins(stage)))
        steady = sum(stretch.steady for log in logs if not log.failure for stretch in passes(log.log))
        if steady > STEADY_PASS_SHARE * len(logs) * 2 * SPEED_COUNT:
            return logs
        tried.append((steady, logs))
    return max(tried, key=lambda candidate: candidate[0])[1]


def mean_friction(stage: Stage, speeds: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the mean dynamic friction [N] over rail `places` [m], at speeds [m/s], shape (n,)."""
    flat: Mapping[str, Any] = anywhere(stage.flat())
    levels = zip(("friction.static", "friction.coulomb"), friction_factors(flat, places).mean(axis=1), strict=True)
    along = {key: flat[key] * factor for key, factor in levels if key in flat}
    return steady_force({**flat, **along}, speeds, forward=True)


def _begins(stage: Stage) -> np.ndarray:
    """Return the positions [m] at which the stretches of rail begin, (SHARED_PLACES,)."""
    low, high = travel(stage)
    return np.linspace(low, high - SHARED_STRETCH * longest_travel(stage), SHARED_PLACES)


def controller_speeds(stage: Stage) -> np.ndarray:
    """Return the speeds [m/s] of the passes, shape (`SPEED_COUNT`,), rising.

    The stage is one whose controller was made faster.
    """
    top = longest_travel(stage) * pace(stage) / SHORTEST_WAY
    return np.geomspace(top / SPEED_RATIO, top, SPEED_COUNT)


def _log(stage: Stage, own_pace: float, number: int, low: float, seed: int) -> RigLog:
    """Return the log of passes over a stretch from `low` [m], in order of rising speed.

    `own_pace` is the crossover [Hz] of the user's stage, and `number` the index of the stretch.
    """
    period, shared = 1 / pace(stage), SHARED_STRETCH * longest_travel(stage)
    parts, before = [(0.0, STANDING_TIME * period)], 0.0
    for speed in controller_speeds(stage):
        run_up = max(0.0, speed * SHORTEST_WAY * period - shared) / 2
        for span in (shared + run_up + before, -(shared + 2 * run_up)):
            parts += [(float(np.sign(span) * speed), abs(span) / speed), (0.0, STANDING_TIME * period)]
        before = run_up
    (recorded,) = run(stage, legs(low, parts), [seed], interval(stage, 1 / (SAMPLES_PER_PERIOD * own_pace)))
    return rig_log(recorded, 0, f"many_speeds_{number + 1}", "constant-speed", stage, seed)


UNSTEADY_SPEEDS, STEADY_SPEEDS, SLOW_PLACES = 2, 1, 8
"""Numbers of speeds and places.

UNSTEADY_SPEEDS is the number of the fastest speeds that were not steady, and STEADY_SPEEDS that of the slowest that
were. SLOW_PLACES is the number of places along the travel, because each log shows the friction of a few millimetres.
"""

SPEED_STRIDE = 4
"""Every fourth speed is run, from the lowest on, if motion was steady at all speeds."""

WAY_POINTS = 500
"""Number of points along a way at which its mean friction is computed."""

SPEED_DURATION, SLOW_STANDS, SLOW_SAMPLES = 3.0, 1.0, 1000.0
"""Periods of the stage's crossover for which each speed lasts, and for the stand before.

SLOW_SAMPLES are those of the log per period. On the thesis's rig these are 0.4 s, 0.125 s and 0.1 ms.
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
    parts = [
        (0.0, SLOW_STANDS * period),
        *((float(sign * speed), SPEED_DURATION * period) for speed in speeds for sign in (1, -1)),
    ]
    logs = []
    for number, low in enumerate(np.linspace(*travel(stage), SLOW_PLACES)):
        (recorded,) = run(quick, legs(low, parts), [seed + number], interval(quick, period / SLOW_SAMPLES))
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
        return speeds[::SPEED_STRIDE][: UNSTEADY_SPEEDS + STEADY_SPEEDS]
    fastest = max(unsteady)
    return speeds[max(fastest + 1 - UNSTEADY_SPEEDS, 0) : fastest + 1 + STEADY_SPEEDS]


def _analysed(log: RigLog) -> SlowSliding:
    flat = as_built_keys(log.stage)
    stiffness, damping = flat["friction.bristle_stiffness"], flat.get("friction.bristle_damping", 0.0)
    mass, exponent = moving_mass(log.stage.flat()), flat["friction.stribeck_exponent"]
    bristles = MassOnBristles((mass, 0.0), (stiffness, 0.0), (damping, 0.0), exponent)
    return stribeck_from_slow_sliding(log.log, machine_between(flat), bristles)


def _true(log: RigLog) -> np.ndarray:
    places = log.true.get("cart_position", log.true["position"])
    places_between = np.linspace(places.min(), places.max(), WAY_POINTS) if len(places) else np.full(1, np.nan)
    flat = anywhere(log.stage.flat())
    levels = [level_under_conditions(flat, name) for name in ("coulomb", "static")]
    return levels * friction_factors(flat, places_between).mean(axis=1)[::-1]
