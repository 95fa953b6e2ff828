"""Which stages have a cycle that attracts, and which cycle: of many stages at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import ROUGH, RTOL, Cycles, asymmetric_cycles, joined, symmetric_cycles, whole_cycles
from friso.hunting.cycle.neighbours import pair_beside, partner
from friso.hunting.cycle.return_map import ReturnMap, return_map
from friso.hunting.persistence import hunts_somehow

NEAR = 1.01
"""Size of the multiplier of a cycle that repels, up to which one that attracts is looked for beside it, stage by stage:
such are born where it is 1, and farther on they are found from the return map, which tells those that are 5 % apart."""


@dataclass(frozen=True)
class Attractors:
    """Of stages, arrays of shape (count,): whether a cycle `attracts`, and whether that is `known` (not where a
    simulation that had to decide failed); of the cycle that attracts its `amplitude` [m], `period` [s] and
    `time_constant` [s] (NaN: there is none, or it attracts by simulation alone); and their symmetric cycles (of stages
    that are not symmetric, those of a whole period), attracting or not."""

    attracts: np.ndarray
    known: np.ndarray
    amplitude: np.ndarray
    period: np.ndarray
    time_constant: np.ndarray
    cycles: Cycles

    def take(self, numbers: np.ndarray) -> Attractors:
        """Those of the stages with these numbers."""
        return Attractors(
            self.attracts[numbers],
            self.known[numbers],
            self.amplitude[numbers],
            self.period[numbers],
            self.time_constant[numbers],
            self.cycles.take(numbers),
        )

    def _adopt(self, which: np.ndarray, cycles: Cycles) -> None:
        """Take those of the cycles that attract for those of the stages with these numbers, which have none so far."""
        new = cycles.attracting
        for mine, theirs in (
            (self.attracts, new),
            (self.amplitude, cycles.amplitude),
            (self.period, cycles.period),
            (self.time_constant, cycles.time_constant),
        ):
            mine[which[new]] = theirs[new]


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def attractors(stages: Ensemble) -> Attractors:
    """What attracts: the symmetric cycle, an asymmetric pair beside it, or, where an orbit may be that could not be
    closed, what simulations from many places tell."""
    kinds = ((stages.symmetric, True), (~stages.symmetric, False))
    parts = [
        (which, _of_one_kind(stages.take(which), symmetric))
        for mask, symmetric in kinds
        if (which := np.flatnonzero(mask)).size
    ]
    if len(parts) == 1:
        return parts[0][1]
    order = np.argsort(np.concatenate([which for which, _ in parts]))
    names = ("attracts", "known", "amplitude", "period", "time_constant")
    arrays = {name: np.concatenate([getattr(part, name) for _, part in parts])[order] for name in names}
    return Attractors(**arrays, cycles=joined([(which, part.cycles) for which, part in parts]))


def _of_one_kind(stages: Ensemble, symmetric: bool) -> Attractors:
    """The same of stages that are all symmetric, or none of them."""
    there = return_map(stages, ROUGH)
    cycles = (symmetric_cycles if symmetric else whole_cycles)(stages, RTOL, there)
    count = stages.count
    amplitude, period, time_constant = (np.full(count, np.nan) for _ in range(3))
    known = Attractors(np.zeros(count, bool), np.ones(count, bool), amplitude, period, time_constant, cycles)
    known._adopt(np.arange(count), cycles)
    rest = np.flatnonzero(~known.attracts)
    if symmetric and rest.size:
        rows = ReturnMap(there.distances[rest], there.returns[rest], there.times[rest])
        known._adopt(rest, asymmetric_cycles(stages.take(rest), rows))
    beside = pair_beside if symmetric else partner
    for k in np.flatnonzero(cycles.found & ~known.attracts & (np.abs(cycles.multiplier) < NEAR)):
        one = np.array([k])
        if (other := beside(stages.take(one), cycles.take(one))) is not None:
            known._adopt(one, other)
    unsure = np.flatnonzero(cycles.uncertain & ~known.attracts)
    if unsure.size:
        known.attracts[unsure], known.known[unsure] = hunts_somehow(stages.take(unsure))
    return known
