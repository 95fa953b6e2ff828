"""Least squares from many starts at once: Levenberg-Marquardt in lockstep, all sensitivities of all starts in lanes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.identification.output_error.problem import Problem

FIRST, LESS, MORE = 1e-2, 0.3, 10.0
"""Damping of the first step, as a share of the curvature, and by how much it falls and grows afterwards."""

ENOUGH = 1e-4
"""Share by which the sum of squares of a fit falls at last, unless that has to be told more precisely."""

BOUND = 1e-9
"""Share of a range by which a number is kept inside it."""


@dataclass(frozen=True)
class Refined:
    """Fitted numbers, shape (starts, parameters), and mean squares of their residuals [N^2], shape (starts,)."""

    inner: np.ndarray
    cost: np.ndarray


def bounds_of(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the ranges of the fitted numbers, each of shape (parameters,)."""
    low = np.array([parameter.inner(parameter.low) for parameter in problem.parameters])
    high = np.array([parameter.inner(parameter.high) for parameter in problem.parameters])
    return low, high


def costs(problem: Problem, inner: np.ndarray) -> np.ndarray:
    """Mean squares of the residuals [N^2], shape (runs,), of fitted numbers of shape (runs, parameters)."""
    costs = np.empty(len(inner))
    for numbers, record in problem.simulated(inner):
        costs[numbers] = np.mean(((problem.target - record.force) * problem.counted) ** 2, axis=1)
    return np.where(np.isfinite(costs), costs, np.inf)


def refine_fit(
    problem: Problem, starts: np.ndarray, free: np.ndarray, iterations: int, enough: float = ENOUGH
) -> Refined:
    """Fit from several starts, shape (starts, parameters); of each only the numbers that are `free`, a mask of the same
    shape. A fit is done when its sum of squares falls by less than the share `enough`."""
    low, high = bounds_of(problem)
    margin = BOUND * (high - low)
    inner = np.clip(starts, low + margin, high - margin)
    cost = costs(problem, inner)
    damping = np.full(len(inner), FIRST)
    busy = np.isfinite(cost)
    for _ in range(iterations):
        if not busy.any():
            break
        trial = inner.copy()
        trial[busy] = _stepped(problem, inner[busy], free[busy], damping[busy])
        trial = np.clip(trial, low + margin, high - margin)
        trial_cost = np.full(len(inner), np.inf)
        trial_cost[busy] = costs(problem, trial[busy])
        better = trial_cost < cost
        done = better & (trial_cost > cost * (1 - enough))
        inner, cost = np.where(better[:, None], trial, inner), np.where(better, trial_cost, cost)
        damping = np.where(better, damping * LESS, damping * MORE)
        busy &= ~done & (damping < 1e3)
    return Refined(inner, cost)


def _stepped(problem: Problem, inner: np.ndarray, free: np.ndarray, damping: np.ndarray) -> np.ndarray:
    """One damped Gauss-Newton step of the free numbers of every start."""
    moved = inner.copy()
    for row, (residual, jacobian) in enumerate(problem.jacobians(inner, free)):
        if not np.isfinite(jacobian).all():
            continue
        square = jacobian.T @ jacobian
        curvature = np.diag(square).copy()
        curvature[curvature == 0] = 1.0
        moved[row, free[row]] += np.linalg.solve(square + damping[row] * np.diag(curvature), -jacobian.T @ residual)
    return moved
