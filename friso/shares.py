"""Shares of runs, draws, machines or rails of which something holds, with their 95 % intervals."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from friso.roots import bracketed_root

DOUBT = 0.05
"""Probability that lies outside an interval."""

ODDS, PRECISE = 60.0, 1e-12
"""Range of the logarithm of the odds in which the ends of intervals are looked for, and how closely."""


@dataclass(frozen=True)
class Share:
    """The probability of something, by a share of runs (NaN: none is known), and its 95 % interval (Clopper, Pearson),
    which holds whatever became of the runs that failed."""

    probability: float
    low: float
    high: float


def share(flags: np.ndarray, decided: np.ndarray) -> Share:
    """The share of runs of which something holds, `flags`, among those where it is `decided`, both of any one shape;
    the others count either way in the interval."""
    count, unknown = np.size(flags), int(np.count_nonzero(~decided))
    hits = int(np.count_nonzero(flags & decided))
    if not count:
        return Share(np.nan, 0.0, 1.0)
    (low, _), (_, high) = share_interval(hits, count), share_interval(hits + unknown, count)
    return Share(hits / (count - unknown) if unknown < count else np.nan, low, high)


def share_interval(hits: int, count: int) -> tuple[float, float]:
    """The 95 % interval of a probability: `hits` of `count` independent trials came true (Clopper and Pearson 1934,
    doi:10.1093/biomet/26.4.404). From the binomial distribution itself: SciPy's functions take 0.3 s to import."""
    low = _probability(hits, count) if hits else 0.0
    high = 1 - _probability(count - hits, count) if hits < count else 1.0
    return low, high


def _probability(hits: int, count: int) -> float:
    """The probability with which as many hits or more of so many trials are as rare as half of `DOUBT`."""
    k = np.arange(1, count + 1)
    factorials = np.concatenate([[0.0], np.cumsum(np.log(k))])
    k = k[hits - 1 :]
    ways = factorials[count] - factorials[k] - factorials[count - k]

    def too_many(odds: float) -> float:
        log_no = -np.logaddexp(0.0, odds)
        return float(np.exp(ways + k * odds + count * log_no).sum()) - DOUBT / 2

    odds = bracketed_root(too_many, -ODDS, ODDS, PRECISE)
    return 1 / (1 + math.exp(-odds))
