"""The edge of hunting of many stages at once: the lowest crossover at and above which no cycle is known to attract."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import hunting_cycles
from friso.studies.guideline.persistence import hunts_somehow

ROUNDS = 6
"""Bisections of the step of the grid that holds the edge."""

FLIP, FOLD, LOST = "flip", "fold", "lost"
BELOW, ABOVE = "below the range", "above the range"

KINDS = {
    FLIP: "the cycle goes on, but repels (its multiplier has passed -1)",
    FOLD: "there is no cycle beyond, from no distance does the stage swing back as far",
    LOST: "beyond, no orbit could be closed near the fixed point of the return map, and simulations settle",
    BELOW: "at no crossover tried does a cycle attract",
    ABOVE: "a cycle attracts up to the highest crossover tried",
}
"""What is known of an edge, and of stages without one in the range."""

Stages = Callable[[np.ndarray, np.ndarray], Ensemble]
"""Stages from their numbers and crossovers, both of shape (count,)."""


@dataclass(frozen=True)
class Edges:
    """The edge of each stage, all of shape (count,).

    `crossover`, in the unit of the grid (NaN without an edge); its `kind`, one of `KINDS`; the multiplier `inside`,
    next below it, where something attracts (NaN: by simulation alone), and `outside`, above it (NaN where no cycle is
    known); and the number of `windows` of the grid in which something attracts: of several the highest counts.
    """

    crossover: np.ndarray
    kind: np.ndarray
    inside: np.ndarray
    outside: np.ndarray
    windows: np.ndarray

    @property
    def known(self) -> np.ndarray:
        """Which stages have an edge in the range, shape (count,)."""
        return np.isfinite(self.crossover)


def joined(parts: list[Edges]) -> Edges:
    """The edges of all stages."""
    return Edges(*(np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(Edges)))


@dataclass(frozen=True)
class _Known:
    """What a multiplier tells: whether the cycle attracts, the multiplier (NaN: no cycle), whether there may be one."""

    attracts: np.ndarray
    multiplier: np.ndarray
    uncertain: np.ndarray

    def reshaped(self, *shape: int) -> _Known:
        return _Known(*(getattr(self, each.name).reshape(shape) for each in fields(_Known)))


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def _known(stages: Stages, which: np.ndarray, crossover: np.ndarray) -> _Known:
    """Where an orbit may be but could not be closed, a long simulation tells whether anything hunts on."""
    some = stages(which, crossover)
    cycles = hunting_cycles(some)
    attracts, unsure = cycles.attracting, np.flatnonzero(cycles.uncertain)
    if unsure.size:
        attracts[unsure] = hunts_somehow(some.take(unsure))
    return _Known(attracts, cycles.multiplier, cycles.uncertain)


def find_edges(stages: Stages, grid: np.ndarray, rounds: int = ROUNDS) -> Edges:
    """The edges of stages whose crossovers are tried on a grid, shape (count, points), ascending; then the step behind
    the last one at which a cycle attracts is halved, `rounds` times.

    A flip is interpolated between the multipliers on both sides of it; else the middle of what is left is taken (of the
    logarithm).
    """
    count, points = grid.shape
    seen = _known(stages, np.repeat(np.arange(count), points), grid.ravel()).reshaped(count, points)
    last = points - 1 - seen.attracts[:, ::-1].argmax(axis=1)
    some = seen.attracts.any(axis=1)
    which = np.flatnonzero(some & (last < points - 1))
    nothing = [np.full(count, np.nan) for _ in range(3)]
    windows = (np.diff(seen.attracts, axis=1, prepend=False) & seen.attracts).sum(axis=1)
    edges = Edges(nothing[0], np.where(some, ABOVE, BELOW).astype(object), nothing[1], nothing[2], windows)
    if which.size:
        search = _Search(stages, which, grid, seen, last)
        for _ in range(rounds):
            search.halve()
        for name, found in search.found().items():
            getattr(edges, name)[which] = found
    return edges


class _Search:
    """Steps that hold an edge on their way to being halved; all arrays of shape (stages,).

    `low`, the logarithm of a crossover at which a cycle attracts, with its multiplier; `high`, one at which none is
    known to, and whether that is because no orbit could be closed; and `flip`, the lowest known one at which the cycle
    repels (inf: none), with its multiplier, which tells of the edge where orbits just above it cannot be closed.
    """

    def __init__(self, stages: Stages, which: np.ndarray, grid: np.ndarray, seen: _Known, last: np.ndarray) -> None:
        at = which, last[which]
        above = which, last[which] + 1
        self.stages, self.which = stages, which
        self.low, self.inside = np.log(grid[at]), seen.multiplier[at]
        self.high, self.outside, self.unsure = np.log(grid[above]), seen.multiplier[above], seen.uncertain[above]
        beyond = np.arange(grid.shape[1]) > last[which, None]
        flips = beyond & np.isfinite(seen.multiplier[which])
        first = flips.argmax(axis=1)
        self.flip = np.where(flips.any(axis=1), np.log(grid[which, first]), np.inf)
        self.flipped = seen.multiplier[which, first]

    def halve(self) -> None:
        middle = (self.low + self.high) / 2
        seen = _known(self.stages, self.which, np.exp(middle))
        inside, flips = seen.attracts, ~seen.attracts & np.isfinite(seen.multiplier)
        self.low, self.inside = np.where(inside, middle, self.low), np.where(inside, seen.multiplier, self.inside)
        self.high, self.outside = np.where(inside, self.high, middle), np.where(inside, self.outside, seen.multiplier)
        self.unsure = np.where(inside, self.unsure, seen.uncertain)
        self.flip, self.flipped = np.where(flips, middle, self.flip), np.where(flips, seen.multiplier, self.flipped)

    def found(self) -> dict[str, np.ndarray]:
        """What the steps tell of the edges, by the names of `Edges`."""
        flips = np.isfinite(self.inside) & np.isfinite(self.flip) & (np.isfinite(self.outside) | self.unsure)
        off = np.abs(self.inside) - 1, np.abs(self.flipped) - 1
        crossed = self.low - off[0] * (self.flip - self.low) / (off[1] - off[0])
        return {
            "crossover": np.exp(np.where(flips, crossed, (self.low + self.high) / 2)),
            "kind": np.where(flips, FLIP, np.where(self.unsure, LOST, FOLD)),
            "inside": self.inside,
            "outside": np.where(flips, self.flipped, self.outside),
        }
