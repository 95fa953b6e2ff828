"""Read friction over velocity from stretches of constant velocity: Coulomb, viscous and, if it shows, Stribeck."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from friso.errors import InputError
from friso.identification.estimate import Estimate
from friso.identification.inverse_model import inverse_model
from friso.identification.logs.log import Log
from friso.identification.readings.common import Mean, by_direction, by_t, t_value
from friso.identification.readings.passes import Pass, on_common_places, passes, places_of
from friso.identification.readings.settings import settings
from friso.identification.readings.stribeck import FittedStribeck, Forces, Possible, stribeck_fit
from friso.intervals import NORMAL_COVERAGE

METHOD = "mean forces over stretches of constant velocity"


@dataclass(frozen=True)
class Direction:
    """Friction over speed in one direction, or in both together.

    Fields are Coulomb [N], viscous [N s/m] and static [N] friction, Stribeck velocity [m/s] and exponent; the
    covariance of the fitted ones in this order (SI), shape (0, 0), (2, 2), (4, 4) or (5, 5); and the Stribeck `curve`,
    None if a straight line fits as well.
    """

    coulomb: Estimate
    viscous: Estimate
    static: Estimate
    stribeck_velocity: Estimate
    stribeck_exponent: Estimate
    covariance: np.ndarray
    curve: FittedStribeck | None = None


@dataclass(frozen=True)
class FrictionVelocity:
    """Friction over speed, in both directions, with its data.

    The `directions` "forward" and "backward" include the constant force in their Coulomb friction; `both` excludes it,
    and `bias` [N] is the constant force on the body as in the stage file.

    Per steady stretch, shape (n,), there are the velocity [m/s], and the mean force [N] without inertia with the
    half-width of its 95 % interval [N]. `unsteady`, shape (m,), has the velocities of unsteady stretches; `places` [m]
    are the ends of the way over which steady stretches were read. `mass` [kg] is that of the inertia.
    """

    directions: Mapping[str, Direction]
    both: Direction
    bias: Estimate
    velocities: np.ndarray
    forces: np.ndarray
    half_widths: np.ndarray
    unsteady: np.ndarray
    places: tuple[float, float]
    mass: float
    warnings: tuple[str, ...]


def friction_velocity(log: Log, mass: float | None = None, exponent: float | None = None) -> FrictionVelocity:
    """Read friction over speed from stretches of constant velocity, over their common places.

    Stretches stay whole if their common places are too few. Inertia, `mass` [kg] times remaining acceleration, is
    subtracted; a mass that is not given is read from the log, and its error counts. The Stribeck curve has the
    `exponent` of the stage unless the forces refute it; otherwise all intervals allow for every exponent that the
    forces permit. Quantities that the speeds cannot show are unknown, with the reason. Raises InputError for missing
    channels.
    """
    stretches = passes(log)
    used = on_common_places(log, [stretch for stretch in stretches if stretch.steady])
    moved, off = _mass(log) if mass is None else (mass, 0.0)
    velocities, forces, errors, swings = np.array([_row(stretch, moved, off) for stretch in used]).reshape(-1, 4).T
    size = np.abs(forces)
    if used:
        linear = np.full_like(size, settings.linearity_of_sensors * size.max())
        errors = np.linalg.norm([errors, linear, swings**2 * np.ptp(size)], axis=0)
    unsteady = np.array([stretch.velocity for stretch in stretches if not stretch.steady])
    sides = {
        words: _direction(velocities[m], np.sign(velocities[m]) * forces[m], errors[m], words, exponent)
        for words, m in by_direction(velocities)
    }
    bias, both, refuted = _together(velocities, forces, errors, exponent)
    places = places_of(log, used)
    warnings = []
    if used and places != places_of(log, [stretch for stretch in stretches if stretch.steady]):
        warnings.append(f"Read on the stretch common to all passes, {places[0] * 1e3:.4g} to {places[1] * 1e3:.4g} mm.")
    if len(unsteady):
        low, high = np.abs(unsteady).min(), np.abs(unsteady).max()
        warnings.append(f"{len(unsteady)} stretches, {low:.3g} to {high:.3g} m/s, were not steady and are left out.")
    if refuted:
        warnings.append(f"The forces refute the Stribeck exponent of the stage, {exponent:g}: it is fitted instead.")
    return FrictionVelocity(sides, both, bias, velocities, forces, errors, unsteady, places, moved, tuple(warnings))


def _mass(log: Log) -> tuple[float, float]:
    """Read the moving mass [kg] off a log by the inverse model, with the half-width of its interval [kg].

    Both are 0 for a log from which the inverse model reads none: it is short, hardly moves, or its force has the wrong
    sign.
    """
    try:
        mass = inverse_model(log).estimate("mass")
    except InputError:
        return 0.0, 0.0
    return (mass.value, mass.half_width) if mass.determined else (0.0, 0.0)


def _row(stretch: Pass, mass: float, error: float) -> tuple[float, float, float, float]:
    """Return velocity [m/s], friction [N], its half-width [N], and relative swing of a pass.

    Inertia, `mass` [kg] times the remaining acceleration, is subtracted, and counts with the `error` [kg] of the mass.
    The relative swing is the standard deviation of the velocity over the velocity.
    """
    force, velocity = stretch.force, stretch.velocity
    half = float(np.hypot(t_value(force.freedom) * force.error, error * stretch.acceleration))
    return velocity, force.value - mass * stretch.acceleration, half, stretch.swing / abs(velocity)


def _together(
    velocities: np.ndarray, forces: np.ndarray, errors: np.ndarray, exponent: float | None
) -> tuple[Estimate, Direction, bool]:
    """Separate the constant force from friction, by stretches in both directions.

    The constant force follows from least squares of Coulomb, viscous and constant force on all stretches, or with the
    Stribeck curve if one shows. Returns the constant force, the friction of both directions without it, and whether
    forces refute the exponent. Both are undetermined with fewer than two stretches in a direction.
    """
    name, method = "bias", f"{METHOD}, forward and backward"
    sign = np.sign(velocities)
    if min((sign > 0).sum(), (sign < 0).sum()) < 2:
        reason = "fewer than two steady stretches in one of the directions"
        return Estimate.unknown(name, "N", method, reason), _nothing(reason), False
    columns = [sign, np.ones_like(sign)]
    if np.abs(velocities).max() >= settings.span_of_speeds * np.abs(velocities).min():
        columns.insert(1, velocities)
    design = np.stack(columns, axis=1)
    even = np.full_like(errors, np.sqrt(np.mean(errors**2)))  # curvature cancels between forward and backward motion
    solution, covariance, freedom = _linear(design, forces, even)
    if freedom < 1:
        reason = "too few steady stretches"
        return Estimate.unknown(name, "N", method, reason), _nothing(reason), False
    bias = by_t(name, "N", Mean(-float(solution[-1]), float(covariance[-1, -1] ** 0.5), freedom), method)
    friction = sign * (forces - solution[-1])
    both = _direction(velocities, friction, errors, "both directions", exponent, 1)
    if both.curve is None:
        return bias, both, False
    offset = both.curve.offset
    value, low, high = (-float(solution[-1]) - end for end in (offset.value, offset.high, offset.low))
    return Estimate(name, "N", value, low, high, method), both, both.curve.refuted


def _deviations(errors: np.ndarray) -> np.ndarray:
    """Return standard deviations [N] of forces from half-widths, at least their median.

    A stretch whose velocity swings counts less; a stretch that happens to be very even counts no more than others.
    """
    return np.maximum(errors, float(np.median(errors))) / NORMAL_COVERAGE


def _linear(design: np.ndarray, forces: np.ndarray, errors: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Fit friction by weighted least squares with Coulomb friction in the first column.

    Returns solution, covariance and degrees of freedom. Friction varies from place to place, and all stretches lie over
    the same places, so errors of the level of friction do not average out.
    """
    deviations = _deviations(errors)
    inverse = np.linalg.pinv(design / deviations[:, None]) / deviations
    solution = inverse @ forces
    freedom = len(forces) - design.shape[1]
    squares = float(np.sum(((forces - design @ solution) / deviations) ** 2))
    return solution, _covariance(inverse, deviations, squares / max(freedom, 1), errors, [0]), freedom


def _covariance(
    inverse: np.ndarray, deviations: np.ndarray, scatter: float, errors: np.ndarray, levels: list[int]
) -> np.ndarray:
    """Return the covariance (p, p) of a weighted least-squares solution.

    `inverse` (p, n) is the matrix that gives the solution from the forces. `scatter` is the residual's variance
    relative to the `deviations` [N], used if above 1. `levels` are the columns for levels of friction, whose error does
    not average out.
    """
    variances = deviations**2 * max(scatter, 1.0)
    covariance = inverse * variances @ inverse.T
    covariance[np.ix_(levels, levels)] += _level(deviations, errors) ** 2
    return covariance


def _level(deviations: np.ndarray, errors: np.ndarray) -> float:
    """Return the standard deviation [N] that all forces share, as read over the same places.

    This is the weighted RMS of the deviations that follow from their half-widths `errors` [N]. The weights follow from
    `deviations` [N].
    """
    return float(np.average((errors / NORMAL_COVERAGE) ** 2, weights=deviations**-2)) ** 0.5


def _nothing(reason: str) -> Direction:
    """Return undetermined friction for a direction; each estimate states the `reason`."""
    units = {"coulomb": "N", "viscous": "N s/m", "static": "N", "stribeck_velocity": "m/s", "stribeck_exponent": ""}
    coulomb, viscous, static, velocity, exponent = (
        Estimate.unknown(f"friction.{name}", unit, METHOD, reason) for name, unit in units.items()
    )
    return Direction(coulomb, viscous, static, velocity, exponent, np.empty((0, 0)))


def _direction(
    velocities: np.ndarray, friction: np.ndarray, errors: np.ndarray, words: str, exponent: float | None, spent: int = 0
) -> Direction:
    """Fit friction over speed for one direction or both.

    Friction [N] is positive against the motion, with half-widths `errors` [N]. `spent` is the number of degrees of
    freedom already used for the constant force; `exponent` is the stage's, if stated.
    """
    speeds = np.abs(velocities)
    method = f"{METHOD}, {words}"
    if len(speeds) < 3 + spent:
        return _nothing(f"{len(speeds)} steady stretches {words}: {3 + spent} are needed")
    slowest = f"no steady motion below {speeds.min() * 1e3:.3g} mm/s"
    if speeds.max() < settings.span_of_speeds * speeds.min():
        return _one_speed(speeds, friction, method, spent)
    solution, covariance, freedom = _linear(np.stack([np.ones_like(speeds), speeds], axis=1), friction, errors)
    covariance, freedom = covariance * freedom / (freedom - spent), freedom - spent
    level, slope = map(Mean, map(float, solution), np.sqrt(np.diag(covariance)).tolist(), [freedom] * 2)
    coulomb = by_t("friction.coulomb", "N", level, method)
    viscous = by_t("friction.viscous", "N s/m", slope, method)
    low, high = speeds.min() * 1e3, speeds.max() * 1e3
    if coulomb.determined and coulomb.low <= 0:
        ends = "with none, within its error" if coulomb.high > 0 else "below zero, as that of no bearing does"
        reason = f"a straight line from {low:.3g} to {high:.3g} mm/s ends at rest {ends}"
        nothing, most = _nothing(reason), max(coulomb.high, 0.0)
        coulomb = coulomb.withheld(reason, 0.0, most)
        return replace(nothing, coulomb=coulomb, viscous=viscous if most else nothing.viscous)
    if distinct(speeds) < settings.speeds_of_a_line:
        reason = f"two speeds, {low:.3g} and {high:.3g} mm/s, do not show whether friction still falls there"
        return _still_falling(coulomb, viscous, reason)
    if freedom >= settings.speeds_of_a_line and distinct(speeds) >= settings.speeds_of_a_curve:
        deviations = _deviations(errors)
        plain = float(np.sum(((friction - solution[0] - solution[1] * speeds) / deviations) ** 2))
        forces = Forces(speeds, friction, np.sign(velocities), deviations, _level(deviations, errors), spent > 0)
        curve = stribeck_fit(forces, plain, exponent)
        if curve is not None:
            return _curved(curve, speeds, method, exponent)
    if viscous.high < 0:
        return _still_falling(coulomb, viscous, f"from {low:.3g} to {high:.3g} mm/s friction falls with the speed")
    flat = f"{slowest}: no rise of friction towards rest shows"
    static = Estimate.unknown("friction.static", "N", method, flat, coulomb.low)
    nothing = _nothing(flat)
    return replace(nothing, coulomb=coulomb, viscous=viscous, static=static, covariance=covariance)


def _one_speed(speeds: np.ndarray, friction: np.ndarray, method: str, spent: int) -> Direction:
    """Bound Coulomb and viscous friction if all speeds are about equal and cannot separate them.

    Coulomb and viscous friction are each at most the whole force. `spent` is the number of degrees of freedom already
    used.
    """
    count = len(friction)
    half = t_value(count - 1 - spent) * float(friction.std(ddof=1)) / count**0.5
    top = float(friction.mean()) + half
    reason = f"all speeds about {speeds.mean() * 1e3:.3g} mm/s: Coulomb and viscous friction cannot be distinguished"
    coulomb = Estimate.unknown("friction.coulomb", "N", method, reason, 0.0, top)
    viscous = Estimate.unknown("friction.viscous", "N s/m", method, reason, 0.0, top / float(speeds.mean()))
    return replace(_nothing(reason), coulomb=coulomb, viscous=viscous)


def distinct(speeds: np.ndarray) -> int:
    """Count the distinct speeds [m/s], shape (n,); speeds within a small ratio count as one."""
    return 1 + int((np.diff(np.log(np.sort(speeds))) > np.log(settings.ratio_of_distinct_speeds)).sum())


def _still_falling(coulomb: Estimate, viscous: Estimate, reason: str) -> Direction:
    """Bound Coulomb friction above and viscous friction below, where friction still falls.

    By a Stribeck effect, a straight line through the forces then has too high an intercept and too low a slope.
    """
    high, low = coulomb.withheld(reason, high=coulomb.high), viscous.withheld(reason, low=viscous.low)
    return replace(_nothing(reason), coulomb=high, viscous=low)


def _curved(curve: FittedStribeck, speeds: np.ndarray, method: str, exponent: float | None) -> Direction:
    """Make estimates for a direction from a Stribeck curve, with intervals for any exponent.

    Any exponent counts that the forces leave open. Static friction and Stribeck velocity are determined only if speeds
    reach below the Stribeck velocity. If friction may still fall at the highest speed, nothing is determined, except
    perhaps the exponent, and static friction and Stribeck velocity have no range: what still falls at the highest speed
    may be another effect than Stribeck's.
    """
    velocity, several = curve.velocity, "several exponents with their Stribeck velocities explain the forces alike"
    if exponent is not None and not curve.refuted:
        method = f"{method}; Stribeck exponent {exponent:g} of the stage"
        several = f"{exponent:g} is that of the stage"
    rises = f"friction rises towards rest, but no steady motion below {speeds.min() * 1e3:.3g} mm/s shows how far"
    falls = f"friction may still fall with the speed at {speeds.max() * 1e3:.3g} mm/s"
    seen = velocity.closed and velocity.value >= speeds.min() and velocity.high - velocity.low < 2 * velocity.value
    high, low = "" if curve.coulomb.closed else falls, "" if seen else rises
    nothing = _nothing(falls)
    return Direction(
        _ranged("coulomb", "N", curve.coulomb, method, high),
        _ranged("viscous", "N s/m", curve.viscous, method, high),
        nothing.static if high else _ranged("static", "N", curve.static, method, low),
        nothing.stribeck_velocity if high else _ranged("stribeck_velocity", "m/s", velocity, method, low),
        _ranged("stribeck_exponent", "", curve.exponent, method, "" if curve.exponent.closed else several),
        curve.covariance,
        curve,
    )


def _ranged(name: str, unit: str, fitted: Possible, method: str, reason: str) -> Estimate:
    """Make an estimate from the range of a fit; it is not determined if there is a `reason`.

    `name` is that of the key in [friction].
    """
    key = f"friction.{name}"
    if reason:
        return Estimate.unknown(key, unit, method, reason, max(fitted.low, 0.0), fitted.high)
    return Estimate(key, unit, fitted.value, fitted.low, fitted.high, method)
