"""Compute how wide an estimate is, and combine the estimates of several logs.

Residuals of a least-squares fit are correlated, so its uncertainty is computed for correlated residuals. Estimates of
one quantity become one value, with the correlations of the combined values.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2
from scipy.stats import t as student

from friso.identification.estimate import Estimate
from friso.identification.readings.common import Mean, by_t, t_value
from friso.intervals import NORMAL_COVERAGE

UPPER_PROBABILITY = 0.975
"""Cumulative probability at the upper end of a 95 % interval, for Student's t."""


ROW_SHARE_OF_LIKENESS = 0.1
"""Largest distance of correlated rows, relative to the number of rows."""


def correlation_length(residual: np.ndarray) -> int:
    """Return over how many rows residuals, (n,), are correlated; 1 for white noise.

    The length is the autocorrelation summed to both sides, up to its first zero.
    """
    centred = residual - residual.mean()
    count = len(centred)
    spectrum = np.abs(np.fft.rfft(centred, 2 * count)) ** 2
    correlation = np.fft.irfft(spectrum)[: max(2, int(ROW_SHARE_OF_LIKENESS * count))]
    if correlation[0] <= 0:
        return 1
    correlation = correlation / correlation[0]
    crossing = np.flatnonzero(correlation <= 0)
    last = crossing[0] if crossing.size else len(correlation)
    return max(1, round(2 * correlation[:last].sum() - 1))


BLOCKS_OF_TIME = 10
"""Number of blocks of time within which errors may be correlated."""

BINS_OF_PLACE_AND_SPEED = 20
"""Number of bins of place, and of speed, within which errors may be correlated. More contain too few rows."""


def groups_of(position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> tuple[np.ndarray, ...]:
    """Number groups of samples whose errors may be correlated; three arrays of shape (n,).

    Groups are blocks of time, of position [m], and of velocity [m/s], split into speeding up and slowing down by the
    acceleration [m/s^2]. Model errors recur with place and speed, so a repeated motion gives no new information.
    """
    return (
        np.arange(len(position)) * BLOCKS_OF_TIME // len(position),
        binned(position, BINS_OF_PLACE_AND_SPEED),
        2 * binned(velocity, BINS_OF_PLACE_AND_SPEED) + (velocity * acceleration > 0),
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
    window = min(max(window, 1), max(2, int(ROW_SHARE_OF_LIKENESS * count)))
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


LEAST_FREEDOM_OF_GROUPS = 3.0
"""Smallest number of degrees of freedom of correlated groups that is assumed (friso's choice)."""


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
    freedom = max(equal - 1, LEAST_FREEDOM_OF_GROUPS)
    wider = float(student.ppf(UPPER_PROBABILITY, freedom)) / NORMAL_COVERAGE
    return wider**2 * (1 + 1 / freedom) * (sums.T @ sums)


EIGENVALUE_OF_LIKENESS = 1e-6
"""Ratio of an eigenvalue to the largest, below which columns cannot be distinguished."""


def _inverse(square: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Invert X' X for unit columns X, and tell which columns the others can replace.

    Directions that the columns do not resolve are left out. `square` is X' X, shape (p, p); the second result has the
    shape (p,).
    """
    sizes, directions = np.linalg.eigh(square)
    collinear = sizes < EIGENVALUE_OF_LIKENESS * sizes[-1]
    resolved = directions[:, ~collinear]
    alike = (np.abs(directions[:, collinear]) > np.sqrt(EIGENVALUE_OF_LIKENESS)).any(axis=1)
    return resolved / sizes[~collinear] @ resolved.T, alike


Correlated = tuple[Sequence[Estimate], np.ndarray]
"""Estimates of one experiment that have a value, and their correlation matrix, shape (estimates, estimates)."""


def combined(estimates: Sequence[Estimate]) -> tuple[list[Estimate], list[str]]:
    """Combine all estimates into one per key, and list disagreements in sentences.

    Estimates are weighted by their intervals; if some disagree, the interval is widened. Experiments that determine a
    key override experiments that only bound it. If none determines the key, the common range of all remains, or a range
    that spans all if they have none in common.
    """
    answers, sentences = [], []
    for key in dict.fromkeys(estimate.name for estimate in estimates):
        estimates_of_key = [estimate for estimate in estimates if estimate.name == key]
        shown = determined(estimates_of_key)
        if len(shown) > 1:
            answer, agrees = _mean(key, shown)
        elif shown:
            answer, agrees = shown[0], True
        else:
            answer, agrees = _intersection(key, estimates_of_key)
        answers.append(answer)
        if not agrees:
            texts = _texts(shown or estimates_of_key)
            sentences.append(f"{key}: the experiments disagree, and the interval allows for it: {texts}")
        for estimate in estimates_of_key if shown else ():
            if not estimate.determined and (estimate.low > answer.high or estimate.high < answer.low):
                sentences.append(f"{key}: {_text(answer)} is shown, but {_text(estimate)}")
    return answers, sentences


def correlations(estimates: Sequence[Estimate], groups: Sequence[Correlated]) -> tuple[tuple[str, ...], np.ndarray]:
    """Return the keys of all groups, and the correlations (keys, keys) of their combined values."""
    keys = tuple(dict.fromkeys(estimate.name for group, _ in groups for estimate in group))
    shown = determined(estimates)
    precision = {key: sum(_weight(estimate) for estimate in shown if estimate.name == key) for key in keys}
    covariance = np.diag([1 / precision[key] for key in keys])
    for group, matrix in groups:
        # weights times standard deviations
        shares = np.array([_weight(estimate) ** 0.5 / precision[estimate.name] for estimate in group])
        places = [keys.index(estimate.name) for estimate in group]
        covariance[np.ix_(places, places)] += (matrix - np.eye(len(group))) * np.outer(shares, shares)
    size = np.sqrt(np.diag(covariance))
    joint = covariance / np.outer(size, size)
    return keys, (joint + joint.T) / 2


def determined(estimates: Sequence[Estimate]) -> list[Estimate]:
    """List the estimates that have a value; their intervals give them weights in a mean."""
    return [estimate for estimate in estimates if estimate.determined]


def _weight(estimate: Estimate) -> float:
    """Return the weight of an estimate: one over its variance."""
    return (NORMAL_COVERAGE / estimate.half_width) ** 2


CHANCE_OF_AGREEMENT = 0.01
"""Probability (chi-square) below which the scatter of estimates counts as disagreement."""


def _mean(key: str, estimates: Sequence[Estimate]) -> tuple[Estimate, bool]:
    """Return the weighted mean of one key's estimates, and whether they agree (chi-square).

    If agreeing estimates scatter more than their intervals allow, the interval is widened by the Birge ratio (Birge
    1932, doi:10.1103/PhysRev.40.207). For three or more it then follows Student's t. Systematic parts of the intervals
    do not average out.

    Estimates disagree, for example, if friction was measured at several places. A scatter common to all is then added
    (`_between`). Two estimates hardly show a scatter, so the interval then spans both.
    """
    values, weights = np.array([(estimate.value, _weight(estimate)) for estimate in estimates]).T
    mean, freedom = float(np.average(values, weights=weights)), len(values) - 1
    shared = float(np.average([estimate.systematic for estimate in estimates], weights=weights))
    squares = float(np.sum(weights * (values - mean) ** 2))
    method = ", ".join(dict.fromkeys(estimate.method for estimate in estimates))
    if chi2.sf(squares, freedom) > CHANCE_OF_AGREEMENT:
        errors = np.array([(estimate.half_width - estimate.systematic) / NORMAL_COVERAGE for estimate in estimates])
        error = float(np.linalg.norm(weights * errors)) / float(weights.sum())
        ratio = (squares / freedom) ** 0.5
        wider = ratio * t_value(freedom) if ratio > 1 and freedom > 1 else NORMAL_COVERAGE * max(ratio, 1.0)
        half = wider * error + shared
        return Estimate(key, estimates[0].unit, mean, mean - half, mean + half, method, systematic=shared), True
    if freedom == 1:
        low, high = min(estimate.low for estimate in estimates), max(estimate.high for estimate in estimates)
        return Estimate(key, estimates[0].unit, (low + high) / 2, low, high, method), False
    return by_t(key, estimates[0].unit, _between(values, 1 / weights), method, shared, shared), False


def _between(values: np.ndarray, variances: np.ndarray) -> Mean:
    """Return the mean, with its error, of values (n,) that scatter beyond their variances.

    A common variance is added, just large enough to explain the scatter (Paule, Mandel 1982, doi:10.6028/jres.087.022).
    The degrees of freedom are the effective number of values less 1, because an uncertain value says little about the
    scatter.
    """

    def excess(added: float) -> float:
        weights = 1 / (variances + added)
        return float(np.sum(weights * (values - np.average(values, weights=weights)) ** 2)) - (len(values) - 1)

    weights = 1 / (variances + brentq(excess, 0.0, float(np.ptp(values)) ** 2))
    equal = weights.sum() ** 2 / (weights @ weights)
    return Mean(float(np.average(values, weights=weights)), float(weights.sum() ** -0.5), max(float(equal) - 1, 1.0))


def _intersection(key: str, estimates: Sequence[Estimate]) -> tuple[Estimate, bool]:
    """Combine estimates without a value: the common range, or else a range that spans all.

    The second result is true if there is a common range.
    """
    bounding = [one for one in estimates if np.isfinite([one.low, one.high]).any()] or estimates[:1]
    low, high = max(estimate.low for estimate in bounding), min(estimate.high for estimate in bounding)
    agrees = low <= high
    if not agrees:
        low, high = min(estimate.low for estimate in bounding), max(estimate.high for estimate in bounding)
    method = ", ".join(dict.fromkeys(estimate.method for estimate in bounding))
    reason = _reasons([estimate.reason for estimate in bounding])
    return Estimate.unknown(key, estimates[0].unit, method, reason, low, high), agrees


def _reasons(reasons: Sequence[str]) -> str:
    """Join reasons; if several differ in numbers only, name the first and count the rest."""
    alike: dict[str, list[str]] = {}
    for reason in dict.fromkeys(reasons):
        alike.setdefault(re.sub(r"\d[\d.e+-]*", "#", reason), []).append(reason)
    parts = [first + (f", and the like {len(others)} times" if others else "") for first, *others in alike.values()]
    return "; ".join(parts)


def _text(estimate: Estimate) -> str:
    """Return an estimate in words: its value with interval, or its range, and its method."""
    return f"{_value(estimate)} by {estimate.method}"


def _texts(estimates: Sequence[Estimate]) -> str:
    """Return several estimates in words, with their methods."""
    methods = dict.fromkeys(estimate.method for estimate in estimates)
    values_of = ([_value(estimate) for estimate in estimates if estimate.method == method] for method in methods)
    return "; ".join(f"{', '.join(values)} by {method}" for method, values in zip(methods, values_of, strict=True))


def _value(estimate: Estimate) -> str:
    """Return an estimate's value with its interval in words, or its range without a value."""
    if estimate.determined:
        return f"{estimate.value:.4g} ({estimate.low:.4g} to {estimate.high:.4g})"
    return f"{estimate.low:.4g} to {estimate.high:.4g} is the possible range"
