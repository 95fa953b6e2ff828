"""Show the results of motion at constant speeds."""

from __future__ import annotations

from itertools import cycle
from typing import Any

import numpy as np

from friso.identification.experiments.constant_speed import FrictionAtSpeeds
from friso.identification.readings.common import stribeck_curve
from friso.identification.readings.friction_position import FrictionPosition
from friso.identification.readings.friction_velocity import Direction, FrictionVelocity
from friso.questions.identify.estimates import estimate_document, estimates_document
from friso.questions.identify.kind_view import WAYS, Facts, KindView
from friso.questions.identify.numbers import digits, estimates_in_words, with_interval, within
from friso.shown.documents import entries
from friso.shown.drawing.figure import Array, Axis, Figure, Markers, Panel, Series
from friso.shown.drawing.palette import BLUE, GREEN, ORANGE, PINK, SKY, VERMILLION


def _facts(result: FrictionAtSpeeds) -> Facts:
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


def _direction_text(direction: Direction) -> str:
    """Write the friction of one direction in words."""
    several = [getattr(direction, name) for name in _FRICTION]
    visible = [estimate for estimate in several if estimate.determined]
    reasons = {estimate.reason: None for estimate in several if not estimate.determined}
    names = [within(estimate.name) for estimate in several if not estimate.determined]
    missing = f"not shown: {', '.join(names)} ({'; '.join(reasons)})" if names else ""
    return "; ".join(text for text in (estimates_in_words(visible), missing) if text)


def _numbers(result: FrictionAtSpeeds) -> dict[str, Any]:
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


VIEW = KindView[FrictionAtSpeeds](
    "Constant speed",
    _facts,
    _numbers,
    lambda result, logs, name: [*_velocity(result.velocity, name), *_position(result.position, name)],
    sentences=lambda result: (result.position.verdict,),
    warnings=lambda result: (*result.velocity.warnings, *result.position.warnings),
)
