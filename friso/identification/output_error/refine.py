"""Refine many starts at once by Levenberg-Marquardt; the runs of all starts are simulated side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from friso.identification.output_error.problem import Problem
from friso.identification.output_error.settings import settings
from friso.progress import Progress, silent

TRIED_DAMPINGS = np.array([0.1, 1.0, 10.0, 100.0])
"""Levenberg-Marquardt dampings that are tried at once, relative to the previous best damping."""


@dataclass(frozen=True)
class Refined:
    """Refined numbers, (starts, parameters), and their mean square residuals [N^2], (starts,)."""

    inner: np.ndarray
    cost: np.ndarray


def refine_fit(
    pieces: Sequence[Problem],
    starts: np.ndarray,
    free: np.ndarray,
    iterations: int,
    enough: float,
    progress: Progress = silent,
    aim: float = np.inf,
    slopes: np.ndarray | None = None,
) -> Refined:
    """Fit all `pieces` of a problem from several starts at once (Levenberg, Marquardt).

    The starts have the shape (starts, parameters); `free`, of equal shape or (parameters,), marks the numbers to fit. A
    fit ends when its sum of squares falls by less than the fraction `enough`.

    For every start several dampings are tried side by side, which costs less than derivatives. After a step the
    derivatives are updated from the change of the residual (Broyden 1965, doi:10.1090/S0025-5718-1965-0198670-6). They
    are computed anew if it falls little, or by much less than they predict. `slopes`, shape (samples, parameters), are
    derivatives near the starts, if they are known. A fit that would not fall to the mean square `aim` at the pace of
    its last iteration is abandoned. Only derivatives computed at its own numbers end or abandon a fit.
    """
    (low, high), free = pieces[0].bounds, np.broadcast_to(free, starts.shape)
    margin = settings.range_share_inside * (high - low)
    low, high = low + margin, high - margin
    inner = np.clip(starts, low, high)
    rest = _residuals(pieces, inner)
    cost = mean_square(rest)
    damping = np.full(len(inner), settings.first_damping)
    busy = np.isfinite(cost)
    near = np.full((rest.shape[1], inner.shape[1]), np.nan) if slopes is None else slopes
    slopes = np.where(free[:, None, :], near, 0.0)
    exact, asked = np.zeros(len(inner), bool), ~np.all(np.isfinite(slopes), axis=(1, 2))
    for iteration in range(iterations):
        progress(iteration, iterations, "")
        anew = np.flatnonzero(busy & asked)
        slopes[anew], exact[anew] = _derivatives(pieces, inner[anew], free[anew], rest[anew]), True
        busy &= np.all(np.isfinite(slopes), axis=(1, 2)) & (damping < settings.highest_damping)
        rows = np.flatnonzero(busy)
        if not rows.size:
            break
        step = _best_steps(
            pieces, inner[rows], rest[rows], slopes[rows], damping[rows, None] * TRIED_DAMPINGS, (low, high)
        )
        fallen = cost[rows] - step.cost
        better, slow = fallen > 0, fallen < enough * cost[rows]
        late = cost[rows] - (iterations - iteration) * np.maximum(fallen, 0.0) > aim
        poor = fallen < settings.share_of_predicted_fall * (cost[rows] - step.predicted)
        raised = np.where(
            exact[rows],
            damping[rows] * TRIED_DAMPINGS[-1] * (TRIED_DAMPINGS[1] / TRIED_DAMPINGS[0]) / TRIED_DAMPINGS[0],
            damping[rows],
        )
        damping[rows] = np.where(better, step.damping, raised)
        busy[rows] = ~(exact[rows] & (late | (better & slow)))
        asked[rows] = np.where(better, poor | slow | late, ~exact[rows])
        taken, rows = np.flatnonzero(better), rows[better]
        for k, row in zip(taken, rows, strict=True):
            slopes[row] += np.outer(step.missed[k], step.weights[k])
        inner[rows], cost[rows], rest[rows] = step.inner[taken], step.cost[taken], step.residual[taken]
        exact[rows] = False
    return Refined(inner, cost)


@dataclass(frozen=True)
class _Steps:
    """The best of several damped steps of each row.

    Fields are the numbers after it, (rows, parameters), with their `residual` [N], (rows, samples), and its mean square
    `cost` [N^2], (rows,); the `damping`, (rows,); the mean square `predicted` by the derivatives, (rows,); the part of
    the residual's change that they `missed`, (rows, samples), and the `weights`, (rows, parameters), with which it
    enters the derivatives by the parameters.
    """

    inner: np.ndarray
    residual: np.ndarray
    cost: np.ndarray
    damping: np.ndarray
    predicted: np.ndarray
    missed: np.ndarray
    weights: np.ndarray


def _best_steps(
    pieces: Sequence[Problem],
    inner: np.ndarray,
    rest: np.ndarray,
    slopes: np.ndarray,
    dampings: np.ndarray,
    ends: tuple[np.ndarray, np.ndarray],
) -> _Steps:
    """Try several dampings, shape (rows, dampings), of each row of numbers (rows, parameters); return the best steps.

    `rest` [N] has the residuals, (rows, samples), and `slopes` their derivatives, (rows, samples, parameters). `ends`
    are those of the parameters' ranges: a number at one of them stays there while it is driven outwards.
    """
    low, high = ends
    across = np.swapaxes(slopes, 1, 2)
    squares, downhill = across @ slopes, -(across @ rest[:, :, None])[:, :, 0]
    inside = ((inner > low) | (downhill > 0)) & ((inner < high) | (downhill < 0))
    steps = _steps(squares * (inside[:, None] & inside[:, :, None]), downhill * inside, dampings)
    trials = np.clip(inner[:, None] + steps, low, high)
    rests = _residuals(pieces, trials.reshape(-1, inner.shape[1])).reshape(*dampings.shape, -1)
    costs = mean_square(rests)
    best = np.arange(len(inner)), costs.argmin(axis=1)
    step = trials[best] - inner
    linear = rest + (slopes @ step[:, :, None])[:, :, 0]
    missed, weights = rests[best] - linear, _weights(step, squares)
    return _Steps(trials[best], rests[best], costs[best], dampings[best], mean_square(linear), missed, weights)


def _weights(steps: np.ndarray, squares: np.ndarray) -> np.ndarray:
    """Return the shares of a change of the residual in its derivatives, for steps (rows, parameters).

    The result has the shape of the steps. `squares` (rows, parameters, parameters) are products of derivatives, whose
    diagonal scales the parameters.
    """
    weighted = np.diagonal(squares, axis1=1, axis2=2) * steps
    length = np.sum(weighted * steps, axis=1, keepdims=True)
    return np.divide(weighted, length, out=np.zeros_like(steps), where=length > 0)


def _residuals(pieces: Sequence[Problem], inner: np.ndarray) -> np.ndarray:
    """Return the residuals [N] of all pieces for fitted numbers (runs, parameters), shape (runs, samples).

    They are infinite for runs that failed.
    """
    return np.concatenate([problem.residuals(inner) for problem in pieces], axis=1)


def mean_square(residuals: np.ndarray) -> np.ndarray:
    """Return the mean squares of residuals over their last axis."""
    return np.mean(residuals**2, axis=-1)


def _derivatives(pieces: Sequence[Problem], inner: np.ndarray, free: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Return the derivatives of the residuals by fitted numbers, shape (rows, samples, parameters).

    They are 0 for numbers that are not `free`. `rest` has the residuals [N], (rows, samples).
    """
    slopes = np.zeros((len(inner), sum(len(problem.target) for problem in pieces), inner.shape[1]))
    first = 0
    for problem in pieces if len(inner) else ():
        part = slice(first, first := first + len(problem.target))
        for row, jacobian in enumerate(problem.jacobians(inner, free, rest[:, part])):
            slopes[row][part, free[row]] = jacobian
    return slopes


def _steps(squares: np.ndarray, downhill: np.ndarray, dampings: np.ndarray) -> np.ndarray:
    """Return damped Gauss-Newton steps, shape (rows, dampings, parameters).

    `squares` (rows, parameters, parameters) is J' J, and `downhill` (rows, parameters) is -J' r. `dampings` has the
    shape (rows, dampings).
    """
    curvature = np.diagonal(squares, axis1=1, axis2=2)
    diagonal = np.where(curvature > 0, curvature, 1.0)[:, :, None] * np.eye(downhill.shape[1])
    damped = squares[:, None] + dampings[:, :, None, None] * diagonal[:, None]
    return np.linalg.solve(damped, downhill[:, None, :, None])[..., 0]
