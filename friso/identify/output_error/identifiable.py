"""Which parameters a log shows: the fit with those that any motion shows, with all, and what of the rest to believe."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from friso.identify.output_error.coverage import Coverage
from friso.identify.output_error.fit import OutputErrorFit, everywhere, first_values, fit, nearby
from friso.identify.output_error.parameters import LONGEST, RATIO, SHARE
from friso.identify.output_error.problem import Problem
from friso.identify.output_error.profile import Profile, profile
from friso.identify.readings.common import low_pass

STRIBECK = (RATIO, "friction.stribeck_velocity")
BRISTLES = ("friction.bristle_stiffness", "friction.bristle_damping")

STEP_OUT = 1.5
"""A closed loop that leaves so many times the residual of the stage that follows the log has got out of step."""

SURE = 0.99
"""Probability that parameters which no motion shows one by one improve the fit all the same."""

SHARP = 3.0
"""Factor between the ends of a profile interval within which a parameter counts as shown."""


def fit_identifiable(
    follows: Problem, loop: Problem | None, covered: Coverage, bandwidth: float
) -> tuple[OutputErrorFit, dict[str, Profile], set[str]]:
    """The fit, the profile of every parameter, and which of those that not every motion shows it does show; `bandwidth`
    [Hz] is that of the motion.

    Which they are is decided by the stage that follows the log, since a closed loop that hunts soon gets out of step;
    the loop then has the last word, unless it cannot follow. Where the fit is clearly better with those that are not
    shown it keeps them: their effect is there, and without it friction and mass would have to explain it."""
    parameters = follows.parameters
    names = [parameter.name for parameter in parameters]
    core = {parameter.name for parameter in parameters if parameter.core}
    optional = {*names} - core
    plain = fit(follows, _numbers(names, core), first_values(parameters)[None])
    hopeful = {name for name in optional if _may_show(name, covered, follows)}
    identifiable: set[str] = set()
    best = plain
    if hopeful:
        every = _numbers(names, core | hopeful)
        full = fit(follows, every, everywhere(follows, every, plain.inner))
        identifiable = _complete({name for name in hopeful if _shows(full, names.index(name), covered)}, optional)
        fitted = hopeful if _pays(full, plain) else identifiable
        free = _numbers(names, core | fitted)
        neutral = np.where(np.isin(np.arange(len(names)), free), full.inner, plain.inner)
        best = full if fitted == hopeful else fit(follows, free, neutral[None]) if identifiable else plain
    if loop is not None:
        starts = nearby(best)
        if set(best.free) - set(_numbers(names, core)):
            starts = np.vstack([starts, everywhere(loop, best.free, plain.inner)])
        looped = fit(loop, best.free, starts)
        best = looped if _in_step(looped, best, bandwidth) else best
    profiles = {name: profile(best, i, _others(names, i, best.free), best.cost) for i, name in enumerate(names)}
    return best, profiles, identifiable


def _pays(full: OutputErrorFit, plain: OutputErrorFit) -> bool:
    """Whether a fit with more parameters is better by more than chance would make it, with a probability of 99 %."""
    more = len(full.free) - len(plain.free)
    return bool(plain.cost > full.cost * (1 + chi2.ppf(SURE, more) / full.independent))


def _in_step(looped: OutputErrorFit, direct: OutputErrorFit, bandwidth: float) -> bool:
    """Whether a closed loop follows: its residual is no larger than that of the stage that follows the log, both within
    the motion's bandwidth [Hz], since the latter knows no noise above it."""
    step = looped.problem.inputs.sample_time
    rms = [np.std(low_pass(fit.residual, step, bandwidth)) for fit in (looped, direct)]
    return bool(rms[0] < STEP_OUT * rms[1])


def _numbers(names: Sequence[str], chosen: set[str]) -> tuple[int, ...]:
    return tuple(i for i, name in enumerate(names) if name in chosen)


def _complete(identifiable: set[str], optional: set[str]) -> set[str]:
    """Without either of the Stribeck effect's parameters, the other one means nothing."""
    effect = set(STRIBECK) & optional
    return identifiable if effect <= identifiable else identifiable - effect


def _others(names: Sequence[str], number: int, free: Sequence[int]) -> tuple[int, ...]:
    """The parameters that follow one that is moved: those fitted, and the one with which it makes a pair."""
    pair = next((pair for pair in (STRIBECK, BRISTLES) if names[number] in pair), ())
    return tuple(i for i, name in enumerate(names) if i != number and (i in free or name in pair))


def _may_show(name: str, covered: Coverage, problem: Problem) -> bool:
    """Whether the motion covers anything that the parameter could show itself in."""
    parameter = next(candidate for candidate in problem.parameters if candidate.name == name)
    if name in STRIBECK:
        return bool(covered.steady.size) and covered.steady[0] < covered.steady[-1] / 10
    if name in BRISTLES:
        return covered.shows_length(min(LONGEST, float(np.ptp(problem.inputs.reference))))
    return parameter.unit != "" or name == SHARE


def _shows(full: OutputErrorFit, number: int, covered: Coverage) -> bool:
    """Whether a parameter has a sharp, closed interval, and the motion covers where it acts."""
    parameter = full.problem.parameters[number]
    others = tuple(i for i in full.free if i != number)
    interval = profile(full, number, others, full.cost)
    sharp = not (interval.open_low or interval.open_high) and (
        not parameter.logarithmic or interval.high < SHARP * interval.low
    )
    if parameter.name in STRIBECK:
        return sharp and covered.shows_speed(full.value("friction.stribeck_velocity"))
    if parameter.name in BRISTLES:
        length = full.value("friction.coulomb") / full.value("friction.bristle_stiffness")
        return sharp and covered.shows_length(length)
    return sharp


def reason(name: str, covered: Coverage) -> str:
    """Why a parameter is not shown, in a sentence."""
    if name in STRIBECK:
        low, high = covered.gap
        if not np.isfinite(high):
            return "no steady motion at all, in which the Stribeck effect would show"
        return (
            f"no steady motion between {low * 1e3:.2g} and {high * 1e3:.3g} mm/s, where the Stribeck effect would show"
        )
    if name in BRISTLES:
        return "the record passes too quickly through the first micrometres of every motion, where the bristles bend"
    return "the fit hardly changes with it, or its end of the range is the best"
