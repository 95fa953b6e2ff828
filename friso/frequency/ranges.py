"""Where something holds along one axis: ranges whose ends are located."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

FINER, ROUNDS = 9, 6
"""Into how many steps that with an end is divided, and how often: to 4 millionths of it."""

Range = tuple[float, float]


def ranges_below(at: np.ndarray, excess: Callable[[np.ndarray], np.ndarray]) -> tuple[Range, ...]:
    """The ranges of positive ascending places (n,) in which a function of them is below 0."""
    below = excess(at) < 0
    changes = np.flatnonzero(below[1:] != below[:-1])
    ends = [_end(at[k], at[k + 1], bool(below[k]), excess) for k in changes]
    ends = [*at[:1][below[:1]], *ends, *at[-1:][below[-1:]]]
    return tuple((float(a), float(b)) for a, b in zip(ends[::2], ends[1::2], strict=True))


def shared(first: tuple[Range, ...], second: tuple[Range, ...]) -> tuple[Range, ...]:
    """What two lists of ranges have in common."""
    pairs = [(max(a[0], b[0]), min(a[1], b[1])) for a in first for b in second]
    return tuple(pair for pair in pairs if pair[0] < pair[1])


def _end(low: float, high: float, first: bool, excess: Callable[[np.ndarray], np.ndarray]) -> float:
    """The zero of the function between two points; `first` says whether it is negative at the lower one."""
    for _ in range(ROUNDS):
        finer = np.geomspace(low, high, FINER)
        other = (excess(finer[1:-1]) < 0) != first
        k = int(other.argmax()) + 1 if other.any() else FINER - 1
        low, high = finer[k - 1], finer[k]
    return float(np.sqrt(low * high))
