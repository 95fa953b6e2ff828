"""How uncertain a least-squares fit is whose residuals are not independent: neighbouring errors are correlated."""

from __future__ import annotations

import numpy as np

LONGEST = 0.1
"""Share of the rows over which errors are looked at for likeness at most."""

COLLINEAR = 1e-6
"""Share of the largest eigenvalue below which columns of a Jacobian count as one: differences are no more precise."""


def correlation_length(residual: np.ndarray) -> int:
    """Rows after which residuals, shape (n,), are no longer correlated: the integrated autocorrelation up to its first
    zero, to both sides; 1 of white noise."""
    centred = residual - residual.mean()
    count = len(centred)
    spectrum = np.abs(np.fft.rfft(centred, 2 * count)) ** 2
    correlation = np.fft.irfft(spectrum)[: max(2, int(LONGEST * count))]
    if correlation[0] <= 0:
        return 1
    correlation = correlation / correlation[0]
    crossing = np.flatnonzero(correlation <= 0)
    last = crossing[0] if crossing.size else len(correlation)
    return max(1, round(2 * correlation[:last].sum() - 1))


def spread_of(jacobian: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Covariance of the parameters of a fit, shape (p, p), from its Jacobian, shape (n, p), and residual, shape (n,).

    Neither equal nor independent errors are assumed: Newey, West 1987, doi:10.2307/1913610, with the window as long as
    the residuals, or their products with a column, stay correlated. Directions in which the fit does not depend on the
    parameters have an infinite variance.
    """
    count, size = jacobian.shape
    scale = np.linalg.norm(jacobian, axis=0)
    positive = scale > 0
    columns = jacobian[:, positive] / scale[positive]
    inverse, alike = _inverse(columns.T @ columns)
    scores = columns * residual[:, None]
    window = max(correlation_length(series) for series in (residual, *scores.T))
    window = min(max(window, 1), max(2, int(LONGEST * count)))
    middle = scores.T @ scores
    for lag in range(1, window):
        shifted = scores[lag:].T @ scores[:-lag]
        middle += (1 - lag / window) * (shifted + shifted.T)
    sandwich = inverse @ middle @ inverse * count / max(count - size, 1)
    covariance = np.full((size, size), np.inf)
    sandwich[alike], sandwich[:, alike] = np.inf, np.inf
    covariance[np.ix_(positive, positive)] = sandwich / np.outer(scale[positive], scale[positive])
    return covariance


def _inverse(square: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The inverse of columns of length 1 times themselves, and which of these cannot be distinguished from others."""
    sizes, directions = np.linalg.eigh(square)
    lost = sizes < COLLINEAR * sizes[-1]
    resolved = directions[:, ~lost]
    alike = (np.abs(directions[:, lost]) > np.sqrt(COLLINEAR)).any(axis=1)
    return resolved / sizes[~lost] @ resolved.T, alike
