"""Find the ranges along one axis in which a condition holds, with their ends located."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from friso.frequency.settings import settings

EVENLY, NEAR = np.linspace(0, 1, 6)[1:-1], np.array([-0.002, 0.0, 0.002])
"""Where a step that contains an end is divided: evenly, and near the zero of a straight line, as fractions of the
step."""

Range = tuple[float, float]


def ranges_below(at: np.ndarray, excess: Callable[[np.ndarray], np.ndarray]) -> tuple[Range, ...]:
    """Return the ranges in which a function is below 0, with their ends located.

    `at` are ascending positive arguments (n,) at which `excess`, the function, is evaluated first.
    """
    values = excess(at)
    below = values < 0
    changes = np.flatnonzero(below[1:] != below[:-1])
    ends = [_end(at[k : k + 2], values[k : k + 2], excess) for k in changes]
    ends = [*at[:1][below[:1]], *ends, *at[-1:][below[-1:]]]
    return tuple((float(a), float(b)) for a, b in zip(ends[::2], ends[1::2], strict=True))


def shared(first: tuple[Range, ...], second: tuple[Range, ...]) -> tuple[Range, ...]:
    """Return the ranges in which both of two lists of ranges hold."""
    pairs = [(max(a[0], b[0]), min(a[1], b[1])) for a in first for b in second]
    return tuple(pair for pair in pairs if pair[0] < pair[1])


def _end(at: np.ndarray, values: np.ndarray, excess: Callable[[np.ndarray], np.ndarray]) -> float:
    """Return the zero of the function `excess` between two arguments, from its values there."""
    precise = settings.end_precision * np.log(at[-1] / at[0])
    while np.log(at[-1] / at[0]) > precise:
        with np.errstate(invalid="ignore"):
            zero = np.nan_to_num(values[0] / (values[0] - values[-1]), nan=0.5)
        shares = np.unique(np.clip(np.append(EVENLY, zero + NEAR), 0.0005, 0.9995))
        places = at[0] * (at[-1] / at[0]) ** shares
        at, values = np.array([at[0], *places, at[-1]]), np.array([values[0], *excess(places), values[-1]])
        k = int(((values < 0) != (values[0] < 0)).argmax())
        at, values = at[k - 1 : k + 1], values[k - 1 : k + 1]
    return float(np.sqrt(at[0] * at[1]))
