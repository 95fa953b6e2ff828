"""The fit: a thousand starts, the best of them refined side by side, and the best of those to the end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.stats import qmc

from friso.engine.driven import Inputs
from friso.identification.output_error.parameters import FitParameter, keys_of
from friso.identification.output_error.problem import Problem
from friso.identification.output_error.refine import bounds_of, refine_fit
from friso.identification.output_error.settings import OutputErrorSettings
from friso.identification.spread import correlation_length, groups_of, spread_of
from friso.intervals import COVERAGE
from friso.progress import Progress, Tally, share_of, silent


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
    def left(self) -> float:
        """What the fit leaves [N], RMS, where it counts."""
        return float(np.sqrt(np.sum(self.residual**2) / max(float(self.problem.counted.sum()), 1.0)))

    def explains(self, noise: float, closely: bool = False) -> bool:
        """Whether it leaves about the `noise` [N] of the log's force, or `closely` no more than that."""
        settings = OutputErrorSettings.current()
        times = settings.noise_ratio_of_a_closed_fit if closely else settings.noise_ratio_of_an_explained_record
        return self.left < times * noise * self.problem.passes

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

    def linearised(self) -> tuple[np.ndarray, np.ndarray]:
        """The residual, shape (n,), and its derivatives to the fitted numbers, shape (n, free)."""
        mask = np.isin(np.arange(len(self.inner)), self.free)
        return self.problem.linearised(self.inner, mask)

    def value(self, name: str) -> float:
        """The SI value of a parameter."""
        names = [parameter.name for parameter in self.problem.parameters]
        i = names.index(name)
        return float(self.problem.parameters[i].outer(self.inner[i]))


def first_values(parameters: Sequence[FitParameter]) -> np.ndarray:
    """The fitted numbers at which the parameters start, shape (parameters,)."""
    return np.array([parameter.inner(parameter.start) for parameter in parameters])


def fit(problem: Problem, free: Sequence[int], starts: np.ndarray, progress: Progress = silent) -> OutputErrorFit:
    """Fit the free parameters, given by number, of a problem, from some starts, shape (starts, parameters), the best of
    which are refined; the others stay as in the first of them."""
    return fits([problem], free, starts, progress)[0]


def fits(
    problems: Sequence[Problem], free: Sequence[int], starts: np.ndarray, progress: Progress = silent
) -> list[OutputErrorFit]:
    """The same of problems that differ in nothing but what counts."""
    pieces, works = _parts(problems[0], len(starts)), 1 + len(problems)
    ranked = _ranked(problems, pieces, starts, share_of(progress, 0, works))
    return [
        _fit(problem, pieces, free, tried, share_of(progress, number, works))
        for number, (problem, tried) in enumerate(zip(problems, ranked, strict=True), 1)
    ]


def _fit(
    problem: Problem, pieces: Sequence[slice], free: Sequence[int], tried: np.ndarray, progress: Progress
) -> OutputErrorFit:
    """Fit from the best starts. What one of them is worth shows after a few iterations, on pieces of a long record: of
    a stage that sticks and slips the best of the starts as they are lead to other optima."""
    settings = OutputErrorSettings.current()
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
        refined = refine_fit(parts, tried, np.tile(mask, (len(tried), 1)), iterations, enough, part)
        tried = refined.inner[np.argsort(refined.cost)]
    return polished(problem, tuple(free), tried[0], share_of(progress, 2, 3))


def everywhere(problem: Problem, free: Sequence[int], first: np.ndarray) -> np.ndarray:
    """Many starts over the ranges of the free parameters, shape (starts, parameters), behind the `first`: they
    find parameters that not every motion shows. Core parameters start about the inverse model's values: a first fit
    of them alone to motion that sticks and slips can be anywhere."""
    settings = OutputErrorSettings.current()
    low, high = bounds_of(problem)
    core = np.array([parameter.core for parameter in problem.parameters])
    logarithmic = np.array([parameter.logarithmic for parameter in problem.parameters])
    centre, half = (
        first_values(problem.parameters),
        np.where(logarithmic, settings.logarithm_of_core_starts, settings.range_share_of_core_starts * (high - low)),
    )
    low, high = (
        np.where(core, np.maximum(centre - half, low), low),
        np.where(core, np.minimum(centre + half, high), high),
    )
    shares = qmc.Sobol(len(first), rng=settings.seed_of_starts).random(settings.starts_of_a_fit)
    starts = np.where(np.isin(np.arange(len(first)), free), low + shares * (high - low), first)
    return np.vstack([first, starts])


def nearby(fit: OutputErrorFit) -> np.ndarray:
    """Starts that another problem's fit allows, shape (starts, parameters), itself the first: drawn from its covariance
    `FAR` times as wide."""
    settings = OutputErrorSettings.current()
    low, high = (end[list(fit.free)] for end in bounds_of(fit.problem))
    deviation = np.sqrt(np.diag(fit.covariance))
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


def _ranked(
    problems: Sequence[Problem], pieces: Sequence[slice], starts: np.ndarray, progress: Progress
) -> list[np.ndarray]:
    """Of each problem the best starts, shape (tried, parameters), the first one always among them."""
    settings = OutputErrorSettings.current()
    if len(starts) <= settings.starts_refined_first:
        return [starts] * len(problems)
    sums = np.zeros((len(problems), len(starts) - 1))
    tally = Tally(progress, len(pieces) * (len(starts) - 1))
    for piece in pieces:
        part, counted = problems[0].part(piece), np.stack([problem.counted[piece] for problem in problems])
        for numbers, record in part.simulated(starts[1:]):
            sums[:, numbers] += counted**2 @ ((part.target - record.force) ** 2).T
            tally.add(len(numbers), "")
    best = np.argsort(np.where(np.isfinite(sums), sums, np.inf), axis=1)[:, : settings.starts_refined_first - 1]
    return [np.vstack([starts[0], starts[1:][chosen]]) for chosen in best]


def _parts(problem: Problem, starts: int) -> list[slice]:
    """What of a record the starts are simulated over: all of a short one; of a long one its beginning in closed loop,
    whose state is not known later on, and else stretches from all over it: slow motion may come last."""
    settings = OutputErrorSettings.current()
    count, most = len(problem.target), int(settings.samples_of_all_starts / starts)
    if count <= most or problem.closed:
        return [slice(0, min(count, most))]
    firsts = np.linspace(
        0, count - most // settings.stretches_of_a_screening, settings.stretches_of_a_screening
    ).astype(int)
    return [slice(int(first), int(first) + most // settings.stretches_of_a_screening) for first in firsts]


def polished(problem: Problem, free: tuple[int, ...], inner: np.ndarray, progress: Progress = silent) -> OutputErrorFit:
    """The end of the fit, and how well it is known."""
    settings = OutputErrorSettings.current()
    mask = np.isin(np.arange(len(inner)), free)
    best = refine_fit(
        [problem], inner[None], mask[None], settings.iterations_of_a_fit, settings.cost_share_of_a_fit, progress
    ).inner[0]
    rest, slopes = problem.linearised(best, mask)
    counted = problem.counted > 0
    velocity, acceleration = problem.inputs.segments[0, :-1, 2:4].T
    groups = groups_of(*(signal[counted] for signal in (problem.inputs.reference, velocity, acceleration)))
    covariance = spread_of(slopes[counted], rest[counted], groups)
    moved = [_moved_by(inputs, problem, best, slopes, rest) for inputs in problem.unsettled]
    return OutputErrorFit(problem, best, free, _reaching_over(covariance, moved), rest)


def _reaching_over(covariance: np.ndarray, moved: Sequence[np.ndarray]) -> np.ndarray:
    """The covariance of fitted numbers, shape (free, free), with deviations whose intervals hold those about what other
    inputs make of them, which are `moved` by so much, each of shape (free,): one of these is true, not one between."""
    if not moved:
        return covariance
    wanted = np.sqrt(np.diag(covariance)) + np.linalg.norm(moved, axis=0) / COVERAGE
    further = covariance + sum(np.outer(off, off) for off in moved) / COVERAGE**2
    deviation = np.sqrt(np.diag(further))
    finite = np.isfinite(deviation) & (deviation > 0)
    wider = np.divide(wanted, deviation, out=np.ones_like(wanted), where=finite)
    return further * np.outer(wider, wider)


def _moved_by(inputs: Inputs, problem: Problem, best: np.ndarray, slopes: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """By how much the fitted numbers move, shape (free,), with other inputs, which a log allows just as well."""
    settings = OutputErrorSettings.current()
    change = replace(problem, inputs=inputs).residuals(best[None])[0] - rest
    if not np.isfinite(change).all():
        return np.zeros(slopes.shape[1])
    size = np.linalg.norm(slopes, axis=0)
    size = np.where(size > 0, size, 1.0)
    return -np.linalg.lstsq(slopes / size, change, rcond=settings.smallest_singular_value)[0] / size
