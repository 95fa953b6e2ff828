"""How slow sliding is shown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from friso.identify.experiments.slow_sliding import SlowSliding
from friso.identify.kind import Source
from friso.views.drawing.figure import BLUE, INK, ORANGE, Axis, Figure, Panel, Series
from friso.views.identify.estimates import estimate_document
from friso.views.identify.kind_view import TIME, Facts, KindView
from friso.views.identify.numbers import with_interval

POINTS, CURVE = 5000, 200
"""Points of a record of slow sliding, and of the curve at steady velocities, that are drawn."""


def _facts(it: SlowSliding) -> Facts:
    names = ("Coulomb friction", "Static friction", "Stribeck velocity")
    facts = [(name, with_interval(each)) for name, each in zip(names, it.estimates, strict=True)]
    if len(it.time):
        facts += [("Friction left unexplained", f"{it.unexplained:.1%} of its standard deviation")]
    return tuple(facts)


def _numbers(it: SlowSliding) -> dict[str, Any]:
    named = {each.name.removeprefix("friction."): estimate_document(each) for each in it.estimates}
    return {**named, "unexplained": it.unexplained, "warnings": list(it.warnings)}


def _figures(it: SlowSliding, logs: Sequence[Source], name: str) -> list[Figure]:
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


VIEW = KindView[SlowSliding]("Slow sliding", _facts, _numbers, _figures)
