"""Motions that go on for ever beside a cycle that repels, of any number of swings or none, told from the return map
near it."""

from __future__ import annotations

import numpy as np

from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import RTOL, Cycles
from friso.hunting.cycle.multipliers import returns_of
from friso.hunting.cycle.shooting import Orbits

RANGE, POINTS = 0.06, 61
"""How far from a cycle its return map is taken, as a share of the distance at which the stage sticks, and runs across
that."""

FINER = 12
"""Further runs on either side where the map breaks off, beyond which the stage does not swing as far again: what
attracts may be as narrow as a step there."""

RETURNS = 3
"""Returns of these runs: the distances that the map itself leads to are then among those that it is taken from."""

ROUGH = 10.0
"""Tolerance of these runs in units of that of the orbits."""

NEAREST = 1e-3
"""Share by which motions are off the cycle at first, at least: closer to it the rounding of the runs decides."""

TIMES = 500
"""How often the map is followed there and back."""

KEPT = 12
"""Distances that stand for the motions that go on."""


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def held_beside(stages: Ensemble, cycles: Cycles, rtol: float = RTOL) -> np.ndarray:
    """Distances [m] at which stages stick in motions that their return map keeps within a few per cent of a cycle that
    repels, shape (count, KEPT), NaN where it keeps none. The map is interpolated: a simulation has to decide whether
    they attract. None either where a limiter chatters: the map is too rough there to tell what it keeps."""
    distances = np.full((stages.count, KEPT), np.nan)
    if stages.chatters:
        return distances
    which = np.flatnonzero(cycles.closed & ~cycles.attracting & np.isfinite(cycles.direction).all(axis=1))
    if not which.size:
        return distances
    heights = _returns(stages.take(which), cycles.orbits.take(which), cycles.direction[which], ROUGH * rtol)
    sticks = cycles.states[which, stages.sticking]
    for k, sticks_at, swings in zip(which, sticks, heights, strict=True):
        height = swings[POINTS // 2, 0]
        shares = swings / height - 1
        held = held_by(shares[:, :-1].ravel(), shares[:, 1:].ravel())
        if held.size:
            spread = held[np.linspace(0, held.size - 1, KEPT).astype(np.int64)]
            distances[k] = sticks_at + np.sign(sticks_at) * spread * height
    return distances


def _returns(stages: Ensemble, orbits: Orbits, direction: np.ndarray, rtol: float) -> np.ndarray:
    """How far stages swing [m] when they begin beside their orbits, shape (count, runs, RETURNS): across the range
    first, the orbit in the middle of that, then where on either side the next return is no longer near it."""
    away = np.linspace(-RANGE, RANGE, POINTS)
    heights = returns_of(stages, orbits, direction, away[None, :], RETURNS, rtol)
    middle = POINTS // 2
    near = np.abs(heights[:, :, 1] / heights[:, middle, :1] - 1) <= RANGE
    inward = np.argmax(~near[:, middle::-1], axis=1), np.argmax(~near[:, middle:], axis=1)
    share = np.linspace(0, 1, FINER + 2)[1:-1]
    step = away[1] - away[0]
    finer = [side * step * (steps[:, None] - share) for side, steps in zip((-1, 1), inward, strict=True)]
    return np.hstack([heights, returns_of(stages, orbits, direction, np.hstack(finer), RETURNS, rtol)])


def held_by(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Where motions are after many returns that a map, which takes deviations `before` a return to those `after` it,
    each of shape (runs,), keeps within its range, ascending. Those that have only ever grown are not held: it takes
    them long to leave a cycle whose multiplier is close to 1 or -1."""
    inside = (np.abs(before) <= RANGE) & (np.abs(after) <= RANGE)
    breaks = before[~inside & np.isfinite(before)]
    low, high = np.max(breaks[breaks < 0], initial=-np.inf), np.min(breaks[breaks > 0], initial=np.inf)
    order = np.argsort(before)
    order = order[(inside & (before > low) & (before < high))[order]]
    if order.size < 2:
        return np.empty(0)
    place = before[order][np.abs(before[order]) >= NEAREST]
    shrank = np.zeros(place.size, bool)
    for _ in range(TIMES):
        earlier = place
        for _ in range(2):
            place = np.where((place > low) & (place < high), np.interp(place, before[order], after[order]), np.nan)
        shrank |= np.abs(place) < np.abs(earlier)
        if not shrank.any():  # deviations of every size grow
            break
    return np.sort(place[np.isfinite(place) & shrank])
