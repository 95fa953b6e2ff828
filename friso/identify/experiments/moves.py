"""Moves, with a reference or without: mass, friction and constant force, and the joint where it shows.

First the inverse model by least squares, then the whole model by its output error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.errors import InputError
from friso.identify.combine import Correlated
from friso.identify.doubts import quality_of
from friso.identify.errors import Residual, SimulationErrors, errors_of, residual_of, unexplained
from friso.identify.estimate import Estimate
from friso.identify.inverse_model import SMOOTH, InverseModel, directions, inverse_model, motion, unit_of
from friso.identify.kind import AnalysisSettings, ExperimentKind, Predictor, Prior, Source
from friso.identify.logs.log import ROLES, Log
from friso.identify.model_error import all_with_model_error, not_described, of_inverse_model
from friso.identify.output_error.answers import estimates_of
from friso.identify.output_error.coverage import Coverage, coverage
from friso.identify.output_error.fit import OutputErrorFit
from friso.identify.output_error.identifiable import fit_identifiable
from friso.identify.output_error.parameters import MASS, is_free, keys_of, parameters_of
from friso.identify.output_error.problem import Problem, Simulated, closed_loop, tracking, why_continuous
from friso.identify.output_error.profile import Profile
from friso.identify.quality import Quality, noise_of
from friso.identify.readings.course import Course
from friso.identify.stage_file import made_up
from friso.progress import Progress, silent
from friso.stage import Stage
from friso.stage.controllers import CONTROLLER


@dataclass(frozen=True)
class IdentifiedMoves:
    """What was found: both fits of the inverse model, the output-error `fit`, the profiles of all parameters by name,
    the estimates by key of the stage file with the `correlation` of the shown ones, what the motion covers, the
    simulated record of the fit and its errors, and `part`, the samples of the log used.

    `loop` is the machine's own closed loop, which was simulated; without it (None) the stage followed the log, and the
    simulated force is what it took to hold it there, which the model does not explain."""

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

    @property
    def correlated(self) -> tuple[Estimate, ...]:
        """The estimates that the rows of `correlation` stand for."""
        return tuple(estimate for estimate in self.estimates if estimate.determined)

    @property
    def force_unit(self) -> str:
        """The unit of the force, which estimates hold in the newton's place."""
        return self.log.unit("force")

    @property
    def flat(self) -> dict[str, Any]:
        """The stage as fitted, as flat keys; what the record does not show is as in the stage given."""
        return self.fit.stage


def identify_moves(
    log: Log, flat: Mapping[str, Any], own_loop: bool, bandwidth: float | None = None, progress: Progress = silent
) -> IdentifiedMoves:
    """Mass, friction and what else the moves of a log show of a stage given as flat keys.

    With `own_loop` the stage's controller is the machine's, and the closed loop is simulated on the log's reference;
    else the model follows the log's position. `bandwidth` [Hz] is the motion's, read off the force by default. Where
    the force is not in newtons, which no loop of a machine allows, estimates are per unit of it. Raises InputError for
    a log without position or force.
    """
    _has(log, ("position", "force", *(("reference",) if own_loop else ())), () if own_loop else ("force",))
    part = log.longest
    share = _cart_share(log, flat)
    inverse, by_direction = (inverse_model(log, bandwidth, split, share) for split in (False, True))
    follows, loop = _problems(log, part, flat, inverse, own_loop)
    moved = motion(log["position"][part], log.sample_time, SMOOTH * inverse.bandwidth)
    starts = {parameter.name: parameter.start for parameter in follows.parameters}
    mass, coulomb = starts[MASS], starts.get("friction.coulomb", np.inf)
    covered = coverage(log["position"][part], moved, mass, coulomb, log.sample_time)
    noise = noise_of(log["force"][part])
    answer = fit_identifiable(follows, loop, covered, inverse.bandwidth, noise, progress)
    estimates, correlation = estimates_of(answer, covered)
    fit = answer.fit
    quality = quality_of(log, inverse, fit, noise, share)
    if quality.failed:
        estimates, correlation = not_described(estimates)
    elif quality.rejected:
        estimates, correlation = of_inverse_model(inverse, flat, estimates)
    else:
        estimates = all_with_model_error(estimates, inverse, flat, quality)
    simulated = (loop or follows).record(fit.inner)
    return IdentifiedMoves(
        log, part, inverse, by_direction, fit, answer.profiles, estimates, correlation, covered, simulated,
        errors_of(log, part, simulated, inverse.bandwidth) if loop else unexplained(log, part, simulated),
        residual_of(fit.residual, moved, log.sample_time), loop, quality,
    )  # fmt: skip


@dataclass(frozen=True)
class SimulatedLog:
    """Another log of the same axis, simulated: the samples used, the record, and its errors."""

    part: slice
    simulated: Simulated
    errors: SimulationErrors


def simulated_log(moves: IdentifiedMoves, log: Log, set_up: Mapping[str, Any] | None = None) -> SimulatedLog:
    """Another log of the same axis simulated with the estimates; `set_up` are the flat keys of the stage as it was
    set up for that log, whose controller and changed keys count.

    Raises InputError where the machine's own loop is not known.
    """
    if moves.loop is None:
        expected = "the machine's own controller, with which another record can be simulated"
        raise InputError("--predict", "no stage file", expected, "--stage examples/emps_axis.toml", log.name)
    part = log.longest
    problem = _same_kind(moves.loop, log, part, set_up, {*log.setup, *moves.log.setup})
    simulated = problem.record(moves.fit.inner)
    return SimulatedLog(part, simulated, errors_of(log, part, simulated, moves.inverse.bandwidth))


def _same_kind(problem: Problem, log: Log, part: slice, set_up: Mapping[str, Any] | None, changed: set[str]) -> Problem:
    """The same stage and parameters on another log, with the controller and the `changed` keys of its set-up."""
    _has(log, ("position", "force", "reference"))
    flat = dict(problem.flat)
    if set_up is not None:
        flat = {key: value for key, value in flat.items() if not key.startswith(f"{CONTROLLER}.")}
        flat |= {key: value for key, value in set_up.items() if key.startswith(f"{CONTROLLER}.") or key in changed}
    return closed_loop(flat, log, part, problem.parameters)


def _has(log: Log, roles: Sequence[str], foreign: Sequence[str] = ()) -> None:
    """Raises InputError for a role that a log does not have, or in another unit than SI, but for the `foreign`."""
    for role in roles:
        if role not in log:
            actual = f"a log with {', '.join(log.signals) or 'no signals'}"
            raise InputError(role, actual, f"its {role}", f'--map {role}="NAME OF THE CHANNEL"', log.name)
        if role in log.units and role not in foreign:
            example = f'--scale {role}="35 {"N" if role == "force" else "mm"}/{log.unit(role)}"'
            raise InputError(role, f"a channel in {log.unit(role)}", "what one of these is in SI", example, log.name)


def _problems(
    log: Log, part: slice, flat: Mapping[str, Any], inverse: InverseModel, own_loop: bool
) -> tuple[Problem, Problem | None]:
    """The stage following the log's position, and in its own loop, with all the parameters in its equations."""
    speed = float(np.abs(motion(log["position"][part], log.sample_time, SMOOTH * inverse.bandwidth).velocity).max())
    levels = _levels(log, flat, inverse)
    position = log["position"][part]
    every = parameters_of(flat, levels, speed, float(np.ptp(position)), all(directions(position)))
    parameters = [replace(parameter, unit=unit_of(parameter.unit, log)) for parameter in every]
    full = {**flat, **keys_of(flat, {parameter.name: parameter.start for parameter in parameters})}
    follows = tracking(full, log, part, parameters, inverse.bandwidth)
    return follows, closed_loop(full, log, part, parameters) if own_loop else None


def _cart_share(log: Log, flat: Mapping[str, Any]) -> float:
    """The share of the mass that moves with the cart, where that is measured apart from a stage on a free joint."""
    if not is_free(flat) or not ("cart_position" in log or "relative_position" in log):
        return 0.0
    return flat["masses.cart"] / (flat["masses.cart"] + flat["masses.stage"])


def _levels(log: Log, flat: Mapping[str, Any], inverse: InverseModel) -> dict[str, float]:
    """Where the fit starts: at the inverse model's values, as far as it shows them and is one of this stage.

    It knows one body. What it does not tell from 0 starts within its interval; all of a stage on a free joint whose
    cart is not measured starts at the stage given.
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


FEW = 7.0
"""Harmonics, and turns in each period, that moves which are repeated stay below: our choice."""

WITHOUT_CONTROLLER = (
    "without the machine's own controller the simulated stage follows the logged position; with it (--stage) the "
    "intervals are narrower, and more is identified"
)

RESTS = 0.1
"""Share of the time for which the position rests from which on what repeats is taken for moves."""


def _claims(course: Course) -> str | None:
    """A reference moves; or nothing repeats, the position rests in between, or the force turns seldom and holds few
    frequencies."""
    if course.reference_moves:
        return "its reference moves"
    repetition = course.repetition
    if repetition is None:
        standing = "reference" in course.log
        return None if standing else f"the {course.signal} does not repeat, and there is no reference that moves"
    if repetition.rests > RESTS:
        return f"{course.repeats}, but the position rests in between"
    if repetition.harmonics < FEW and repetition.turns < FEW:
        return f"{course.repeats}, but rarely reverses and contains few frequencies"
    return None


def _analyse(logs: Sequence[Source], prior: Prior, settings: AnalysisSettings) -> IdentifiedMoves:
    """With a stage that was given and a reference, in the machine's own loop; from what other experiments show."""
    (log,) = logs
    assert isinstance(log, Log)
    if prior.from_user:
        _has(log, ("force",))
    flat = prior.flat(log) if _in_newtons(log) else made_up(log, inverse_model(log, settings.bandwidth)).flat()
    start = {**flat, **{key: estimate.value for key, estimate in prior.estimates.items() if key in flat}}
    return identify_moves(log, start, prior.from_user and "reference" in log, settings.bandwidth, settings.progress)


def _in_newtons(log: Log) -> bool:
    return log.unit("force") == ROLES["force"]


def _around(log: Log) -> Stage | None:
    """A stage around a log whose force is in newtons."""
    return made_up(log, inverse_model(log)) if _in_newtons(log) else None


def _estimates(result: IdentifiedMoves, stage: Stage | None) -> tuple[Estimate, ...]:
    """Keys of the stage file, which are in newtons."""
    return result.estimates if _in_newtons(result.log) else ()


def _correlated(result: IdentifiedMoves, estimates: Sequence[Estimate]) -> Correlated:
    """Those that are shown, as the fit correlates them."""
    return (result.correlated, result.correlation) if estimates else ((), np.zeros((0, 0)))


def _notes(results: Sequence[IdentifiedMoves], stage: Stage | None) -> list[str]:
    """Where the drive that was given is not the one simulated, and where no controller was."""
    loops = [result for result in results if result.loop] if stage is not None else []
    reasons = [why_continuous(stage.flat(), result.log.sample_time) for result in loops if stage is not None]
    followed = any(result.loop is None for result in results)
    return [
        *(sentence for sentence in dict.fromkeys(reasons) if sentence),
        *([WITHOUT_CONTROLLER] if followed else []),
    ]


def _predict(result: IdentifiedMoves, log: Log, prior: Prior, settings: AnalysisSettings) -> SimulatedLog | None:
    if "reference" not in log or result.loop is None:
        return None
    return simulated_log(result, log, prior.flat(log) or None)


def _check_prediction(logs: Sequence[Source], other: Log, prior: Prior) -> None:
    """Raises InputError where none of the logs will be simulated in the machine's own loop, or the other cannot be."""
    _has(other, ("position", "force", "reference"))
    prior.flat(other)
    if not prior.from_user:
        expected = "the machine's own controller, with which another record can be simulated"
        raise InputError("--predict", "no stage file", expected, "--stage examples/emps_axis.toml", other.name)
    if not any(isinstance(log, Log) and "reference" in log for log in logs):
        actual = f"{', '.join(log.name for log in logs)}, without a reference"
        expected = "a log of moves with its reference, in whose loop the machine is identified"
        raise InputError("--predict", actual, expected, "--map reference=SetPos", other.name)


KIND = ExperimentKind[IdentifiedMoves](
    _analyse,
    _estimates,
    _correlated,
    after=("frequency", "steps"),
    claims=_claims,
    foreign=("force", "disturbance"),
    around=_around,
    notes=_notes,
    predictor=Predictor("a log with a reference beside moves", _predict, _check_prediction),
    doubts=lambda result: result.quality.doubts,
    failed=lambda result: result.quality.rejected or result.quality.failed,
)
