"""Where values that scatter pass zero, or turn, and up to what that is known: by a cubic through them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from friso.hunting.boundary.settings import ContinuationSettings


class Crossing(NamedTuple):
    """A place at which values pass zero, by how much it may be off, and their slope there."""

    place: float
    reserve: float
    slope: float


def crossing(places: np.ndarray, values: np.ndarray) -> Crossing | None:
    """The last place at which the cubic through values, (n,), passes zero in the direction of their trend. It may be
    off by twice what their scatter moves the cubic or their trend, or by the distance to where the cubic passes zero as
    well; None if that is more than half of the range of places, beyond which nothing is known, or if it does not pass
    zero, or there are too few values."""
    if len(places) < ContinuationSettings.current().least_cubic_values:
        return None
    trend, curve = (np.polynomial.Polynomial.fit(places, values, degree) for degree in (1, 3))
    slopes, roots = curve.deriv(), curve.roots()
    real = roots.real[np.abs(roots.imag) < 1e-9 * np.ptp(places)]
    inside = real[(real >= places.min()) & (real <= places.max())]
    steepness = float(trend.deriv()(0.0))
    along = inside[slopes(inside) * steepness > 0]
    if not along.size:
        return None
    place = float(along.max())
    slope = float(slopes(place))
    reserve = max(
        2 * _scatter(curve, places, values) / min(abs(slope), abs(steepness)), float(np.abs(inside - place).max())
    )
    return Crossing(place, reserve, slope) if reserve <= np.ptp(places) / 2 else None


class FoldBack(NamedTuple):
    """A length along a branch at which it turns back, its place there, and by how much that may be off."""

    length: float
    place: float
    reserve: float


def turn(lengths: np.ndarray, places: np.ndarray) -> FoldBack | None:
    """Where the cubic through places, (n,), over lengths turns, nearest to length 0. The place may be off by twice what
    they scatter about it; None if it does not turn among them, from either end by more than that, or there are too
    few."""
    if len(places) < ContinuationSettings.current().least_cubic_values:
        return None
    curve = np.polynomial.Polynomial.fit(lengths, places, 3)
    turns = curve.deriv().roots()
    real = turns.real[np.abs(turns.imag) < 1e-9 * np.ptp(lengths)]
    inside = real[(real >= lengths.min()) & (real <= lengths.max())]
    reserve = 2 * _scatter(curve, lengths, places)
    if not inside.size or reserve > np.ptp(places) / 2:
        return None
    length = float(inside[np.abs(inside).argmin()])
    return FoldBack(length, float(curve(length)), reserve)


def _scatter(curve: np.polynomial.Polynomial, at: np.ndarray, values: np.ndarray) -> float:
    """Standard deviation of values, (n,), about a cubic through them."""
    return float(np.sqrt(np.sum((values - curve(at)) ** 2) / (len(at) - 4)))
