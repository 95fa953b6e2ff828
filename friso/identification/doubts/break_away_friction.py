"""Doubt: motions begin with more friction than the fitted static friction, because the fit leaves these moments out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from friso.identification.doubt import Doubt, KeyCase, RaisedDoubt
from friso.identification.output_error.parameters import CURVE, MASS, is_free
from friso.identification.readings.common import by_direction, robust, stribeck_curve
from friso.identification.readings.ramps import Ramps, force_ramps
from friso.identification.readings.settings import settings
from friso.identification.settings import doubt_settings
from friso.intervals import NORMAL_COVERAGE

MEDIAN_ERROR_RATIO = 1.25
"""Ratio of the standard deviations of median and mean, for normal errors: sqrt(pi / 2), rounded."""


def find(case: KeyCase) -> Iterator[RaisedDoubt]:
    """Compare the friction at which motions begin with the fitted static friction.

    A stage that follows a log shows friction while it moves, and the Stribeck curve extrapolates to standstill. For a
    body that sticks by another law, or with another exponent, the extrapolated static friction is too low.
    """
    if is_free(case.flat) or (case.fit.problem.closed and case.fit.explains(case.quality.noise)):
        return
    ramps = force_ramps(case.log.per_unit_of_force(), case.fit.value(MASS))
    more = friction_beyond(case.determined, case.fit.stage, ramps)
    if more is not None:
        static, unit = case.determined["friction.static"].value, case.unit
        why = f"motions begin with {more:.3g} {unit} of friction, more than the {static:.3g} {unit} of the fit"
        yield RaisedDoubt(words="", size=more - static, unit=case.unit, refuses=dict.fromkeys(CURVE, why))


def friction_beyond(determined: Mapping[str, Any], flat: Mapping[str, Any], ramps: Ramps) -> float | None:
    """Return the friction [N] at which motions begin if it exceeds the fitted static friction.

    Returns None if it does not exceed the interval of static friction, or with too few ramps in either direction.
    `determined` has estimates by key, `flat` the fitted stage, and `ramps` the forces at which motions begin.
    """
    static = determined.get("friction.static")
    sides = [side for _, side in by_direction(ramps.directions)]
    if static is None or len(ramps.forces) < settings.fewest_ramps:
        return None
    if not all(side.any() for side in sides):
        return None
    bias = sum(one.value for name, one in determined.items() if name.startswith("bias."))
    friction = ramps.forces + ramps.directions * bias - _rises(flat, ramps.speeds)
    medians = [float(np.median(friction[side])) for side in sides]
    middle = float(np.mean(medians))
    apart = robust(friction - np.where(sides[0], *medians))
    scatter = MEDIAN_ERROR_RATIO * apart * np.sqrt(sum(1 / side.sum() for side in sides)) / len(sides)
    unsure = NORMAL_COVERAGE * scatter + float(np.median(ramps.unsure))
    return middle if middle - unsure > static.high else None


def _rises(flat: Mapping[str, Any], speeds: np.ndarray) -> np.ndarray:
    """Return how far friction can exceed static friction [N], up to each of the speeds [m/s].

    The result has the shape (n,). Viscous friction may rise faster than the Stribeck curve falls.
    """
    static, coulomb = flat["friction.static"], flat["friction.coulomb"]
    up_to = np.linspace(0, 1, doubt_settings.speeds_of_a_start)[:, None] * speeds
    exponent = flat.get("friction.stribeck_exponent", 2.0)
    curve = stribeck_curve(up_to, coulomb, static, flat["friction.stribeck_velocity"], exponent)
    viscous = flat["friction.viscous"] * (1 + abs(flat.get("friction.viscous_asymmetry", 0.0)))
    return (curve + viscous * up_to).max(axis=0) - static


DOUBT = Doubt(
    "curve",
    find,
    "the friction at which motions begin",
    "static friction and the Stribeck curve are refused",
    "force ramps from rest (break-away)",
)
