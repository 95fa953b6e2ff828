"""Shares of draws, machines or rails of which something holds, with their 95 % intervals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest


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
    low = binomtest(hits, count).proportion_ci(0.95, method="exact").low
    high = binomtest(hits + unknown, count).proportion_ci(0.95, method="exact").high
    return Share(hits / (count - unknown) if unknown < count else np.nan, float(low), float(high))
