"""Cycles of one stage next to another one: the other of two near a fold, and the pair born in a flip."""

from __future__ import annotations

import numpy as np

from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import KEPT, LEANING, ROUGH, RTOL, Cycles, described
from friso.hunting.cycle.multipliers import returns_of
from friso.hunting.cycle.rest import stuck
from friso.hunting.cycle.shooting import close

BESIDE, AROUND = 0.2, 81
"""How far from a cycle another one is sought, as a share of its distance, and the number of runs over that range."""

SOONER = (0.96, 0.94, 0.98, 1.0, 0.9)
"""Shares of the period of a cycle tried for another one."""

DISTINCT = 1e-3
"""Share of the distance by which two cycles differ at least."""

BIRTH, RETURNS = 3e-3, 400
"""Where beside a symmetric cycle that repels, as a share of its distance, a run begins, and for how many returns it is
watched whether an asymmetric pair takes over."""


def partner(stages: Ensemble, cycles: Cycles, rtol: float = RTOL) -> Cycles | None:
    """The other cycle of one stage near a fold, at which the two meet; None if none is found near the first."""
    away = np.linspace(-BESIDE, BESIDE, AROUND)
    heights = returns_of(stages, cycles.orbits, cycles.direction, away[None, :], 2, rtol)[0]
    rise = heights[:, 1] - heights[:, 0]
    here = np.nanargmin(np.abs(heights[:, 0] / heights[AROUND // 2, 0] - 1))
    crosses = np.flatnonzero(rise[:-1] * rise[1:] < 0)
    crosses = crosses[np.abs(crosses + 0.5 - here) > 1]
    if not crosses.size:
        return None
    k = crosses[np.abs(crosses - here).argmin()]
    share = away[k] + (away[k + 1] - away[k]) * rise[k] / (rise[k] - rise[k + 1])
    size = np.abs(cycles.states[:, stages.sticking])
    several = stages.take(np.zeros(len(SOONER), np.int64))
    starts = stuck(several, np.repeat(size * (1 + share), len(SOONER)))
    tried = close(several, starts, cycles.orbits.times * np.array(SOONER), cycles.sign, rtol)
    apart = np.abs(np.abs(tried.states[:, stages.sticking]) / size - 1)
    others = np.flatnonzero(tried.closed & (apart > DISTINCT) & (apart < 2 * BESIDE))
    if not others.size:
        return None
    return described(stages, tried.take(others[:1]), rtol)


def pair_beside(stages: Ensemble, cycle: Cycles, rtol: float = RTOL) -> Cycles | None:
    """One of the attracting pair beside the symmetric cycle of one stage, which repels: where a motion that leaves it
    ends, if it stays near; None if it goes away."""
    size = np.abs(cycle.states[:, stages.sticking])
    start = cycle.states + BIRTH * size[:, None] * cycle.direction
    end = stages.run(start, 2 * RETURNS * cycle.orbits.times, ROUGH).ends
    if not np.isfinite(end).all() or abs(end[0, stages.sticking] / cycle.states[0, stages.sticking] - 1) > KEPT:
        return None
    orbit = close(stages, end, 2 * cycle.orbits.times, 1.0, rtol)
    pair = described(stages, orbit, rtol)
    return pair if pair.found[0] and abs(pair.middle[0]) > LEANING * pair.amplitude[0] else None
