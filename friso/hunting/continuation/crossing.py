"""Locate where scattered values pass zero or turn, by a cubic with an error bound."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from friso.hunting.continuation.settings import continuation_settings


class Crossing(NamedTuple):
    """Where values pass zero over a key's range, with an error bound and the slope there.

    `place` runs from 0 to 1 over the range, and `reserve` bounds its error. `slope` is the change of the value per
    place.
    """

    place: float
    reserve: float
    slope: float


def crossing(places: np.ndarray, values: np.ndarray) -> Crossing | None:
    """Fit a cubic to values over places, shape (n,), and return where it passes zero.

    A zero counts if it lies within the range of places, and the cubic goes up or down there as the values do overall.
    The last zero that counts is returned.

    Its error is twice the distance by which the scatter of the values may shift it. If another zero within the range,
    counted or not, lies farther away than that, the error is the distance to the farthest.

    Returns None if there are too few values, if no zero counts, or if the error exceeds half of the range of places.
    """
    if len(places) < continuation_settings.least_cubic_values:
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
    """A fold: how far along the branch it lies, where in the key's range, and with what error.

    `length` is along the branch, from where the curve was fitted. `place` runs from 0 to 1 over the key's range, and
    `reserve` bounds its error.
    """

    length: float
    place: float
    reserve: float


def turn(lengths: np.ndarray, places: np.ndarray) -> FoldBack | None:
    """Fit a cubic to places over lengths along a branch, shape (n,); return where it turns back.

    Of several such points, the one nearest to length 0 counts. The error of the place is twice the scatter about the
    cubic. Returns None if there are too few places, or if the cubic does not turn within the lengths. Returns None as
    well if the error exceeds half of the range of places.
    """
    if len(places) < continuation_settings.least_cubic_values:
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
    """Return the standard deviation of values, (n,), about a cubic `curve` through them.

    `at`, shape (n,), are the places of the values.
    """
    return float(np.sqrt(np.sum((values - curve(at)) ** 2) / (len(at) - 4)))
