"""How constant speeds are shown."""

from __future__ import annotations

from itertools import cycle
from typing import Any

import numpy as np

from friso.identify.experiments.constant_speed import FrictionAtSpeeds
from friso.identify.readings.friction_position import FrictionPosition
from friso.identify.readings.friction_velocity import Direction, FrictionVelocity
from friso.views.drawing.figure import (
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
from friso.views.identify.estimates import estimate_document
from friso.views.identify.kind_view import WAYS, Facts, KindView
from friso.views.identify.numbers import digits, listed, with_interval, within


def _facts(it: FrictionAtSpeeds) -> Facts:
    facts = [(f"Friction {name}", _direction_text(each)) for name, each in it.velocity.directions.items()]
    facts += [
        ("Friction, both directions", _direction_text(it.velocity.both)),
        ("Constant force", with_interval(it.velocity.bias)),
        ("Repeatability along the rail", with_interval(it.position.repeatability)),
    ]
    facts += [
        (f"Along the rail at {digits(each.velocity, 'm/s')}", f"mean {with_interval(each.mean)}, standard deviation "
         f"{digits(each.spread, 'N')}; correlation length {with_interval(each.correlation_length)}")
        for each in it.position.passes
    ]  # fmt: skip
    return tuple(facts)


def _direction_text(it: Direction) -> str:
    several = (it.coulomb, it.viscous, it.static, it.stribeck_velocity)
    shown = [each for each in several if each.shown]
    reasons = {each.reason: None for each in several if not each.shown}
    names = [within(each.name) for each in several if not each.shown]
    lost = f"not shown: {', '.join(names)} ({'; '.join(reasons)})" if names else ""
    return "; ".join(text for text in (listed(shown), lost) if text)


def _numbers(it: FrictionAtSpeeds) -> dict[str, Any]:
    sides = {**it.velocity.directions, "both": it.velocity.both}
    passes = [
        {
            "velocity_m_per_s": each.velocity,
            "mean": estimate_document(each.mean),
            "spread_n": each.spread,
            "correlation_length": estimate_document(each.correlation_length),
            "steady": each.steady,
        }
        for each in it.position.passes
    ]
    return {
        "directions": {name: _direction_numbers(each) for name, each in sides.items()},
        "bias": estimate_document(it.velocity.bias),
        "velocities_m_per_s": it.velocity.velocities,
        "forces_n": it.velocity.forces,
        "unsteady_m_per_s": it.velocity.unsteady,
        "passes": passes,
        "repeatability": estimate_document(it.position.repeatability),
        "separated": it.position.separated,
        "verdict": it.position.verdict,
        "warnings": [*it.velocity.warnings, *it.position.warnings],
    }


def _direction_numbers(it: Direction) -> dict[str, Any]:
    several = {"coulomb": it.coulomb, "viscous": it.viscous, "static": it.static}
    several["stribeck_velocity"] = it.stribeck_velocity
    return {name: estimate_document(each) for name, each in several.items()}


def _velocity(it: FrictionVelocity, name: str) -> list[Figure]:
    """Friction over velocity with intervals and the fit of each direction."""
    if not len(it.velocities):
        return []
    series, markers = [], []
    for word, chosen in (("forward", it.velocities > 0), ("backward", it.velocities < 0)):
        if not chosen.any():
            continue
        v, f, half = it.velocities[chosen], it.forces[chosen], it.half_widths[chosen]
        gap = np.full(len(v), np.nan)
        bars = np.stack([v, v, gap], axis=1).ravel(), np.stack([f - half, f + half, gap], axis=1).ravel()
        series += [Series(*bars, "", WAYS[word], width=1.2), *_fit(it.directions[word], v, word)]
        markers.append(Markers(v, f, f"{word}, with 95 % interval", WAYS[word]))
    panel = Panel("", Axis("Velocity", "m/s"), Axis("Friction", "N"), tuple(series), tuple(markers))
    caption = "Mean force less inertia over stretches of constant velocity."
    if len(it.unsteady):
        caption += f" {len(it.unsteady)} stretches were not steady and are left out."
    return [Figure(f"{name}_velocity", "Friction over velocity", caption, (panel,))]


def _fit(it: Direction, velocities: Array, word: str) -> list[Series]:
    """The curve fitted to one direction, over the velocities it was fitted to."""
    if not (it.coulomb.shown and it.viscous.shown):
        return []
    size = np.geomspace(np.abs(velocities).min(), np.abs(velocities).max(), 200)
    friction = it.coulomb.value + it.viscous.value * size
    if it.static.shown and it.stribeck_velocity.shown:
        rise = it.static.value - it.coulomb.value
        friction = friction + rise * np.exp(-((size / it.stribeck_velocity.value) ** 2))
    way = 1.0 if word == "forward" else -1.0
    return [Series(way * size, way * friction, f"fit, {word}", WAYS[word], "dashed")]


def _position(it: FrictionPosition, name: str) -> list[Figure]:
    """Force over the place, pass by pass."""
    if not it.passes:
        return []
    colours = cycle((BLUE, ORANGE, GREEN, PINK, SKY, VERMILLION))
    lines = tuple(
        Series(
            each.places,
            np.sign(each.velocity) * each.force,
            f"{digits(each.velocity, 'm/s')}{'' if each.steady else ', not steady'}",
            colour,
            width=1.0,
        )
        for each, colour in zip(it.passes, colours, strict=False)
    )
    panel = Panel("", Axis("Position", "m"), Axis("Friction", "N"), lines)
    return [Figure(f"{name}_position", "Friction along the rail", it.verdict, (panel,))]


VIEW = KindView[FrictionAtSpeeds](
    "Constant speed",
    _facts,
    _numbers,
    lambda it, logs, name: [*_velocity(it.velocity, name), *_position(it.position, name)],
    sentences=lambda it: (it.position.verdict,),
    warnings=lambda it: (*it.velocity.warnings, *it.position.warnings),
)
