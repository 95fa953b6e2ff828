"""Compute medians and paired differences of machines, with 95 % intervals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import binom

from friso.intervals import COVERAGE


@dataclass(frozen=True)
class EstimatedValue:
    """A value and its 95 % interval; NaN if unknown."""

    value: float
    low: float
    high: float


def median(values: np.ndarray) -> EstimatedValue:
    """Return the median of values (n,) and its 95 % interval, from those that are not NaN.

    Infinite values are allowed.
    """
    ranked = np.sort(values[~np.isnan(values)])
    if not ranked.size:
        return EstimatedValue(np.nan, np.nan, np.nan)
    return EstimatedValue(_middle(ranked), *quantile_interval(ranked, 0.5))


def quantile_interval(values: np.ndarray, share: float) -> tuple[float, float]:
    """Return the 95 % interval of a quantile of a population, from values (n,) drawn from it.

    A fraction `share` of the population lies below the quantile. The interval by order statistics (David, Nagaraja
    2003, Order Statistics, Sec. 7.1) holds for any distribution. It is infinite for too few values.
    """
    ranked = np.concatenate([[-np.inf], np.sort(values), [np.inf]])
    low, high = (int(binom.ppf(tail, values.size, share)) for tail in (0.025, 0.975))
    return float(ranked[low]), float(ranked[high + 1])


def _middle(ordered: np.ndarray) -> float:
    """Return the median of ordered values, which may be infinite."""
    low, high = ordered[(len(ordered) - 1) // 2], ordered[len(ordered) // 2]
    return float(low if low == high else (low + high) / 2)


def difference(flags: np.ndarray, before: np.ndarray) -> EstimatedValue:
    """Return how much more probable an event is with a change than `before`, on paired machines.

    `flags` and `before`, (count,), are true for machines with the event. The interval is Wald's, with half a machine
    added to every cell (Agresti, Min 2005, doi:10.1002/sim.1781). The result is NaN without machines.
    """
    count = len(flags)
    if not count:
        return EstimatedValue(np.nan, np.nan, np.nan)
    gained, lost = (int(np.count_nonzero(cell)) for cell in (flags & ~before, ~flags & before))
    more, less, total = gained + 0.5, lost + 0.5, count + 2
    centre = (more - less) / total
    half = COVERAGE * np.sqrt((more + less) - (more - less) ** 2 / total) / total
    return EstimatedValue((gained - lost) / count, max(-1.0, float(centre - half)), min(1.0, float(centre + half)))
