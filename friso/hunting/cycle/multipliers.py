"""Compute how deviations from a cycle grow per return.

Floquet multipliers describe small deviations, the slope of the return map finite ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.settings import settings
from friso.hunting.cycle.shooting import Orbits, Shot, shoot
from friso.hunting.cycle.swings import swings
from friso.hunting.settings import tolerance_settings


@dataclass(frozen=True)
class Multipliers:
    """Floquet multipliers of orbits, without the trivial one along the cycle.

    `local` (count, states - 1) has the largest first. `direction` (count, states) is the eigenvector of the first,
    scaled to a position of 1. `slope` (count,) is the slope of the return map along that direction over a finite range.
    It is only computed where a limiter may chatter, and NaN elsewhere. `high` and `low` [m] (count,) are the extremes
    of the position on the orbit.
    """

    local: np.ndarray
    direction: np.ndarray
    slope: np.ndarray
    high: np.ndarray
    low: np.ndarray


def multipliers(stages: Ensemble, orbits: Orbits, rtol: float) -> Multipliers:
    """Compute the multipliers of closed orbits, one orbit per stage.

    Runs have the relative tolerance `rtol`. The multipliers are growth factors over half a period if the orbits were
    closed over half a period, else over a whole one.
    """
    shot = shoot(stages, orbits.states, orbits.times, orbits.sign, rtol)
    flows = np.where(shot.done[:, None, None], shot.flows, np.nan)
    local, direction = _floquet(stages, flows, stages.rates(shot.ends))
    slope = slopes(stages, orbits, direction, rtol) if stages.chatters else np.full(stages.count, np.nan)
    high, low = (np.where(shot.done, extreme, np.nan) for extreme in (shot.high, shot.low))
    return Multipliers(local, direction, slope, high, low)


def decisive(local: np.ndarray) -> np.ndarray:
    """Return the multiplier that decides whether orbits are stable, (count,).

    `local`, shape (count, n), are multipliers with the largest first. That one decides; of a complex pair, its
    magnitude.
    """
    first = local[:, 0]
    complex_pair = np.abs(np.imag(first)) > 1e-6 * np.abs(first)
    return np.where(complex_pair, np.abs(first), np.real(first))


def decisive_of(stages: Ensemble, shot: Shot) -> np.ndarray:
    """Return the multiplier that decides whether orbits are stable, (count,), from shots along them."""
    return decisive(_floquet(stages, shot.flows, stages.rates(shot.ends))[0])


def _floquet(stages: Ensemble, flows: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute the multipliers of orbits, and the direction in which the largest one acts.

    Deviations are compared at equal states of the integrator. `flows` (count, states, states) are derivatives of final
    by initial states, and `rates` (count, states) time derivatives at the end.
    """
    phase = stages.integral
    sections = flows - rates[:, :, None] * flows[:, None, phase, :] / rates[:, phase, None, None]
    sections[:, :, phase] = 0.0
    finite = np.all(np.isfinite(sections), axis=(1, 2), keepdims=True)
    values, vectors = np.linalg.eig(np.where(finite, sections, 0.0))
    values = np.where(finite[:, :, 0], values, np.nan)
    order = np.argsort(-np.abs(values), axis=1)
    values = np.take_along_axis(values, order, axis=1)[:, :-1]  # the last multiplier belongs to the phase and is zero
    first = np.take_along_axis(vectors, order[:, None, :1], axis=2)[:, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        return values, np.real(first / first[:, stages.sticking, None])


def slopes(stages: Ensemble, orbits: Orbits, direction: np.ndarray, rtol: float) -> np.ndarray:
    """Return the slope of the return map over a small range about the orbits, shape (count,).

    Runs start beside the orbits along a direction (count, states); a straight line is fitted to their returns.
    """
    coarser = min(tolerance_settings.slope_rtol_factor * rtol, max(rtol, tolerance_settings.chattering_rtol))
    away = np.linspace(-settings.slope_range_share / 2, settings.slope_range_share / 2, settings.slope_runs)[None, :]
    heights = returns_of(stages, orbits, direction, away, 2, coarser)
    return np.array([_straight(pairs[np.isfinite(pairs).all(axis=1)]) for pairs in heights])


def _straight(pairs: np.ndarray) -> float:
    """Fit a straight line without outliers to pairs (points, 2), and return its slope.

    The slope is NaN if too few pairs are left. A stage that does not break away makes an outlier.
    """
    if len(pairs) < settings.least_slope_runs:
        return np.nan
    first, second = (pairs - np.median(pairs, axis=0)).T
    earlier, later = np.triu_indices(len(first), 1)
    # median of all slopes, after Theil and Sen
    slope = np.nanmedian((second[later] - second[earlier]) / (first[later] - first[earlier]))
    near = np.abs(second - slope * first) < settings.near_return_share * np.ptp(first)
    if np.count_nonzero(near) < settings.least_slope_runs:
        return np.nan
    return float(np.polyfit(first[near], second[near], 1)[0])


def returns_of(
    stages: Ensemble, orbits: Orbits, direction: np.ndarray, away: np.ndarray, returns: int, rtol: float
) -> np.ndarray:
    """Measure how far stages swing [m] on each return, shape (count, points, returns).

    Each run starts displaced from its orbit along `direction`, shape (count, states). `away`, shape (1, points), has
    the displacements as fractions of the orbit's sticking distance. Returns that a run does not make are NaN.
    """
    count, points = stages.count, away.shape[1]
    distance = orbits.states[:, stages.sticking]
    starts = orbits.states[:, None, :] + (away * np.abs(distance)[:, None])[:, :, None] * direction[:, None, :]
    starts = starts.reshape(count * points, -1)
    several = stages.take(np.repeat(np.arange(count), points))
    per_return = orbits.swings
    durations = (returns + 0.5) * np.repeat(orbits.times, points)
    extrema = swings(several, starts, durations, per_return * returns, rtol)
    return np.abs(extrema.values[:, per_return - 1 :: per_return]).reshape(count, points, returns)
