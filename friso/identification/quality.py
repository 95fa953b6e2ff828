"""The quality of a fit of moves: what it leaves unexplained against the noise of the record, and what may be wrong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.identification.doubt import DOUBTS, RaisedDoubt, RecordCase, ValueCase, causes, raised
from friso.identification.inverse_model import InverseModel
from friso.identification.logs.log import Log
from friso.identification.output_error.fit import OutputErrorFit
from friso.identification.settings import DoubtSettings
from friso.quantities import percent, plain_factor

UNKNOWN = (
    "a delay, a filter, a constant force, one that drifts or varies with position, a missing feedforward and a mode in "
    "the band were considered, and none explains it: check --scale, including its sign, and which channel is which"
)
"""What to do where no cause is found."""

WITHOUT_FRICTION = ". The stage file says that there is no friction: with a table [friction], friction is identified"
"""What to do where the structure that was told leaves friction out."""


@dataclass(frozen=True)
class Quality:
    """How well a fit of moves describes its record, with what speaks against believing it.

    `noise` [N] is that of the record's force; `left` [N] the RMS that the fit leaves of it where it counts, and
    `noise_left` what the noise alone would leave there. `inverse_error` and `whole_error` are relative errors of the
    force: by the inverse model, and by steady friction and mass of the whole model on the samples of the inverse model.
    `findings` are the doubts raised. The whole model may be `rejected`, or nothing holds at all (`failed`). The inverse
    models `without` a cause are of a log rid of what may be wrong with it. A record is `spoilt` where what is wrong
    with it passes for friction at low speed, and `unsettled` where much is left for which no cause was found. A cause
    is `seen` where the samples themselves show it, as a force that clips: no effect is named then that would
    explain it.
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
        """Sentences that speak against believing the fit."""
        return tuple(finding.words for finding in self.findings if finding.words)

    @property
    def ratio(self) -> float:
        """What is left over what noise alone would leave."""
        return self.left / self.noise_left if self.noise_left > 0 else np.inf

    @property
    def lacks_something(self) -> bool:
        """Whether the fit leaves clearly more than noise."""
        return self.ratio > DoubtSettings.current().noise_ratio_of_a_lacking_model

    @property
    def lacking(self) -> float:
        """Share of what is left, RMS, that is not noise: 0 of a model that lacks nothing."""
        return float(np.sqrt(max(0.0, 1 - 1 / self.ratio**2))) if self.ratio > 1 else 0.0


def quality_of(
    log: Log, inverse: InverseModel, fit: OutputErrorFit, noise: float, cart_share: float, led: bool = False
) -> Quality:
    """Judge a fit of moves, and name in sentences what is wrong with it.

    Where it is `led` by an effect that explains what the fit leaves, the inverse model's causes are not named: the
    effect is.

    The whole model may describe a record that is `beyond` the inverse one, which does not know of sticking. A cause is
    no doubt then if the whole model is clearly better than the inverse model without it.
    """
    settings, case = DoubtSettings.current(), RecordCase(log, inverse, cart_share)
    flat, left, passed = fit.stage, fit.left, fit.problem.noise_left(noise)
    findings = list(raised("record", case))
    plain = Quality(noise, left, passed, inverse.error, whole_error(flat, inverse), tuple(findings))
    if fit.problem.closed and fit.explains(noise):
        return plain
    force = float(np.sqrt(np.mean(log["force"][log.longest][fit.problem.counted > 0] ** 2)))
    beyond = inverse.error > settings.error_of_a_poor_model and left < settings.error_of_an_unsettled_record * force
    poor = inverse.error > settings.error_of_a_poor_model and not beyond
    reasons = causes(case) if plain.lacks_something or poor else []
    if beyond:
        share = settings.error_share_of_a_clearly_better_model * force
        reasons = [cause for cause in reasons if cause.without is None or share * cause.without.error < left]
    worse = max(settings.error_ratio_of_a_contradiction * inverse.error, settings.error_of_a_fine_model)
    rejected = not (beyond or poor) and plain.whole_error > worse and plain.lacks_something
    seen = any(cause.without is None and DOUBTS[cause.doubt].moment == "cause" for cause in reasons)
    named = [] if led and not (poor or seen) else reasons
    words = _verdict(plain, named, case.unit, poor, rejected, flat["friction.model"] == "none")
    findings += [RaisedDoubt(words, plain.ratio, doubt="model")] if words else []
    findings += raised("value", ValueCase(log, inverse, cart_share, plain.lacks_something, poor))
    without = tuple(cause.without for cause in reasons if cause.without)
    best = min([inverse.error, *(model.error for model in without)])
    unsettled = plain.lacks_something and min(left / force, best) > settings.error_of_an_unsettled_record
    return replace(
        plain,
        findings=tuple(findings),
        rejected=rejected,
        failed=poor and plain.whole_error > settings.error_of_a_poor_model,
        without=without,
        spoilt=unsettled or any(cause.spoils for cause in reasons),
        unsettled=unsettled,
        seen=seen,
    )


def _verdict(
    plain: Quality, reasons: list[RaisedDoubt], unit: str, poor: bool, rejected: bool, frictionless: bool
) -> str:
    """What the fit leaves unexplained and why, in a sentence; "" where it lacks nothing."""
    why = "".join(f"; {cause.words}" for cause in reasons)
    if poor:
        return (
            f"A mass with friction leaves {percent(plain.inverse_error, 3)} of the force unexplained: "
            f"{why.removeprefix('; ') or UNKNOWN}"
        )
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

    Both have the shape (n,).
    """
    return _by_direction(flat, np.abs(velocity), np.sign(velocity))


def whole_error(flat: Mapping[str, Any], inverse: InverseModel) -> float:
    """Return the relative force error of a stage's mass and steady friction.

    It is taken on the samples of the inverse model. Dry friction turns as gradually as the direction in the inverse
    model, whose columns are filtered.
    """
    mass = sum(flat.get(f"masses.{name}", 0.0) for name in ("cart", "stage"))
    acceleration, velocity, sign, _ = inverse.columns.T
    dry = {**flat, "friction.viscous": 0.0}
    wet = steady_friction(flat, velocity) - steady_friction(dry, velocity)
    left = inverse.measured - mass * acceleration - wet - _by_direction(dry, np.abs(velocity), sign)
    return float(np.linalg.norm(left) / np.linalg.norm(inverse.measured))


def _by_direction(flat: Mapping[str, Any], speed: np.ndarray, sign: np.ndarray) -> np.ndarray:
    """Return friction [N] at speeds [m/s] in directions from -1 to 1, each of shape (n,).

    It changes gradually from one direction to the other; the constant force is left out.
    """
    from friso.frequency.friction import steady_force  # brings SymPy along

    forward, backward = (steady_force(flat, speed, forwards) for forwards in (True, False))
    constant = flat.get("bias.cart", 0.0) + flat.get("bias.stage", 0.0)
    return forward * (1 + sign) / 2 - backward * (1 - sign) / 2 - constant
