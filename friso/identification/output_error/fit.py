"""Fit simulated motion to logs, and estimate how far a fit may be off.

A fit of the whole model simulates a thousand starts, refines the best few, and iterates the best to the end.
Levenberg-Marquardt refines them, with the runs of all starts simulated side by side.

A fit is moved by a force that the model leaves out: one linear step estimates how far. Its error is estimated by
repeating it on simulated logs of the fitted machine, whose true values are known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.stats import chi2, norm, qmc
from scipy.stats import t as student

from friso.engine.batch import Inputs
from friso.identification.combine import (
    BINS_OF_PLACE_AND_SPEED,
    UPPER_PROBABILITY,
    binned,
    correlation_length,
    groups_of,
    spread_of,
)
from friso.identification.logs.log import Log
from friso.identification.output_error.parameters import BRISTLES, FitParameter, stages
from friso.identification.output_error.problem import Problem, blur_of, tracking
from friso.identification.output_error.settings import settings
from friso.identification.readings.common import digit_of, noise_of
from friso.intervals import NORMAL_COVERAGE
from friso.progress import Progress, Tally, share_of, silent

TRIED_DAMPINGS = np.array([0.1, 1.0, 10.0, 100.0])
"""Levenberg-Marquardt dampings that are tried at once, relative to the previous best damping."""


@dataclass(frozen=True)
class Refined:
    """Refined numbers, (starts, parameters), and their mean square residuals [N^2], (starts,)."""

    inner: np.ndarray
    cost: np.ndarray


RANGE_SHARE_INSIDE = 1e-9
"""Smallest distance of a fitted number from the ends of its range, relative to the range."""

FIRST_DAMPING = 1e-2
"""Levenberg-Marquardt damping of the first step, relative to the curvature."""

HIGHEST_DAMPING = 1e3
"""Levenberg-Marquardt damping at which a fit that does not improve is abandoned."""

SHARE_OF_PREDICTED_FALL = 0.5
"""Fall of the sum of squares, relative to its prediction, below which derivatives are computed anew."""


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
    margin = RANGE_SHARE_INSIDE * (high - low)
    low, high = low + margin, high - margin
    inner = np.clip(starts, low, high)
    rest = _residuals(pieces, inner)
    cost = mean_square(rest)
    damping = np.full(len(inner), FIRST_DAMPING)
    busy = np.isfinite(cost)
    near = np.full((rest.shape[1], inner.shape[1]), np.nan) if slopes is None else slopes
    slopes = np.where(free[:, None, :], near, 0.0)
    exact, asked = np.zeros(len(inner), bool), ~np.all(np.isfinite(slopes), axis=(1, 2))
    for iteration in range(iterations):
        progress(iteration, iterations, "")
        anew = np.flatnonzero(busy & asked)
        slopes[anew], exact[anew] = _derivatives(pieces, inner[anew], free[anew], rest[anew]), True
        busy &= np.all(np.isfinite(slopes), axis=(1, 2)) & (damping < HIGHEST_DAMPING)
        rows = np.flatnonzero(busy)
        if not rows.size:
            break
        step = _best_steps(
            pieces, inner[rows], rest[rows], slopes[rows], damping[rows, None] * TRIED_DAMPINGS, (low, high)
        )
        fallen = cost[rows] - step.cost
        better, slow = fallen > 0, fallen < enough * cost[rows]
        late = cost[rows] - (iterations - iteration) * np.maximum(fallen, 0.0) > aim
        poor = fallen < SHARE_OF_PREDICTED_FALL * (cost[rows] - step.predicted)
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


NOISE_RATIO_OF_A_CLOSED_FIT = 1.2
"""Ratio of residual to noise up to which a closed-loop fit is judged by its noise alone."""

NOISE_RATIO_OF_AN_EXPLAINED_RECORD = 2.0
"""Largest ratio of residual to noise of a fit that explains its record."""

WIDEST_LOGARITHM = 0.7
"""Half-width of a 95 % interval, in the logarithm, beyond which a parameter counts as not determined."""


@dataclass(frozen=True)
class OutputErrorFit:
    """A fit of the whole model to a log, with the uncertainty of its numbers.

    `inner`, shape (parameters,), has all numbers of the model; those with the indices `free` were fitted. Their
    `covariance` has the shape (free, free), and the `residual` [N] the shape (n,).
    """

    problem: Problem
    inner: np.ndarray
    free: tuple[int, ...]
    covariance: np.ndarray
    residual: np.ndarray

    @property
    def cost(self) -> float:
        """Return the mean square of the residual [N^2]."""
        return float(np.mean(self.residual**2))

    @property
    def left(self) -> float:
        """Return the RMS residual force [N] over the samples that count."""
        return float(np.sqrt(np.sum(self.residual**2) / max(float(self.problem.counted.sum()), 1.0)))

    def explains(self, noise: float, closely: bool = False) -> bool:
        """Tell whether the residual is about as large as the noise, `noise` [N], of the log's force.

        With `closely`, the limit is tighter. For a stage that follows the log, only a part of the noise passes into the
        residual.
        """
        times = NOISE_RATIO_OF_A_CLOSED_FIT if closely else NOISE_RATIO_OF_AN_EXPLAINED_RECORD
        return self.left < times * self.problem.noise_left(noise)

    @property
    def fitted(self) -> list[str]:
        """Return the names of the fitted parameters."""
        return [self.problem.names[number] for number in self.free]

    @property
    def bounded(self) -> set[int]:
        """Return the indices of fitted numbers whose intervals are narrow enough to be reported."""
        bounded = set()
        for number, deviation in zip(self.free, self.deviation, strict=True):
            parameter = self.problem.parameters[number]
            most = WIDEST_LOGARITHM if parameter.logarithmic else (parameter.high - parameter.low) / 2
            bounded |= {number} if NORMAL_COVERAGE * deviation < most else set()
        return bounded

    def is_noise_of_motion(self, noise: float) -> bool:
        """Tell whether noise of an integrated motion, which accumulates to slow effects, explains the whole residual.

        `noise` [N] is that of the logged force.
        """
        return self.problem.accumulates and self.left <= self.problem.noise_left(noise)

    @property
    def independent(self) -> float:
        """Return the number of independent samples of the residual, whose neighbours are correlated."""
        return max(float(self.problem.counted.sum()), 1.0) / correlation_length(self.residual)

    @property
    def stage(self) -> dict[str, Any]:
        """Return the fitted stage as flat keys such as friction.static, with SI values."""
        return stages(self.problem.flat, self.problem.parameters, self.inner)

    @property
    def deviation(self) -> np.ndarray:
        """Return the standard deviations of the fitted numbers, shape (free,)."""
        return np.sqrt(np.diag(self.covariance))

    def with_deviations(self, wanted: np.ndarray) -> OutputErrorFit:
        """Return the fit with given deviations, shape (free,), and unchanged correlations.

        A deviation that is 0 or not finite stays, because its scale is unknown.
        """
        usable = np.isfinite(self.deviation) & (self.deviation > 0)
        wider = np.divide(wanted, self.deviation, out=np.ones(len(self.free)), where=usable)
        return self.with_covariance(self.covariance * np.outer(wider, wider))

    def with_covariance(self, covariance: np.ndarray) -> OutputErrorFit:
        """Return the fit with another covariance, (free, free), on which its derivatives do not depend."""
        fit = replace(self, covariance=covariance)
        vars(fit).update({name: value for name, value in vars(self).items() if name == "linearised"})
        return fit

    @cached_property
    def linearised(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the residual, (n,), and its derivatives by the fitted numbers, (n, free)."""
        mask = np.isin(np.arange(len(self.inner)), self.free)
        return self.problem.linearised(self.inner, mask)

    @property
    def slopes(self) -> np.ndarray:
        """Return the derivatives of the residual by all numbers, (n, parameters); 0 for those not fitted."""
        slopes = np.zeros((len(self.problem.target), len(self.inner)))
        slopes[:, list(self.free)] = self.linearised[1]
        return slopes

    def value(self, name: str) -> float:
        """Return the value of a parameter in SI units."""
        i = self.problem.names.index(name)
        return float(self.problem.parameters[i].outer(self.inner[i]))


def first_values(parameters: Sequence[FitParameter]) -> np.ndarray:
    """Return the start values of the parameters as fitted numbers, shape (parameters,)."""
    return np.array([parameter.inner(parameter.start) for parameter in parameters])


ITERATIONS_OF_FIRST_STARTS = 5
"""Number of iterations of the brief refinement, which shows how good a start is."""

ITERATIONS_OF_FURTHER_STARTS = 7
"""Number of further iterations of the starts kept after the brief refinement."""

COST_SHARE_OF_REFINEMENT = 1e-4
"""Relative decrease of the sum of squares per iteration at which a fit ends by default."""


def fit(problem: Problem, free: Sequence[int], starts: np.ndarray, progress: Progress = silent) -> OutputErrorFit:
    """Fit the `free` parameters of a problem, given by index, from several starts.

    The starts have the shape (starts, parameters). All are simulated, and the best of them refined in rounds that keep
    fewer and fewer. The quality of a start shows after a few iterations, on pieces of a long record: for a stage that
    sticks and slips the best starts often lead to worse optima. Parameters that are not free stay as in the first
    start.
    """
    pieces = _parts(problem, len(starts))
    tried = _best_starts(problem, pieces, starts, share_of(progress, 0, 2))
    progress = share_of(progress, 1, 2)
    mask = np.zeros(tried.shape[1], bool)
    mask[list(free)] = True
    rough = [problem] if problem.closed else [problem.part(piece) for piece in pieces]
    rounds = (
        (rough, settings.starts_refined_first, ITERATIONS_OF_FIRST_STARTS),
        ([problem], settings.starts_refined_further, ITERATIONS_OF_FURTHER_STARTS),
    )
    enough = COST_SHARE_OF_REFINEMENT
    for number, (parts, most, iterations) in enumerate(rounds):
        tried, part = tried[:most], share_of(progress, number, 3)
        refined = refine_fit(parts, tried, mask, iterations, enough, part)
        tried = refined.inner[np.argsort(refined.cost)]
    return polished(problem, tuple(free), tried[0], share_of(progress, 2, 3))


RANGE_SHARE_OF_CORE_STARTS = 0.02
"""Largest distance of a start from the inverse model's value, relative to the range, for parameters that may be
0."""

LOGARITHM_OF_CORE_STARTS = 0.3
"""Largest distance of starting masses and frictions from the inverse model's values, in the logarithm."""

SEED_OF_STARTS = 7
"""Random seed of the starts, which makes results repeatable."""


def everywhere(problem: Problem, free: Sequence[int], first: np.ndarray) -> np.ndarray:
    """Spread many starts over the ranges of the free parameters, beginning with `first`.

    The result has the shape (starts, parameters). Wide starts are needed for parameters that only some motions show.
    Parameters that any motion shows keep their values of `first` in one half of the starts, because errors of mass and
    friction would hide which of the others is best. In the other half they start near the inverse model's values,
    because a first fit of them alone to stick-slip motion can end anywhere.
    """
    low, high = problem.bounds
    core = np.array([parameter.core for parameter in problem.parameters])
    logarithmic = np.array([parameter.logarithmic for parameter in problem.parameters])
    centre, spread = first_values(problem.parameters), RANGE_SHARE_OF_CORE_STARTS * (high - low)
    half = np.where(logarithmic, LOGARITHM_OF_CORE_STARTS, spread)
    low = np.where(core, np.maximum(centre - half, low), low)
    high = np.where(core, np.minimum(centre + half, high), high)
    shares = qmc.Sobol(len(first), rng=SEED_OF_STARTS).random(settings.starts_of_a_fit)
    starts = np.where(np.isin(np.arange(len(first)), free), low + shares * (high - low), first)
    half = len(starts) // 2  # of a Sobol sequence, either half is spread evenly, but not every second point
    starts[:half] = np.where(core, first, starts[:half])
    return np.vstack([first, starts])


DEVIATIONS_OF_NEAR_STARTS = 3.0
"""Spread of the starts around an earlier fit, in that fit's standard deviations."""


def nearby(fit: OutputErrorFit) -> np.ndarray:
    """Sample starts around the fit of another problem; the first start is the fit itself.

    The result has the shape (starts, parameters). Starts spread several times as wide as the fit's covariance, because
    the closed loop of a hunting stage has other optima.
    """
    low, high = (end[list(fit.free)] for end in fit.problem.bounds)
    deviation = fit.deviation
    usable = np.isfinite(deviation) & (deviation > 0)
    correlation = np.eye(len(fit.free))
    part = fit.covariance[np.ix_(usable, usable)]
    correlation[np.ix_(usable, usable)] = part / np.outer(deviation[usable], deviation[usable])
    spread = np.minimum(DEVIATIONS_OF_NEAR_STARTS * np.where(usable, deviation, np.inf), (high - low) / 4)
    rows = np.random.default_rng(SEED_OF_STARTS).multivariate_normal(
        np.zeros(len(spread)), correlation, settings.starts_near_a_fit, method="eigh"
    )
    starts = np.tile(fit.inner, (settings.starts_near_a_fit + 1, 1))
    starts[1:, list(fit.free)] += rows * spread
    starts[:, list(fit.free)] = np.clip(starts[:, list(fit.free)], low, high)
    return starts


def _best_starts(problem: Problem, pieces: Sequence[slice], starts: np.ndarray, progress: Progress) -> np.ndarray:
    """Return the best starts of a problem, (tried, parameters), beginning with the first start."""
    if len(starts) <= settings.starts_refined_first:
        return starts
    sums = np.zeros(len(starts) - 1)
    tally = Tally(progress, len(pieces) * len(sums))
    for piece in pieces:
        part = problem.part(piece)
        for numbers, record in part.simulated(starts[1:]):
            sums[numbers] += (part.target - record.force) ** 2 @ part.counted**2
            tally.add(len(numbers), "")
    best = np.argsort(np.where(np.isfinite(sums), sums, np.inf))[: settings.starts_refined_first - 1]
    return np.vstack([starts[0], starts[1:][best]])


SAMPLES_OF_ALL_STARTS = 6e6
"""Total number of samples simulated for all starts together. Longer records are cut."""

STRETCHES_OF_A_SCREENING = 8
"""Stretches into which a long record is cut for its starts, because slow motion may occur anywhere."""


def _parts(problem: Problem, starts: int) -> list[slice]:
    """Return the stretches of a record over which `starts` starts are simulated.

    A short record is used whole. Of a long one in closed loop the beginning is used, because its later state is
    unknown; otherwise stretches from all over it, because slow motion may come last.
    """
    count, most = len(problem.target), int(SAMPLES_OF_ALL_STARTS / starts)
    if count <= most or problem.closed:
        return [slice(0, min(count, most))]
    length = most // STRETCHES_OF_A_SCREENING
    firsts = np.linspace(0, count - length, STRETCHES_OF_A_SCREENING).astype(int)
    return [slice(int(first), int(first) + length) for first in firsts]


ITERATIONS_OF_A_FIT = 30
"""Largest number of iterations of the best start. Fits that need more are on a ridge."""

COST_SHARE_OF_A_FIT = 1e-6
"""Relative decrease of the sum of squares per iteration at which the best fit ends. Larger values stop too
early."""


def polished(
    problem: Problem,
    free: tuple[int, ...],
    inner: np.ndarray,
    progress: Progress = silent,
    slopes: np.ndarray | None = None,
) -> OutputErrorFit:
    """Finish a fit, and determine the uncertainty of its numbers.

    `inner` are the numbers so far, of which those with the indices `free` are fitted. `slopes`, shape (n, parameters),
    are derivatives of the residual near them, if they are known. Standard deviations allow for correlated errors, and
    for the other inputs that the log allows (`problem.unsettled`).
    """
    mask = np.isin(np.arange(len(inner)), free)
    until = ITERATIONS_OF_A_FIT, COST_SHARE_OF_A_FIT
    best = refine_fit([problem], inner[None], mask, *until, progress, slopes=slopes).inner[0]
    rest, fitted = problem.linearised(best, mask)
    covariance = spread_along(problem, fitted, rest)
    moved = [_moved_by(inputs, problem, best, fitted, rest) for inputs in problem.unsettled]
    fit = OutputErrorFit(problem, best, free, _reaching_over(covariance, moved), rest)
    vars(fit)["linearised"] = (rest, fitted)
    return fit


def polished_again(fit: OutputErrorFit, problem: Problem) -> OutputErrorFit:
    """Finish a fit of a slightly different problem, from the numbers and the derivatives of `fit`."""
    return polished(problem, fit.free, fit.inner, slopes=fit.slopes)


def spread_along(problem: Problem, slopes: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Return the covariance of numbers fitted to a problem, shape (p, p).

    The residual `rest` [N] has the shape (n,), its derivatives `slopes` (n, p). Errors are taken to be correlated in
    time, place and speed: many reversals of one sine tell no more than a few.
    """
    counted = problem.counted > 0
    velocity, acceleration = problem.inputs.segments[0, :-1, 2:4].T
    groups = groups_of(*(signal[counted] for signal in (problem.inputs.reference, velocity, acceleration)))
    return spread_of(slopes[counted], rest[counted], groups)


def _reaching_over(covariance: np.ndarray, moved: Sequence[np.ndarray]) -> np.ndarray:
    """Widen a covariance, (free, free), until intervals contain the results with other inputs.

    Each of `moved`, shape (free,), is the shift of the fitted numbers by one input. Intervals reach the whole shift,
    because one of the inputs is true, not their mean.
    """
    if not moved:
        return covariance
    wanted = np.sqrt(np.diag(covariance)) + np.linalg.norm(moved, axis=0) / NORMAL_COVERAGE
    further = covariance + sum(np.outer(off, off) for off in moved) / NORMAL_COVERAGE**2
    deviation = np.sqrt(np.diag(further))
    finite = np.isfinite(deviation) & (deviation > 0)
    wider = np.divide(wanted, deviation, out=np.ones_like(wanted), where=finite)
    return further * np.outer(wider, wider)


def _moved_by(inputs: Inputs, problem: Problem, best: np.ndarray, slopes: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Return the shift of the fitted numbers, (free,), by other inputs that the log allows.

    `best`, shape (parameters,), are the numbers of the model, `rest` [N], (n,), their residual, and `slopes`, (n,
    free), its derivatives. The shift is 0 if the simulation with the other `inputs` fails.
    """
    change = replace(problem, inputs=inputs).residuals(best[None])[0] - rest
    if not np.isfinite(change).all():
        return np.zeros(slopes.shape[1])
    return shift_against(change, slopes)


SMALLEST_SINGULAR_VALUE = 1e-3
"""Ratio of a singular value of the Jacobian to the largest, below which parameters cannot be distinguished."""


def shift_against(change: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Return the shift of fitted numbers, (p,), that best undoes a change of the residual [N], (n,).

    `slopes`, (n, p), are derivatives of the residual by the numbers.
    """
    size = np.linalg.norm(slopes, axis=0)
    size = np.where(size > 0, size, 1.0)
    return -np.linalg.lstsq(slopes / size, change, rcond=SMALLEST_SINGULAR_VALUE)[0] / size


PROBABILITY_OF_AN_EFFECT = 0.999
"""Confidence with which one explanation of a record must be better before the other is dropped."""


@dataclass(frozen=True)
class ExplainedResidual:
    """What additional forces, which the model leaves out, explain of a fit's residual.

    `moved`, shape (free,), is the shift of the fitted numbers. `sizes`, shape (forces,), are the fitted sizes of the
    forces, and `left` is the fraction of the residual's power that remains. `rest` [N], shape (n,), is the remaining
    residual, and `slopes`, shape (n, numbers + forces), its derivatives by numbers and sizes.
    """

    moved: np.ndarray
    sizes: np.ndarray
    left: float
    rest: np.ndarray
    slopes: np.ndarray

    def sure(self, fit: OutputErrorFit) -> np.ndarray:
        """Tell for each additional force, shape (forces,), whether it is present: its size is not 0 within its error.

        The error allows for residuals that repeat at every reversal. With a slow sine, a coupling or a delay cannot
        then be told from slightly different friction.
        """
        size = np.linalg.norm(self.slopes, axis=0)
        usable = np.isfinite(size) & (size > 0)
        covariance = spread_along(fit.problem, self.slopes[:, usable], self.rest)
        chance = 1 - PROBABILITY_OF_AN_EFFECT
        deviations = np.sqrt(np.diag(covariance)[-len(self.sizes) :])
        return np.abs(self.sizes) > norm.isf(chance / 2) * deviations


def explained_by_forces(
    fit: OutputErrorFit, forces: Sequence[np.ndarray], units: Sequence[float], searched: int = 1
) -> ExplainedResidual | None:
    """Fit additional forces to the residual of a fit, while its parameters may change, too.

    A force [N], shape (n,), is that of an effect of size 1. It is simulated at its size in `units`, small enough to be
    linear. Returns None if the forces explain no more than the best of `searched` random ones.
    """
    rest, slopes = fit.linearised
    return explained_by(slopes, rest, effects_of(forces, units, fit), fit.problem.counted, searched)


def explained_by(
    slopes: np.ndarray, rest: np.ndarray, effects: Sequence[np.ndarray], counted: np.ndarray, searched: int = 1
) -> ExplainedResidual | None:
    """Explain a residual, shape (n,), by changes of the fitted numbers and additional effects.

    `slopes` are the derivatives by the numbers, (n, numbers). Each of the `effects`, and the weights `counted` of the
    samples, has the shape (n,). A number without effect, or with infinite derivatives, does not move. Returns None if
    the effects explain no more than the best of `searched` random ones.
    """
    every = np.column_stack([slopes, *effects])
    size = np.linalg.norm(every, axis=0)
    usable = np.isfinite(size) & (size > 0)
    if not (usable[slopes.shape[1] :].all() and np.isfinite(rest).all()):
        return None
    solution = np.zeros(len(size))
    scaled, smallest = every[:, usable] / size[usable], SMALLEST_SINGULAR_VALUE**2
    solution[usable] = np.linalg.lstsq(scaled.T @ scaled, -rest @ scaled, rcond=smallest)[0] / size[usable]
    left = rest + every[:, usable] @ solution[usable]
    independent = max(float(counted.sum()), 1.0) / correlation_length(left)
    chance = chi2.isf((1 - PROBABILITY_OF_AN_EFFECT) / searched, len(effects))
    if rest @ rest <= left @ left * (1 + chance / independent):
        return None
    moved, sizes = np.split(solution, [slopes.shape[1]])
    return ExplainedResidual(moved, sizes, float(left @ left) / float(rest @ rest), left, every)


def is_sure_beside_all(fit: OutputErrorFit, forces: Sequence[np.ndarray], units: Sequence[float]) -> bool:
    """Tell whether a residual shows the last of some forces even if all parameters may change.

    `forces` [N], shape (n,) each, have size 1; `units` are the sizes at which they are simulated.
    """
    rest, slopes = beside_all_numbers(fit)
    explained = explained_by(slopes, rest, effects_of(forces, units, fit), fit.problem.counted)
    return explained is not None and bool(explained.sure(fit)[-1])


def beside_all_numbers(fit: OutputErrorFit, further: Sequence[np.ndarray] = ()) -> tuple[np.ndarray, np.ndarray]:
    """Return the residual after a linear refit of all parameters and `further` effects, with its derivatives.

    The residual [N] and each of the effects have the shape (n,), the derivatives (n, parameters + effects).

    Parameters that the log does not determine take part: what they explain, such as the Stribeck effect at a reversal,
    is no effect outside the model.
    """
    rest, slopes = fit.problem.linearised(fit.inner, np.ones(len(fit.inner), bool))
    slopes = np.column_stack([slopes, *further])
    size = np.linalg.norm(slopes, axis=0)
    usable = np.isfinite(size) & (size > 0)
    scaled = slopes[:, usable] / size[usable]
    solution = np.linalg.lstsq(scaled, -rest, rcond=SMALLEST_SINGULAR_VALUE)[0]
    return rest + scaled @ solution, slopes


def reaching_over(fit: OutputErrorFit, further: np.ndarray) -> OutputErrorFit:
    """Return the fit with intervals extended at both ends by `further`, shape (free,)."""
    return fit.with_deviations(fit.deviation + further / NORMAL_COVERAGE)


def effects_of(forces: Sequence[np.ndarray], units: Sequence[float], fit: OutputErrorFit) -> list[np.ndarray]:
    """Return the change of a fit's residual per unit of each additional force, shape (n,) each.

    A force [N], shape (n,), is that of an effect of size 1, and is simulated at its size in `units`. All forces are
    simulated side by side.
    """
    inputs, (rest, _), sizes = fit.problem.inputs, fit.linearised, np.array(units)[:, None]
    pushed = replace(fit.problem, inputs=replace(inputs, force=inputs.force + sizes * np.array(forces)))
    return [*(pushed.residuals(np.tile(fit.inner, (len(forces), 1))) - rest) / sizes]


SEED_OF_REPETITIONS = 11
"""Random seed of the noise of simulated logs, which makes results repeatable."""

REPETITIONS_OF_A_FIT = 4
"""Number of simulated logs on which a fit is repeated. With 4, Student's t is 1.4 times the normal quantile."""

ITERATIONS_OF_A_REPETITION = 15
"""Number of iterations of a repeated fit, which starts from the true values."""


def as_far_off_as_repeated(
    once: OutputErrorFit, log: Log, part: slice, bandwidth: float, noise: float, progress: Progress
) -> OutputErrorFit:
    """Widen a fit to a log by the errors of fits to simulated logs of the fitted machine.

    The stage followed `part` of the log; `noise` [N] is that of its force, and `bandwidth` [Hz] that of its motion.
    Noise of position and force shifts break-aways, which biases the fit to one side in a way that a Jacobian does not
    show (parametric bootstrap: Efron, Tibshirani 1993, chapter 6).

    If the residual of the log exceeds the residuals of the simulated logs, errors are scaled up by the ratio.
    """
    free, rng = np.isin(np.arange(len(once.inner)), once.free), np.random.default_rng(SEED_OF_REPETITIONS)
    again = []
    for number in range(REPETITIONS_OF_A_FIT):
        progress(number, REPETITIONS_OF_A_FIT, "moves: the same fit of simulated logs")
        like = simulated_log(once.problem, once.inner, log, part, bandwidth, noise, rng)
        until = ITERATIONS_OF_A_REPETITION, COST_SHARE_OF_REFINEMENT
        again.append(refine_fit([like], once.inner[None], free, *until, slopes=once.slopes))
    off = np.sqrt(np.mean([(fit.inner[0] - once.inner)[free] ** 2 for fit in again], axis=0))
    off = off * float(student.ppf(UPPER_PROBABILITY, REPETITIONS_OF_A_FIT)) / NORMAL_COVERAGE
    usual = float(np.mean([fit.cost[0] for fit in again]))
    off *= np.sqrt(max(1.0, once.cost / usual)) if 0 < usual < np.inf else 1.0
    return once.with_deviations(np.maximum(off, once.deviation))


def late_by_a_sample(fit: OutputErrorFit) -> OutputErrorFit:
    """Widen the damping of the bristles by the effect of one sample of delay.

    A delay looks like bristle damping of delay times bristle stiffness. The widening is for a stage that followed a log
    without explaining it to its noise. A fit without both bristle parameters stays as it is.
    """
    if not {*BRISTLES} <= {*fit.fitted}:
        return fit
    late = fit.value("friction.bristle_stiffness") * fit.problem.inputs.sample_time
    covariance = fit.covariance.copy()
    place = fit.fitted.index("friction.bristle_damping")
    covariance[place, place] += (late / fit.value("friction.bristle_damping") / NORMAL_COVERAGE) ** 2
    return fit.with_covariance(covariance)


def simulated_log(
    problem: Problem, inner: np.ndarray, log: Log, part: slice, bandwidth: float, noise: float, rng: np.random.Generator
) -> Problem:
    """Return the problem of fitting a simulated log of a machine with the fitted numbers `inner`.

    The simulated log has the logged force plus the guiding controller's, and the stage's own position, both with the
    errors of the logged ones in `part` of the log. `noise` [N] is the force's; a force whose resolution is coarser than
    its noise has errors of rounding instead. `bandwidth` [Hz] is the motion's.
    """
    record, speed = problem.record(inner), np.abs(problem.inputs.velocity)
    digit = digit_of(log["force"][part])
    signals = {role: values.copy() for role, values in log.signals.items()}
    signals["position"][part] = _measured(record.position, log, part, problem, rng)
    force = problem.inputs.force + record.force
    rounded = 0 < noise <= digit / np.sqrt(12)
    rough = _rounding(log["force"][part], speed, digit, rng) if rounded else noise * rng.standard_normal(len(force))
    signals["force"][part] = force + rough
    like = tracking(problem.flat, replace(log, signals=signals), part, problem.parameters, bandwidth)
    level = len(like.sharper) - len(problem.sharper)
    like = like.held_to(level - 1) if level else like
    return replace(like, inputs=replace(like.inputs, held=problem.inputs.held))


def _measured(position: np.ndarray, log: Log, part: slice, problem: Problem, rng: np.random.Generator) -> np.ndarray:
    """Return simulated positions [m], (n,), as the sensor of a log would measure them.

    Digits coarser than the noise round them, as an encoder does. Otherwise errors are white; those of a position that
    was integrated from a velocity are the integral of the velocity's.
    """
    logged, white = log["position"][part], rng.standard_normal(len(position))
    digit = digit_of(logged)
    if log.is_integrated:
        return position + np.cumsum(noise_of(log["velocity"][part]) * white) * log.sample_time
    if digit > 0 and noise_of(logged) <= digit / np.sqrt(12):
        return logged[0] + digit * np.rint((position - logged[0]) / digit)
    return position + blur_of(logged, problem.inputs.reference) * white


def _rounding(force: np.ndarray, speed: np.ndarray, digit: float, rng: np.random.Generator) -> np.ndarray:
    """Sample errors of rounding [N], (n,), of a force that was logged in coarse digits [N].

    Forces at one level and one `speed` [m/s] are rounded alike, in both directions, so that errors last as long as a
    motion is steady and do not average out as noise does. Rounding the force of the fit again would not show them: its
    levels are those that the rounded log has.
    """
    levels = np.stack([np.rint(np.abs(force) / digit), binned(speed, BINS_OF_PLACE_AND_SPEED)])
    alike = np.unique(levels, axis=1, return_inverse=True)[1].ravel()
    return digit * np.sign(force) * (rng.random(alike.max() + 1) - 0.5)[alike]
