"""Find lasting motions near an unstable cycle from the return map around it."""

from __future__ import annotations

import numpy as np

from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import CYCLE_RTOL, Cycles
from friso.hunting.cycle.multipliers import returns_of
from friso.hunting.cycle.settings import settings
from friso.hunting.cycle.shooting import Orbits
from friso.hunting.settings import tolerance_settings


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def held_beside(stages: Ensemble, cycles: Cycles, rtol: float = CYCLE_RTOL) -> np.ndarray:
    """Return distances [m] at which stages stick in lasting motions beside an unstable cycle.

    The return map keeps these motions within a few per cent of the cycle. The shape is (count, n), NaN for no motion.
    The map is interpolated, so a simulation has to decide whether the motions are attractors. The result is NaN where a
    limiter chatters, because the map is too rough.
    """
    distances = np.full((stages.count, settings.held_starts), np.nan)
    if stages.chatters:
        return distances
    which = np.flatnonzero(cycles.closed & ~cycles.attracting & np.isfinite(cycles.direction).all(axis=1))
    if not which.size:
        return distances
    heights = _returns(
        stages.take(which),
        cycles.orbits.take(which),
        cycles.direction[which],
        tolerance_settings.held_rtol_factor * rtol,
    )
    sticks = cycles.states[which, stages.sticking]
    for k, sticks_at, swings in zip(which, sticks, heights, strict=True):
        height = swings[settings.held_runs // 2, 0]
        shares = swings / height - 1
        held = held_by(shares[:, :-1].ravel(), shares[:, 1:].ravel())
        if held.size:
            spread = held[np.linspace(0, held.size - 1, settings.held_starts).astype(np.int64)]
            distances[k] = sticks_at + np.sign(sticks_at) * spread * height
    return distances


def _returns(stages: Ensemble, orbits: Orbits, direction: np.ndarray, rtol: float) -> np.ndarray:
    """Measure how far stages swing [m] when started beside their orbits, (count, runs, returns).

    Starts are displaced along `direction`, shape (count, states). They are first spread evenly over a range about the
    orbit. On either side, more starts are added where the next return begins to leave the range.
    """
    away = np.linspace(-settings.held_range_share, settings.held_range_share, settings.held_runs)
    heights = returns_of(stages, orbits, direction, away[None, :], settings.held_returns, rtol)
    middle = settings.held_runs // 2
    near = np.abs(heights[:, :, 1] / heights[:, middle, :1] - 1) <= settings.held_range_share
    inward = np.argmax(~near[:, middle::-1], axis=1), np.argmax(~near[:, middle:], axis=1)
    share = np.linspace(0, 1, settings.held_break_runs + 2)[1:-1]
    step = away[1] - away[0]
    finer = [side * step * (steps[:, None] - share) for side, steps in zip((-1, 1), inward, strict=True)]
    return np.hstack([heights, returns_of(stages, orbits, direction, np.hstack(finer), settings.held_returns, rtol)])


def held_by(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return deviations from a cycle at which motions last, kept within a range by a return map.

    The map takes the deviations `before` a return to those `after` it, each of shape (runs,). The result ascends, and
    is empty if no motion lasts. A motion that grew at every return is left out: near a multiplier of 1 or -1 it merely
    leaves slowly.
    """
    inside = (np.abs(before) <= settings.held_range_share) & (np.abs(after) <= settings.held_range_share)
    breaks = before[~inside & np.isfinite(before)]
    low, high = np.max(breaks[breaks < 0], initial=-np.inf), np.min(breaks[breaks > 0], initial=np.inf)
    order = np.argsort(before)
    order = order[(inside & (before > low) & (before < high))[order]]
    if order.size < 2:
        return np.empty(0)
    place = before[order][np.abs(before[order]) >= settings.nearest_start_share]
    shrank = np.zeros(place.size, bool)
    for _ in range(settings.held_map_steps):
        earlier = place
        for _ in range(2):
            place = np.where((place > low) & (place < high), np.interp(place, before[order], after[order]), np.nan)
        shrank |= np.abs(place) < np.abs(earlier)
        if not shrank.any():  # deviations of every size grow
            break
    return np.sort(place[np.isfinite(place) & shrank])
