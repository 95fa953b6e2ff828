"""The fit: a thousand starts, the best of them refined side by side, and the best of those handed to lmfit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import lmfit
import numpy as np
from scipy.stats import qmc

from friso.engine.driven import Inputs
from friso.identification.output_error.parameters import FitParameter, keys_of
from friso.identification.output_error.problem import Problem
from friso.identification.output_error.refine import bounds_of, costs, refine_fit
from friso.identification.spread import correlation_length, groups_of, spread_of
from friso.intervals import COVERAGE

STARTS, KEPT = 1024, 6
"""Starts that are simulated, and how many of them are refined."""

NARROW = 0.3
"""Share by which the starts of core parameters are off the inverse model's values, each way."""

SCREENED, STRETCHES = 1e7, 8
"""Samples that the starts are simulated over, all together: long records are cut for them, into so many stretches."""

ROUGH, FINE = 12, 30
"""Iterations of the refinement of the starts kept, and most evaluations of lmfit times the parameters."""

NEARBY, FAR = 127, 3.0
"""Starts near an earlier fit, and how many times as far as its covariance they are drawn: the loop of a stage that
hunts has optima of its own, and the fit it starts from is of another problem."""

ALIKE = 1e-3
"""Share of the largest singular value below which fitted numbers cannot be distinguished."""

SEED = 7


@dataclass(frozen=True)
class OutputErrorFit:
    """The fitted numbers `inner`, shape (parameters,), of which `free` were fitted; their `covariance`, shape (free,
    free), and the residual [N], shape (n,)."""

    problem: Problem
    inner: np.ndarray
    free: tuple[int, ...]
    covariance: np.ndarray
    residual: np.ndarray

    @property
    def cost(self) -> float:
        return float(np.mean(self.residual**2))

    @property
    def independent(self) -> float:
        """So many independent samples the residual is worth."""
        return max(float(self.problem.counted.sum()), 1.0) / correlation_length(self.residual)

    @property
    def stage(self) -> dict[str, Any]:
        """The stage of the fit as flat keys."""
        parameters = zip(self.problem.parameters, self.inner, strict=True)
        values = {parameter.name: parameter.outer(inner) for parameter, inner in parameters}
        return {**self.problem.flat, **keys_of(self.problem.flat, values)}

    def value(self, name: str) -> float:
        """The SI value of a parameter."""
        names = [parameter.name for parameter in self.problem.parameters]
        i = names.index(name)
        return float(self.problem.parameters[i].outer(self.inner[i]))


def first_values(parameters: Sequence[FitParameter]) -> np.ndarray:
    """The fitted numbers at which the parameters start, shape (parameters,)."""
    return np.array([parameter.inner(parameter.start) for parameter in parameters])


def fit(problem: Problem, free: Sequence[int], starts: np.ndarray) -> OutputErrorFit:
    """Fit the free parameters, given by number, of a problem, from some starts, shape (starts, parameters), the best of
    which are refined; the others stay as in the first of them."""
    mask = np.zeros(starts.shape[1], bool)
    mask[list(free)] = True
    screened = _screened(problem, starts)
    refined = refine_fit(problem, screened, np.tile(mask, (len(screened), 1)), ROUGH)
    best = refined.inner[np.argmin(refined.cost)]
    return _polished(problem, tuple(free), best)


def everywhere(problem: Problem, free: Sequence[int], first: np.ndarray) -> np.ndarray:
    """Many starts over the ranges of the free parameters, shape (starts, parameters), behind the `first`: they
    find parameters that not every motion shows."""
    low, high = bounds_of(problem)
    core = np.array([parameter.core for parameter in problem.parameters])
    half = np.array(
        [NARROW if parameter.logarithmic else NARROW * abs(parameter.start) for parameter in problem.parameters]
    )
    low, high = np.where(core, first - half, low), np.where(core, first + half, high)
    shares = qmc.Sobol(len(first), rng=SEED).random(STARTS)
    starts = np.where(np.isin(np.arange(len(first)), free), low + shares * (high - low), first)
    return np.vstack([first, starts])


def nearby(fit: OutputErrorFit) -> np.ndarray:
    """Starts that another problem's fit allows, shape (starts, parameters), itself the first: drawn from its covariance
    `FAR` times as wide."""
    low, high = (end[list(fit.free)] for end in bounds_of(fit.problem))
    deviation = np.sqrt(np.diag(fit.covariance))
    usable = np.isfinite(deviation) & (deviation > 0)
    correlation = np.eye(len(fit.free))
    part = fit.covariance[np.ix_(usable, usable)]
    correlation[np.ix_(usable, usable)] = part / np.outer(deviation[usable], deviation[usable])
    spread = np.minimum(FAR * np.where(usable, deviation, np.inf), (high - low) / 4)
    rows = np.random.default_rng(SEED).multivariate_normal(np.zeros(len(spread)), correlation, NEARBY, method="eigh")
    starts = np.tile(fit.inner, (NEARBY + 1, 1))
    starts[1:, list(fit.free)] += rows * spread
    starts[:, list(fit.free)] = np.clip(starts[:, list(fit.free)], low, high)
    return starts


def _screened(problem: Problem, starts: np.ndarray) -> np.ndarray:
    """The best starts, shape (kept, parameters), the first one always among them."""
    if len(starts) <= KEPT:
        return starts
    screened = np.sum([costs(problem.part(part), starts[1:]) for part in _parts(problem, len(starts))], axis=0)
    return np.vstack([starts[0], starts[1:][np.argsort(screened)[: KEPT - 1]]])


def _parts(problem: Problem, starts: int) -> list[slice]:
    """What of a record the starts are simulated over: all of a short one; of a long one its beginning in closed loop,
    whose state is not known later on, and else stretches from all over it: slow motion may come last."""
    count, most = len(problem.target), int(SCREENED / starts)
    if count <= most or problem.closed:
        return [slice(0, min(count, most))]
    firsts = np.linspace(0, count - most // STRETCHES, STRETCHES).astype(int)
    return [slice(int(first), int(first) + most // STRETCHES) for first in firsts]


def _polished(problem: Problem, free: tuple[int, ...], inner: np.ndarray) -> OutputErrorFit:
    """The end of the fit by lmfit, with derivatives from runs side by side."""
    low, high = bounds_of(problem)
    mask = np.isin(np.arange(len(inner)), free)
    names = [f"p{i}" for i in free]
    parameters = lmfit.Parameters()
    for name, i in zip(names, free, strict=True):
        parameters.add(name, value=inner[i], min=low[i], max=high[i])

    def numbers(parameters: lmfit.Parameters) -> np.ndarray:
        full = inner.copy()
        full[list(free)] = [parameters[name].value for name in names]
        return full

    def residual(parameters: lmfit.Parameters) -> np.ndarray:
        return problem.residuals(numbers(parameters)[None])[0]

    def jacobian(parameters: lmfit.Parameters) -> np.ndarray:
        return problem.jacobians(numbers(parameters)[None], mask[None])[0][1]

    result: Any = lmfit.minimize(residual, parameters, Dfun=jacobian, max_nfev=FINE * len(free), ftol=1e-6, xtol=1e-6)
    best = numbers(result.params)
    ((rest, slopes),) = problem.jacobians(best[None], mask[None])
    counted = problem.counted > 0
    velocity, acceleration = problem.inputs.segments[0, :-1, 2:4].T
    groups = groups_of(*(signal[counted] for signal in (problem.inputs.reference, velocity, acceleration)))
    covariance = spread_of(slopes[counted], rest[counted], groups)
    for inputs in problem.unsettled:
        off = _moved_by(inputs, problem, best, slopes, rest) / COVERAGE
        covariance = covariance + np.outer(off, off)
    return OutputErrorFit(problem, best, free, covariance, rest)


def _moved_by(inputs: Inputs, problem: Problem, best: np.ndarray, slopes: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """By how much the fitted numbers move, shape (free,), with other inputs, which a log allows just as well."""
    change = replace(problem, inputs=inputs).residuals(best[None])[0] - rest
    if not np.isfinite(change).all():
        return np.zeros(slopes.shape[1])
    size = np.linalg.norm(slopes, axis=0)
    size = np.where(size > 0, size, 1.0)
    return -np.linalg.lstsq(slopes / size, change, rcond=ALIKE)[0] / size
