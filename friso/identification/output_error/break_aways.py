"""Whether the friction with which motions begin exceeds the static friction of a fit that leaves these moments out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from friso.identification.estimate import Estimate
from friso.identification.output_error.identifiable import CURVE
from friso.identification.readings.common import by_direction, robust, stribeck_curve
from friso.identification.readings.ramps import Ramps
from friso.intervals import COVERAGE

FEW = 3
"""Break-aways that say something, at least."""

STEPS = 50
"""Speeds at which the curve of a fit is looked at, up to that of a body that has begun to move."""

MEDIAN = 1.25
"""Deviation of a median over that of a mean, of normal errors."""


def exceeded_at_break_away(
    estimates: Sequence[Estimate], flat: Mapping[str, Any], ramps: Ramps, unit: str
) -> dict[str, str]:
    """Why static friction and the Stribeck velocity are not to be believed, where motions begin with more friction than
    the interval of the former holds; empty where they do not.

    A stage that follows a log shows friction while it moves, and the Stribeck curve leads from there to standstill: of
    a body that sticks by another law, or by a curve with another exponent, it leads to a static friction too low.
    """
    names = {estimate.name: estimate for estimate in estimates if estimate.determined}
    static = names.get("friction.static")
    sides = [side for _, side in by_direction(ramps.directions)]
    if static is None or len(ramps.forces) < FEW or not all(side.any() for side in sides):
        return {}
    bias = sum(one.value for name, one in names.items() if name.startswith("bias."))
    friction = ramps.forces + ramps.directions * bias - _rises(flat, ramps.speeds)
    medians = [float(np.median(friction[side])) for side in sides]
    middle = float(np.mean(medians))
    apart = robust(friction - np.where(sides[0], *medians))
    scatter = MEDIAN * apart * np.sqrt(sum(1 / side.sum() for side in sides)) / len(sides)
    unsure = COVERAGE * scatter + float(np.median(ramps.unsure))
    if middle - unsure <= static.high:
        return {}
    why = f"motions begin with {middle:.3g} {unit} of friction, more than the {static.value:.3g} {unit} of the fit"
    return dict.fromkeys(CURVE, why)


def _rises(flat: Mapping[str, Any], speeds: np.ndarray) -> np.ndarray:
    """By how much [N] friction at speeds up to these [m/s], shape (n,), exceeds static friction at most."""
    static, coulomb = flat["friction.static"], flat["friction.coulomb"]
    up_to = np.linspace(0, 1, STEPS)[:, None] * speeds
    exponent = flat.get("friction.stribeck_exponent", 2.0)
    curve = stribeck_curve(up_to, coulomb, static, flat["friction.stribeck_velocity"], exponent)
    viscous = flat["friction.viscous"] * (1 + abs(flat.get("friction.viscous_asymmetry", 0.0)))
    return (curve + viscous * up_to).max(axis=0) - static
