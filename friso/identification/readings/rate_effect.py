"""Estimate static friction from break-away forces, which fall with the rate of the force.

While the force rises at a rate R the bristles creep at a speed v with F = g(v) (1 - R/(sigma_0 v)), from LuGre with
dz/dt = R/sigma_0; break-away is the largest F over all speeds. It lies below F_s by a part that grows as R^(2/3) while
it is small (g expanded to second order in v/v_s) and depends on R/(sigma_0 v_s) and F_c/F_s only. Inertia, left out
here, only delays: break-away is no lower (Canudas de Wit et al. 1995, doi:10.1109/9.376053, Fig. 3).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from friso.identification.estimate import Estimate
from friso.identification.readings.common import Mean, by_t, correlated_mean, stribeck_curve, t_value
from friso.identification.readings.settings import settings
from friso.quantities import percent

RELATIVE_SPEEDS = np.geomspace(1e-4, 10, 2001)
"""Speeds, relative to the Stribeck velocity, among which the largest force is searched."""


def break_away(
    force_rate: float, static: float, coulomb: float, bristle_stiffness: float, stribeck_velocity: float
) -> float:
    """Return the least break-away force [N] of LuGre friction at a `force_rate` [N/s].

    Static and Coulomb friction are in N, bristle stiffness in N/m, Stribeck velocity in m/s. Inertia, which is left
    out, only raises break-away.
    """
    level = stribeck_curve(RELATIVE_SPEEDS, coulomb, static, 1.0)
    creep = 1 - force_rate / (bristle_stiffness * stribeck_velocity * RELATIVE_SPEEDS)
    return float(max(np.max(level * creep), coulomb))


def share_below(force_rate: float) -> float:
    """Return by which fraction break-away may lie below static friction at a rate [N/s].

    The bound holds whatever the Coulomb friction is, if bristle stiffness times Stribeck velocity is at least the
    setting `least_bristle_rate`. Returns 1 for rates at which nothing can be concluded.
    """
    return min(1 - break_away(force_rate, 1.0, 0.0, settings.least_bristle_rate, 1.0), 1.0)


def static_friction(
    name: str, forces: np.ndarray, rates: np.ndarray, relative_error: float = 0.0, late: float = 0.0
) -> Estimate:
    """Estimate static friction [N] from break-away forces [N] at force rates [N/s], shape (n,).

    Rates that differ enough are extrapolated to 0. Otherwise the upper end of the interval allows for the most that
    break-away may lie below static friction (`share_below`). Static friction stays unknown with fewer than 3 forces, or
    if the rates do not show it.

    `relative_error` is a standard deviation common to all forces, such as that of a stiffness. Forces may be up to
    `late` [N] too high, because they were read after the break-away.
    """
    if len(forces) < 3:
        low = float(np.min(forces)) if len(forces) else 0.0
        return Estimate.unknown(name, "N", "break-away forces", f"{len(forces)} break-aways: 3 are needed", low)
    low, high = np.percentile(rates, [10, 90])
    if high >= settings.spread_of_rates * low > 0:
        estimate = _extrapolated(name, forces, rates, relative_error)
    else:
        estimate = _bounded(name, forces, rates, relative_error)
    return replace(estimate, low=max(float(estimate.low - late), 0.0), systematic=estimate.systematic + late / 2)


def _bounded(name: str, forces: np.ndarray, rates: np.ndarray, relative_error: float) -> Estimate:
    """Estimate static friction from break-aways at one rate.

    Break-aways are too low by a bounded part, and the value is raised by half of it. Static friction is not determined
    if the bound is too large.
    """
    mean = correlated_mean(forces)
    share = share_below(float(np.median(rates)))
    method = "mean break-away force; at rate 0 it may be higher, which is allowed for"  # one sentence for many logs
    scatter = t_value(mean.freedom) * mean.error
    half = float(np.hypot(scatter, t_value(mean.freedom) * relative_error * mean.value))
    low, high = mean.value - half, (mean.value + half) / (1 - share) if share < 1 else np.inf
    low, high = float(low), float(high)
    if share > 2 * settings.share_extrapolated:
        reason = (
            f"at {np.median(rates):.3g} N/s ramps may break away up to {percent(share)} below static friction; ramps "
            f"below {_slow_enough():.2g} N/s, or at rates more than {settings.spread_of_rates:g} times apart, would "
            "show it"
        )
        return Estimate.unknown(name, "N", method, reason, low, high)
    value = float(mean.value * (1 + share / (1 - share) / 2))
    return Estimate(name, "N", value, low, high, method, systematic=(high - low) / 2 - scatter)


def _slow_enough() -> float:
    """Return the highest force rate [N/s] at which ramps of a single rate show static friction."""
    rates = settings.least_bristle_rate * np.geomspace(1e-6, 1, 145)
    return float(max(rate for rate in rates if share_below(rate) <= 2 * settings.share_extrapolated))


def _rising(name: str, forces: np.ndarray, rates: np.ndarray) -> Estimate | None:
    """Return a bound on static friction if break-away clearly rises with the rate; else None.

    Bristles make break-away fall with the rate. If motion is noticed late by a constant time, forces rise in proportion
    to the rate: the line extrapolated to rate 0, and the forces at the lowest rates, bound static friction.
    """
    if len(forces) < 4:
        return None
    design = np.stack([np.ones_like(rates), rates], axis=1)
    solution, rest, _, _ = np.linalg.lstsq(design, forces, rcond=None)
    freedom = len(forces) - 2
    errors = t_value(freedom) * np.sqrt(np.diag(np.linalg.inv(design.T @ design)) * float(np.sum(rest)) / freedom)
    lowest, highest = rates <= 1.5 * rates.min(), rates >= rates.max() / 1.5
    low, high = (float(forces[chosen].mean()) for chosen in (lowest, highest))
    if not (solution[1] > errors[1] and high > low):
        return None
    reason = (
        f"break-away rises with the force rate, from {low:.3g} N at {rates.min():.3g} N/s to {high:.3g} N at "
        f"{rates.max():.3g} N/s, which contradicts LuGre's bristles: usually the motion is noticed late, by a "
        f"threshold or a filter, here by about {1e3 * float(solution[1]):.2g} ms; static friction is no more than at "
        "the lowest rate"
    )
    return Estimate.unknown(name, "N", "break-away forces", reason, max(float(solution[0] - errors[0]), 0.0), low)


def _extrapolated(name: str, forces: np.ndarray, rates: np.ndarray, relative_error: float) -> Estimate:
    """Extrapolate break-away forces to rate 0 by a straight line over rate^(2/3).

    The line is fitted at the lower rates. The interval is widened by half of the extrapolated distance.
    """
    rises = _rising(name, forces, rates)
    if rises is not None:
        return rises
    near = rates <= max(settings.range_of_rates * rates.min(), np.sort(rates)[2])
    if np.ptp(rates[near]) == 0:
        return _bounded(name, forces[near], rates[near], relative_error)
    power = rates[near] ** (2 / 3)
    design = np.stack([np.ones_like(power), power], axis=1)
    (level, slope), rest, _, _ = np.linalg.lstsq(design, forces[near], rcond=None)
    freedom = int(near.sum()) - 2
    inverse = np.linalg.inv(design.T @ design) * float(np.sum(rest)) / freedom
    error, offset = float(np.hypot(inverse[0, 0] ** 0.5, relative_error * level)), -slope * float(power.min())
    method = f"break-away forces at {rates[near].min():.3g} to {rates[near].max():.3g} N/s, extrapolated to 0"
    least = float(np.mean(forces[rates <= 1.5 * rates.min()]))
    if slope + t_value(freedom) * inverse[1, 1] ** 0.5 >= 0:
        if share_below(float(rates.min())) <= settings.share_extrapolated:
            return _bounded(name, forces[near], np.full(int(near.sum()), rates.min()), relative_error)
        reason = "break-away does not fall with the force rate: the rates may be too high to show static friction"
        return Estimate.unknown(name, "N", method, reason, least)
    if offset > settings.share_extrapolated * level:
        reason = f"the lowest force rate, {rates.min():.3g} N/s, is too high: the forces still rise towards rate 0"
        return Estimate.unknown(name, "N", method, reason, least)
    return by_t(name, "N", Mean(float(level), error, freedom), method, offset / 2, offset / 2)
