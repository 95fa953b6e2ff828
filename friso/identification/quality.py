"""Judge a fit of moves: its residual against the noise of the record, and possible causes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.identification.doubt import DOUBTS, RaisedDoubt, RecordCase, ValueCase, causes, raised
from friso.identification.inverse_model import InverseModel
from friso.identification.logs.log import Log
from friso.identification.output_error.fit import OutputErrorFit
from friso.identification.settings import doubt_settings
from friso.identification.witness import Replay, doubt_of
from friso.quantities import percent, plain_factor

UNKNOWN = (
    "a delay, a filter, a constant force, one that drifts or varies with position, a missing feedforward and a mode in "
    "the band were considered, and none explains it: check --scale, including its sign, and which channel is which"
)
"""Clause of a message if no cause of a large residual is found."""

WITHOUT_FRICTION = ". The stage file says that there is no friction: with a table [friction], friction is identified"
"""Advice added to a message if the stage file has no friction."""


@dataclass(frozen=True, kw_only=True)
class Quality:
    """Quality of a fit of moves, with reasons against trusting it.

    `noise` [N] is the noise of the record's force; `left` [N] the RMS residual over counted samples, and `noise_left`
    [N] the residual expected of noise, and of sensors that are not quite linear. `inverse_error` and `whole_error` are
    relative errors of the force: by the inverse model, and by steady friction and mass of the whole model on the
    samples of the inverse model. `findings` are the doubts raised. The whole model may be `rejected`, or nothing holds
    at all (`failed`). `without` has inverse models of the log corrected for a cause. A record is `spoilt` if its fault
    passes for friction at low speed, and `unsettled` if a large residual has no known cause. `seen` is true if the
    samples themselves show a cause, such as clipping; no other effect is named then.
    """

    noise: float
    left: float
    noise_left: float
    inverse_error: float
    whole_error: float
    findings: tuple[RaisedDoubt, ...] = ()
    rejected: bool = False
    failed: bool = False
    without: tuple[InverseModel, ...] = ()
    spoilt: bool = False
    unsettled: bool = False
    seen: bool = False

    @property
    def doubts(self) -> tuple[str, ...]:
        """Return sentences against trusting the fit."""
        return tuple(finding.words for finding in self.findings if finding.words)

    @property
    def ratio(self) -> float:
        """Return the ratio of the residual to the residual of the sensors' errors alone."""
        return self.left / self.noise_left if self.noise_left > 0 else np.inf

    @property
    def lacks_something(self) -> bool:
        """Tell whether the fit leaves clearly more than noise."""
        return self.ratio > doubt_settings.noise_ratio_of_a_lacking_model

    @property
    def may_imitate_bristles(self) -> bool:
        """Tell whether the residual is so large that missing effects may look like bristles."""
        return self.ratio > doubt_settings.noise_ratio_of_imitated_bristles

    @property
    def lacking(self) -> float:
        """Return the fraction of the RMS residual that is not noise, from 0 to 1."""
        return float(np.sqrt(max(0.0, 1 - 1 / self.ratio**2))) if self.ratio > 1 else 0.0


def quality_of(
    log: Log,
    inverse: InverseModel,
    fit: OutputErrorFit,
    noise: float,
    cart_share: float,
    led: bool = False,
    replay: Replay | None = None,
) -> Quality:
    """Judge a fit of moves, and name in sentences what is wrong with it.

    `noise` [N] is the force's, and `cart_share` the fraction of the mass that moves with a measured cart. If the fit is
    `led` by an effect that explains the residual, this effect is named instead of the inverse model's causes.

    The whole model may describe a record that the inverse model, which has no sticking, does not. A cause then raises
    no doubt if the whole model is clearly better than the inverse model corrected for the cause.
    """
    case = RecordCase(log, inverse, cart_share, replay)
    flat, left, passed = fit.stage, fit.left, fit.problem.noise_left(noise)
    findings = list(raised("record", case))
    if replay is not None and (said := doubt_of(replay, log)):
        findings.insert(0, RaisedDoubt(words=said, size=replay.slope, doubt="controller"))
    plain = Quality(
        noise=noise,
        left=left,
        noise_left=passed,
        inverse_error=inverse.error,
        whole_error=whole_error(flat, inverse),
        findings=tuple(findings),
    )
    if fit.problem.closed and fit.explains(noise):
        return plain
    force = float(np.sqrt(np.mean(log["force"][log.longest][fit.problem.counted > 0] ** 2)))
    roughly = inverse.error > doubt_settings.error_of_a_poor_model
    beyond = roughly and left < doubt_settings.error_of_an_unsettled_record * force
    poor = roughly and not beyond
    reasons = causes(case) if plain.lacks_something or poor else []
    better = doubt_settings.error_share_of_a_clearly_better_model * force
    if beyond:
        reasons = [cause for cause in reasons if cause.without is None or better * cause.without.error < left]
    worse = max(doubt_settings.error_ratio_of_a_contradiction * inverse.error, doubt_settings.error_of_a_fine_model)
    contradicts = plain.whole_error > worse and left > better * inverse.error
    rejected = plain.lacks_something and contradicts and not (beyond or poor)
    seen = any(cause.without is None and DOUBTS[cause.doubt].moment == "cause" for cause in reasons)
    named = [] if led and not (poor or seen) else reasons
    words = _verdict(plain, named, case.unit, poor, rejected, flat["friction.model"] == "none")
    findings += [RaisedDoubt(words=words, size=plain.ratio, doubt="model")] if words else []
    findings += raised("value", ValueCase(log, inverse, cart_share, replay, lacks=plain.lacks_something, poor=poor))
    without = tuple(cause.without for cause in reasons if cause.without)
    best = min([inverse.error, *(model.error for model in without)])
    unsettled = plain.lacks_something and min(left / force, best) > doubt_settings.error_of_an_unsettled_record
    return replace(
        plain,
        findings=tuple(findings),
        rejected=rejected,
        failed=poor and plain.whole_error > doubt_settings.error_of_a_poor_model,
        without=without,
        spoilt=unsettled or any(one.spoils for one in (*reasons, *findings)),
        unsettled=unsettled,
        seen=seen,
    )


def _verdict(
    plain: Quality, reasons: list[RaisedDoubt], unit: str, poor: bool, rejected: bool, frictionless: bool
) -> str:
    """Write how much the fit leaves unexplained, and why; "" if nothing is missing in the model.

    `reasons` are findings that explain what is left. The inverse model may be `poor`, or the whole model `rejected`;
    `frictionless` is true if the stage file says that there is no friction.
    """
    why = "".join(f"; {cause.words}" for cause in reasons)
    if poor:
        left = f"A mass with friction leaves {percent(plain.inverse_error, 3)} of the force unexplained"
        return f"{left}: {why.removeprefix('; ') or UNKNOWN}"
    if rejected:
        return (
            f"The whole model contradicts the record: on the moves it leaves {percent(plain.whole_error, 3)} of the "
            f"force, a plain mass with friction {percent(plain.inverse_error, 3)}. What follows is from the latter "
            f"alone{why}{WITHOUT_FRICTION if frictionless else ''}"
        )
    if plain.lacks_something:
        return (
            f"The fit leaves {plain.left:.3g} {unit} unexplained, {plain_factor(plain.ratio)} times what the noise of "
            f"the record would leave: the model lacks something, for which the intervals allow{why}"
        )
    return ""


def steady_friction(flat: Mapping[str, Any], velocity: np.ndarray) -> np.ndarray:
    """Return friction [N] of a stage at steady velocities [m/s], without its constant force.

    Velocities and friction have the shape (n,).
    """
    return _by_direction(flat, np.abs(velocity), np.sign(velocity))


def whole_error(flat: Mapping[str, Any], inverse: InverseModel) -> float:
    """Return the relative force error of a stage's mass and steady friction.

    The error is taken on the samples of the inverse model. Dry friction changes sign as gradually as the inverse
    model's filtered direction.
    """
    mass = sum(flat.get(f"masses.{name}", 0.0) for name in ("cart", "stage"))
    acceleration, velocity, sign, _ = inverse.columns.T
    dry = {**flat, "friction.viscous": 0.0}
    wet = steady_friction(flat, velocity) - steady_friction(dry, velocity)
    left = inverse.measured - mass * acceleration - wet - _by_direction(dry, np.abs(velocity), sign)
    return float(np.linalg.norm(left) / np.linalg.norm(inverse.measured))


def _by_direction(flat: Mapping[str, Any], speed: np.ndarray, sign: np.ndarray) -> np.ndarray:
    """Return friction [N] at speeds [m/s] in directions from -1 to 1, each of shape (n,).

    Friction changes gradually from one direction to the other; the constant force is left out.
    """
    from friso.frequency.system import steady_force  # imports SymPy, which is slow

    forward, backward = (steady_force(flat, speed, forwards) for forwards in (True, False))
    constant = flat.get("bias.cart", 0.0) + flat.get("bias.stage", 0.0)
    return forward * (1 + sign) / 2 - backward * (1 - sign) / 2 - constant
