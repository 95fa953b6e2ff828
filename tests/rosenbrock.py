"""A Rosenbrock step in plain Python, extended precision, straight from Hairer & Wanner II, Sec. IV.7."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from friso.engine.tableaus import Tableau

Real = np.longdouble


class Step(NamedTuple):
    """State at the end, error estimate (both (n,)), coefficients of the dense output (m, n), and the stages (s, n)."""

    end: np.ndarray
    error: np.ndarray
    dense: np.ndarray
    k: np.ndarray


def solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Gaussian elimination with partial pivoting, in extended precision."""
    a, b = matrix.astype(Real), right.astype(Real)
    n = b.size
    for k in range(n):
        p = k + int(np.argmax(np.abs(a[k:, k])))
        a[[k, p]], b[[k, p]] = a[[p, k]], b[[p, k]]
        for i in range(k + 1, n):
            factor = a[i, k] / a[k, k]
            a[i, k:] -= factor * a[k, k:]
            b[i] -= factor * b[k]
    x = np.zeros(n, Real)
    for k in reversed(range(n)):
        x[k] = (b[k] - a[k, k + 1 :] @ x[k + 1 :]) / a[k, k]
    return x


def step(
    method: Tableau,
    f: Callable[[np.ndarray, float], np.ndarray],
    jacobian: np.ndarray,
    drift: np.ndarray,
    x: np.ndarray,
    t: float,
    h: float,
) -> Step:
    """Take one step of length h from x at time t.

    `jacobian` is df/dx and `drift` df/dt there.
    """
    x, h = x.astype(Real), Real(h)
    matrix = np.eye(x.size, dtype=Real) / (Real(method.gamma) * h) - jacobian
    k: list[np.ndarray] = []
    for i in range(method.stages):
        a, c = (method.a[i - 1], method.c[i - 1]) if i else ((), ())
        place = x + sum((Real(w) * kj for w, kj in zip(a, k, strict=True)), start=np.zeros(x.size, Real))
        pull = sum((Real(w) / h * kj for w, kj in zip(c, k, strict=True)), start=np.zeros(x.size, Real))
        right = f(place, t + Real(method.time[i]) * h) + h * Real(method.rate[i]) * drift + pull
        k.append(solve(matrix, right))
    last = (*method.a[-1], 1.0)
    end = x + sum((Real(w) * kj for w, kj in zip(last, k, strict=True)), start=np.zeros(x.size, Real))
    dense = [sum(Real(w) * kj for w, kj in zip(row, k, strict=False)) for row in method.dense]
    return Step(end, k[-1], np.array(dense), np.array(k))


def between(x: np.ndarray, taken: Step, theta: float) -> np.ndarray:
    """The dense output at the fraction theta of the step from x."""
    inner = np.zeros(x.size, Real)
    for row in taken.dense[::-1]:
        inner = row + theta * inner
    return (1 - theta) * x + theta * (taken.end + (1 - theta) * inner)
