"""The figures of experiments in time: steps, stick-slip, break-away ramps and constant speeds."""

from __future__ import annotations

from dataclasses import replace
from itertools import cycle

import numpy as np

from friso.identify.experiments.break_away import BreakAway
from friso.identify.experiments.friction_position import FrictionPosition
from friso.identify.experiments.friction_velocity import Direction, FrictionVelocity
from friso.identify.experiments.presliding import Presliding
from friso.identify.experiments.slow_sliding import SlowSliding
from friso.identify.experiments.steps import StepStiffness
from friso.identify.experiments.stick_slip import StickSlip
from friso.identify.logs.log import Log
from friso.identify.method import ConstantSpeed, Result
from friso.views.drawing.figure import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PINK,
    SKY,
    VERMILLION,
    Array,
    Axis,
    Band,
    Figure,
    Limit,
    Markers,
    Panel,
    Series,
)
from friso.views.identify.numbers import digits, with_interval

AREA = "#cfdfee"
WAYS = {"forward": BLUE, "backward": ORANGE}
TIME = Axis("Time", "s")

POINTS, CURVE = 5000, 200
"""Points of a record of slow sliding, and of the curve at steady velocities, that are drawn."""


def friction_figures(it: Result, log: Log, label: str) -> list[Figure]:
    """All figures of one experiment in time; their names begin with "identify_" and the label."""
    name = f"identify_{label}"
    if isinstance(it, StepStiffness):
        return _steps(it, name)
    if isinstance(it, StickSlip):
        return _stick_slip(it, log, name)
    if isinstance(it, BreakAway):
        return _break_away(it, name)
    if isinstance(it, Presliding):
        return _presliding(it, name)
    if isinstance(it, SlowSliding):
        return _slow_sliding(it, name)
    if isinstance(it, ConstantSpeed):
        return [*_velocity(it.velocity, name), *_position(it.position, name)]
    raise TypeError(f"no figures of a {type(it).__name__}")


def _steps(it: StepStiffness, name: str) -> list[Figure]:
    """Deflection and force over time with the settled windows, and the one over the other."""
    panels = []
    for quantity, unit, values in (("Deflection", "m", it.position), ("Force", "N", it.force)):
        low, high = float(values.min()), float(values.max())
        room = 0.06 * (high - low)
        bands = tuple(
            Band(
                np.array([w.start, w.end]),
                np.full(2, low - room),
                np.full(2, high + room),
                "settled" if i == 0 else "",
                AREA,
            )
            for i, w in enumerate(it.windows)
        )
        line = Series(it.time, values, quantity.lower() + ("" if unit == "m" else ", low-passed"), INK, width=1.0)
        panels.append(Panel("", TIME, Axis(quantity, unit, (low - room, high + room)), (line,), bands=bands))
    caption = "Shaded: where both had settled, and their means were taken."
    figures = [Figure(f"{name}_record", "Steps of the position", caption, tuple(panels))]
    if len(it.windows) < 2:
        return figures
    x, y = np.array([[w.position, w.force] for w in it.windows]).T
    lines = ()
    if it.stiffness.shown:
        ends = np.array([x.min(), x.max()])
        line = y.mean() + it.stiffness.value * (ends - x.mean())
        lines = (Series(ends, line, f"stiffness {with_interval(it.stiffness)}", BLUE),)
    points = Markers(x, y, "settled windows", INK)
    panel = Panel("", Axis("Deflection", "m"), Axis("Force", "N"), lines, (points,))
    caption = f"Means of the settled windows. Hysteresis: {with_interval(it.hysteresis)}."
    return [*figures, Figure(f"{name}_stiffness", "Force over deflection", caption, (panel,))]


def _stick_slip(it: StickSlip, log: Log, name: str) -> list[Figure]:
    """Force on the cart with its peaks, and the cart's speed, over time."""
    pull = Series(log.time, _broken(it.pull, log), "force on the cart", GREY, width=1.0)
    peaks = tuple(
        Markers(it.times[chosen], way * it.forces[chosen], f"break-away, {word}", WAYS[word], "triangle")
        for word, way, chosen in (("forward", 1, it.directions > 0), ("backward", -1, it.directions < 0))
        if chosen.any()
    )
    speed = Series(log.time, _broken(it.cart_velocity, log), "", INK, width=0.9)
    time = replace(TIME, limits=(float(log.time[0]), float(log.time[-1])))
    panels = (
        Panel("", time, Axis("Force on the cart", "N"), (pull,), peaks),
        Panel("", time, Axis("Velocity of the cart", "m/s"), (speed,)),
    )
    caption = (
        "While the cart sticks, the force on it grows; at the peak it breaks away, and its velocity shows a spike. "
        f"Static friction: {with_interval(it.static)}."
    )
    return [Figure(f"{name}_slips", "Stick-slip", caption, panels)]


def _broken(values: np.ndarray, log: Log) -> np.ndarray:
    """A signal of shape (n,) whose line breaks at the gaps of a log: without the last sample before each."""
    broken = values.astype(float)
    broken[[part.stop - 1 for part in log.segments[:-1]]] = np.nan
    return broken


def _presliding(it: Presliding, name: str) -> list[Figure]:
    """Force and model, and the motion, over the last tenth of the record."""
    if not len(it.model):
        return []
    return [Figure(f"{name}_force", "Motion before sliding", presliding_caption(it), presliding_panels(it))]


def presliding_caption(it: Presliding) -> str:
    """What the bristles are, and how much of the force they explain."""
    return (
        f"The last tenth of the record. Stiffness of the bristles: {with_interval(it.stiffness)}; damping: "
        f"{with_interval(it.damping)}. {it.unexplained:.1%} of the friction are left unexplained."
    )


def presliding_panels(it: Presliding) -> tuple[Panel, ...]:
    """Force and model, and the motion, over the last tenth of the record."""
    late = slice(-(len(it.time) // 10), None)
    time, motion = it.time[late], it.position[late] - it.position[late].mean()
    lines = (
        Series(time, it.force[late], "force, low-passed", INK, width=1.6),
        Series(time, it.model[late], "mass and bristles", ORANGE, "dashed", 1.2),
    )
    return (
        Panel("", TIME, Axis("Force", "N"), lines),
        Panel("", TIME, Axis("Position about its mean", "m"), (Series(time, motion, "", BLUE, width=1.0),)),
    )


def _slow_sliding(it: SlowSliding, name: str) -> list[Figure]:
    """Friction over velocity as it was and as the model has it, and both over time at its end."""
    if not len(it.model):
        return []
    caption, panels = slow_sliding_caption(it), slow_sliding_panels(it)
    return [Figure(f"{name}_friction", "Friction in slow sliding", caption, panels)]


def slow_sliding_caption(it: SlowSliding) -> str:
    """What the friction is, and how much of it the model explains."""
    coulomb, static, stribeck = (with_interval(each) for each in it.estimates)
    return (
        "Force less inertia, and the friction of LuGre's bristles in the motion that was measured. Coulomb friction: "
        f"{coulomb}; static friction: {static}; Stribeck velocity: {stribeck}. {it.unexplained:.1%} of the friction "
        "are left unexplained."
    )


def slow_sliding_panels(it: SlowSliding) -> tuple[Panel, ...]:
    """Friction over time, and over velocity, as it was and as the model has it."""
    friction = Axis("Friction, low-passed", "N")
    some = slice(None, None, max(len(it.time) // POINTS, 1))

    def both(x: np.ndarray) -> tuple[Series, ...]:
        return (
            Series(x[some], it.friction[some], "force less inertia", INK, width=1.4),
            Series(x[some], it.model[some], "LuGre's bristles", ORANGE, "dashed", 1.0),
        )

    over = Panel("", Axis("Velocity", "m/s"), friction, (*both(it.velocity), *_steady_friction(it)))
    return Panel("", TIME, friction, both(it.time)), over


def _steady_friction(it: SlowSliding) -> tuple[Series, ...]:
    """The friction at steady velocities without the viscous, either way."""
    coulomb, static, stribeck = (each.value for each in it.estimates)
    if not all(each.shown for each in it.estimates):
        return ()
    speeds = np.linspace(0, float(np.abs(it.velocity).max()), CURVE)
    level = coulomb + (static - coulomb) * np.exp(-((speeds / stribeck) ** it.exponent))
    velocities, forces = (np.concatenate([-values[::-1], [np.nan], values]) for values in (speeds, level))
    return (Series(velocities, forces, "at steady velocity", BLUE, width=2.0),)


def _break_away(it: BreakAway, name: str) -> list[Figure]:
    """Break-away force over force rate."""
    if not len(it.times):
        return []
    points = tuple(
        Markers(it.rates[chosen], it.forces[chosen], word, WAYS[word])
        for word, chosen in (("forward", it.directions > 0), ("backward", it.directions < 0))
        if chosen.any()
    )
    low, high = float(it.rates.min()) / 1.3, float(it.rates.max()) * 1.3
    bands, limits = (), ()
    if np.isfinite([it.static.low, it.static.high]).all():
        ends = np.array([low, high])
        bands = (Band(ends, np.full(2, it.static.low), np.full(2, it.static.high), "static friction, 95 %", AREA),)
    if it.static.shown:
        limits = (Limit((it.static.value,), "", INK),)
    panel = Panel(
        "",
        Axis("Force rate", "N/s", (low, high), log=True),
        Axis("Break-away force", "N"),
        (),
        points,
        limits,
        bands=bands,
    )
    caption = f"Each ramp from rest. Static friction, as of the slowest ramps: {with_interval(it.static)}."
    return [Figure(f"{name}_rates", "Break-away force over force rate", caption, (panel,))]


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
