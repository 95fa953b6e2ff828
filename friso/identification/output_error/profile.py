"""Compute profile intervals, by moving one parameter and refitting all others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from friso.identification.output_error.fit import OutputErrorFit, shift_against
from friso.identification.output_error.refine import Refined, mean_square, refine_fit
from friso.identification.output_error.settings import settings

WORSE = float(chi2.ppf(0.95, 1))
"""Increase of -2 ln(likelihood) at the ends of a 95 % interval."""


@dataclass(frozen=True)
class Profile:
    """Cost of a fit as one parameter is moved away, with all others refitted.

    `values` of the parameter ascend [SI]; `cost` has the mean square of the residual [N^2] at each. Inside the 95 %
    interval the cost is at most `limit`. `low` and `high` are the interval's ends; `open_low` and `open_high` mark ends
    that are only the range's.
    """

    name: str
    values: np.ndarray
    cost: np.ndarray
    limit: float
    low: float
    high: float
    open_low: bool
    open_high: bool


def profile(fit: OutputErrorFit, number: int, others: tuple[int, ...], best: float) -> tuple[Profile, Refined]:
    """Compute the cost of a fit over values of one parameter, with others refitted at each.

    The parameter has the index `number`, and `others` are the indices to refit. `best` is the mean square [N^2] of the
    fit with which costs are compared. The values reach beyond the interval's ends, or over the whole range. Returns the
    profile and the fits behind it.
    """
    low, high = (float(end[number]) for end in fit.problem.bounds)
    centre = fit.inner[number]
    spread = fit.covariance[fit.free.index(number), fit.free.index(number)] if number in fit.free else np.inf
    limit = best * (1 + WORSE / fit.independent)
    parameter = fit.problem.parameters[number]
    half = settings.deviations_of_a_profile * np.sqrt(spread) if spread > 0 else np.inf
    while True:
        near, far = max(low, centre - half), min(high, centre + half)
        values = np.unique([*np.linspace(near, far, settings.points_of_a_profile), centre])
        fits = _fits(fit, number, others, values, limit)
        cost = fits.cost
        left, right, open_left, open_right = _ends(values, cost, limit)
        if not ((open_left and near > low) or (open_right and far < high)):
            break
        half *= settings.widening_of_a_profile
    ends = float(parameter.outer(left)), float(parameter.outer(right))
    return Profile(parameter.name, parameter.outer(values), cost, limit, *ends, open_left, open_right), fits


def _fits(fit: OutputErrorFit, number: int, others: tuple[int, ...], values: np.ndarray, limit: float) -> Refined:
    """Fit all other parameters at each of the `values` of the parameter with the index `number`.

    The `others` are indices. A fit whose mean square would stay above `limit` is abandoned.
    """
    starts = np.repeat(fit.inner[None], len(values), axis=0)
    starts[:, number] = values
    if not others:
        return Refined(starts, mean_square(fit.problem.residuals(starts)))
    following = starts.copy()
    following[:, list(others)] += np.outer(values - fit.inner[number], _following(fit, number, others))
    following = np.clip(following, *fit.problem.bounds)
    stay, follow = mean_square(fit.problem.residuals(np.vstack([starts, following]))).reshape(2, -1)
    inner, cost = np.where((follow < stay)[:, None], following, starts), np.minimum(stay, follow)
    away = ~np.isclose(values, fit.inner[number], rtol=0, atol=1e-6 * np.ptp(values))
    free = np.isin(np.arange(starts.shape[1]), others)
    until = settings.iterations_of_a_profile, settings.cost_share_of_a_profile * WORSE / fit.independent
    refined = refine_fit([fit.problem], inner[away], free, *until, aim=limit, slopes=fit.slopes)
    inner[away], cost[away] = refined.inner, refined.cost
    return Refined(inner, cost)


def _following(fit: OutputErrorFit, number: int, others: tuple[int, ...]) -> np.ndarray:
    """Return how far other fitted numbers shift per shift of one, to first order, (others,).

    `number` is the index of the one, and `others` are those of the other numbers. The shifts are 0 if the one is not
    fitted.
    """
    if number not in fit.free:
        return np.zeros(len(others))
    slopes = fit.linearised[1]
    along, across = slopes[:, fit.free.index(number)], slopes[:, [fit.free.index(other) for other in others]]
    return shift_against(along, across)


def _ends(values: np.ndarray, cost: np.ndarray, limit: float) -> tuple[float, float, bool, bool]:
    """Find where a profile crosses the limit on either side of its minimum.

    `cost`, of the shape of `values`, is the profile. Returns the lower and the upper end, and for each end whether it
    is open. Where the profile does not cross the limit, the end is open, and is the first or last of the `values`.
    """
    lowest = int(np.argmin(cost))
    left, right = values[0], values[-1]
    inside = cost <= max(limit, cost[lowest])
    below, above = np.flatnonzero(~inside[:lowest]), np.flatnonzero(~inside[lowest:])
    if below.size:
        left = _crossing(values, cost, limit, below[-1], below[-1] + 1)
    if above.size:
        right = _crossing(values, cost, limit, lowest + above[0], lowest + above[0] - 1)
    return left, right, not below.size, not above.size


def _crossing(values: np.ndarray, cost: np.ndarray, limit: float, outside: int, inside: int) -> float:
    """Find where a profile crosses the limit between two neighbouring values.

    `outside` is the index of the value with a cost above the limit, `inside` that of the other. Between them, the
    square root of the excess cost is taken to grow linearly with distance from the best fit.
    """
    if not np.isfinite(cost[outside]):
        return values[inside]
    base = min(cost[inside], limit)
    share = np.sqrt((limit - base) / (cost[outside] - base)) if cost[outside] > base else 1.0
    return values[inside] + min(share, 1.0) * (values[outside] - values[inside])
