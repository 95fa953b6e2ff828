"""What a log of moves tells: the inverse model by least squares, then the whole model by its output error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import chi2

from friso.identify.errors import Errors, Residual, errors_of, residual_of, unexplained
from friso.identify.estimate import Estimate
from friso.identify.experiments.common import low_pass
from friso.identify.inverse_model import SMOOTH, InverseModel, inverse_model, motion
from friso.identify.logs.log import Log
from friso.identify.output_error.coverage import Coverage, coverage
from friso.identify.output_error.fit import Fit, everywhere, first_values, fit, nearby
from friso.identify.output_error.parameters import LONGEST, MASS, RATIO, Parameter, keys_of, parameters_of
from friso.identify.output_error.problem import Problem, Simulated, closed_loop, tracking
from friso.identify.output_error.profile import Profile, profile
from friso.intervals import COVERAGE
from friso.quantities import StageError

METHOD = "output error"

STRIBECK = (RATIO, "friction.stribeck_velocity")
BRISTLES = ("friction.bristle_stiffness", "friction.bristle_damping")

STEP_OUT = 1.5
"""A closed loop that leaves so many times the residual of the stage that follows the log has got out of step."""

SURE = 0.99
"""Probability that parameters which no motion shows one by one improve the fit all the same."""

SHARP = 3.0
"""Factor between the ends of a profile interval within which a parameter counts as shown."""


@dataclass(frozen=True)
class Moves:
    """What was found: both fits of the inverse model, the output-error `fit`, the profiles of all parameters by name,
    the estimates by key of the stage file with the `correlation` of the shown ones, what the motion covers, the
    simulated record of the fit and its errors, and `part`, the samples of the log used.

    `loop` is the machine's own closed loop, which was simulated; without it (None) the stage followed the log, and the
    simulated force is what it took to hold it there, which the model does not explain."""

    log: Log
    part: slice
    inverse: InverseModel
    by_direction: InverseModel
    fit: Fit
    profiles: Mapping[str, Profile]
    estimates: tuple[Estimate, ...]
    correlation: np.ndarray
    covered: Coverage
    simulated: Simulated
    errors: Errors
    residual: Residual
    loop: Problem | None

    @property
    def correlated(self) -> tuple[Estimate, ...]:
        """The estimates that the rows of `correlation` stand for."""
        return tuple(each for each in self.estimates if each.shown and each.half_width > 0)

    @property
    def flat(self) -> dict[str, Any]:
        """The stage as fitted, as flat keys; what the record does not show is as in the stage given."""
        return fitted_flat(self.fit)


def fitted_flat(found: Fit) -> dict[str, Any]:
    """The stage of a fit as flat keys."""
    values = {each.name: each.outer(inner) for each, inner in zip(found.problem.parameters, found.inner, strict=True)}
    return {**found.problem.flat, **keys_of(found.problem.flat, values)}


def longest(log: Log) -> slice:
    """The longest stretch of a log without gaps."""
    return max(log.segments, key=lambda part: part.stop - part.start)


def identify_moves(log: Log, flat: Mapping[str, Any], own_loop: bool, bandwidth: float | None = None) -> Moves:
    """Mass, friction and what else the moves of a log show of a stage given as flat keys.

    With `own_loop` the stage's controller is the machine's, and the closed loop is simulated on the log's reference;
    else the model follows the log's position. `bandwidth` [Hz] is the motion's, told from the force unless given.
    Raises StageError for a log without position or force.
    """
    _has(log, ("position", "force", *(("reference",) if own_loop else ())))
    part = longest(log)
    share = _cart_share(log, flat)
    inverse, by_direction = (inverse_model(log, bandwidth, split, share) for split in (False, True))
    follows, loop = _problems(log, part, flat, inverse, own_loop)
    moved = motion(log["position"][part], log.sample_time, SMOOTH * inverse.bandwidth)
    mass, coulomb = (each.start for each in follows.parameters if each.name in (MASS, "friction.coulomb"))
    covered = coverage(log["position"][part], moved, mass, coulomb, log.sample_time)
    found, profiles, shown = _fitted(follows, loop, covered, inverse.bandwidth)
    estimates, correlation = _estimates(found, profiles, shown, covered)
    simulated = (loop or follows).record(found.inner)
    return Moves(
        log, part, inverse, by_direction, found, profiles, estimates, correlation, covered, simulated,
        errors_of(log, part, simulated, inverse.bandwidth) if loop else unexplained(log, part, simulated),
        residual_of(found.residual, moved, log.sample_time), loop,
    )  # fmt: skip


def predict(found: Moves, log: Log) -> tuple[slice, Simulated, Errors]:
    """Another log of the same axis simulated with what was found: the samples used, the record, its errors.

    Raises StageError where the machine's own loop is not known.
    """
    if found.loop is None:
        expected = "the machine's own controller, with which another record can be simulated"
        raise StageError("--predict", "no stage file", expected, "--stage examples/emps_axis.toml", log.name)
    part = longest(log)
    problem = _same_kind(found.loop, log, part)
    simulated = problem.record(found.fit.inner)
    return part, simulated, errors_of(log, part, simulated, found.inverse.bandwidth)


def _same_kind(problem: Problem, log: Log, part: slice) -> Problem:
    """The same stage and parameters on another log."""
    _has(log, ("position", "force", "reference"))
    return closed_loop(problem.flat, log, part, problem.parameters)


def _has(log: Log, roles: Sequence[str]) -> None:
    for role in roles:
        if role not in log:
            given = f"a log with {', '.join(log.signals) or 'no signals'}"
            raise StageError(role, given, f"its {role}", f'--map {role}="NAME OF THE CHANNEL"', log.name)
        if role in log.units:
            example = f'--scale {role}="35 {"N" if role == "force" else "mm"}/{log.unit(role)}"'
            raise StageError(role, f"a channel in {log.unit(role)}", "what one of these is in SI", example, log.name)


def _problems(
    log: Log, part: slice, flat: Mapping[str, Any], inverse: InverseModel, own_loop: bool
) -> tuple[Problem, Problem | None]:
    """The stage following the log's position, and in its own loop, with all the parameters in its equations."""
    speed = float(np.abs(motion(log["position"][part], log.sample_time, SMOOTH * inverse.bandwidth).velocity).max())
    levels = _levels(log, flat, inverse)
    parameters = parameters_of(flat, levels, speed, float(np.ptp(log["position"][part])))
    full = {**flat, **keys_of(flat, {each.name: each.start for each in parameters})}
    follows = tracking(full, log, part, parameters, inverse.bandwidth)
    return follows, closed_loop(full, log, part, parameters) if own_loop else None


def _cart_share(log: Log, flat: Mapping[str, Any]) -> float:
    """The share of the mass that moves with the cart, where that is measured apart from a stage on a free joint."""
    if not _free(flat) or not ("cart_position" in log or "relative_position" in log):
        return 0.0
    return flat["masses.cart"] / (flat["masses.cart"] + flat["masses.stage"])


def _free(flat: Mapping[str, Any]) -> bool:
    return "joint.stiffness" in flat and not flat["joint.locked"]


def _levels(log: Log, flat: Mapping[str, Any], inverse: InverseModel) -> dict[str, float]:
    """Where the fit starts: at the inverse model's values, as far as it shows them and is one of this stage.

    It knows one body. What it does not tell from 0 starts within its interval; all of a stage on a free joint whose
    cart is not measured starts at the stage given.
    """
    if _free(flat) and not _cart_share(log, flat):
        mass = flat["masses.cart"] + flat["masses.stage"]
        return {"mass": mass, "coulomb": flat["friction.coulomb"], "viscous": flat["friction.viscous"], "offset": 0.0}
    levels = {"offset": inverse.value("offset")}
    for each in inverse.estimates:
        if each.name in ("mass", "viscous", "coulomb"):
            levels[each.name] = each.value if each.low > 0 else max(each.high / 2, 1e-6)
    return levels


def _fitted(
    follows: Problem, loop: Problem | None, covered: Coverage, bandwidth: float
) -> tuple[Fit, dict[str, Profile], set[str]]:
    """The fit, the profile of every parameter, and which of those that not every motion shows it does show.

    Which they are is told by the stage that follows the log, since a closed loop that hunts soon gets out of step; the
    loop then has the last word, unless it cannot follow. Where the fit is clearly better with those that are not shown
    it keeps them: their effect is there, and without it friction and mass would have to explain it.
    """
    parameters = follows.parameters
    names = [each.name for each in parameters]
    core = {each.name for each in parameters if each.core}
    asked = {*names} - core
    plain = fit(follows, _numbers(names, core), first_values(parameters)[None])
    hopeful = {name for name in asked if _may_show(name, covered, follows)}
    shown: set[str] = set()
    found = plain
    if hopeful:
        every = _numbers(names, core | hopeful)
        whole = fit(follows, every, everywhere(follows, every, plain.inner))
        shown = _complete({name for name in hopeful if _shows(whole, names.index(name), covered)}, asked)
        kept = hopeful if _pays(whole, plain) else shown
        free = _numbers(names, core | kept)
        neutral = np.where(np.isin(np.arange(len(names)), free), whole.inner, plain.inner)
        found = whole if kept == hopeful else fit(follows, free, neutral[None]) if shown else plain
    if loop is not None:
        looped = fit(loop, found.free, nearby(found))
        found = looped if _in_step(looped, found, bandwidth) else found
    profiles = {name: profile(found, i, _others(names, i, found.free), found.cost) for i, name in enumerate(names)}
    return found, profiles, shown


def _pays(whole: Fit, plain: Fit) -> bool:
    """Whether a fit with more parameters is better by more than chance would make it, with a probability of 99 %."""
    more = len(whole.free) - len(plain.free)
    return bool(plain.cost > whole.cost * (1 + chi2.ppf(SURE, more) / whole.independent))


def _in_step(looped: Fit, found: Fit, bandwidth: float) -> bool:
    """Whether a closed loop follows: its residual is no larger than that of the stage that follows the log, both within
    the motion's bandwidth [Hz], since the latter knows no noise above it."""
    step = looped.problem.inputs.sample_time
    rms = [np.std(low_pass(each.residual, step, bandwidth)) for each in (looped, found)]
    return bool(rms[0] < STEP_OUT * rms[1])


def _numbers(names: Sequence[str], wanted: set[str]) -> tuple[int, ...]:
    return tuple(i for i, name in enumerate(names) if name in wanted)


def _complete(shown: set[str], asked: set[str]) -> set[str]:
    """Without either of the Stribeck effect's parameters, the other one means nothing."""
    effect = set(STRIBECK) & asked
    return shown if effect <= shown else shown - effect


def _others(names: Sequence[str], number: int, free: Sequence[int]) -> tuple[int, ...]:
    """The parameters that follow one that is moved: those fitted, and the one with which it makes a pair."""
    pair = next((pair for pair in (STRIBECK, BRISTLES) if names[number] in pair), ())
    return tuple(i for i, name in enumerate(names) if i != number and (i in free or name in pair))


def _may_show(name: str, covered: Coverage, problem: Problem) -> bool:
    """Whether the motion covers anything that the parameter could show itself in."""
    each = next(each for each in problem.parameters if each.name == name)
    if name in STRIBECK:
        return bool(covered.steady.size) and covered.steady[0] < covered.steady[-1] / 10
    if name in BRISTLES:
        return covered.shows_length(min(LONGEST, float(np.ptp(problem.inputs.reference))))
    return each.unit != ""


def _shows(whole: Fit, number: int, covered: Coverage) -> bool:
    """Whether a parameter has a sharp, closed interval, and the motion covers where it acts."""
    parameter = whole.problem.parameters[number]
    others = tuple(i for i in whole.free if i != number)
    seen = profile(whole, number, others, whole.cost)
    sharp = not (seen.open_low or seen.open_high) and (not parameter.logarithmic or seen.high < SHARP * seen.low)
    if parameter.name in STRIBECK:
        return sharp and covered.shows_speed(whole.value("friction.stribeck_velocity"))
    if parameter.name in BRISTLES:
        length = whole.value("friction.coulomb") / whole.value("friction.bristle_stiffness")
        return sharp and covered.shows_length(length)
    return sharp


def _estimates(
    found: Fit, profiles: Mapping[str, Profile], shown: set[str], covered: Coverage
) -> tuple[tuple[Estimate, ...], np.ndarray]:
    """The keys of the stage file with their intervals, and the correlation of those shown."""
    parameters = found.problem.parameters
    spread = np.zeros((len(parameters), len(parameters)))
    spread[np.ix_(found.free, found.free)] = _no_narrower(found, profiles)
    keys, slopes = _slopes(found)
    covariance = slopes @ spread @ slopes.T
    deviation = np.sqrt(np.diag(covariance))
    values = _keys_at(found, found.inner)
    unknown = {name: reason(name, covered) for name in profiles if name not in shown and not _core(parameters, name)}
    estimates = []
    for i, key in enumerate(keys):
        owner = RATIO if key == "friction.static" else key
        unit = next((each.unit for each in parameters if each.name == key), "N" if key == "friction.static" else "kg")
        if owner in unknown:
            low, high = _range(owner, profiles, values)
            estimates.append(Estimate.unknown(key, unit, METHOD, unknown[owner], low, high))
        else:
            estimates.append(Estimate.normal(key, unit, values[key], deviation[i], METHOD))
    known = [i for i, each in enumerate(estimates) if each.shown and each.half_width > 0]
    part = covariance[np.ix_(known, known)] / np.outer(deviation[known], deviation[known])
    return tuple(estimates), part


def _no_narrower(found: Fit, profiles: Mapping[str, Profile]) -> np.ndarray:
    """The covariance of the fitted numbers with spreads that reach as far as the profiles do."""
    spread = np.sqrt(np.diag(found.covariance))
    factors = np.ones(len(found.free))
    for i, number in enumerate(found.free):
        parameter = found.problem.parameters[number]
        seen = profiles[parameter.name]
        half = float(parameter.inner(seen.high) - parameter.inner(seen.low)) / 2
        factors[i] = max(1.0, half / (COVERAGE * spread[i])) if spread[i] > 0 else 1.0
    return found.covariance * np.outer(factors, factors)


def _core(parameters: Sequence[Parameter], name: str) -> bool:
    return next(each.core for each in parameters if each.name == name)


def _keys_at(found: Fit, inner: np.ndarray) -> dict[str, float]:
    values = {each.name: each.outer(number) for each, number in zip(found.problem.parameters, inner, strict=True)}
    return {key: float(value) for key, value in keys_of(found.problem.flat, values).items()}


def _slopes(found: Fit) -> tuple[list[str], np.ndarray]:
    """The keys of the stage file, and their derivatives to the fitted numbers, shape (keys, parameters)."""
    at = _keys_at(found, found.inner)
    step = 1e-6
    moved = [_keys_at(found, found.inner + step * row) for row in np.eye(len(found.inner))]
    return list(at), np.array([[(each[key] - at[key]) / step for each in moved] for key in at])


def _range(owner: str, profiles: Mapping[str, Profile], values: Mapping[str, float]) -> tuple[float, float]:
    """What is left possible of a key that is not shown."""
    low, high = profiles[owner].low, profiles[owner].high
    scale = values["friction.coulomb"] if owner == RATIO else 1.0
    return low * scale, high * scale


def reason(name: str, covered: Coverage) -> str:
    """Why a parameter is not shown, in a sentence."""
    if name in STRIBECK:
        low, high = covered.gap
        return (
            f"no steady motion between {low * 1e3:.2g} and {high * 1e3:.3g} mm/s, where the Stribeck effect would show"
        )
    if name in BRISTLES:
        return "the record passes too quickly through the first micrometres of every motion, where the bristles bend"
    return "the fit hardly changes with it"
