"""Fractions of runs, draws, machines or rails with a property, and their 95 % intervals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

DOUBT_PROBABILITY = 0.05
"""Probability outside an interval."""


@dataclass(frozen=True)
class Share:
    """The probability of an outcome, estimated from runs, with its interval, usually of 95 %.

    The interval, from `low` to `high` (Clopper, Pearson), holds whatever the outcome of failed runs would have been.
    The probability is NaN if no run succeeded.
    """

    probability: float
    low: float
    high: float


def share(flags: np.ndarray, decided: np.ndarray, doubt: float = DOUBT_PROBABILITY) -> Share:
    """Return the fraction of runs with `flags` set, among those that are `decided`.

    Both arrays have any one shape. The interval allows for either outcome of undecided runs. It misses the probability
    with a probability of at most `doubt`.
    """
    count, unknown = np.size(flags), int(np.count_nonzero(~decided))
    hits = int(np.count_nonzero(flags & decided))
    if not count:
        return Share(np.nan, 0.0, 1.0)
    (low, _), (_, high) = share_interval(hits, count, doubt), share_interval(hits + unknown, count, doubt)
    return Share(hits / (count - unknown) if unknown < count else np.nan, low, high)


def separation(values: np.ndarray, flags: np.ndarray) -> tuple[float, float]:
    """Return how well `values` separate the flagged runs from others, and how probable it is by chance.

    The measure is the rank-biserial correlation (Kerby 2014, doi 10.2466/11.IT.3.1): 1 if all flagged runs have the
    larger values, -1 if they have the smaller ones, 0 if the values separate nothing. Some runs must be flagged, and
    some not. The probability is that of Mann and Whitney's test.
    """
    from scipy.stats import mannwhitneyu  # 0.7 s to import

    test = mannwhitneyu(values[flags], values[~flags])
    return 2 * float(test.statistic) / (flags.sum() * (~flags).sum()) - 1, float(test.pvalue)


def share_interval(hits: int, count: int, doubt: float = DOUBT_PROBABILITY) -> tuple[float, float]:
    """Return the interval of a probability that misses it with a probability of at most `doubt`.

    `hits` of `count` independent trials were seen. Clopper and Pearson 1934, doi:10.1093/biomet/26.4.404. SciPy's
    special functions serve, because its statistics take 0.7 s to import.
    """
    from scipy.special import betaincinv

    low = betaincinv(hits, count - hits + 1, doubt / 2) if hits else 0.0
    high = betaincinv(hits + 1, count - hits, 1 - doubt / 2) if hits < count else 1.0
    return float(low), float(high)


def quantile_interval(values: np.ndarray, share: float) -> tuple[float, float]:
    """Return the 95 % interval of a quantile of a population, from values (n,) drawn from it.

    A fraction `share` of the population lies below the quantile. The interval by order statistics (David, Nagaraja
    2003, Order Statistics, Sec. 7.1) holds for any distribution. It is infinite for too few values.
    """
    from scipy.stats import binom

    ranked = np.concatenate([[-np.inf], np.sort(values), [np.inf]])
    low, high = (int(binom.ppf(tail, values.size, share)) for tail in (0.025, 0.975))
    return float(ranked[low]), float(ranked[high + 1])
