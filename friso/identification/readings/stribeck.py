"""Fit a Stribeck curve to friction at constant speeds, with profile intervals.

At a given Stribeck velocity and exponent the curve is linear in all other parameters. Least squares are therefore
computed over a grid of both, and an interval contains every value that explains the forces within chance, for any
exponent (profile likelihood). A linearised interval at the best fit is much too narrow, because another exponent with
another velocity may fit as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import f as fisher

from friso.identification.output_error.settings import settings as output_error_settings
from friso.identification.readings.common import t_value
from friso.identification.readings.settings import settings as reading_settings


@dataclass(frozen=True)
class Possible:
    """A parameter's best value, and the range that the forces allow.

    The range is `closed` unless it reaches an end of the search.
    """

    value: float
    low: float
    high: float
    closed: bool


@dataclass(frozen=True)
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


def stribeck_fit(forces: Forces, plain: float, exponent: float | None) -> FittedStribeck | None:
    """Fit a Stribeck curve to forces; return None if a straight line fits as well.

    `plain` is the line's sum of squares over variances. A given `exponent` is used unless the forces refute it; too few
    forces leave all exponents possible.
    """
    speeds = forces.speeds
    low = speeds.min() / reading_settings.ratio_below_the_slowest
    high = speeds.max() * reading_settings.ratio_above_the_fastest
    velocities = np.geomspace(low, high, reading_settings.grid_of_velocities)
    least, most = output_error_settings.stribeck_exponents
    shapes = np.linspace(least, most, reading_settings.grid_of_exponents)
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
        refuted = not apart and bool(fisher.sf(worse, 1, left) < reading_settings.chance_of_a_curve)
        if not refuted:
            grid, left = stated, left + (not apart)
    free = len(grid.shapes) > 1 and not apart
    usual = grid
    if free:
        usual = _Grid(forces, velocities, np.array([reading_settings.usual_exponent]), False).around(left + free)
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
    return bool(chance < reading_settings.chance_of_a_curve)


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
        for _ in range(reading_settings.refinements_of_the_grid if np.isfinite(self.least) and left > 0 else 0):
            inside, ends, margin = grid.room(left) >= 0, [], reading_settings.margin_of_the_grid
            for points, here in ((grid.velocities, inside.any(axis=1)), (grid.shapes, inside.any(axis=0))):
                at = np.flatnonzero(here)
                ends += [points[max(at[0] - margin, 0)], points[min(at[-1] + margin, len(points) - 1)]]
            several = np.linspace(ends[2], ends[3], reading_settings.grid_of_exponents)
            velocities = np.geomspace(ends[0], ends[1], reading_settings.grid_of_velocities)
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
        cut = any(float(self.shapes[shaped][end]) == output_error_settings.stribeck_exponents[end] for end in (0, -1))

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
            linear(0, 1.0, shared, not ends[1]),
            linear(1, 1 / fastest, 0.0, not ends[1]),
            linear(2, 1.0, shared, not ends[0]),
            Possible(float(self.velocities[best[0]]), *velocities, not any(ends)),
            Possible(float(self.shapes[best[1]]), *shapes, open_shape and not (cut or self.apart)),
            linear(3, 1.0, 0.0, True) if forces.both else Possible(0.0, 0.0, 0.0, False),
            self._covariance((int(best[0]), int(best[1])), scatter, open_shape and not self.apart),
            refuted,
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
