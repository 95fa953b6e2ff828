"""What a record of slow motion leaves open: friction at higher speeds than its own, and a mass whose inertia is lost in
what the model does not explain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from friso.identification.estimate import Estimate
from friso.identification.output_error.parameters import HIGHEST_RATIO, stribeck_up_to

SLIDING = ("friction.coulomb", "friction.viscous", "friction.viscous_asymmetry")
"""What friction is once the Stribeck effect has died away."""

DIED_AWAY = 2.0
"""Stribeck velocities at which 2 % of the effect is left, by the usual exponent 2, and hardly depends on it."""

Known = tuple[tuple[Estimate, ...], np.ndarray]
"""Estimates, and the correlation of those that are shown."""


def without_sliding(
    estimates: Sequence[Estimate], correlation: np.ndarray, flat: Mapping[str, Any], top: float, unit: str
) -> Known:
    """The estimates without what friction is at higher speeds than the `top` [m/s] of a record during which the
    Stribeck effect may act; `unit` is that of the force.

    Such a record shows the sum of the effect and of Coulomb friction: dry friction there, of which the latter is at
    least a quarter. Where the Stribeck velocity is not shown it may be the highest of bearings; where it is, what the
    effect leaves at twice that is small, and less depends on the exponent that was assumed.
    """
    if "friction.stribeck_velocity" not in flat:
        return tuple(estimates), correlation
    determined = {estimate.name: estimate for estimate in estimates if estimate.determined}
    stribeck, level = determined.get("friction.stribeck_velocity"), determined.get("friction.coulomb")
    if top >= (DIED_AWAY * stribeck.high if stribeck else stribeck_up_to(flat)):
        return tuple(estimates), correlation
    dry = f": {level.value:.3g} {unit} is dry friction there" if level else ""
    why = f"the log moves at {top * 1e3:.3g} mm/s at most, where the Stribeck effect may still act{dry}"
    return without(estimates, correlation, dict.fromkeys(SLIDING, why))


def with_unexplained_inertia(
    estimates: Sequence[Estimate], correlation: np.ndarray, acceleration: np.ndarray, unexplained: float, unit: str
) -> Known:
    """The estimates with masses as uncertain as what a model leaves `unexplained` [N], noise apart, makes them; over
    the samples of this acceleration [m/s^2], shape (n,); `unit` is that of the force.

    Any of what is left may pass for inertia: a mass whose inertia is less is not shown. What a fit leaves is least like
    inertia where that is large: a mass is as uncertain as the square of their ratio at least (our choice).
    """
    masses = {one.name: one for one in estimates if one.determined and one.name in ("masses.cart", "masses.stage")}
    inertia = sum(mass.value for mass in masses.values()) * float(np.sqrt(np.mean(acceleration**2)))
    if inertia < unexplained:
        left = f"{unexplained:.2g} {unit}"
        why = f"its inertia, {inertia:.2g} {unit}, is less than what the model leaves unexplained, {left}"
        return without(estimates, correlation, dict.fromkeys(masses, why))
    least = (unexplained / inertia) ** 2 if masses and inertia > 0 else 0.0
    return tuple(_no_narrower(one, least) if one.name in masses else one for one in estimates), correlation


def _no_narrower(estimate: Estimate, share: float) -> Estimate:
    """An estimate that may be off by this share of its value at least."""
    off = share * estimate.value
    return replace(estimate, low=min(estimate.low, estimate.value - off), high=max(estimate.high, estimate.value + off))


def without(estimates: Sequence[Estimate], correlation: np.ndarray, reasons: Mapping[str, str]) -> Known:
    """The estimates without those for which there are reasons."""
    kept = [estimate.name not in reasons for estimate in estimates if estimate.determined]
    answers = tuple(_withdrawn(estimate, reasons.get(estimate.name, "")) for estimate in estimates)
    return answers, correlation[np.ix_(kept, kept)]


def _withdrawn(estimate: Estimate, why: str) -> Estimate:
    """An estimate that is not shown, for a reason; dry friction bounds Coulomb friction."""
    if not why or not estimate.determined:
        return estimate
    ends = (estimate.low / HIGHEST_RATIO, estimate.high) if estimate.name == "friction.coulomb" else (-np.inf, np.inf)
    return Estimate.unknown(estimate.name, estimate.unit, estimate.method, why, *ends)
