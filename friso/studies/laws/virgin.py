"""Read a measured virgin curve, which replaces that of the stage's friction law.

It is given by points of friction force over displacement from rest. A concave, rising curve from 0 is fitted by least
squares: parallel springs that slip one after the other make such a curve. Knots near rest that the points do not
support only follow noise, and are left out.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import nnls

from friso.axis import AxisKind
from friso.equations.friction.measured import MeasuredFriction, virgin_displacements
from friso.errors import InputError
from friso.identification.logs.read import read_table
from friso.identification.logs.units import unit_factor
from friso.studies.settings import settings


@dataclass(frozen=True)
class ConcaveFit:
    """A concave curve that rises from 0, with n increasing `knots`, where parts of it end.

    The curve is a sum of parts, one for each knot and kind. A part of the first kind is straight up to its knot; one of
    the second kind is bent, so that its slope falls to 0 there. `strength`, shape (2, n), is the end value of each
    part. `error` is the standard error of the initial slope. `misfit` is -2 times the logarithm of the likelihood, and
    `free` the number of free parameters.
    """

    knots: np.ndarray
    strength: np.ndarray
    error: float
    misfit: float
    free: int

    @property
    def corners(self) -> np.ndarray:
        """Return the knots at which a part of the curve ends; knots without a part are left out."""
        return self.knots[self.strength.any(axis=0)]

    @property
    def akaike(self) -> float:
        """Return Akaike's criterion: the smaller it is, the more likely the curve."""
        return self.misfit + 2 * self.free

    @property
    def slope(self) -> float:
        """Return the slope at the start of the curve."""
        return float(np.sum(self.strength * INITIAL_SLOPES[:, None] / self.knots))

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Return the curve's values at x, shape (m,); it is constant beyond the last knot."""
        return _shapes(x, self.knots) @ self.strength.ravel()


INITIAL_SLOPES = np.array([1.0, 2.0])
"""Initial slopes of both kinds of parts, in units of their end value over their knot."""


def _shapes(x: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Return the parts, each with end value 1, whose weighted sum is a concave curve.

    Their values at x, shape (m,), have the shape (m, 2 n) for n `knots`. Every part rises from 0 at x = 0 to 1 at its
    knot, and stays 1 beyond. The first n parts rise straight. The other n rise as parabolas whose slope falls to 0 at
    the knot. Below x = 0, where noise may lead, all parts continue straight.
    """
    reached = np.minimum(x[:, None] / knots, 1.0)
    return np.hstack([reached, reached * (2 - np.maximum(reached, 0.0))])


def knots_of(x: np.ndarray) -> np.ndarray:
    """Return the knots at which a curve through points, shape (m,), may bend.

    The knots are all points but 0, or some of them: closer together near 0, but not closer than the scatter of x.
    """
    back = np.minimum(np.diff(x), 0.0)
    places = np.unique(x[x > settings.blurred_scatters * np.sqrt(np.mean(back**2))])
    places = places[
        np.append(
            places[0] >= settings.knot_distance * places[-1], np.diff(places) > settings.knot_distance * places[-1]
        )
    ]
    if len(places) <= settings.most_knots:
        return places
    wanted = np.geomspace(places[0], places[-1], settings.most_knots)
    return places[np.unique(np.searchsorted(places, wanted).clip(max=len(places) - 1))]


def concave_fits(x: np.ndarray, y: np.ndarray, end: float) -> Iterator[ConcaveFit]:
    """Yield concave curves through points x and y, both (m,), that reach the value `end`.

    Fits use straight parts and, for many points, bent parts too. The first fit uses all knots, and each further one
    leaves out one more knot near 0, until fits are far worse than the best. Beyond the points a curve continues with
    its final slope, at most as far again.
    """
    knots = knots_of(x)
    rows = _rows(x, y, knots)
    straight, _ = nnls(rows[:, : len(knots)], rows[:, -1], maxiter=settings.fit_steps)
    slope, lacks = straight[-1] / knots[-1], end - straight.sum()
    further = min(lacks / slope, knots[-1]) if slope > 0 else knots[-1]
    if further > settings.knot_distance * knots[-1] and lacks > 0:
        knots = np.append(knots, knots[-1] + further)
        rows = _rows(x, y, knots)
    rows = np.vstack([rows, settings.end_weight * np.sqrt(len(x)) * np.append(np.ones(2 * len(knots)), end)])
    best = np.inf
    for bent in (False, True)[: 1 + (len(x) > settings.most_knots)]:
        for first in range(len(knots)):
            fit = _fit(rows, knots, first, bent, len(x), end)
            best = min(best, fit.akaike)
            if fit.akaike > best + settings.hopeless_criterion:
                break
            yield fit


def _rows(x: np.ndarray, y: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Return the equations of the least-squares fit, reduced to as few rows as unknowns.

    For n knots the shape is (2 n + 1, 2 n + 1) at most; the last column is the right-hand side.
    """
    return np.asarray(np.linalg.qr(np.column_stack([_shapes(x, knots), y]), mode="r"))


def _fit(rows: np.ndarray, knots: np.ndarray, first: int, bent: bool, points: int, end: float) -> ConcaveFit:
    """Fit one curve, without the knots before index `first`, from the equations of all knots.

    Without `bent` it has straight parts only. `points` is the number of points, and `end` the value reached.
    """
    used = np.arange(2 * len(knots)).reshape(2, -1)[: 1 + bent, first:].ravel()
    weights, away = nnls(rows[:, used], rows[:, -1], maxiter=settings.fit_steps)
    strength = np.zeros((2, len(knots)))
    strength.flat[used] = weights
    free = used[weights > 0]
    misfit = float(points * np.log(away**2 / points + (settings.rounded_points * end) ** 2))
    gain = (INITIAL_SLOPES[:, None] / knots).ravel()[free]
    spread = np.linalg.pinv(rows[:, free]).T @ gain
    noise = away / np.sqrt(max(points - len(free), 1))
    if points <= settings.most_knots:
        noise = max(noise, settings.least_noise * end)
    error = float(noise * np.linalg.norm(spread))
    return ConcaveFit(knots[first:], strength[:, first:], error, misfit, len(free))


EXAMPLE = "displacement [um],force [N]"
"""Example heading of a file with a virgin curve."""


TRIED_OFFSETS = (-0.2, -0.1, -0.05, 0.05, 0.1, 0.2)
"""Displacements at which the force may begin, relative to the displacement at a third of static friction."""


@dataclass(frozen=True)
class VirginPoints:
    """Measured points of a virgin curve (friction force over displacement from rest).

    `displacement` [m] and `force` [N] have the shape (n,). `scatter` [N] is the standard deviation of the force about a
    smooth curve. `stiffness` [N/m] is the range of the initial slope, up to infinity if the points lie too far from
    rest.
    """

    displacement: np.ndarray
    force: np.ndarray
    scatter: float
    stiffness: tuple[float, float]

    def means(self, force: np.ndarray) -> np.ndarray:
        """Return forces at the displacements [N], averaged over neighbouring points.

        `force` has the shape (n,). An average is over `together` points, enough to suppress scatter, so the result is
        shorter.
        """
        return np.convolve(force, np.full(self.together, 1 / self.together), "valid")

    @property
    def together(self) -> int:
        """Return the number of neighbouring points in an average."""
        wanted = (self.usual / (settings.curve_error * max(self.force))) ** 2
        return int(np.clip(np.ceil(wanted), 1, max(len(self.force) // settings.most_knots, 1)))

    @property
    def usual(self) -> float:
        """Return the largest deviation [N] of the points that scatter alone should cause."""
        return self.scatter * float(np.sqrt(2 * np.log(len(self.force))))


def read_virgin_curve(path: str | os.PathLike[str], kind: AxisKind) -> tuple[np.ndarray, np.ndarray]:
    """Read displacement [m] from rest and force [N], both (n,), from a file in any log format.

    The file has one channel of each, recognised by their units for this `kind` of axis. Raises InputError or LogError
    for a file without such a curve.
    """
    channels = read_table(Path(path)).channels
    displacement, force = (
        _channel(path, [(c.values, unit_factor(c.unit, unit)) for c in channels if c.unit], unit)
        for unit in (kind.length, kind.force)
    )
    if displacement.shape != force.shape or len(force) < settings.least_points:
        raise _refused(
            path,
            f"{len(displacement)} displacements and {len(force)} forces",
            f"{settings.least_points} points or more",
        )
    if len(force) > settings.most_points:
        raise _refused(path, f"{len(force)} points", f"at most {settings.most_points}: thin them out")
    if not (np.isfinite(displacement).all() and np.isfinite(force).all()):
        raise _refused(path, "a point that is no number", "numbers in every row")
    noise = settings.backward_share * displacement.max()
    if np.count_nonzero(displacement > 0) < settings.least_points - 1 or displacement.min() < -noise:
        raise _refused(path, "displacements at or below 0", "displacements from rest, positive")
    if np.any(np.maximum.accumulate(displacement) - displacement > noise):
        raise _refused(path, "displacements that do not increase", "displacements from rest (0) on, one way")
    if force.max() <= 0 or force[-1] < force[0] or np.median(force) <= 0:
        raise _refused(path, "a force that does not rise", "the force that opposes the displacement, positive")
    return displacement, force


def _channel(path: str | os.PathLike[str], candidates: list[tuple[np.ndarray, float | None]], unit: str) -> np.ndarray:
    """Return the values of the only channel that can be converted to a unit, in that unit.

    `candidates` are values and their factors to this unit. Raises InputError if none can be converted, or several.
    """
    in_unit = [values * factor for values, factor in candidates if factor is not None]
    if len(in_unit) != 1:
        raise _refused(
            path, f"{len(in_unit)} channels in {unit} or a part of it", f"one channel in {unit}, with its unit"
        )
    return in_unit[0]


def _refused(path: str | os.PathLike[str], actual: str, expected: str) -> InputError:
    return InputError("--virgin", f"{path}: {actual}", expected, f"a file that begins with: {EXAMPLE}")


def with_virgin_curve(
    measured: MeasuredFriction, displacement: np.ndarray, force: np.ndarray
) -> tuple[MeasuredFriction, VirginPoints]:
    """Replace the virgin curve of measured friction by points [m, N], both of shape (n,).

    The new curve is the nearest one of springs that slip one after the other: concave, from 0 to static friction, by
    least squares. The curve is straight between few points and smooth through many. Also returns the points with their
    scatter. Raises InputError for points that contradict static friction.
    """
    static = measured.levels.static
    end = float(force[-max(len(force) // settings.late_points, 1) :].mean())
    if not settings.reached_friction * static <= end <= static / settings.reached_friction:
        actual = f"points up to {end:.4g}, where friction.static is {static:.4g} (SI)"
        raise InputError("--virgin", actual, "points up to break-away", '--set friction.static="3 N"')
    away = displacement != 0  # the point at rest only shows the sensor's offset
    moved, rising = displacement[away], force[away]
    fits = list(concave_fits(moved, rising, static))
    fit, likeliest = (
        min(fits, key=lambda fit: fit.misfit + settings.number_gain * fit.free),
        min(fit.akaike for fit in fits),
    )
    if len(moved) > settings.most_knots:  # many points show where the force begins, if not at displacement 0
        third = np.interp(settings.first_friction * static, fit(np.sort(moved)), np.sort(moved))
        fits += [other for share in TRIED_OFFSETS for other in concave_fits(moved - share * third, rising, static)]
        likeliest = min(likeliest, *(other.akaike for other in fits))
    likely = [
        (a.slope, settings.slope_errors * a.error)
        for a in fits
        if a is fit or a.akaike <= likeliest + settings.likely_difference
    ]
    low, high = min(slope - error for slope, error in likely), max(slope + error for slope, error in likely)
    first = moved > 0
    blind = (
        np.count_nonzero(moved[first] <= fit.corners[0]) < 2
        or fit(moved[first][:1])[0] > settings.first_friction * static
    )
    high += high - fit.slope  # leaving out points near rest makes a curve softer, never stiffer
    ends = max(low, 0.0), np.inf if blind else high
    points = VirginPoints(displacement, force, _scatter(rising - fit(moved)), ends)
    at_rest = force[~away]
    if len(at_rest) and abs(at_rest.mean()) > settings.curve_error * static + points.usual:
        actual = f"a force of {at_rest.mean():.4g} at displacement 0 (SI)"
        raise InputError("--virgin", actual, "none there: less what the sensor shows at rest", f"{EXAMPLE}, then 0,0")
    dense = virgin_displacements(static, fit.slope, fit.corners)
    return replace(measured, stiffness=fit.slope, displacement=dense, force=fit(dense)), points


def _scatter(residual: np.ndarray) -> float:
    """Return the standard deviation of a curve's residual, shape (n,), without slow changes.

    Differences of neighbouring values show it.
    """
    return float(np.sqrt(np.mean(np.diff(residual) ** 2) / 2))
