"""Analyse moves: the inverse model by least squares, then the whole model by its output error; predict other logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from friso.errors import InputError
from friso.identification.combine import binned, correlation_length
from friso.identification.doubt import (
    FitCase,
    FittedCase,
    KeyCase,
    Quality,
    judged_fit,
    judged_keys,
    leading_effect,
    quality_of,
    raised,
)
from friso.identification.estimate import Estimate
from friso.identification.inverse_model import (
    FilteredMotion,
    InverseModel,
    directions,
    inverse_model,
    moved_in,
    unit_of,
)
from friso.identification.kind import FirstEstimates
from friso.identification.logs.log import Log
from friso.identification.model_error import allowed_for
from friso.identification.output_error.fit import OutputErrorFit, as_far_off_as_repeated, late_by_a_sample
from friso.identification.output_error.identifiable import (
    Coverage,
    IdentifiableFit,
    Profile,
    coverage,
    fit_identifiable,
)
from friso.identification.output_error.parameters import MASS, fit_parameters, is_free, keys_of
from friso.identification.output_error.problem import Problem, Simulated, loop_problem, tracking
from friso.identification.output_error.to_keys import drawn_from, estimates_of
from friso.identification.readings.common import noise_of
from friso.identification.witness import Replay, witnessed
from friso.progress import Progress, between, silent
from friso.stage.controllers import CONTROLLER

FITTED_SHARE, REPEATED_SHARE = 0.8, 0.92
"""Fractions of the analysis that are done after the fit, and after its repetition on simulated logs. Fits of either
direction alone are the last step.
"""


@dataclass(frozen=True, kw_only=True)
class IdentifiedMoves:
    """Result of an analysis of moves.

    Fields are both fits of the inverse model (common and by direction), the output-error `fit`, the profiles of
    parameters by name, the estimates of stage-file keys with the `correlation` of the determined ones, the coverage of
    the motion, the simulated record of the fit and its errors, and `part`, the samples used.

    `loop` is the machine's own closed loop, if it was simulated; if None, the stage followed the log, and the simulated
    force is the guiding force, which the model does not explain.
    """

    log: Log
    part: slice
    inverse: InverseModel
    by_direction: InverseModel
    fit: OutputErrorFit
    profiles: Mapping[str, Profile]
    estimates: tuple[Estimate, ...]
    correlation: np.ndarray
    covered: Coverage
    simulated: Simulated
    errors: SimulationErrors
    residual: Residual
    loop: Problem | None
    quality: Quality
    replay: Replay | None = None

    @property
    def correlated(self) -> tuple[Estimate, ...]:
        """Return the estimates in the order of the rows of `correlation`."""
        return tuple(estimate for estimate in self.estimates if estimate.determined)

    @property
    def force_unit(self) -> str:
        """Return the unit of the force, which replaces the newton in estimates."""
        return self.log.unit("force")

    @property
    def flat(self) -> dict[str, Any]:
        """Return the fitted stage as flat keys such as friction.static, with SI values.

        Keys that the record does not determine stay as given.
        """
        return self.fit.stage


def identify_moves(
    log: Log,
    flat: Mapping[str, Any],
    own_loop: bool,
    bandwidth: float | None = None,
    progress: Progress = silent,
    tell: FirstEstimates = lambda name, estimates: None,
) -> IdentifiedMoves:
    """Identify mass, friction and other keys of a stage from a log of moves.

    `flat` has the stage as flat keys with SI values. With `own_loop` its controller is the machine's: it is replayed on
    the log, and the closed loop is simulated on the logged reference. Otherwise the model follows the logged position.
    `bandwidth` [Hz] is the motion's, read from the log by default. If the force is not in newtons (not allowed with
    `own_loop`), estimates are per unit of force. `tell` gets the inverse model's estimates as soon as they are known.
    Raises InputError for a log without position or force, or one whose clock, unit or sign the controller contradicts.
    """
    check_roles(log, ("position", "force", *(("reference",) if own_loop else ())), () if own_loop else ("force",))
    share = _cart_share(log, flat)
    log, replay = witnessed(log, flat) if own_loop else (log, None)
    part = log.longest
    inverse = inverse_model(log, bandwidth, False, share)
    by_direction = inverse_model(log, inverse.bandwidth, True, share, slowest=inverse.slowest)
    tell(log.name, inverse.estimates)
    moved = moved_in(log, log["position"][part], inverse.bandwidth)
    follows, loop = _problems(log, part, flat, inverse, float(np.abs(moved.velocity).max()), own_loop)
    starts = {parameter.name: parameter.start for parameter in follows.parameters}
    mass, coulomb = starts[MASS], starts.get("friction.coulomb", np.inf)
    covered = coverage(log["position"][part], moved, mass, coulomb, log.sample_time)
    noise = noise_of(log["force"][part])
    answer = fit_identifiable(follows, loop, covered, inverse.bandwidth, noise, between(progress, 0, FITTED_SHARE))
    fit = answer.fit
    fitted = FittedCase(log, inverse, share, flat=flat, fit=fit, velocity=moved.velocity)
    leading = leading_effect(fitted) if fit.left > fit.problem.noise_left(noise) else None
    quality = quality_of(log, inverse, fit, noise, share, leading is not None, replay)
    if not fit.problem.closed:
        fit = as_far_off_as_repeated(
            fit, log, part, inverse.bandwidth, noise, between(progress, FITTED_SHARE, REPEATED_SHARE)
        )
        fit = fit if fit.explains(noise) else late_by_a_sample(fit)
    case = FitCase(
        log,
        inverse,
        share,
        flat=flat,
        fit=fit,
        quality=quality,
        velocity=moved.velocity,
        leading=None if quality.seen else leading,
        progress=between(progress, REPEATED_SHARE, 1),
    )
    doubted = judged_fit(case)
    inverse, quality, answer = doubted.inverse, doubted.quality, replace(answer, fit=doubted.fit)
    case = _with_estimates(doubted, answer, covered, moved.acceleration)
    fit, estimates, correlation = case.fit, case.estimates, case.correlation
    simulated = (loop or fit.problem).record(fit.inner)
    return IdentifiedMoves(
        log=log,
        part=part,
        inverse=inverse,
        by_direction=by_direction,
        fit=fit,
        profiles=answer.profiles,
        estimates=estimates,
        correlation=correlation,
        covered=covered,
        simulated=simulated,
        errors=errors_of(log, part, simulated, inverse.bandwidth) if loop else unexplained(log, part, simulated),
        residual=residual_of(fit.residual, moved, log.sample_time),
        loop=loop,
        quality=quality,
        replay=replay,
    )


def _with_estimates(doubted: FitCase, answer: IdentifiableFit, covered: Coverage, acceleration: np.ndarray) -> KeyCase:
    """Return the case with an estimate for each key, after all doubts about them were examined.

    `answer` has the fit with its intervals, and `covered` the speeds and displacements of the motion. `acceleration`
    [m/s^2], shape (n,), is smooth.
    """
    fit, inverse, quality = doubted.fit, doubted.inverse, doubted.quality
    if quality.rejected:
        acceleration, left = inverse.columns[:, 0], float(np.std(inverse.measured - inverse.fitted))
    else:
        acceleration, left = acceleration[fit.problem.counted > 0], quality.left * quality.lacking

    def case(answer: IdentifiableFit) -> KeyCase:
        estimates, correlation = estimates_of(answer, covered)
        shown = {"estimates": estimates, "correlation": correlation, "acceleration": acceleration, "unexplained": left}
        return KeyCase(**{one.name: getattr(doubted, one.name) for one in fields(doubted)}, **shown)

    refuted = {name: why for finding in raised("curve", case(answer)) for name, why in finding.refuses.items()}
    return judged_keys(allowed_for(case(replace(answer, refuted=refuted))))


@dataclass(frozen=True)
class SimulatedLog:
    """A simulation of a log, with the estimates from another log of the same axis.

    Fields are the samples used, the simulated record and its errors; `apart` is the largest deviation among machines
    drawn from the estimates, relative to the position (infinite if one diverges).
    """

    part: slice
    simulated: Simulated
    errors: SimulationErrors
    apart: float


def simulated_log(moves: IdentifiedMoves, log: Log, set_up: Mapping[str, Any] | None = None) -> SimulatedLog:
    """Simulate another log of an identified axis with its estimates.

    `set_up` has the stage for this log as flat keys, of which the controller and changed keys are used. Raises
    InputError where the machine's own loop is not known.
    """
    if moves.loop is None:
        expected = "the machine's own controller, with which another record can be simulated"
        raise InputError("--predict", "no stage file", expected, "--stage examples/emps_axis.toml", log.name)
    part = log.longest
    problem = _same_kind(moves.loop, log, part, set_up, {*log.setup, *moves.log.setup})
    simulated = problem.record(moves.fit.inner)
    drawn = drawn_from(moves.estimates, moves.correlation, problem.parameters, moves.fit.inner)
    others = [np.linalg.norm(record.position - simulated.position, axis=1) for _, record in problem.simulated(drawn)]
    away = np.nan_to_num(np.concatenate(others), nan=np.inf)
    errors = errors_of(log, part, simulated, moves.inverse.bandwidth)
    return SimulatedLog(part, simulated, errors, float(away.max()) / float(np.linalg.norm(log["position"][part])))


def _same_kind(problem: Problem, log: Log, part: slice, set_up: Mapping[str, Any] | None, changed: set[str]) -> Problem:
    """Set up the fit of a closed loop to another log, with that log's own [setup].

    `set_up` has the stage for that log as flat keys; its controller and the `changed` keys are used. Raises InputError
    for a missing role.
    """
    check_roles(log, ("position", "force", "reference"))
    flat = dict(problem.flat)
    if set_up is not None:
        flat = {key: value for key, value in flat.items() if not key.startswith(f"{CONTROLLER}.")}
        flat |= {key: value for key, value in set_up.items() if key.startswith(f"{CONTROLLER}.") or key in changed}
    return loop_problem(flat, log, part, problem.parameters)


def check_roles(log: Log, roles: Sequence[str], foreign: Sequence[str] = ()) -> None:
    """Check that a log has the given roles in SI units, except for the `foreign` roles.

    Raises InputError for a role that is missing, or in another unit.
    """
    for role in roles:
        if role not in log:
            actual = f"a log with {', '.join(log.signals) or 'no signals'}"
            raise InputError(role, actual, f"its {role}", f'--map {role}="NAME OF THE CHANNEL"', log.name)
        if role in log.units and role not in foreign:
            example = f'--scale {role}="35 {"N" if role == "force" else "mm"}/{log.unit(role)}"'
            raise InputError(role, f"a channel in {log.unit(role)}", "its factor to SI units", example, log.name)


def _problems(
    log: Log, part: slice, flat: Mapping[str, Any], inverse: InverseModel, speed: float, own_loop: bool
) -> tuple[Problem, Problem | None]:
    """Set up two fits: of the stage that follows the log, and of the stage in its own loop.

    Both have all parameters of their equations. The second is None without `own_loop`. `speed` [m/s] is the highest of
    the log.
    """
    levels = _levels(log, flat, inverse)
    position = log["position"][part]
    every = fit_parameters(flat, levels, speed, float(np.ptp(position)), all(directions(position)))
    parameters = [replace(parameter, unit=unit_of(parameter.unit, log)) for parameter in every]
    full = {**flat, **keys_of(flat, {parameter.name: parameter.start for parameter in parameters})}
    follows = tracking(full, log, part, parameters, inverse.bandwidth)
    return follows, loop_problem(full, log, part, parameters) if own_loop else None


def _cart_share(log: Log, flat: Mapping[str, Any]) -> float:
    """Return the cart's fraction of the mass if a free joint's cart is measured, otherwise 0."""
    if not is_free(flat) or not ("cart_position" in log or "relative_position" in log):
        return 0.0
    return flat["masses.cart"] / (flat["masses.cart"] + flat["masses.stage"])


def _levels(log: Log, flat: Mapping[str, Any], inverse: InverseModel) -> dict[str, float]:
    """Return start values of the fit, from the inverse model as far as it determines them.

    The inverse model has one body. Values that cannot be distinguished from 0 start within their interval. A stage on a
    free joint without a measured cart starts at the given values.
    """
    if is_free(flat) and not _cart_share(log, flat):
        mass = flat["masses.cart"] + flat["masses.stage"]
        return {"mass": mass, "coulomb": flat["friction.coulomb"], "viscous": flat["friction.viscous"], "offset": 0.0}
    levels = {"offset": inverse.value("offset")}
    for estimate in inverse.estimates:
        if estimate.name in ("mass", "viscous", "coulomb"):
            value = inverse.value(estimate.name)
            levels[estimate.name] = value if value > 0 and not estimate.low <= 0 else max(estimate.high / 2, 1e-6)
            levels[estimate.name] = levels[estimate.name] if np.isfinite(levels[estimate.name]) else max(value, 1e-6)
    return levels


@dataclass(frozen=True)
class SimulationErrors:
    """Relative errors of a simulated record: norm of the difference over norm of the measured.

    Errors are given for position, velocity, acceleration and force; one filter gives velocity and acceleration of both
    records. For a stage that follows the log's position, only the force has an error, its unexplained part; the others
    are NaN.
    """

    position: float
    velocity: float
    acceleration: float
    force: float


@dataclass(frozen=True)
class Residual:
    """Residual force of a fit [N] and its properties.

    `rms` and `mean` are in newtons, `correlation_time` [s] is the time over which it stays correlated. `by_position`
    and `by_velocity` are the fractions of the residual's power explained by its means over places along the rail, and
    over speeds.
    """

    rms: float
    mean: float
    correlation_time: float
    by_position: float
    by_velocity: float

    @property
    def white(self) -> bool:
        """Tell whether neighbouring samples are uncorrelated."""
        return self.correlation_time == 0.0


def errors_of(log: Log, part: slice, simulated: Simulated, bandwidth: float) -> SimulationErrors:
    """Compare a simulated record with the samples `part` of a log.

    `bandwidth` [Hz] is the motion's.
    """
    measured = moved_in(log, log["position"][part], bandwidth)
    modelled = moved_in(log, simulated.position, bandwidth)
    disturbance = log["disturbance"][part] if "disturbance" in log else 0.0
    return SimulationErrors(
        _relative(log["position"][part], simulated.position),
        _relative(measured.velocity, modelled.velocity),
        _relative(measured.acceleration, modelled.acceleration),
        _relative(log["force"][part], simulated.force + disturbance),
    )


def unexplained(log: Log, part: slice, held: Simulated) -> SimulationErrors:
    """Return the force that guides a stage along a log, relative to the logged force.

    `held` is the simulated record with this force, which the model leaves unexplained; `part` are the samples. The
    result stands as the error of the force; errors of the motion are NaN.
    """
    share = float(np.linalg.norm(held.force) / np.linalg.norm(log["force"][part]))
    return SimulationErrors(np.nan, np.nan, np.nan, share)


def residual_of(residual: np.ndarray, moved: FilteredMotion, sample_time: float) -> Residual:
    """Describe the residual force [N], (n,), of a fit sampled every `sample_time` [s].

    `moved` is the filtered motion of these samples.
    """
    alike = correlation_length(residual)
    return Residual(
        float(np.sqrt(np.mean(residual**2))),
        float(residual.mean()),
        0.0 if alike <= 1 else alike * sample_time,
        _explained(residual, moved.position),
        _explained(residual, moved.velocity),
    )


def _relative(measured: np.ndarray, simulated: np.ndarray) -> float:
    """Return the norm of measured minus simulated values over the norm of the measured ones."""
    return float(np.linalg.norm(measured - simulated) / np.linalg.norm(measured))


BINS_OF_A_RESIDUAL = 40
"""Number of bins of place, and of speed, in which the mean residual is taken. Fewer hide cogging; more contain
noise."""


def _explained(residual: np.ndarray, along: np.ndarray) -> float:
    """Return the fraction of a residual's power that its means over bins of `along` explain.

    `along`, shape (n,), is a position or a speed. The fraction that chance explains is subtracted.
    """
    bins = binned(along, BINS_OF_A_RESIDUAL)
    count = np.bincount(bins)
    means = np.bincount(bins, residual) / np.maximum(count, 1)
    power = float(np.mean(residual**2))
    independent = len(residual) / correlation_length(residual)
    share = float(np.sum(count * means**2)) / len(residual) / power if power else 0.0
    return max(0.0, share - min(1.0, np.count_nonzero(count) / independent))
