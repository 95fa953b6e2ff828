"""What a record of slow motion leaves open: friction at higher speeds than its own, and a mass whose inertia is lost in
what the model does not explain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from friso.identification.estimate import Estimate
from friso.identification.inverse_model import FilteredMotion
from friso.identification.output_error.parameters import HIGHEST_RATIO, stribeck_up_to
from friso.identification.quality import Quality

SLIDING = ("friction.coulomb", "friction.viscous", "friction.viscous_asymmetry")
"""What friction is once the Stribeck effect has died away."""


def without_what_is_too_slow(
    estimates: Sequence[Estimate],
    correlation: np.ndarray,
    flat: Mapping[str, Any],
    moved: FilteredMotion,
    counted: np.ndarray,
    quality: Quality,
    unit: str,
) -> tuple[tuple[Estimate, ...], np.ndarray]:
    """The estimates without those that need a quicker motion, and the correlation of the rest; `counted`, shape
    (n,), are the samples that the fit was judged by, `unit` is that of the force.

    Below the highest Stribeck velocity of bearings, a record that does not show the Stribeck effect shows the sum of it
    and of Coulomb friction: dry friction there, of which the latter is at least a quarter. A mass is not shown where
    its inertia is less than what the model leaves, noise apart: any of that passes for inertia.
    """
    determined = {estimate.name: estimate for estimate in estimates if estimate.determined}
    reasons: dict[str, str] = {}
    top = float(np.abs(moved.velocity).max())
    if (
        "friction.stribeck_velocity" in flat
        and top < stribeck_up_to(flat)
        and "friction.stribeck_velocity" not in determined
    ):
        level = determined.get("friction.coulomb")
        dry = f": {level.value:.3g} {unit} is dry friction there" if level else ""
        why = f"the log moves at {top * 1e3:.3g} mm/s at most, where the Stribeck effect may still act{dry}"
        reasons = dict.fromkeys(SLIDING, why)
    masses = [name for name in ("masses.cart", "masses.stage") if name in determined]
    inertia = sum(determined[name].value for name in masses) * float(np.sqrt(np.mean(moved.acceleration[counted] ** 2)))
    unexplained = quality.left * quality.lacking
    if masses and inertia < unexplained:
        left = f"{unexplained:.2g} {unit}"
        why = f"its inertia, {inertia:.2g} {unit}, is less than what the model leaves unexplained, {left}"
        reasons |= dict.fromkeys(masses, why)
    kept = [name not in reasons for name in determined]
    answers = tuple(_withdrawn(estimate, reasons.get(estimate.name, "")) for estimate in estimates)
    return answers, correlation[np.ix_(kept, kept)]


def _withdrawn(estimate: Estimate, why: str) -> Estimate:
    """An estimate that is not shown, for a reason; dry friction bounds Coulomb friction."""
    if not why or not estimate.determined:
        return estimate
    ends = (estimate.low / HIGHEST_RATIO, estimate.high) if estimate.name == "friction.coulomb" else (-np.inf, np.inf)
    return Estimate.unknown(estimate.name, estimate.unit, estimate.method, why, *ends)
