"""Show the results of slow sliding."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from friso.identification.experiments.slow_sliding import SlowSliding
from friso.identification.kind import Source
from friso.identification.readings.common import stribeck_curve
from friso.quantities import percent
from friso.questions.identify.estimates import estimate_document
from friso.questions.identify.kind_view import TIME, Facts, KindView
from friso.questions.identify.numbers import with_interval
from friso.shown.documents import entries
from friso.shown.drawing.figure import Axis, Figure, Panel, Series
from friso.shown.drawing.palette import BLUE, INK, ORANGE

RECORD_POINTS, CURVE_POINTS = 5000, 200
"""Numbers of points drawn: of a record of slow sliding, and of the curve at steady velocities."""


def _facts(result: SlowSliding) -> Facts:
    """List Coulomb and static friction and Stribeck velocity, and how much stays unexplained."""
    names = ("Coulomb friction", "Static friction", "Stribeck velocity")
    facts = [(name, with_interval(estimate)) for name, estimate in zip(names, result.estimates, strict=True)]
    if len(result.time):
        facts += [("Residual friction", f"{percent(result.unexplained, 3)} of its standard deviation")]
    return tuple(facts)


def _numbers(result: SlowSliding) -> dict[str, Any]:
    """Return Coulomb and static friction and the Stribeck velocity, for the document."""
    named = {estimate.name.removeprefix("friction."): estimate_document(estimate) for estimate in result.estimates}
    return named | entries(result, "unexplained", "warnings")


def _figures(result: SlowSliding, logs: Sequence[Source], name: str) -> list[Figure]:
    """Draw measured and modelled friction, over velocity and over time; empty without a model."""
    if not len(result.model):
        return []
    caption, panels = slow_sliding_caption(result), slow_sliding_panels(result)
    return [Figure(f"{name}_friction", "Friction in slow sliding", caption, panels)]


def slow_sliding_caption(result: SlowSliding) -> str:
    """Write Coulomb and static friction and Stribeck velocity, and how much stays unexplained."""
    coulomb, static, stribeck = (with_interval(estimate) for estimate in result.estimates)
    return (
        "Force less inertia, and the friction of LuGre bristles in the measured motion. Coulomb "
        f"friction: {coulomb}; static friction: {static}; Stribeck velocity: {stribeck}. "
        f"{percent(result.unexplained, 3)} of "
        "the friction remains unexplained."
    )


def slow_sliding_panels(result: SlowSliding) -> tuple[Panel, ...]:
    """Draw measured and modelled friction over time and over velocity."""
    friction = Axis("Friction, low-passed", "N")
    thinned = slice(None, None, max(len(result.time) // RECORD_POINTS, 1))

    def both(x: np.ndarray) -> tuple[Series, ...]:
        """Draw measured and modelled friction over a signal."""
        return (
            Series(x[thinned], result.friction[thinned], "force less inertia", INK, width=1.4),
            Series(x[thinned], result.model[thinned], "LuGre's bristles", ORANGE, "dashed", 1.0),
        )

    over = Panel("", Axis("Velocity", "m/s"), friction, (*both(result.velocity), *_steady_friction(result)))
    return Panel("", TIME, friction, both(result.time)), over


def _steady_friction(result: SlowSliding) -> tuple[Series, ...]:
    """Draw the friction at steady velocities without the viscous part, in both directions."""
    coulomb, static, stribeck = (estimate.value for estimate in result.estimates)
    if not all(estimate.determined for estimate in result.estimates):
        return ()
    speeds = np.linspace(0, float(np.abs(result.velocity).max()), CURVE_POINTS)
    level = stribeck_curve(speeds, coulomb, static, stribeck, result.exponent)
    velocities, forces = (np.concatenate([-values[::-1], [np.nan], values]) for values in (speeds, level))
    return (Series(velocities, forces, "at steady velocity", BLUE, width=2.0),)


VIEW = KindView[SlowSliding]("Slow sliding", _facts, _numbers, _figures)
