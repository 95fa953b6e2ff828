"""Constant speeds there and back: Coulomb, viscous and static friction, Stribeck velocity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import cycle
from typing import Any

import numpy as np

from friso.equations.bandwidth import bandwidth
from friso.identification.combine import Correlated
from friso.identification.estimate import Estimate, digits, estimates_in_words, with_interval, within
from friso.identification.estimate_documents import estimate_document, estimates_document
from friso.identification.kind import WAYS, AnalysisSettings, ExperimentKind, Facts, Prior, Source
from friso.identification.logs.log import Log
from friso.identification.output_error.parameters import EXPONENT
from friso.identification.readings.common import stribeck_curve
from friso.identification.readings.course import Course
from friso.identification.readings.friction_position import FrictionPosition, friction_position
from friso.identification.readings.friction_velocity import (
    SPEEDS_OF_A_LINE,
    Direction,
    FrictionVelocity,
    distinct,
    friction_velocity,
)
from friso.identification.readings.motion_events import passes
from friso.shown.documents import entries
from friso.shown.drawing.figure import (
    BLUE,
    GREEN,
    ORANGE,
    PINK,
    SKY,
    VERMILLION,
    Array,
    Axis,
    Figure,
    Markers,
    Panel,
    Series,
)
from friso.stage import Stage


@dataclass(frozen=True)
class FrictionAtSpeeds:
    """Friction over velocity and over position, from one log of constant speeds."""

    velocity: FrictionVelocity
    position: FrictionPosition


def _stated_exponent(prior: Prior) -> float | None:
    """Return the Stribeck exponent of the user's stage file; None if not stated or uncertain."""
    if prior.stage is None or not prior.from_user or EXPONENT in {*prior.made_up, *prior.stage.uncertain()}:
        return None
    return prior.stage.flat().get(EXPONENT)


def _direction_text(direction: Direction) -> str:
    """Write the friction of one direction in words."""
    several = [getattr(direction, name) for name in _FRICTION]
    visible = [estimate for estimate in several if estimate.determined]
    reasons = {estimate.reason: None for estimate in several if not estimate.determined}
    names = [within(estimate.name) for estimate in several if not estimate.determined]
    missing = f"not shown: {', '.join(names)} ({'; '.join(reasons)})" if names else ""
    return "; ".join(text for text in (estimates_in_words(visible), missing) if text)


_FRICTION = ("coulomb", "viscous", "static", "stribeck_velocity", "stribeck_exponent")
"""Names of the estimates of one direction."""


def _velocity(friction: FrictionVelocity, name: str) -> list[Figure]:
    """Draw friction over velocity with intervals and the fit of each direction.

    The list is empty if no velocity was measured. `name` begins the figure's name.
    """
    if not len(friction.velocities):
        return []
    series, markers = [], []
    for word, chosen in (("forward", friction.velocities > 0), ("backward", friction.velocities < 0)):
        if not chosen.any():
            continue
        v, f, half = friction.velocities[chosen], friction.forces[chosen], friction.half_widths[chosen]
        gap = np.full(len(v), np.nan)
        bars = np.stack([v, v, gap], axis=1).ravel(), np.stack([f - half, f + half, gap], axis=1).ravel()
        series += [Series(*bars, "", WAYS[word], width=1.2), *_fit(friction.directions[word], v, word)]
        markers.append(Markers(v, f, f"{word}, with 95 % interval", WAYS[word]))
    panel = Panel("", Axis("Velocity", "m/s"), Axis("Friction", "N"), tuple(series), tuple(markers))
    caption = "Mean force less inertia over stretches of constant velocity."
    if len(friction.unsteady):
        caption += f" {len(friction.unsteady)} stretches were not steady and are left out."
    return [Figure(f"{name}_velocity", "Friction over velocity", caption, (panel,))]


def _fit(direction: Direction, velocities: Array, word: str) -> list[Series]:
    """Draw the curve fitted to one direction, over the velocities it was fitted to.

    The list is empty if Coulomb or viscous friction could not be determined.
    """
    if not (direction.coulomb.determined and direction.viscous.determined):
        return []
    size, curve = np.geomspace(np.abs(velocities).min(), np.abs(velocities).max(), 200), direction.curve
    if curve is None:
        dry = np.full_like(size, direction.coulomb.value)
    else:
        levels = (curve.coulomb, curve.static, curve.velocity, curve.exponent)
        dry = stribeck_curve(size, *(level.value for level in levels))
    friction = dry + direction.viscous.value * size
    sign = 1.0 if word == "forward" else -1.0
    return [Series(sign * size, sign * friction, f"fit, {word}", WAYS[word], "dashed")]


def _position(friction: FrictionPosition, name: str) -> list[Figure]:
    """Draw the friction force over the position on the rail, pass by pass; empty without passes."""
    if not friction.passes:
        return []
    colours = cycle((BLUE, ORANGE, GREEN, PINK, SKY, VERMILLION))
    lines = tuple(
        Series(
            stretch.places,
            np.sign(stretch.velocity) * stretch.force,
            f"{digits(stretch.velocity, 'm/s')}{'' if stretch.steady else ', not steady'}",
            colour,
            width=1.0,
        )
        for stretch, colour in zip(friction.passes, colours, strict=False)
    )
    panel = Panel("", Axis("Position", "m"), Axis("Friction", "N"), lines)
    return [Figure(f"{name}_position", "Friction along the rail", friction.verdict, (panel,))]


class ConstantSpeedKind(ExperimentKind[FrictionAtSpeeds]):
    """Constant speeds there and back, which show friction over velocity and position."""

    title = "Constant speed"
    after = ("frequency", "moves")
    foreign = ("force",)
    per_unit = True

    def analyse_log(self, log: Log, prior: Prior, settings: AnalysisSettings) -> FrictionAtSpeeds:
        """Analyse a log of constant speeds, with the loop's crossover, and the assumed masses or that of the log."""
        friction = friction_velocity(log, sum(prior.masses(log)) or None, _stated_exponent(prior))
        return FrictionAtSpeeds(friction, friction_position(log, friction.mass, bandwidth(prior.flat(log))))

    def estimates(self, result: FrictionAtSpeeds, stage: Stage | None) -> tuple[Estimate, ...]:
        """Return estimates of friction and constant force, in the order of their covariance.

        An exponent that the stage states is not included.
        """
        both, bias = result.velocity.both, "bias.stage" if stage and "masses.cart" not in stage.flat() else "bias.cart"
        friction = [both.coulomb, both.viscous, both.static, both.stribeck_velocity]
        friction += [both.stribeck_exponent] if both.stribeck_exponent.low < both.stribeck_exponent.high else []
        return *friction, replace(result.velocity.bias, name=bias)

    def correlated(self, result: FrictionAtSpeeds, estimates: Sequence[Estimate]) -> Correlated:
        """Return estimates with their correlation in the fit.

        The constant force is independent, because passes go there and back.
        """
        covariance = result.velocity.both.covariance
        if not covariance.size:
            return super().correlated(result, estimates)
        size = np.sqrt(np.diag(covariance))
        together = np.eye(len(estimates))
        together[: len(size), : len(size)] = covariance / np.outer(size, size)
        rows = [row for row, estimate in enumerate(estimates) if estimate.determined]
        return [estimates[row] for row in rows], together[np.ix_(rows, rows)]

    def partial(self, log: Log) -> bool:
        """Tell whether a log alone has too few speeds for a curve of friction over speed."""
        steady = [abs(stretch.velocity) for stretch in passes(log) if stretch.steady]
        return not steady or distinct(np.array(steady)) < SPEEDS_OF_A_LINE

    def claims_together(self, courses: Sequence[Course]) -> str | None:
        """Return why logs move at constant speeds, or None if they do not.

        Most of their motion must be at constant speeds, enough for a curve of friction over speed. At the slowest
        speeds a body may stick and slip, so logs in one direction count too.
        """
        speeds = [course.speeds for course in courses]
        fitting = all(len(of_one) or course.one_way for of_one, course in zip(speeds, courses, strict=True))
        count = distinct(np.concatenate(speeds)) if fitting and any(map(len, speeds)) else 0
        enough = count >= SPEEDS_OF_A_LINE
        return f"most of the way goes at one of {count} constant speeds" if enough else None

    def facts(self, result: FrictionAtSpeeds) -> Facts:
        """List friction over speed, by direction and for both, and friction along the rail."""
        facts = [(f"Friction {name}", _direction_text(side)) for name, side in result.velocity.directions.items()]
        facts += [
            ("Friction, both directions", _direction_text(result.velocity.both)),
            ("Repeatability along the rail", with_interval(result.position.repeatability)),
        ]
        facts += [
            (
                f"Along the rail at {digits(stretch.velocity, 'm/s')}",
                f"mean {with_interval(stretch.mean)}, standard deviation {digits(stretch.spread, 'N')}; "
                f"correlation length {with_interval(stretch.correlation_length)}",
            )
            for stretch in (result.position.passes if result.position.repeats else ())
        ]
        return tuple(facts)

    def numbers(self, result: FrictionAtSpeeds) -> dict[str, Any]:
        """Return friction over speed and over position on the rail, for the document."""
        sides = {**result.velocity.directions, "both": result.velocity.both}
        passes = [
            {
                **entries(stretch, "velocity_m_per_s", "spread_n", "steady"),
                **estimates_document(stretch, "mean", "correlation_length"),
            }
            for stretch in result.position.passes
        ]
        return {
            "directions": {name: estimates_document(side, *_FRICTION) for name, side in sides.items()},
            "bias": estimate_document(result.velocity.bias),
            **entries(result.velocity, "velocities_m_per_s", "forces_n", "unsteady_m_per_s"),
            "passes": passes,
            "repeatability": estimate_document(result.position.repeatability),
            **entries(result.position, "separated", "verdict"),
            "warnings": [*result.velocity.warnings, *result.position.warnings],
        }

    def sentences(self, result: FrictionAtSpeeds) -> tuple[str, ...]:
        """Say whether friction varies along the rail."""
        return (result.position.verdict,)

    def warnings(self, result: FrictionAtSpeeds) -> tuple[str, ...]:
        """Return the warnings of both analyses."""
        return (*result.velocity.warnings, *result.position.warnings)

    def figures(self, result: FrictionAtSpeeds, logs: Sequence[Source], name: str) -> list[Figure]:
        """Draw friction over velocity and along the rail."""
        return [*_velocity(result.velocity, name), *_position(result.position, name)]


KIND = ConstantSpeedKind()
