"""Fit a concave, rising curve from 0 to measured points, by least squares.

Parallel springs that slip one after the other make such a curve. Knots near rest that the points do not support only
follow noise, and are left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

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
        return float(np.sum(self.strength * _SLOPES[:, None] / self.knots))

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Return the curve's values at x, shape (m,); it is constant beyond the last knot."""
        return _shapes(x, self.knots) @ self.strength.ravel()


_SLOPES = np.array([1.0, 2.0])
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
    gain = (_SLOPES[:, None] / knots).ravel()[free]
    spread = np.linalg.pinv(rows[:, free]).T @ gain
    noise = away / np.sqrt(max(points - len(free), 1))
    if points <= settings.most_knots:
        noise = max(noise, settings.least_noise * end)
    error = float(noise * np.linalg.norm(spread))
    return ConcaveFit(knots[first:], strength[:, first:], error, misfit, len(free))
