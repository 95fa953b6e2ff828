"""Friction against velocity from stretches of constant velocity: Coulomb, viscous and, where it shows, Stribeck."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import f as fisher

from friso.identification.estimate import Estimate
from friso.identification.logs.log import Log
from friso.identification.readings.common import Mean, by_direction, by_t, stribeck_curve, t_value
from friso.identification.readings.passes import CUTOFF, Pass, on_common_places, passes, places_of
from friso.intervals import COVERAGE

SPAN = 1.5
"""Ratio of the greatest to the least speed from which Coulomb and viscous friction can be distinguished."""

SPEEDS, DISTINCT = 5, 1.1
"""Speeds, each so many times the last, from which a curve of four parameters may be fitted."""

STRAIGHT = 3
"""Speeds, each so many times the last, from which it shows whether friction is a straight line over them."""

ROUNDING = 1e-9
"""Of the greatest force: no mean is known better."""

SURE = 0.01
"""Probability by chance below which a Stribeck curve is taken for shown."""

METHOD = "mean forces over stretches of constant velocity"


@dataclass(frozen=True)
class Direction:
    """One direction: Coulomb [N], viscous [N s/m], static [N] friction and Stribeck velocity [m/s], with the covariance
    of those fitted (in that order, SI), shape (2, 2) or (4, 4), or (0, 0)."""

    coulomb: Estimate
    viscous: Estimate
    static: Estimate
    stribeck_velocity: Estimate
    covariance: np.ndarray


@dataclass(frozen=True)
class FrictionVelocity:
    """The directions "forward" and "backward", each with what constant force there is in its Coulomb friction, both
    together with that taken out, and the `bias` [N] itself, on top of equal friction. Per steady stretch, shape (n,):
    velocity [m/s], mean force [N] less inertia, half-width of its 95 % interval [N]; velocities of those that were not
    steady, shape (m,); and the `places` [m] from end to end over which the steady ones were read."""

    directions: Mapping[str, Direction]
    both: Direction
    bias: Estimate
    velocities: np.ndarray
    forces: np.ndarray
    half_widths: np.ndarray
    unsteady: np.ndarray
    places: tuple[float, float]
    warnings: tuple[str, ...]


def friction_velocity(log: Log, mass: float = 0.0) -> FrictionVelocity:
    """Friction-velocity map from the stretches of constant velocity, over the places that all of them share if they
    share one, `mass` [kg] times what is left of acceleration taken off. What the speeds present cannot show is unknown,
    with the reason. Raises InputError for missing channels."""
    stretches = passes(log, CUTOFF)
    used = on_common_places(log, [stretch for stretch in stretches if stretch.steady], CUTOFF)
    velocities, forces, errors = np.array([_row(stretch, mass) for stretch in used]).reshape(-1, 3).T
    unsteady = np.array([stretch.velocity for stretch in stretches if not stretch.steady])
    sides = {
        words: _direction(np.abs(velocities[m]), np.sign(velocities[m]) * forces[m], errors[m], words)
        for words, m in by_direction(velocities)
    }
    bias, both = _together(velocities, forces, errors)
    places = places_of(log, used)
    warnings = []
    if used and places != places_of(log, [stretch for stretch in stretches if stretch.steady]):
        warnings.append(f"Read on the stretch common to all passes, {places[0] * 1e3:.4g} to {places[1] * 1e3:.4g} mm.")
    if len(unsteady):
        low, high = np.abs(unsteady).min(), np.abs(unsteady).max()
        warnings.append(f"{len(unsteady)} stretches, {low:.3g} to {high:.3g} m/s, were not steady and are left out.")
    return FrictionVelocity(sides, both, bias, velocities, forces, errors, unsteady, places, tuple(warnings))


def _row(stretch: Pass, mass: float) -> tuple[float, float, float]:
    return (
        stretch.velocity,
        stretch.force.value - mass * stretch.acceleration,
        t_value(stretch.force.freedom) * stretch.force.error,
    )


def _together(velocities: np.ndarray, forces: np.ndarray, errors: np.ndarray) -> tuple[Estimate, Direction]:
    """The bias by least squares of Coulomb, viscous and bias on all stretches, and the friction without it."""
    name, method = "offset", f"{METHOD}, forward and backward"
    sign = np.sign(velocities)
    if min((sign > 0).sum(), (sign < 0).sum()) < 2:
        reason = "fewer than two steady stretches in one of the directions"
        return Estimate.unknown(name, "N", method, reason), _nothing(reason)
    columns = [sign, np.ones_like(sign)]
    if np.abs(velocities).max() >= SPAN * np.abs(velocities).min():
        columns.insert(1, velocities)
    design = np.stack(columns, axis=1)
    even = np.full_like(errors, np.sqrt(np.mean(errors**2)))  # a curve that the line lacks cancels, there and back
    solution, covariance, freedom = _linear(design, forces, even)
    if freedom < 1:
        return Estimate.unknown(name, "N", method, "too few steady stretches"), _nothing("too few steady stretches")
    bias = by_t(name, "N", Mean(float(solution[-1]), float(covariance[-1, -1] ** 0.5), freedom), method)
    return bias, _direction(np.abs(velocities), sign * (forces - solution[-1]), errors, "both directions", 1)


def _deviations(forces: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """Standard deviation [N] of each stretch by its half-width in `errors` [N], but no less than the median: one where
    the velocity swings counts less, one that happens to be even does not count for more than the others."""
    least = max(float(np.median(errors)), ROUNDING * float(np.abs(forces).max()))
    return np.maximum(errors, least) / COVERAGE


def _linear(design: np.ndarray, forces: np.ndarray, errors: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Weighted least squares with Coulomb friction in the first column: solution, covariance, degrees of freedom.

    Friction varies from place to place, and all stretches lie over the same places: what one of them shows of Coulomb
    friction is not averaged out over the others.
    """
    deviations = _deviations(forces, errors)
    inverse = np.linalg.pinv(design / deviations[:, None]) / deviations
    solution = inverse @ forces
    freedom = len(forces) - design.shape[1]
    squares = float(np.sum(((forces - design @ solution) / deviations) ** 2))
    return solution, _covariance(inverse, deviations, squares / max(freedom, 1), errors, [0]), freedom


def _covariance(
    inverse: np.ndarray, deviations: np.ndarray, scatter: float, errors: np.ndarray, levels: list[int]
) -> np.ndarray:
    """Of a solution, by the `inverse` of its design; `scatter` is the variance over that of the `deviations` [N], which
    counts where it is greater than 1; `levels` are the places of what is a level of friction."""
    variances = deviations**2 * max(scatter, 1.0)
    covariance = inverse * variances @ inverse.T
    covariance[np.ix_(levels, levels)] += float(np.average((errors / COVERAGE) ** 2, weights=deviations**-2))
    return covariance


def _nothing(reason: str) -> Direction:
    names = (("coulomb", "N"), ("viscous", "N s/m"), ("static", "N"), ("stribeck_velocity", "m/s"))
    unknown = [Estimate.unknown(f"friction.{name}", unit, METHOD, reason) for name, unit in names]
    return Direction(unknown[0], unknown[1], unknown[2], unknown[3], np.empty((0, 0)))


def _direction(speeds: np.ndarray, friction: np.ndarray, errors: np.ndarray, words: str, spent: int = 0) -> Direction:
    """Fit of one direction, friction [N] positive against the motion, with half-widths `errors` [N]; `spent` degrees of
    freedom are gone before."""
    method = f"{METHOD}, {words}"
    if len(speeds) < 3 + spent:
        return _nothing(f"{len(speeds)} steady stretches {words}: {3 + spent} are needed")
    slowest = f"no steady motion below {speeds.min() * 1e3:.3g} mm/s"
    if speeds.max() < SPAN * speeds.min():
        return _one_speed(speeds, friction, method, spent)
    solution, covariance, freedom = _linear(np.stack([np.ones_like(speeds), speeds], axis=1), friction, errors)
    covariance, freedom = covariance * freedom / (freedom - spent), freedom - spent
    names = (("friction.coulomb", "N"), ("friction.viscous", "N s/m"))
    coulomb, viscous = (_fitted(*name, i, solution, covariance, freedom, method) for i, name in enumerate(names))
    low, high = speeds.min() * 1e3, speeds.max() * 1e3
    if coulomb.determined and coulomb.low <= 0:
        ends = "with none, within its error" if coulomb.high > 0 else "below zero, as that of no bearing does"
        reason = f"a straight line from {low:.3g} to {high:.3g} mm/s ends at rest {ends}"
        nothing, most = _nothing(reason), max(coulomb.high, 0.0)
        coulomb = Estimate.unknown(coulomb.name, "N", method, reason, 0.0, most)
        return replace(nothing, coulomb=coulomb, viscous=viscous if most else nothing.viscous)
    if distinct(speeds) < STRAIGHT:
        reason = f"two speeds, {low:.3g} and {high:.3g} mm/s, do not show whether friction still falls there"
        return _still_falling(coulomb, viscous, reason)
    curved = _stribeck(speeds, friction, errors, solution, freedom)
    if curved is not None:
        return _curved(*curved, speeds, method)
    if viscous.high < 0:
        return _still_falling(coulomb, viscous, f"from {low:.3g} to {high:.3g} mm/s friction falls with the speed")
    flat = f"{slowest}: no rise of friction towards rest shows"
    static = Estimate.unknown("friction.static", "N", method, flat, coulomb.low)
    speed = Estimate.unknown("friction.stribeck_velocity", "m/s", method, static.reason, 0.0, float(speeds.min()))
    return Direction(coulomb, viscous, static, speed, covariance)


def _one_speed(speeds: np.ndarray, friction: np.ndarray, method: str, spent: int) -> Direction:
    """At one speed Coulomb and viscous friction go together: a range for either."""
    count = len(friction)
    half = t_value(count - 1 - spent) * float(friction.std(ddof=1)) / count**0.5
    top = float(friction.mean()) + half
    reason = f"all speeds about {speeds.mean() * 1e3:.3g} mm/s: Coulomb and viscous friction cannot be distinguished"
    nothing = _nothing(reason)
    return Direction(
        Estimate.unknown("friction.coulomb", "N", method, reason, 0.0, top),
        Estimate.unknown("friction.viscous", "N s/m", method, reason, 0.0, top / float(speeds.mean())),
        nothing.static,
        nothing.stribeck_velocity,
        nothing.covariance,
    )


def distinct(speeds: np.ndarray) -> int:
    """How many speeds there are, of shape (n,) [m/s]: those within `DISTINCT` count as one."""
    return 1 + int((np.diff(np.log(np.sort(speeds))) > np.log(DISTINCT)).sum())


def _still_falling(coulomb: Estimate, viscous: Estimate, reason: str) -> Direction:
    """A Stribeck effect at the speeds at hand makes the start of a straight line through the forces too high and its
    slope too low: both are bounds."""
    nothing = _nothing(reason)
    return Direction(
        Estimate.unknown(coulomb.name, "N", coulomb.method, reason, high=coulomb.high),
        Estimate.unknown(viscous.name, "N s/m", viscous.method, reason, low=viscous.low),
        nothing.static,
        nothing.stribeck_velocity,
        nothing.covariance,
    )


def _fitted(
    name: str, unit: str, place: int, solution: np.ndarray, covariance: np.ndarray, freedom: int, method: str
) -> Estimate:
    return by_t(name, unit, Mean(float(solution[place]), float(covariance[place, place] ** 0.5), freedom), method)


def _stribeck(
    speeds: np.ndarray, friction: np.ndarray, errors: np.ndarray, line: np.ndarray, freedom: int
) -> tuple[np.ndarray, np.ndarray, int] | None:
    """The fit of F_c, F_v, F_s, v_s, covariance and degrees of freedom; None where a straight line does as well."""
    if freedom < 3 or distinct(speeds) < SPEEDS:
        return None
    deviations, scale = _deviations(friction, errors), float(np.abs(friction).max())
    plain = float(np.sum(((friction - line[0] - line[1] * speeds) / deviations) ** 2))

    def off(p: np.ndarray) -> np.ndarray:
        dry = stribeck_curve(speeds, p[0], p[2], np.exp(p[3]))
        return ((dry + p[1] * speeds / speeds.max()) * scale - friction) / deviations

    def start(at: float) -> list[float]:
        return [line[0] / scale, line[1] * speeds.max() / scale, float(friction[np.argmin(speeds)]) / scale, np.log(at)]

    fits = [least_squares(off, start(at)) for at in np.geomspace(speeds.min(), speeds.max() / 2, 4)]
    best = min(fits, key=lambda fit: fit.cost)
    left, rest = freedom - 2, 2 * best.cost
    bent = best.x[2] > best.x[0] > 0
    if not bent or (rest > 0 and fisher.sf((plain - rest) / 2 / (rest / left), 2, left) > SURE):
        return None
    units = np.array([scale, scale / speeds.max(), scale, np.exp(best.x[3])])
    solution = np.array([best.x[0], best.x[1], best.x[2], 1.0]) * units
    inverse = units[:, None] * np.linalg.pinv(best.jac) / deviations
    return solution, _covariance(inverse, deviations, rest / left, errors, [0, 2]), left


def _curved(solution: np.ndarray, covariance: np.ndarray, freedom: int, speeds: np.ndarray, method: str) -> Direction:
    """With a Stribeck curve; F_s and v_s are shown only where speeds reach below the Stribeck velocity."""
    names = ("coulomb", "viscous", "static", "stribeck_velocity")
    units = ("N", "N s/m", "N", "m/s")
    fits = [
        _fitted(f"friction.{name}", unit, i, solution, covariance, freedom, method)
        for i, (name, unit) in enumerate(zip(names, units, strict=True))
    ]
    if solution[3] < speeds.min() or fits[3].half_width > solution[3] or solution[2] < solution[0]:
        reason = f"friction rises towards rest, but no steady motion below {speeds.min() * 1e3:.3g} mm/s shows how far"
        fits[2] = Estimate.unknown(fits[2].name, "N", method, reason, float(solution[0]))
        fits[3] = Estimate.unknown(fits[3].name, "m/s", method, reason, 0.0, float(speeds.max()))
    return Direction(fits[0], fits[1], fits[2], fits[3], covariance)
