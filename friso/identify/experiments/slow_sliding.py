"""Friction that falls with the speed, from slow motion that swings, or sticks and slips.

Where friction falls steeply no controller holds a constant speed, and `friction_velocity` has nothing to read. The
motion itself goes through all those speeds: LuGre's bristles, dz/dt = v - sigma_0 |v| z / g(v) with
g = F_c + (F_s - F_c) exp(-(v/v_s)^2) (Astrom, Canudas de Wit 2008, doi:10.1109/MCS.2008.929425), follow from the motion
that was measured, with no loop to be simulated, and F_c, F_s, v_s from the force they have to make up. Mass, stiffness
and damping of the bristles come from other experiments, see `presliding`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from friso.identify.estimate import Estimate
from friso.identify.experiments.at_bearing import Between, at_bearing, rate_of
from friso.identify.experiments.common import (
    BLOCKS,
    LINEARITY,
    Mean,
    by_t,
    channel,
    deflections,
    jackknife,
    low_pass,
    reach,
)
from friso.identify.logs.log import Log

BELOW_MODE, CHECKED, MOTION = 1 / 3, 0.7, 8.0
"""Low-pass of the equation over the frequency of the structure's mode, at most; that of a second fit by which the first
one is checked, and of the motion itself, both over that of the first."""

MOST, FEWEST = 60_000, 2000
"""Samples that are used at most, and that are needed."""

LEAST, SAMPLED = 20, 0.2
"""Periods of the low-pass that a record lasts at least, and the highest frequency of the motion over the samples'."""

STARTS, BOUNDS = (0.2, 0.5), (0.01, 10.0)
"""Stribeck velocities from which the fit starts, over the RMS velocity; and bounds of all that is fitted, over that and
over the mean friction."""

STEP = 1e-3
"""Of the logarithms, for derivatives."""

EXPLAINED = 0.2
"""Share of the friction's standard deviation that the model may leave unexplained."""

REACH = 1.5
"""Stribeck velocities which the motion has to reach: at this one a tenth of the fall is left."""

NAMES = ("friction.coulomb", "friction.static", "friction.stribeck_velocity")
UNITS = ("N", "N", "m/s")
METHOD = "LuGre in the motion of slow sliding"
BRISTLES = (
    "mass and bristles have to be known: give a log of small motion before sliding too, --as presliding, and one that "
    "shows the mass"
)


@dataclass(frozen=True)
class Known:
    """Moving mass [kg], stiffness [N/m] and damping [N s/m] of the bristles as other experiments show them, each with
    the half-width of its interval."""

    mass: tuple[float, float]
    stiffness: tuple[float, float]
    damping: tuple[float, float]

    def off(self) -> list[Known]:
        """With each of the three in turn at the end of its interval."""
        return [replace(self, **{key: (sum(value), value[1])}) for key, value in vars(self).items()]


@dataclass(frozen=True)
class SlowSliding:
    """Coulomb and static friction [N] and Stribeck velocity [m/s], and the `correlation` of the three, shape (3, 3).
    Over time [s], shape (n,): the velocity [m/s] of the body on the bearing, its friction [N], low-passed, and that of
    the model (empty where there is none); and the share of the friction's standard deviation that it leaves
    unexplained."""

    estimates: tuple[Estimate, ...]
    correlation: np.ndarray
    time: np.ndarray
    velocity: np.ndarray
    friction: np.ndarray
    model: np.ndarray
    unexplained: float


@dataclass(frozen=True)
class _Motion:
    """Interval [s] of the samples; position [m] and velocity [m/s] of the body on the bearing and force [N] less
    inertia and viscous friction, shape (n,); low-pass [Hz], and the samples which its ends do not touch."""

    interval: float
    position: np.ndarray
    velocity: np.ndarray
    friction: np.ndarray
    cutoff: float
    inside: slice

    def passed(self, signal: np.ndarray) -> np.ndarray:
        return low_pass(signal, self.interval, self.cutoff)[self.inside]


def stribeck_from_slow_sliding(log: Log, between: Between, known: Known | None) -> SlowSliding:
    """Static and Coulomb friction and Stribeck velocity from a log of position and force in which the bearing slides
    slowly, there and back. Of a log with gaps the longest stretch is used, and of that no more than `MOST` samples.

    A joint is held. The intervals contain what a lower low-pass changes, what the intervals of the known mass and
    bristles do, and the share of the friction that is left unexplained. Raises StageError for missing channels.
    """
    part = slice(log.longest.start, min(log.longest.stop, log.longest.start + MOST))
    position, force = channel(log, "position")[part], channel(log, "force")[part]
    if known is None:
        return _nothing(BRISTLES)
    if len(position) < FEWEST:
        return _nothing(f"the record has {len(position)} samples: {FEWEST} are needed")
    highest = reach(position, log.sample_time)
    cutoff = min(highest, BELOW_MODE * between.mode.frequency) if between.mode else highest
    if not cutoff * len(position) * log.sample_time > LEAST:
        return _nothing("the motion does not stand out of the noise")
    if highest * log.sample_time > SAMPLED:
        needed = SAMPLED / highest
        return _nothing(f"the motion goes up to {highest:.3g} Hz: one sample in {needed:.3g} s or less is needed")
    signals = (log.time[part], position, force, between)
    motion = _motion(*signals, known.mass[0], cutoff)
    best, model = _fitted(motion, known, _starts(motion))
    jacobian, residual = _derivatives(motion, known, best), _residual(motion, known, best)
    shifts = [_fitted(_motion(*signals, known.mass[0], CHECKED * cutoff), known, [best])[0] - best]
    for other in known.off():
        changed = _residual(_motion(*signals, other.mass[0], cutoff), other, best) - residual
        shifts.append(-np.linalg.lstsq(jacobian, changed, rcond=None)[0])
    friction, velocity = motion.passed(motion.friction), motion.passed(motion.velocity)
    left = float(residual.std() / friction.std())
    found, correlation = _estimates(best, jackknife(jacobian, -residual)[:3, :3], np.array(shifts)[:, :3], left)
    time = log.time[part][motion.inside]
    return SlowSliding(_judged(found, left, velocity), correlation, time, velocity, friction, model, left)


def _nothing(why: str) -> SlowSliding:
    none = np.empty(0)
    return SlowSliding(_unknown(why), np.eye(3), none, none, none, none, np.nan)


def _unknown(why: str) -> tuple[Estimate, ...]:
    return tuple(Estimate.unknown(*each, METHOD, why) for each in zip(NAMES, UNITS, strict=True))


def _motion(
    time: np.ndarray, position: np.ndarray, force: np.ndarray, between: Between, mass: float, cutoff: float
) -> _Motion:
    interval = float(time[1] - time[0])
    seen = low_pass(position - position[0], interval, MOTION * cutoff)
    body, force = at_bearing(time, seen, force, between, mass)
    velocity = rate_of(time, body)
    carried = mass * (1 - between.beyond) * rate_of(time, velocity) + between.viscous * velocity
    edge = int(2 / (cutoff * interval))
    return _Motion(interval, body, velocity, force - carried, cutoff, slice(edge, len(time) - edge))


def _starts(motion: _Motion) -> list[np.ndarray]:
    """Logarithms of Coulomb friction [N], of what static friction is more [N], and of the Stribeck velocity [m/s], and
    the constant force [N], from which the fit starts."""
    level, speed = float(np.abs(motion.friction).mean()), float(motion.velocity.std())
    return [np.array([np.log(level), np.log(level / 2), np.log(share * speed), 0.0]) for share in STARTS]


def _bounds(motion: _Motion) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest parameters."""
    level, speed = float(np.abs(motion.friction).mean()), float(motion.velocity.std())
    low, high = (np.log(np.array([level, level, speed]) * by) for by in BOUNDS)
    return np.append(low, -level), np.append(high, level)


def _model(motion: _Motion, known: Known, p: np.ndarray) -> np.ndarray:
    """Friction [N] at the low-pass, of bristles in the motion."""
    moves = np.diff(motion.position)
    coulomb, more, stribeck = np.exp(p[:3])
    level = coulomb + more * np.exp(-((moves / motion.interval / stribeck) ** 2))
    z = deflections(moves, level / known.stiffness[0])
    rate = np.gradient(z, motion.interval)
    return motion.passed(known.stiffness[0] * z + known.damping[0] * rate) + p[3]


def _residual(motion: _Motion, known: Known, p: np.ndarray) -> np.ndarray:
    return _model(motion, known, p) - motion.passed(motion.friction)


def _derivatives(motion: _Motion, known: Known, p: np.ndarray) -> np.ndarray:
    """Of the residual by the parameters, shape (n, 4)."""
    steps = STEP * np.eye(len(p))
    return np.stack([(_model(motion, known, p + e) - _model(motion, known, p - e)) / (2 * STEP) for e in steps], axis=1)


def _fitted(motion: _Motion, known: Known, starts: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The parameters that fit best from any start, and the friction they make [N]."""
    target = motion.passed(motion.friction)
    scale = float(target.std()) or 1.0

    def off(p: np.ndarray) -> np.ndarray:
        return (_model(motion, known, p) - target) / scale

    size, bounds = (0.1, 0.1, 0.1, scale), _bounds(motion)
    inside = [np.clip(start, *bounds) for start in starts]
    fits = [least_squares(off, start, bounds=bounds, x_scale=size, diff_step=STEP) for start in inside]
    best = min(fits, key=lambda fit: fit.cost).x
    return best, _model(motion, known, best)


def _estimates(
    best: np.ndarray, covariance: np.ndarray, shifts: np.ndarray, left: float
) -> tuple[tuple[Estimate, ...], np.ndarray]:
    """The three quantities and their correlation, by the logarithms that were fitted, their covariance, shape (3, 3),
    and `shifts` of them, shape (m, 3), and the share of the friction that is `left`."""
    coulomb, more, stribeck = np.exp(best[:3])
    values = (coulomb, coulomb + more, stribeck)
    turned = np.array([[coulomb, 0, 0], [coulomb, more, 0], [0, 0, stribeck]])  # derivatives by the logarithms
    covariance, shifts = turned @ covariance @ turned.T, shifts @ turned.T
    whole = covariance + shifts.T @ shifts / 4
    size = np.sqrt(np.maximum(np.diag(whole), np.finfo(float).tiny))
    found = []
    for i, (name, unit) in enumerate(zip(NAMES, UNITS, strict=True)):
        mean = Mean(float(values[i]), float(covariance[i, i] ** 0.5), BLOCKS - 1)
        systematic = float(np.abs(shifts[:, i]).sum()) + (left + LINEARITY) * mean.value
        found.append(by_t(name, unit, mean, METHOD, systematic, systematic))
    return tuple(found), whole / np.outer(size, size)


def _judged(found: tuple[Estimate, ...], left: float, velocity: np.ndarray) -> tuple[Estimate, ...]:
    """What was found as far as the motion shows it, whose model leaves a share of the friction unexplained."""
    coulomb, static, stribeck = found
    fastest = float(np.abs(velocity).max())
    if left > EXPLAINED:
        return _unknown(f"{left:.0%} of the friction are not explained by LuGre's bristles")
    if not coulomb.low > 0:
        return _unknown("the force does not show friction")
    if fastest < REACH * stribeck.value:
        return _unknown(f"no faster than {fastest:.3g} m/s, the motion does not show where friction ceases to fall")
    if not (static.low > coulomb.value and stribeck.low > 0):
        why = "no rise of friction towards rest shows"
        return coulomb, *(Estimate.unknown(each.name, each.unit, METHOD, why) for each in (static, stribeck))
    return found
