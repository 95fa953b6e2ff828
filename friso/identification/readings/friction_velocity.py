"""Read friction over velocity: Coulomb, viscous and, if it shows, Stribeck.

Stretches of constant velocity show friction. At uneven instants, regression on local polynomials of motion and force
gives mass and friction.

At a given Stribeck velocity and exponent the curve is linear in all other parameters. Least squares are therefore
computed over a grid of both, and an interval contains every value that explains the forces within chance, for any
exponent (profile likelihood). A linearised interval at the best fit is much too narrow, because another exponent with
another velocity may fit as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import f as fisher

from friso.errors import InputError
from friso.identification.combine import spread_of
from friso.identification.estimate import Estimate
from friso.identification.inverse_model import inverse_model, unit_of
from friso.identification.logs.checks import runs
from friso.identification.logs.log import Log
from friso.identification.output_error.parameters import STRIBECK_EXPONENTS
from friso.identification.readings.common import Mean, by_direction, by_t, channel, t_value
from friso.identification.readings.motion_events import Pass, on_common_places, passes, places_of
from friso.intervals import NORMAL_COVERAGE


@dataclass(frozen=True)
class Possible:
    """A parameter's best value, and the range that the forces allow.

    The range is `closed` unless it reaches an end of the search.
    """

    value: float
    low: float
    high: float
    closed: bool


@dataclass(frozen=True, kw_only=True)
class FittedStribeck:
    """A Stribeck curve through forces at some speeds, with the remaining ranges.

    Ranges are given for Coulomb [N], viscous [N s/m] and static friction [N], the Stribeck velocity [m/s], the
    exponent, and the constant force [N] that adds to friction in forward motion. The covariance (SI) covers the first
    five, or four with a given exponent; a given exponent may be `refuted`.
    """

    coulomb: Possible
    viscous: Possible
    static: Possible
    velocity: Possible
    exponent: Possible
    offset: Possible
    covariance: np.ndarray
    refuted: bool


@dataclass(frozen=True)
class Forces:
    """Friction [N] against the motion at speeds [m/s], shape (n,), to which a curve is fitted.

    `directions` are 1 or -1; `deviations` [N] weigh each force, and `level` [N] is a deviation common to all. `both` is
    true if both directions share one curve and a constant force.
    """

    speeds: np.ndarray
    friction: np.ndarray
    directions: np.ndarray
    deviations: np.ndarray
    level: float
    both: bool


RATIO_BELOW_THE_SLOWEST = 30.0
"""Ratio by which a Stribeck velocity may lie below the slowest speed."""

RATIO_ABOVE_THE_FASTEST = 2.0
"""Ratio by which a Stribeck velocity may lie above the fastest speed."""

GRID_OF_VELOCITIES = 81
"""Number of Stribeck velocities in the grid. Fewer miss the valley of the cost."""

GRID_OF_EXPONENTS = 41
"""Number of Stribeck exponents in the grid."""

CHANCE_OF_A_CURVE = 0.01
"""Probability below which a Stribeck curve is significant, or an exponent is refuted."""

USUAL_EXPONENT = 2.0
"""Stribeck exponent assumed for few forces, which cannot determine one more parameter."""


def stribeck_fit(forces: Forces, plain: float, exponent: float | None) -> FittedStribeck | None:
    """Fit a Stribeck curve to forces; return None if a straight line fits as well.

    `plain` is the line's sum of squares over variances. A given `exponent` is used unless the forces refute it; too few
    forces leave all exponents possible.
    """
    speeds = forces.speeds
    low = speeds.min() / RATIO_BELOW_THE_SLOWEST
    high = speeds.max() * RATIO_ABOVE_THE_FASTEST
    velocities = np.geomspace(low, high, GRID_OF_VELOCITIES)
    least, most = STRIBECK_EXPONENTS
    shapes = np.linspace(least, most, GRID_OF_EXPONENTS)
    left = len(speeds) - 5 - forces.both
    apart = left < 1
    left += apart
    if left < 1:
        return None
    grid = _Grid(forces, velocities, shapes, apart).around(left)
    refuted = False
    if exponent is not None:
        stated = _Grid(forces, velocities, np.array([exponent]), False).around(left + (not apart))
        worse = (stated.least - grid.least) / max(grid.least / left, 1.0)
        refuted = not apart and bool(fisher.sf(worse, 1, left) < CHANCE_OF_A_CURVE)
        if not refuted:
            grid, left = stated, left + (not apart)
    free = len(grid.shapes) > 1 and not apart
    usual = grid
    if free:
        usual = _Grid(forces, velocities, np.array([USUAL_EXPONENT]), False).around(left + free)
    if not (_better(plain, grid.least, 2 + free, left) or _better(plain, usual.least, 2, left + free)):
        return None
    return grid.curve(left, refuted, (velocities[0], velocities[-1]))


def _better(plain: float, least: float, more: int, left: int) -> bool:
    """Tell whether a curve fits significantly better than a line with fewer parameters (F-test).

    `plain` and `least` are the sums of squares of line and curve. The curve has `more` parameters than the line, and
    leaves `left` degrees of freedom.
    """
    if not 0 < least < plain:
        return least < plain
    chance = fisher.sf((plain - least) / more * left / least, more, left)
    return bool(chance < CHANCE_OF_A_CURVE)


REFINEMENTS_OF_THE_GRID = 2
"""Number of refinements of the grid around the possible region."""

MARGIN_OF_THE_GRID = 2
"""Number of grid steps that a refined grid reaches beyond the possible region."""


class _Grid:
    """Least squares of the linear parameters, at each Stribeck velocity and exponent of a grid.

    Arrays begin with the axes (velocities, exponents). `cost` is the sum of squares over variances, infinite where
    friction would not rise towards rest. `solutions` (..., p) have the `covariance` (..., p, p), not yet scaled to the
    scatter of the residual. If `apart`, each exponent is compared with its own best velocity only.
    """

    def __init__(self, forces: Forces, velocities: np.ndarray, shapes: np.ndarray, apart: bool) -> None:
        """Solve the grid of Stribeck `velocities` [m/s], (velocities,), and exponents `shapes`."""
        self.forces, self.velocities, self.shapes, self.apart = forces, velocities, shapes, apart
        speeds = forces.speeds
        decay = np.exp(-((speeds / velocities[:, None, None]) ** shapes[:, None]))
        columns = [1 - decay, np.broadcast_to(speeds / speeds.max(), decay.shape), decay]
        if forces.both:
            columns.append(np.broadcast_to(forces.directions, decay.shape))
        design = np.stack(columns, axis=-1) / forces.deviations[:, None]
        target = forces.friction / forces.deviations
        inverse = np.linalg.pinv(design, rcond=1e-9)
        self.solutions = inverse @ target
        self.cost = np.sum((target - np.einsum("vsnp,vsp->vsn", design, self.solutions)) ** 2, axis=-1)
        self.covariance = inverse @ np.swapaxes(inverse, -1, -2)
        coulomb, static = self.solutions[..., 0], self.solutions[..., 2]
        self.cost[(static <= coulomb) | (coulomb <= 0)] = np.inf

    @property
    def least(self) -> float:
        """Return the smallest sum of squares over variances in the grid."""
        return float(self.cost.min())

    def around(self, left: int) -> _Grid:
        """Return a finer grid around the curves that the forces allow, at `left` degrees of freedom.

        The new grid lies within this one. If no curve is possible, this grid is returned.
        """
        grid = self
        for _ in range(REFINEMENTS_OF_THE_GRID if np.isfinite(self.least) and left > 0 else 0):
            inside, ends, margin = grid.room(left) >= 0, [], MARGIN_OF_THE_GRID
            for points, here in ((grid.velocities, inside.any(axis=1)), (grid.shapes, inside.any(axis=0))):
                at = np.flatnonzero(here)
                ends += [points[max(at[0] - margin, 0)], points[min(at[-1] + margin, len(points) - 1)]]
            several = np.linspace(ends[2], ends[3], GRID_OF_EXPONENTS)
            velocities = np.geomspace(ends[0], ends[1], GRID_OF_VELOCITIES)
            grid = _Grid(grid.forces, velocities, several if len(grid.shapes) > 1 else grid.shapes, grid.apart)
        return grid

    def room(self, left: int) -> np.ndarray:
        """Return how far the cost of each grid point is below the limit for a possible curve.

        The result has the shape (velocities, exponents), and is negative where the forces exclude the curve. `left` is
        the number of degrees of freedom.
        """
        least = self.cost.min(axis=0, keepdims=True) if self.apart else np.array([[self.least]])
        least = np.where(np.isfinite(least), least, 0.0)
        return t_value(left) ** 2 * np.maximum(least / left, 1.0) - (self.cost - least)

    def curve(self, left: int, refuted: bool, outer: tuple[float, float]) -> FittedStribeck:
        """Return the best curve of the grid, with the ranges of its parameters.

        `left` is the number of degrees of freedom, and `refuted` is stored in the result. Ranges that reach an `outer`
        Stribeck velocity or exponent are not closed.
        """
        forces, open_shape = self.forces, len(self.shapes) > 1
        best = np.unravel_index(int(np.argmin(self.cost)), self.cost.shape)
        scatter, t = max(float(self.cost[best]) / left, 1.0), t_value(left)
        room = self.room(left)
        inside = room >= 0
        fast, shaped = np.asarray(inside.any(axis=1)), np.asarray(inside.any(axis=0))
        ends = [bool(self.velocities[fast][end] == outer[end]) for end in (0, -1)]
        cut = any(float(self.shapes[shaped][end]) == STRIBECK_EXPONENTS[end] for end in (0, -1))

        def linear(place: int, scale: float, level: float, closed: bool) -> Possible:
            centre = self.solutions[..., place][inside] * scale
            half = np.sqrt(room[inside] * self.covariance[..., place, place][inside]) * scale
            value = float(self.solutions[(*best, place)]) * scale
            below, above = value - float((centre - half).min()), float((centre + half).max()) - value
            return Possible(value, value - float(np.hypot(below, level)), value + float(np.hypot(above, level)), closed)

        shared = t * forces.level
        fastest = forces.speeds.max()
        velocities, shapes = _between(self.velocities, fast, True), _between(self.shapes, shaped, False)
        return FittedStribeck(
            coulomb=linear(0, 1.0, shared, not ends[1]),
            viscous=linear(1, 1 / fastest, 0.0, not ends[1]),
            static=linear(2, 1.0, shared, not ends[0]),
            velocity=Possible(float(self.velocities[best[0]]), *velocities, not any(ends)),
            exponent=Possible(float(self.shapes[best[1]]), *shapes, open_shape and not (cut or self.apart)),
            offset=linear(3, 1.0, 0.0, True) if forces.both else Possible(0.0, 0.0, 0.0, False),
            covariance=self._covariance((int(best[0]), int(best[1])), scatter, open_shape and not self.apart),
            refuted=refuted,
        )

    def _covariance(self, best: tuple[int, int], scatter: float, open_shape: bool) -> np.ndarray:
        """Return the covariance of the curve's parameters (SI), linearised at the best curve.

        `best` is its place in the grid. Variances are multiplied by `scatter`. With an `open_shape`, the exponent is
        among the parameters.
        """
        forces, speeds = self.forces, self.forces.speeds
        velocity, shape = float(self.velocities[best[0]]), float(self.shapes[best[1]])
        ratio = speeds / velocity
        decay, drop = np.exp(-(ratio**shape)), float(self.solutions[(*best, 2)] - self.solutions[(*best, 0)])
        columns = [1 - decay, speeds, decay, drop * decay * ratio**shape * shape / velocity]
        if open_shape:
            columns.append(-drop * decay * ratio**shape * np.log(ratio))
        count = len(columns)
        columns += [forces.directions] if forces.both else []
        design = np.stack(columns, axis=1)
        size = np.linalg.norm(design, axis=0)
        inverse = np.linalg.pinv(design / size / forces.deviations[:, None]) / size[:, None]
        covariance = (inverse @ inverse.T * scatter)[:count, :count]
        covariance[np.ix_([0, 2], [0, 2])] += forces.level**2
        return covariance


def _between(points: np.ndarray, inside: np.ndarray, ratios: bool) -> tuple[float, float]:
    """Return the range of grid points that lie inside, widened by half a step on each side.

    `points` ascend by equal differences or, if `ratios`, by equal ratios. The mask `inside` has their shape.
    """
    (at,) = np.nonzero(inside)
    scale = np.log(points) if ratios else points
    step = float(scale[1] - scale[0]) if len(points) > 1 else 0.0
    ends = np.array([scale[at[0]] - step / 2, scale[at[-1]] + step / 2])
    low, high = np.exp(ends) if ratios else np.clip(ends, points[0], points[-1])
    return float(low), float(high)


METHOD = "mean forces over stretches of constant velocity"


@dataclass(frozen=True, kw_only=True)
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


@dataclass(frozen=True, kw_only=True)
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


LINEARITY_OF_SENSORS = 1e-3
"""Relative error of the ratio of two channels, the linearity of good sensors and amplifiers."""


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
        linear = np.full_like(size, LINEARITY_OF_SENSORS * size.max())
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
    return FrictionVelocity(
        directions=sides,
        both=both,
        bias=bias,
        velocities=velocities,
        forces=forces,
        half_widths=errors,
        unsteady=unsteady,
        places=places,
        mass=moved,
        warnings=tuple(warnings),
    )


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


SPAN_OF_SPEEDS = 1.5
"""Ratio of speeds from which Coulomb and viscous friction can be separated."""


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
    if np.abs(velocities).max() >= SPAN_OF_SPEEDS * np.abs(velocities).min():
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
    return Direction(
        coulomb=coulomb,
        viscous=viscous,
        static=static,
        stribeck_velocity=velocity,
        stribeck_exponent=exponent,
        covariance=np.empty((0, 0)),
    )


SPEEDS_OF_A_LINE = 3
"""Fewest distinct speeds that show a deviation from a straight line."""

SPEEDS_OF_A_CURVE = 5
"""Fewest distinct speeds to which a curve with four parameters is fitted."""


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
    if speeds.max() < SPAN_OF_SPEEDS * speeds.min():
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
    if distinct(speeds) < SPEEDS_OF_A_LINE:
        reason = f"two speeds, {low:.3g} and {high:.3g} mm/s, do not show whether friction still falls there"
        return _still_falling(coulomb, viscous, reason)
    if freedom >= SPEEDS_OF_A_LINE and distinct(speeds) >= SPEEDS_OF_A_CURVE:
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


RATIO_OF_DISTINCT_SPEEDS = 1.1
"""Smallest ratio of two distinct speeds."""


def distinct(speeds: np.ndarray) -> int:
    """Count the distinct speeds [m/s], shape (n,); speeds within a small ratio count as one."""
    return 1 + int((np.diff(np.log(np.sort(speeds))) > np.log(RATIO_OF_DISTINCT_SPEEDS)).sum())


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
    nothing, at_rest = _nothing(falls), "" if curve.exponent.closed else several
    stribeck = _ranged("stribeck_velocity", "m/s", velocity, method, low)
    return Direction(
        coulomb=_ranged("coulomb", "N", curve.coulomb, method, high),
        viscous=_ranged("viscous", "N s/m", curve.viscous, method, high),
        static=nothing.static if high else _ranged("static", "N", curve.static, method, low),
        stribeck_velocity=nothing.stribeck_velocity if high else stribeck,
        stribeck_exponent=_ranged("stribeck_exponent", "", curve.exponent, method, at_rest),
        covariance=curve.covariance,
        curve=curve,
    )


def _ranged(name: str, unit: str, fitted: Possible, method: str, reason: str) -> Estimate:
    """Make an estimate from the range of a fit; it is not determined if there is a `reason`.

    `name` is that of the key in [friction].
    """
    key = f"friction.{name}"
    if reason:
        return Estimate.unknown(key, unit, method, reason, max(fitted.low, 0.0), fitted.high)
    return Estimate(key, unit, fitted.value, fitted.low, fitted.high, method)


METHOD_OF_STAMPS = "least squares on local polynomials at the stamps"
_NAMES = (("mass", "kg"), ("friction.viscous", "N*s/m"), ("friction.coulomb", "N"), ("bias.cart", "N"))
"""Names and units of the fitted numbers, in their order."""
_ONE_WAY = "the motion is in one direction only, in which a constant force passes for friction"


@dataclass(frozen=True)
class StampedFriction:
    """Mass and friction from a log without an even clock.

    `estimates` have intervals, and `correlation` is that of those determined. `velocity` [m/s] and `friction` [N], the
    force less inertia, have the shape (rows,); `fitted` [N] is the curve there. Polynomials reach over `width` samples,
    and samples are `steps` [s] apart: the least, the usual, and the largest step without gaps.
    """

    log: Log
    estimates: tuple[Estimate, ...]
    correlation: np.ndarray
    velocity: np.ndarray
    friction: np.ndarray
    fitted: np.ndarray
    width: int
    steps: tuple[float, float, float]

    @property
    def by_name(self) -> Mapping[str, Estimate]:
        """Return the estimates by name."""
        return {estimate.name: estimate for estimate in self.estimates}


@dataclass(frozen=True)
class _StampedFit:
    """A fit with polynomials over some samples: rows, their solution and its covariance."""

    width: int
    columns: np.ndarray
    force: np.ndarray
    solution: np.ndarray
    covariance: np.ndarray

    @property
    def deviations(self) -> np.ndarray:
        """Return the standard deviation of each fitted number."""
        return np.sqrt(np.diag(self.covariance))


def local_polynomials(time: np.ndarray, values: np.ndarray, degree: int, width: int) -> np.ndarray:
    """Fit a polynomial around each instant [s], and return its value, slope and curvature there, shape (3, n).

    A polynomial of the `degree` is fitted to `width` samples, an odd number. The ends, without enough samples, are NaN.
    """
    out, half = np.full((3, len(time)), np.nan), width // 2
    if len(time) < width:
        return out
    times, held = (np.lib.stride_tricks.sliding_window_view(array, width) for array in (time, values))
    apart = times - time[half : len(time) - half, None]
    scale = np.abs(apart).max(axis=1)
    powers = (apart / scale[:, None])[..., None] ** np.arange(degree + 1)
    solution = (np.linalg.pinv(powers) @ held[..., None])[..., 0]
    for order, factor in enumerate((1.0, 1.0, 2.0)):
        out[order, half : len(time) - half] = factor * solution[:, order] / scale**order
    return out


WIDTHS_OF_POLYNOMIALS = (5, 7, 9, 13, 19, 27, 39)
"""Numbers of samples tried for local polynomials. Noise needs many, short moves need few."""

ROWS_OF_A_STAMPED_FIT = 30
"""Fewest samples within moves for mass and friction. With fewer, four numbers have no honest interval."""

STEPS_OF_A_HOLE = 4.0
"""Longest step between uneven instants over which a polynomial may reach, in usual steps."""


def stamped_friction(log: Log) -> StampedFriction:
    """Identify mass, Coulomb and viscous friction from a log with a force and a velocity or position.

    Of several widths of the polynomials the one counts whose error is least: chance, together with the difference to
    the next narrower one. Raises InputError for a log with too little steady sliding.
    """
    fits = [fit for width in WIDTHS_OF_POLYNOMIALS if (fit := _fit(log, width)) is not None]
    if not fits:
        least = ROWS_OF_A_STAMPED_FIT
        expected = f"{least} samples or more within moves: faster sampling, or longer moves"
        raise InputError("position", f"{len(log.time)} samples, of which fewer slide", expected, "", log.name)
    apart = [np.abs(fit.solution - other.solution) for fit, other in zip(fits, [fits[0], *fits], strict=False)]
    apart[0] = apart[1] if len(fits) > 1 else np.zeros(4)
    relative = [(fit.deviations[0] + away[0]) / abs(fit.solution[0]) for fit, away in zip(fits, apart, strict=True)]
    best = int(np.argmin(relative))
    fit, away = fits[best], apart[best]
    steps = np.diff(log.time)
    usual = float(np.median(steps))
    regular = steps[steps <= STEPS_OF_A_HOLE * usual]
    estimates, correlation = _estimates(log, fit, away)
    curve = fit.columns[:, 1:] @ fit.solution[1:]
    velocity, inertia = fit.columns[:, 1], fit.columns[:, 0] * fit.solution[0]
    shown = (float(steps.min()), usual, float(regular.max()))
    return StampedFriction(log, estimates, correlation, velocity, fit.force - inertia, curve, fit.width, shown)


def _estimates(log: Log, fit: _StampedFit, away: np.ndarray) -> tuple[tuple[Estimate, ...], np.ndarray]:
    """Return the estimates of a fit, and the correlation of those with a value.

    The fitted numbers are `away` from those with narrower polynomials.
    """
    size, both = fit.deviations, len(np.unique(np.sign(fit.columns[:, 1]))) == 2
    estimates = []
    for i, (name, unit) in enumerate(_NAMES):
        unit = unit_of(unit, log)
        if not both and i > 1:
            estimates.append(Estimate.unknown(name, unit, METHOD_OF_STAMPS, _ONE_WAY))
            continue
        one = Estimate.normal(name, unit, fit.solution[i], size[i], METHOD_OF_STAMPS).widened(float(away[i]))
        estimates.append(one if i > 2 else one.if_positive("its interval reaches down to zero"))
    kept = [i for i, estimate in enumerate(estimates) if estimate.determined]
    return tuple(estimates), fit.covariance[np.ix_(kept, kept)] / np.outer(size[kept], size[kept])


DEGREE_OF_POLYNOMIALS = 3
"""Degree of local polynomials of force and velocity; a position has one more. With 2 a quintic move of 17 samples
shows 3 % too much mass, with 3 0.2 %."""

SPEED_SHARE_OF_STAMPED_SLIDING = 0.03
"""Smallest speed that counts as sliding, relative to the highest."""


def _fit(log: Log, width: int) -> _StampedFit | None:
    """Fit force = M a + F_v v + F_c sign(v) + offset within moves, with polynomials over `width` samples.

    The result is None if too few polynomials lie within moves in one direction and without holes.
    """
    time, force = log.time, channel(log, "force")
    smooth = local_polynomials(time, force, DEGREE_OF_POLYNOMIALS, width)[0]
    if "velocity" in log:
        velocity, acceleration, _ = local_polynomials(time, log["velocity"], DEGREE_OF_POLYNOMIALS, width)
    else:
        place = channel(log, "position")
        _, velocity, acceleration = local_polynomials(time, place, DEGREE_OF_POLYNOMIALS + 1, width)
    speed = np.abs(velocity)
    direction = np.sign(velocity) * (speed > SPEED_SHARE_OF_STAMPED_SLIDING * np.nanmax(speed, initial=0.0))
    whole = np.append(np.diff(time) <= STEPS_OF_A_HOLE * np.median(np.diff(time)), False)
    groups, rows, half = np.zeros(len(time), int), np.zeros(len(time), bool), width // 2
    number = 0
    for sign in (-1.0, 1.0):
        for part in runs(direction == sign):
            for piece in runs(np.append(whole[part.start : part.stop - 1], False)) or []:
                first, last = part.start + piece.start + half, part.start + piece.stop + 1 - half
                rows[first:last], number = True, number + 1
                groups[first:last] = number
    if np.count_nonzero(rows) < ROWS_OF_A_STAMPED_FIT:
        return None
    columns = np.stack([acceleration, velocity, np.sign(velocity), np.ones_like(velocity)], axis=1)[rows]
    if len(np.unique(np.sign(velocity[rows]))) == 1:
        columns[:, 3] = 0.0  # motion in one direction only adds a constant force to Coulomb friction
    scale = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    solution = np.linalg.lstsq(columns / scale, smooth[rows], rcond=1e-10)[0] / scale
    covariance = spread_of(columns, smooth[rows] - columns @ solution, (groups[rows],))
    return _StampedFit(width, columns, smooth[rows], solution, covariance)
