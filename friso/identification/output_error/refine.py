"""Refine many starts at once by Levenberg-Marquardt; the runs of all starts are simulated side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from friso.identification.output_error.problem import Problem
from friso.identification.output_error.settings import OutputErrorSettings
from friso.progress import Progress, silent

LADDER = np.array([0.1, 1.0, 10.0, 100.0])
"""Levenberg-Marquardt dampings that are tried at once, relative to the previous best damping."""


@dataclass(frozen=True)
class Refined:
    """Refined numbers, (starts, parameters), and their mean square residuals [N^2], (starts,)."""

    inner: np.ndarray
    cost: np.ndarray


def bounds_of(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of the ranges of the fitted numbers, each of shape (parameters,)."""
    low = np.array([parameter.inner(parameter.low) for parameter in problem.parameters])
    high = np.array([parameter.inner(parameter.high) for parameter in problem.parameters])
    return low, high


def costs(pieces: Sequence[Problem], inner: np.ndarray) -> np.ndarray:
    """Return mean squares of the residuals [N^2], (runs,), of fitted numbers (runs, parameters)."""
    costs = np.zeros(len(inner))
    for problem in pieces:
        for numbers, record in problem.simulated(inner):
            costs[numbers] += np.sum(((problem.target - record.force) * problem.counted) ** 2, axis=1)
    costs /= sum(len(problem.target) for problem in pieces)
    return np.where(np.isfinite(costs), costs, np.inf)


def refine_fit(
    pieces: Sequence[Problem],
    starts: np.ndarray,
    free: np.ndarray,
    iterations: int,
    enough: float,
    progress: Progress = silent,
    aim: float = np.inf,
) -> Refined:
    """Fit all `pieces` of a problem from several starts at once (Levenberg, Marquardt).

    The starts have the shape (starts, parameters); `free`, of equal shape, marks the numbers to fit. A fit ends when
    its sum of squares falls by less than the fraction `enough`.

    For every start several dampings are tried side by side, which costs less than derivatives; these are recomputed
    only if one damping was better. A number at an end of its range stays there while it is driven outwards. A fit that
    would not fall to the mean square `aim` at the pace of its last iteration is abandoned.
    """
    settings = OutputErrorSettings.current()
    low, high = bounds_of(pieces[0])
    margin = settings.range_share_inside * (high - low)
    low, high = low + margin, high - margin
    inner = np.clip(starts, low, high)
    cost = costs(pieces, inner)
    damping = np.full(len(inner), settings.first_damping)
    busy = np.isfinite(cost)
    squares, gradients = np.zeros((*inner.shape, inner.shape[1])), np.zeros(inner.shape)
    moved = busy.copy()
    for iteration in range(iterations):
        progress(iteration, iterations, "")
        squares[moved], gradients[moved] = _curvature(pieces, inner[moved], free[moved])
        busy &= np.isfinite(gradients).all(axis=1) & (damping < settings.highest_damping)
        rows = np.flatnonzero(busy)
        if not rows.size:
            break
        dampings = damping[rows, None] * LADDER
        downhill = -gradients[rows]
        inside = ((inner[rows] > low) | (downhill > 0)) & ((inner[rows] < high) | (downhill < 0))
        steps = _steps(squares[rows] * (inside[:, None] & inside[:, :, None]), downhill * inside, dampings)
        trials = np.clip(inner[rows, None] + steps, low, high)
        squared = costs(pieces, trials.reshape(-1, inner.shape[1])).reshape(dampings.shape)
        best = np.arange(len(rows)), squared.argmin(axis=1)
        better = squared[best] < cost[rows]
        done = better & (squared[best] > cost[rows] * (1 - enough))
        damping[rows] = np.where(better, dampings[best], dampings[:, -1] * (LADDER[1] / LADDER[0]) / LADDER[0])
        late = np.minimum(squared[best], cost[rows])
        late -= (iterations - 1 - iteration) * (cost[rows] - late)
        inner[rows[better]], cost[rows[better]] = trials[best][better], squared[best][better]
        left = late > aim
        busy[rows[done | left]] = False
        moved[:] = False
        moved[rows[better & ~done & ~left]] = True
    return Refined(inner, cost)


def _curvature(pieces: Sequence[Problem], inner: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return J' J and J' r for each row of fitted numbers, from Jacobian J and residual r.

    Entries are 0 for numbers that are not `free`.
    """
    count = inner.shape[1]
    squares, gradients = np.zeros((len(inner), count, count)), np.zeros((len(inner), count))
    for problem in pieces if len(inner) else ():
        for row, (residual, jacobian) in enumerate(problem.jacobians(inner, free)):
            squares[row][np.ix_(free[row], free[row])] += jacobian.T @ jacobian
            gradients[row, free[row]] += jacobian.T @ residual
    return squares, gradients


def _steps(squares: np.ndarray, downhill: np.ndarray, dampings: np.ndarray) -> np.ndarray:
    """Return damped Gauss-Newton steps, shape (rows, dampings, parameters).

    `squares` (rows, parameters, parameters) is J' J, and `downhill` (rows, parameters) is -J' r. `dampings` has the
    shape (rows, dampings).
    """
    curvature = np.diagonal(squares, axis1=1, axis2=2)
    diagonal = np.where(curvature > 0, curvature, 1.0)[:, :, None] * np.eye(downhill.shape[1])
    damped = squares[:, None] + dampings[:, :, None, None] * diagonal[:, None]
    return np.linalg.solve(damped, downhill[:, None, :, None])[..., 0]
