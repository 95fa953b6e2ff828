"""Decide which parameters a log determines, and fit those.

The motion of a record shows only some of them: steady speeds show the Stribeck effect, sticking shows the bristles.

Parameters that any motion shows are fitted first, then all. Parameters that need special motion are profiled: one is
moved, and all others are refitted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter

import numpy as np
from scipy.stats import chi2

from friso.axis import axis_of
from friso.identification.inverse_model import FilteredMotion
from friso.identification.logs.checks import runs
from friso.identification.output_error.fit import (
    NOISE_RATIO_OF_A_CLOSED_FIT,
    PROBABILITY_OF_AN_EFFECT,
    OutputErrorFit,
    Refined,
    everywhere,
    first_values,
    fit,
    mean_square,
    nearby,
    polished,
    polished_again,
    refine_fit,
    shift_against,
)
from friso.identification.output_error.parameters import BRISTLES, CURVE, EXPONENT, MASS, RATIO, SHARE, STRIBECK, bends
from friso.identification.output_error.problem import Problem
from friso.identification.output_error.settings import settings
from friso.identification.readings.common import low_pass, turns_of
from friso.progress import Progress, between, silent

SPEED_FACTOR_OF_COVERAGE = 3.0
"""Factor below and above the Stribeck velocity within which a record must move steadily to show it."""

SPEED_SHARE_OF_REST = 1e-4
"""Speed that is told as rest, relative to the highest steady one. No stage moves over more than four decades."""

DEVIATIONS_OF_A_BEND = 5.0
"""Smallest visible bend of bristles, in standard deviations of the position's noise."""

SAMPLES_OF_A_BEND = 5
"""Fewest samples that must show the bristles bending at the start of a motion."""

STARTS_WITH_A_BEND = 3
"""Fewest starts of motion with visible bending. One may be chance."""


@dataclass(frozen=True)
class Coverage:
    """Steady speeds and starts of motion in a record; they decide what a fit can show.

    `steady` has the mean speeds of pieces of steady motion [m/s], ascending. `starts` has an array for each stretch
    between turning points: the distances [m] covered at its samples, NaN where inertia outweighed friction.
    `resolution` [m] is the smallest visible displacement, `slowest` [m/s] the lowest visible speed.
    """

    steady: np.ndarray
    starts: tuple[np.ndarray, ...]
    resolution: float
    slowest: float

    def shows_speed(self, speed: float) -> bool:
        """Tell whether the record has steady motion near a speed [m/s], both below and above it.

        Friction falls around the Stribeck velocity; steady motion on one side of this velocity alone does not show the
        fall.
        """
        below = (self.steady >= speed / SPEED_FACTOR_OF_COVERAGE) & (self.steady < speed)
        above = (self.steady > speed) & (self.steady <= speed * SPEED_FACTOR_OF_COVERAGE)
        return bool(below.any() and above.any())

    @property
    def gap(self) -> tuple[float, float]:
        """Return the range of speeds [m/s], widest by ratio, in which there is no steady motion.

        The range lies between neighbouring steady speeds, or below the lowest. If there is no steady motion at all, its
        upper end is infinite. Speeds far below the highest count as rest, however little noise there is.
        """
        slowest = max(self.slowest, SPEED_SHARE_OF_REST * float(self.steady.max(initial=0.0)))
        faster = self.steady[self.steady > slowest]
        speeds = np.concatenate([[slowest], faster]) if faster.size else np.array([slowest, np.inf])
        widest = int(np.argmax(speeds[1:] / speeds[:-1]))
        return float(speeds[widest]), float(speeds[widest + 1])

    def shows_length(self, length: float) -> bool:
        """Tell whether bristles are repeatedly seen bending by a length [m].

        The bend must stand out of the noise of the position over several samples of several starts, because one start
        may be chance.
        """
        least = DEVIATIONS_OF_A_BEND * self.resolution
        passes = [np.sum((distance > least) & (distance < length)) for distance in self.starts]
        return bool(sum(count >= SAMPLES_OF_A_BEND for count in passes) >= STARTS_WITH_A_BEND)


TIME_OF_STEADY_MOTION = 0.02  # [s]
"""Shortest stretch of steady motion. Shorter stretches show no speed above the noise."""

FRICTION_SHARE_OF_INERTIA = 0.5
"""Largest inertia force in motion that counts as steady, relative to Coulomb friction."""


def coverage(position: np.ndarray, moved: FilteredMotion, mass: float, coulomb: float, sample_time: float) -> Coverage:
    """Determine at which steady speeds, and from which starts, a record moves.

    `position` [m] has the shape (n,) and is sampled every `sample_time` [s]; `moved` is the filtered motion. Motion
    counts as steady where inertia, by `mass` [kg], stays below a fraction of the friction `coulomb` [N] for long
    enough.
    """
    rough = position - moved.position
    steps = np.abs(np.diff(position))
    quantum = steps[steps > 0].min() if (steps > 0).any() else 0.0
    resolution = max(float(np.std(rough)), float(quantum) / np.sqrt(12))
    length = max(1, round(TIME_OF_STEADY_MOTION / sample_time))
    slowest = resolution / (length * sample_time)
    calm = (mass * np.abs(moved.acceleration) < FRICTION_SHARE_OF_INERTIA * coulomb) & (
        np.abs(moved.velocity) > slowest
    )
    stretches = [stretch for stretch in runs(calm) if stretch.stop - stretch.start >= length]
    speeds = [_speeds(np.abs(moved.velocity[stretch]), length) for stretch in stretches]
    steady = np.sort(np.concatenate(speeds)) if speeds else np.zeros(0)
    starts = _starts(position, moved, mass / coulomb, DEVIATIONS_OF_A_BEND * resolution)
    return Coverage(steady, starts, resolution, slowest)


def _starts(position: np.ndarray, moved: FilteredMotion, mass_per_force: float, swing: float) -> tuple[np.ndarray, ...]:
    """Return the distances [m] covered since the last turning point, for each stretch.

    A stretch runs from one turning point to the next, and has one distance per sample. A reversal by less than `swing`
    [m] is no turning point. Distances are NaN at samples where inertia outweighs friction, because the force does not
    show the bristles there. `mass_per_force` is the mass over the Coulomb friction [kg/N].
    """
    ends = np.unique([0, *turns_of(position, swing)])
    calm = mass_per_force * np.abs(moved.acceleration) < FRICTION_SHARE_OF_INERTIA
    pieces = zip(ends, [*ends[1:], len(position)], strict=True)
    return tuple(np.where(calm[a:b], np.abs(position[a:b] - position[a]), np.nan) for a, b in pieces)


def _speeds(speed: np.ndarray, length: int) -> np.ndarray:
    """Cut the speeds of a stretch into pieces of about `length` samples; return the means [m/s]."""
    return np.array([piece.mean() for piece in np.array_split(speed, max(1, len(speed) // length))])


PLAIN_SHARE, LOOP_SHARE, ALONG_SHARE, AGAIN_LOOP = 0.1, 0.4, 0.85, 0.95
"""Fractions of the whole fit that are done after its steps: mass and sliding friction; all parameters in closed loop;
all parameters along the log; the closed loop from the fit along the log. Uncertainties are the last step.
"""

FITTED_SHARE, SETTLED_SHARE, PROFILED_SHARE = 0.5, 0.65, 0.95
"""Fractions of the fit along the log that are done after its steps: all parameters; motion between samples; profiles.
The last step refits the determined parameters.
"""


@dataclass(frozen=True)
class IdentifiableFit:
    """A fit, and the names of the parameters that the record determines.

    `shown` has the names of the determined parameters, apart from those that every motion determines. `profiles` has a
    profile by name for each parameter that only some motions determine. `refuted` has the reason for each parameter
    that something else in the record contradicts.
    """

    fit: OutputErrorFit
    profiles: Mapping[str, Profile]
    shown: frozenset[str]
    refuted: Mapping[str, str] = field(default_factory=dict)


def fit_identifiable(
    follows: Problem,
    loop: Problem | None,
    covered: Coverage,
    bandwidth: float,
    noise: float,
    progress: Progress = silent,
) -> IdentifiableFit:
    """Fit the whole model to a log, and decide which parameters to report.

    `follows` is the stage driven along the log, `loop` the stage with its own controller (None: not available).
    `bandwidth` [Hz] is the motion's, `noise` [N] the force's.

    If the closed loop explains the record to its noise, its fit decides; it may start from the fit of the stage that
    follows the log. Otherwise the stage that follows the log decides which parameters are determined, because a hunting
    loop soon gets out of step; the loop then only improves values, if it can follow. If the fit is clearly better with
    undetermined parameters it keeps them, because friction and mass would otherwise absorb their effect.
    """
    names = follows.names
    core = {parameter.name for parameter in follows.parameters if parameter.core}
    part = between(progress, 0, PLAIN_SHARE, "moves: mass and sliding friction along the log")
    plain = fit(follows, _numbers(names, core), first_values(follows.parameters)[None], part)
    explaining = []
    if loop is not None:
        numbers = tuple(range(len(names)))
        part = between(progress, PLAIN_SHARE, LOOP_SHARE, "moves: all parameters in closed loop")
        full = fit(loop, numbers, np.vstack([nearby(plain), everywhere(loop, numbers, plain.inner)]), part)
        if full.explains(noise, closely=True):
            return believed(full, core, covered, between(progress, LOOP_SHARE, 1), explained=True)
        explaining = [full] if full.explains(noise) else []
    part = between(progress, *((PLAIN_SHARE, 1) if loop is None else (LOOP_SHARE, ALONG_SHARE)))
    along = _identifiable_on_log(follows, plain, core, covered, noise, part)
    if loop is None:
        return along
    starts = nearby(along.fit)
    if set(along.fit.free) - set(_numbers(names, core)):
        starts = np.vstack([starts, everywhere(loop, along.fit.free, plain.inner)])
    part = between(progress, ALONG_SHARE, AGAIN_LOOP, "moves: the closed loop from there")
    best = min((fit(loop, along.fit.free, starts, part), *explaining), key=attrgetter("cost"))
    if not (_in_step(best, along.fit, bandwidth) and bounds_as_much(best, along.fit)):
        return along
    if best.explains(noise, closely=True):
        return believed(best, core, covered, between(progress, AGAIN_LOOP, 1), explained=True)
    return replace(along, fit=best)


def _identifiable_on_log(
    follows: Problem, plain: OutputErrorFit, core: set[str], covered: Coverage, noise: float, progress: Progress
) -> IdentifiableFit:
    """Fit the stage that follows the log, and find which parameters it determines.

    `plain` is the fit of the `core` parameters alone, and `noise` [N] is the force's. Parameters that the motion cannot
    show are tried only if the others do not explain the record.
    """
    names = follows.names
    hopeful = {name for name in names if name not in core and _may_show(name, covered, follows)}
    plain = with_force_settled(with_smoothness_settled(plain), noise)
    follows = plain.problem
    if not hopeful:
        return IdentifiableFit(plain, {}, frozenset())
    numbers = _numbers(names, core | hopeful)
    part = between(progress, 0, FITTED_SHARE, "moves: all parameters along the log")
    full = fit(follows, numbers, everywhere(follows, numbers, plain.inner), part)
    between(progress, FITTED_SHARE, SETTLED_SHARE)(0, 0, "moves: what happens between the samples")
    full = with_force_settled(with_smoothness_settled(full), noise)
    if not full.explains(noise):
        full = with_force_settled(with_smoothness_settled(_searched_again(full)), noise)
    answer = believed(full, core, covered, between(progress, SETTLED_SHARE, PROFILED_SHARE))
    if full.problem.inputs is not plain.problem.inputs:
        plain = polished(full.problem, plain.free, plain.inner)
    alone = full.explains(noise) and not plain.explains(noise)
    better = _pays(full, plain) and (alone or answer.fit.bounded >= plain.bounded)
    better = better and not plain.is_noise_of_motion(noise)
    if better or answer.shown == hopeful:
        return answer
    if not answer.shown:
        return replace(answer, fit=plain)
    free = _numbers(names, core | answer.shown | ({EXPONENT} if RATIO in answer.shown else set()))
    neutral = np.where(np.isin(np.arange(len(names)), free), full.inner, plain.inner)
    part = between(progress, PROFILED_SHARE, 1, "moves: the parameters that are shown")
    return replace(answer, fit=fit(full.problem, free, neutral[None], part))


BETTER_FITS_BY_PROFILES = 3
"""Largest number of times that a fit is replaced by a better one found in a profile."""


def believed(
    full: OutputErrorFit, core: set[str], covered: Coverage, progress: Progress, explained: bool = False
) -> IdentifiableFit:
    """Decide which uncertain parameters of a fit to report, by refitting all others.

    Uncertain parameters are those that not every motion shows: all but the `core`. For each, all others are refitted at
    several of its values, which gives its profile and interval. A narrow, closed interval suffices if the fit has
    `explained` the record. Otherwise the motion must also cover the parameter's effect; no other parameter is examined.
    A clearly better fit among the refits replaces `full`.
    """
    names = full.problem.names
    profiles: dict[str, Profile] = {}
    again = BETTER_FITS_BY_PROFILES
    while True:
        blurred = any(name in STRIBECK and not _sharp(full, seen) for name, seen in profiles.items())
        rest = {*names} - core - profiles.keys() - {*(CURVE if blurred else ())}
        asked = [i for i in full.free if names[i] in rest and (explained or _covers(full, names[i], covered))]
        if not asked:
            break
        i = asked[0]
        progress(len(profiles), len(profiles) + len(asked), f"moves: how well {names[i]} is known")
        seen, fits = profile(full, i, tuple(other for other in full.free if other != i), full.cost)
        profiles[names[i]] = seen
        if again and fits.cost.min() < full.cost * (1 - WORSE / full.independent):
            again -= 1
            full, profiles = polished(full.problem, full.free, fits.inner[np.argmin(fits.cost)]), {}
    shown = {name for name, seen in profiles.items() if _sharp(full, seen)}
    return IdentifiableFit(full, profiles, frozenset(_complete(shown, {*names} - core)))


FURTHER_SEARCHES = 4
"""Largest number of further searches, each of which follows another optimum."""

COST_SHARE_OF_ANOTHER_OPTIMUM = 0.9
"""Ratio of a new fit's sum of squares to the last one's below which it counts as another optimum, and a further
search may pay."""


def _searched_again(full: OutputErrorFit) -> OutputErrorFit:
    """Search all parameters again from the mass and friction of a fit, as long as that finds another optimum.

    All parameters are searched, also those that the motion cannot show: without static friction no model explains moves
    too small to slide steadily. A fit within the noise is no reason to stop: of small moves it was the second of
    three optima, and not yet right.
    """
    problem, free = full.problem, tuple(range(len(full.inner)))
    for _ in range(FURTHER_SEARCHES):
        before = full
        full = min(full, fit(problem, free, everywhere(problem, free, full.inner)), key=attrgetter("cost"))
        if full.cost > COST_SHARE_OF_ANOTHER_OPTIMUM * before.cost:
            break
    return full


PROBABILITY_OF_MORE_PARAMETERS = 0.99
"""Confidence (F-test) with which parameters not determined singly must improve a fit together to be kept."""


def _pays(full: OutputErrorFit, plain: OutputErrorFit) -> bool:
    """Tell whether a fit with more parameters, `full`, is better than `plain` beyond chance."""
    more = len(full.free) - len(plain.free)
    chance = chi2.ppf(PROBABILITY_OF_MORE_PARAMETERS, more) / full.independent
    return bool(plain.cost > full.cost * (1 + chance))


RESIDUAL_RATIO_OUT_OF_STEP = 1.5
"""Ratio of residuals above which a closed loop is out of step with the log."""


def _in_step(looped: OutputErrorFit, direct: OutputErrorFit, bandwidth: float) -> bool:
    """Tell whether a closed loop follows the log about as well as the stage driven along the log.

    The residuals are compared below the motion's bandwidth [Hz], above which only the loop's residual has noise, and at
    the samples that count for the driven stage.
    """
    step, counted = looped.problem.inputs.sample_time, direct.problem.counted > 0
    powers = [np.sum(low_pass(fit.residual, step, bandwidth)[counted] ** 2) for fit in (looped, direct)]
    return bool(powers[0] <= RESIDUAL_RATIO_OUT_OF_STEP**2 * powers[1])


def bounds_as_much(looped: OutputErrorFit, direct: OutputErrorFit) -> bool:
    """Tell whether a closed loop bounds all numbers that the stage following the log bounds.

    For stick-slip motion the derivatives of a closed loop may show only shifted break-aways, and bound nothing.
    """
    bounded = [
        {i for i, variance in zip(fit.free, np.diag(fit.covariance), strict=True) if np.isfinite(variance)}
        for fit in (looped, direct)
    ]
    return bounded[0] >= bounded[1]


def _numbers(names: Sequence[str], chosen: set[str]) -> tuple[int, ...]:
    """Return the indices of the chosen names."""
    return tuple(i for i, name in enumerate(names) if name in chosen)


def _complete(identifiable: set[str], optional: set[str]) -> set[str]:
    """Return the determined parameters, without the Stribeck curve if one half of it is missing.

    The halves are the curve's height and its velocity. A half that is not among the `optional` parameters cannot be
    missing. `identifiable` are the names of determined parameters.
    """
    effect = set(STRIBECK) & optional
    return identifiable if effect <= identifiable else identifiable - set(CURVE)


def _may_show(name: str, covered: Coverage, problem: Problem) -> bool:
    """Tell whether the record contains motion in which a parameter could have a visible effect."""
    parameter = problem.parameter(name)
    if name in CURVE:
        return bool(covered.steady.size) and covered.steady[0] < covered.steady[-1] / 10
    if name in BRISTLES:
        return covered.shows_length(min(bends(axis_of(problem.flat))[1], float(np.ptp(problem.inputs.reference))))
    return parameter.unit != "" or name == SHARE


FACTOR_OF_A_SHARP_PROFILE = 3.0
"""Largest ratio of upper to lower end of the interval of a determined parameter."""


def _sharp(full: OutputErrorFit, seen: Profile) -> bool:
    """Tell whether a profile interval is closed on both sides and narrow."""
    parameter = full.problem.parameter(seen.name)
    closed = not (seen.open_low or seen.open_high)
    return closed and (not parameter.logarithmic or seen.high < FACTOR_OF_A_SHARP_PROFILE * seen.low)


SAMPLED_BRISTLE_FREQUENCY = 0.25
"""Highest frequency of the mass on its bristles, times the sample time, that a log can show."""


def _covers(full: OutputErrorFit, name: str, covered: Coverage) -> bool:
    """Tell whether the motion covers the speeds or displacements at which a parameter acts.

    For bristles, their swing must also be slow enough for the sampling. The result is true for parameters that act in
    any motion.
    """
    if name in CURVE:
        return covered.shows_speed(full.value("friction.stribeck_velocity"))
    if name in BRISTLES:
        stiffness = full.value("friction.bristle_stiffness")
        swings = np.sqrt(stiffness / full.value(MASS)) / (2 * np.pi)
        fast_enough = swings * full.problem.inputs.sample_time < SAMPLED_BRISTLE_FREQUENCY
        return bool(fast_enough and covered.shows_length(full.value("friction.coulomb") / stiffness))
    return True


def why_not_shown(name: str, covered: Coverage) -> str:
    """Return in a sentence why a record does not determine the parameter `name`."""
    if name in CURVE:
        low, high = covered.gap
        if not np.isfinite(high):
            return "no steady motion at all, in which the Stribeck effect would show"
        if high > SPEED_FACTOR_OF_COVERAGE**2 * low:
            gap = f"between {low * 1e3:.2g} and {high * 1e3:.3g} mm/s"
            return f"no steady motion {gap}, where the Stribeck effect would show"
    if name in BRISTLES:
        return (
            "the record passes too quickly, for its sampling, through the first micrometres of every motion, where the "
            "bristles bend"
        )
    return "the fit hardly changes with it, or its end of the range is the best"


def with_smoothness_settled(fit: OutputErrorFit) -> OutputErrorFit:
    """Refit with the position of a log smoothed less and less, as long as the fit improves.

    Smoothing blurs the instants of break-away: for stick-slip motion without noise, a Stribeck exponent of 2 was fitted
    as 1.47 and the bristles a fifth too soft. Too little smoothing passes the noise of the position on to the force.
    """
    while fit.problem.sharper:
        sharper = polished_again(fit, fit.problem.held_to(0))
        if sharper.cost >= fit.cost:
            break
        fit = sharper
    return fit


def with_force_settled(fit: OutputErrorFit, noise: float) -> OutputErrorFit:
    """Fit the force of a log as held and as interpolated between samples; return the better fit.

    A held force acts half a sample later, which shifts bristle damping by half a sample times the bristle stiffness.
    The worse fit is ruled out if it is clearly worse, and the better one explains the force to its `noise` [N].
    Otherwise both stay possible, and intervals allow for both.
    """
    problem = fit.problem
    other = next((inputs for inputs in problem.unsettled if inputs.held != problem.inputs.held), None)
    if other is None:
        return fit
    sharper = tuple(inputs for inputs in problem.unsettled if inputs is not other)
    turned = tuple(replace(inputs, held=other.held) for inputs in sharper)
    swapped = polished_again(fit, replace(problem, inputs=other, unsettled=(problem.inputs, *turned)))
    better, worse = sorted((fit, swapped), key=lambda one: one.cost)
    unexplained = better.left > NOISE_RATIO_OF_A_CLOSED_FIT * problem.noise_left(noise)
    chance = chi2.ppf(PROBABILITY_OF_AN_EFFECT, 1) / better.independent
    if unexplained or worse.cost < better.cost * (1 + chance):
        return better
    return polished_again(better, replace(better.problem, unsettled=turned if better is swapped else sharper))


WORSE = float(chi2.ppf(0.95, 1))
"""Increase of -2 ln(likelihood) at the ends of a 95 % interval."""


@dataclass(frozen=True)
class Profile:
    """Cost of a fit as one parameter is moved away, with all others refitted.

    `values` of the parameter ascend [SI]; `cost` has the mean square of the residual [N^2] at each. Inside the 95 %
    interval the cost is at most `limit`. `low` and `high` are the interval's ends; `open_low` and `open_high` mark ends
    that are only the range's.
    """

    name: str
    values: np.ndarray
    cost: np.ndarray
    limit: float
    low: float
    high: float
    open_low: bool
    open_high: bool


DEVIATIONS_OF_A_PROFILE = 4.0
"""First distance from the fit to which a profile reaches, in standard deviations."""

WIDENING_OF_A_PROFILE = 5.0
"""Factor by which a profile's reach grows whenever the interval's end lies beyond it."""


def profile(fit: OutputErrorFit, number: int, others: tuple[int, ...], best: float) -> tuple[Profile, Refined]:
    """Compute the cost of a fit over values of one parameter, with others refitted at each.

    The parameter has the index `number`, and `others` are the indices to refit. `best` is the mean square [N^2] of the
    fit with which costs are compared. The values reach beyond the interval's ends, or over the whole range. Returns the
    profile and the fits behind it.
    """
    low, high = (float(end[number]) for end in fit.problem.bounds)
    centre = fit.inner[number]
    spread = fit.covariance[fit.free.index(number), fit.free.index(number)] if number in fit.free else np.inf
    limit = best * (1 + WORSE / fit.independent)
    parameter = fit.problem.parameters[number]
    half = DEVIATIONS_OF_A_PROFILE * np.sqrt(spread) if spread > 0 else np.inf
    while True:
        near, far = max(low, centre - half), min(high, centre + half)
        values = np.unique([*np.linspace(near, far, settings.points_of_a_profile), centre])
        fits = _fits(fit, number, others, values, limit)
        cost = fits.cost
        left, right, open_left, open_right = _ends(values, cost, limit)
        if not ((open_left and near > low) or (open_right and far < high)):
            break
        half *= WIDENING_OF_A_PROFILE
    ends = float(parameter.outer(left)), float(parameter.outer(right))
    return Profile(parameter.name, parameter.outer(values), cost, limit, *ends, open_left, open_right), fits


COST_SHARE_OF_A_PROFILE = 0.1
"""Relative decrease of the excess cost per iteration at which a fit of a profile ends. Larger values end too
early."""


def _fits(fit: OutputErrorFit, number: int, others: tuple[int, ...], values: np.ndarray, limit: float) -> Refined:
    """Fit all other parameters at each of the `values` of the parameter with the index `number`.

    The `others` are indices. A fit whose mean square would stay above `limit` is abandoned.
    """
    starts = np.repeat(fit.inner[None], len(values), axis=0)
    starts[:, number] = values
    if not others:
        return Refined(starts, mean_square(fit.problem.residuals(starts)))
    following = starts.copy()
    following[:, list(others)] += np.outer(values - fit.inner[number], _following(fit, number, others))
    following = np.clip(following, *fit.problem.bounds)
    stay, follow = mean_square(fit.problem.residuals(np.vstack([starts, following]))).reshape(2, -1)
    inner, cost = np.where((follow < stay)[:, None], following, starts), np.minimum(stay, follow)
    away = ~np.isclose(values, fit.inner[number], rtol=0, atol=1e-6 * np.ptp(values))
    free = np.isin(np.arange(starts.shape[1]), others)
    until = settings.iterations_of_a_profile, COST_SHARE_OF_A_PROFILE * WORSE / fit.independent
    refined = refine_fit([fit.problem], inner[away], free, *until, aim=limit, slopes=fit.slopes)
    inner[away], cost[away] = refined.inner, refined.cost
    return Refined(inner, cost)


def _following(fit: OutputErrorFit, number: int, others: tuple[int, ...]) -> np.ndarray:
    """Return how far other fitted numbers shift per shift of one, to first order, (others,).

    `number` is the index of the one, and `others` are those of the other numbers. The shifts are 0 if the one is not
    fitted.
    """
    if number not in fit.free:
        return np.zeros(len(others))
    slopes = fit.linearised[1]
    along, across = slopes[:, fit.free.index(number)], slopes[:, [fit.free.index(other) for other in others]]
    return shift_against(along, across)


def _ends(values: np.ndarray, cost: np.ndarray, limit: float) -> tuple[float, float, bool, bool]:
    """Find where a profile crosses the limit on either side of its minimum.

    `cost`, of the shape of `values`, is the profile. Returns the lower and the upper end, and for each end whether it
    is open. Where the profile does not cross the limit, the end is open, and is the first or last of the `values`.
    """
    lowest = int(np.argmin(cost))
    left, right = values[0], values[-1]
    inside = cost <= max(limit, cost[lowest])
    below, above = np.flatnonzero(~inside[:lowest]), np.flatnonzero(~inside[lowest:])
    if below.size:
        left = _crossing(values, cost, limit, below[-1], below[-1] + 1)
    if above.size:
        right = _crossing(values, cost, limit, lowest + above[0], lowest + above[0] - 1)
    return left, right, not below.size, not above.size


def _crossing(values: np.ndarray, cost: np.ndarray, limit: float, outside: int, inside: int) -> float:
    """Find where a profile crosses the limit between two neighbouring values.

    `outside` is the index of the value with a cost above the limit, `inside` that of the other. Between them, the
    square root of the excess cost is taken to grow linearly with distance from the best fit.
    """
    if not np.isfinite(cost[outside]):
        return values[inside]
    base = min(cost[inside], limit)
    share = np.sqrt((limit - base) / (cost[outside] - base)) if cost[outside] > base else 1.0
    return values[inside] + min(share, 1.0) * (values[outside] - values[inside])
