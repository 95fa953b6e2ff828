"""Fit the whole model: simulate a thousand starts, refine the best few side by side, and iterate the best to the
end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.stats import qmc

from friso.engine.batch import Inputs
from friso.identification.output_error.parameters import FitParameter, stages
from friso.identification.output_error.problem import Problem
from friso.identification.output_error.refine import refine_fit
from friso.identification.output_error.settings import settings
from friso.identification.spread import correlation_length, groups_of, spread_of
from friso.intervals import NORMAL_COVERAGE
from friso.progress import Progress, Tally, share_of, silent


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
        times = settings.noise_ratio_of_a_closed_fit if closely else settings.noise_ratio_of_an_explained_record
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
            most = settings.widest_logarithm if parameter.logarithmic else (parameter.high - parameter.low) / 2
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
        (rough, settings.starts_refined_first, settings.iterations_of_first_starts),
        ([problem], settings.starts_refined_further, settings.iterations_of_further_starts),
    )
    enough = settings.cost_share_of_refinement
    for number, (parts, most, iterations) in enumerate(rounds):
        tried, part = tried[:most], share_of(progress, number, 3)
        refined = refine_fit(parts, tried, mask, iterations, enough, part)
        tried = refined.inner[np.argsort(refined.cost)]
    return polished(problem, tuple(free), tried[0], share_of(progress, 2, 3))


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
    centre, spread = first_values(problem.parameters), settings.range_share_of_core_starts * (high - low)
    half = np.where(logarithmic, settings.logarithm_of_core_starts, spread)
    low = np.where(core, np.maximum(centre - half, low), low)
    high = np.where(core, np.minimum(centre + half, high), high)
    shares = qmc.Sobol(len(first), rng=settings.seed_of_starts).random(settings.starts_of_a_fit)
    starts = np.where(np.isin(np.arange(len(first)), free), low + shares * (high - low), first)
    half = len(starts) // 2  # of a Sobol sequence, either half is spread evenly, but not every second point
    starts[:half] = np.where(core, first, starts[:half])
    return np.vstack([first, starts])


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
    spread = np.minimum(settings.deviations_of_near_starts * np.where(usable, deviation, np.inf), (high - low) / 4)
    rows = np.random.default_rng(settings.seed_of_starts).multivariate_normal(
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


def _parts(problem: Problem, starts: int) -> list[slice]:
    """Return the stretches of a record over which `starts` starts are simulated.

    A short record is used whole. Of a long one in closed loop the beginning is used, because its later state is
    unknown; otherwise stretches from all over it, because slow motion may come last.
    """
    count, most = len(problem.target), int(settings.samples_of_all_starts / starts)
    if count <= most or problem.closed:
        return [slice(0, min(count, most))]
    length = most // settings.stretches_of_a_screening
    firsts = np.linspace(0, count - length, settings.stretches_of_a_screening).astype(int)
    return [slice(int(first), int(first) + length) for first in firsts]


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
    until = settings.iterations_of_a_fit, settings.cost_share_of_a_fit
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


def shift_against(change: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Return the shift of fitted numbers, (p,), that best undoes a change of the residual [N], (n,).

    `slopes`, (n, p), are derivatives of the residual by the numbers.
    """
    size = np.linalg.norm(slopes, axis=0)
    size = np.where(size > 0, size, 1.0)
    return -np.linalg.lstsq(slopes / size, change, rcond=settings.smallest_singular_value)[0] / size
