"""Constant speeds there and back: Coulomb, viscous and static friction, Stribeck velocity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from friso.equations.bandwidth import bandwidth
from friso.identification.combine import Correlated
from friso.identification.estimate import Estimate
from friso.identification.kind import AnalysisSettings, ExperimentKind, Prior, independent, of_one
from friso.identification.logs.log import Log
from friso.identification.output_error.parameters import EXPONENT
from friso.identification.readings.course import Course
from friso.identification.readings.friction_position import FrictionPosition, friction_position
from friso.identification.readings.friction_velocity import FrictionVelocity, distinct, friction_velocity
from friso.identification.readings.passes import passes
from friso.identification.readings.settings import settings as reading_settings
from friso.stage import Stage


@dataclass(frozen=True)
class FrictionAtSpeeds:
    """Friction over velocity and over position, from one log of constant speeds."""

    velocity: FrictionVelocity
    position: FrictionPosition


def _analyse(log: Log, prior: Prior, settings: AnalysisSettings) -> FrictionAtSpeeds:
    """Analyse a log of constant speeds, with the loop's crossover, and with the assumed masses or that of the log."""
    friction = friction_velocity(log, sum(prior.masses(log)) or None, _stated_exponent(prior))
    return FrictionAtSpeeds(friction, friction_position(log, friction.mass, bandwidth(prior.flat(log))))


def _stated_exponent(prior: Prior) -> float | None:
    """Return the Stribeck exponent of the user's stage file; None if not stated or uncertain."""
    if prior.stage is None or not prior.from_user or EXPONENT in {*prior.made_up, *prior.stage.uncertain()}:
        return None
    return prior.stage.flat().get(EXPONENT)


def _estimates(result: FrictionAtSpeeds, stage: Stage | None) -> tuple[Estimate, ...]:
    """Return estimates of friction and constant force, in the order of their covariance.

    An exponent that the stage states is not included.
    """
    both, bias = result.velocity.both, "bias.stage" if stage and "masses.cart" not in stage.flat() else "bias.cart"
    friction = [both.coulomb, both.viscous, both.static, both.stribeck_velocity]
    friction += [both.stribeck_exponent] if both.stribeck_exponent.low < both.stribeck_exponent.high else []
    return *friction, replace(result.velocity.bias, name=bias)


def _correlated(result: FrictionAtSpeeds, estimates: Sequence[Estimate]) -> Correlated:
    """Return estimates with their correlation in the fit.

    The constant force is independent, because passes go there and back.
    """
    covariance = result.velocity.both.covariance
    if not covariance.size:
        return independent(result, estimates)
    size = np.sqrt(np.diag(covariance))
    together = np.eye(len(estimates))
    together[: len(size), : len(size)] = covariance / np.outer(size, size)
    rows = [row for row, estimate in enumerate(estimates) if estimate.determined]
    return [estimates[row] for row in rows], together[np.ix_(rows, rows)]


def _partial(log: Log) -> bool:
    """Tell whether a log alone has too few speeds for a curve of friction over speed."""
    steady = [abs(stretch.velocity) for stretch in passes(log) if stretch.steady]
    return not steady or distinct(np.array(steady)) < reading_settings.speeds_of_a_line


def _claims_together(courses: Sequence[Course]) -> str | None:
    """Return why logs move at constant speeds, or None if they do not.

    Most of their motion must be at constant speeds, enough for a curve of friction over speed. At the slowest speeds a
    body may stick and slip, so logs in one direction count too.
    """
    speeds = [course.speeds for course in courses]
    fitting = all(len(of_one) or course.one_way for of_one, course in zip(speeds, courses, strict=True))
    count = distinct(np.concatenate(speeds)) if fitting and any(map(len, speeds)) else 0
    enough = count >= reading_settings.speeds_of_a_line
    return f"most of the way goes at one of {count} constant speeds" if enough else None


KIND = ExperimentKind[FrictionAtSpeeds](
    of_one(_analyse),
    _estimates,
    _correlated,
    after=("frequency", "moves"),
    foreign=("force",),
    per_unit=True,
    partial=_partial,
    claims_together=_claims_together,
)
