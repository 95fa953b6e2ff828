"""Compute the uncertainty of a least-squares fit with correlated residuals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import t as student

from friso.identification.settings import identification_settings
from friso.intervals import NORMAL_COVERAGE

UPPER_PROBABILITY = 0.975
"""Cumulative probability at the upper end of a 95 % interval, for Student's t."""


def correlation_length(residual: np.ndarray) -> int:
    """Return over how many rows residuals, (n,), are correlated; 1 for white noise.

    The length is the autocorrelation summed to both sides, up to its first zero.
    """
    centred = residual - residual.mean()
    count = len(centred)
    spectrum = np.abs(np.fft.rfft(centred, 2 * count)) ** 2
    correlation = np.fft.irfft(spectrum)[: max(2, int(identification_settings.row_share_of_likeness * count))]
    if correlation[0] <= 0:
        return 1
    correlation = correlation / correlation[0]
    crossing = np.flatnonzero(correlation <= 0)
    last = crossing[0] if crossing.size else len(correlation)
    return max(1, round(2 * correlation[:last].sum() - 1))


def groups_of(position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> tuple[np.ndarray, ...]:
    """Number groups of samples whose errors may be correlated; three arrays of shape (n,).

    Groups are blocks of time, of position [m], and of velocity [m/s], split into speeding up and slowing down by the
    acceleration [m/s^2]. Model errors recur with place and speed, so a repeated motion gives no new information.
    """
    return (
        np.arange(len(position)) * identification_settings.blocks_of_time // len(position),
        binned(position, identification_settings.bins_of_place_and_speed),
        2 * binned(velocity, identification_settings.bins_of_place_and_speed) + (velocity * acceleration > 0),
    )


def binned(values: np.ndarray, count: int) -> np.ndarray:
    """Return for each value the number of its bin, of `count` bins of equal width; shape (n,)."""
    edges = np.linspace(values.min(), values.max(), count + 1)[1:-1]
    return np.digitize(values, edges)


def spread_of(jacobian: np.ndarray, residual: np.ndarray, groups: Sequence[np.ndarray] = ()) -> np.ndarray:
    """Return the covariance of fitted parameters, (p, p).

    The Jacobian has the shape (n, p), the residual (n,). Errors need be neither equal nor independent: Newey, West
    1987, doi:10.2307/1913610, with a window as long as the residuals, or their products with a column, stay correlated.

    Errors may also be correlated within each of some `groups` (Cameron, Miller 2015, doi:10.3368/jhr.50.2.317), numbers
    of shape (n,): each parameter has the largest of the resulting deviations, widened by Student's t for the number of
    groups. Directions in which the fit does not depend on the parameters have an infinite variance.
    """
    count, size = jacobian.shape
    scale = np.linalg.norm(jacobian, axis=0)
    positive = scale > 0
    columns = jacobian[:, positive] / scale[positive]
    inverse, alike = _inverse(columns.T @ columns)
    scores = columns * residual[:, None]
    sandwich = inverse @ _neighbours(scores, residual) @ inverse * count / max(count - size, 1)
    deviation = np.sqrt(np.diag(sandwich))
    widest = deviation.copy()
    for group in groups:
        widest = np.maximum(widest, np.sqrt(np.diag(inverse @ _together(scores, group) @ inverse)))
    wider = np.divide(widest, deviation, out=np.ones_like(widest), where=deviation > 0)
    sandwich = sandwich * np.outer(wider, wider)
    covariance = np.full((size, size), np.inf)
    sandwich[alike], sandwich[:, alike] = np.inf, np.inf
    covariance[np.ix_(positive, positive)] = sandwich / np.outer(scale[positive], scale[positive])
    return covariance


def _neighbours(scores: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Return the covariance of the sum of scores, (n, p), whose neighbours are correlated.

    Scores are the columns of the fit times the residual, (n,).
    """
    count = len(scores)
    window = max(correlation_length(series) for series in (residual, *scores.T))
    window = min(max(window, 1), max(2, int(identification_settings.row_share_of_likeness * count)))
    return covariance_of_sum(scores, window)


def covariance_of_sum(scores: np.ndarray, window: int) -> np.ndarray:
    """Return the covariance of the sum of scores, (n, p), which are correlated over less than a `window` of rows.

    The weight of a correlation falls linearly with the distance (Newey, West 1987, doi:10.2307/1913610).
    """
    total = scores.T @ scores
    for lag in range(1, min(window, len(scores))):
        cross = scores[lag:].T @ scores[:-lag]
        total += (1 - lag / window) * (cross + cross.T)
    return total


def _together(scores: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Return the covariance of the sum of scores, (n, p), that are correlated within groups.

    `group`, shape (n,), has the number of each row's group. Scores are the columns of the fit times the residual. The
    covariance is scaled so that normal intervals of `NORMAL_COVERAGE` deviations hold. The degrees of freedom are the
    effective number of equal groups less 1.
    """
    names, members = np.unique(group, return_inverse=True)
    sums = np.stack([np.bincount(members, column, len(names)) for column in scores.T], axis=1)
    power = np.bincount(members, (scores**2).sum(axis=1), len(names))
    equal = power.sum() ** 2 / (power @ power) if power.any() else 1.0
    freedom = max(equal - 1, identification_settings.least_freedom_of_groups)
    wider = float(student.ppf(UPPER_PROBABILITY, freedom)) / NORMAL_COVERAGE
    return wider**2 * (1 + 1 / freedom) * (sums.T @ sums)


def _inverse(square: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Invert X' X for unit columns X, and tell which columns the others can replace.

    Directions that the columns do not resolve are left out. `square` is X' X, shape (p, p); the second result has the
    shape (p,).
    """
    sizes, directions = np.linalg.eigh(square)
    collinear = sizes < identification_settings.eigenvalue_of_likeness * sizes[-1]
    resolved = directions[:, ~collinear]
    alike = (np.abs(directions[:, collinear]) > np.sqrt(identification_settings.eigenvalue_of_likeness)).any(axis=1)
    return resolved / sizes[~collinear] @ resolved.T, alike
