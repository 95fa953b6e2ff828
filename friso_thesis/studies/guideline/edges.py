"""Find the edges of the symmetric cycle of many stages.

An edge is the lowest crossover from which on the cycle is not known to attract. Other attractors above it, such as an
asymmetric cycle, are looked for only after a jump and where no orbit could be closed. `friso.hunting.margin` and
`friso.design_method.verification`, by contrast, survey all attractors.

Where no orbit could be closed, long simulations from many starts give evidence: a swing that lasts to the end.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.engine.arrays import ArrayColumns, Status
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import kernel
from friso.hunting import Ensemble, find_cycles, stuck, wait
from friso.hunting.criteria import lasts
from friso.hunting.measures import swing_of

START_DISTANCES = np.geomspace(0.02, 2.0, 95)
"""Start distances, relative to the loop's deflection by the break-away force, 5 % apart. Cycles have distances from
0.03, at the smallest friction gaps, to 1.5."""

RESTING_BAND = 0.005
"""Band around the reference within which a motion counts as resting, relative to the loop's deflection by the
break-away force. The smallest cycles of the sweeps swing by at least 0.06 from peak to peak."""

SLOW_DISTANCE = 0.05
"""Distance whose cycle sets the length of simulations, relative to the deflection by the break-away force. Small cycles
have the longest periods, because a stage sticks longer near its reference."""

RUN_PERIODS, JUDGED_PERIODS = 200.0, 2.0
"""Default length of simulations, and length of the end that is judged, in periods of the cycle at `SLOW_DISTANCE`. Near
a cycle that repels by 1 % per half period, a deviation grows 50 times within the first."""

PERSISTENCE_RTOL = 1e-6
"""Relative tolerance of the simulations."""


@dataclass(frozen=True)
class Begin:
    """Start of runs: keys of a motion, initial states, and when the motion is over [s].

    States have the shape (count, states); None stands for rest.
    """

    motion: Mapping[str, Any]
    starts: np.ndarray | None = None
    over: np.ndarray | float = 0.0


def from_rest(stages: Ensemble, distances: np.ndarray) -> Begin:
    """Return a start at rest, stuck at distances (count,) relative to the break-away deflection."""
    return Begin({"motion.displacement": stages.length}, stuck(stages, distances * stages.length))


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def still_swings(stages: Ensemble, begin: Begin, periods: float = RUN_PERIODS) -> tuple[np.ndarray, np.ndarray]:
    """Return which stages still swing at the end, and which runs were completed, both (count,).

    After the motion is over, runs last as long as `periods` periods of a slow cycle.
    """
    period = 2 * (wait(stages, SLOW_DISTANCE * stages.length) + 2 * np.pi / stages.number("rate"))
    end = begin.over + periods * period
    options = RunOptions(
        rtol=PERSISTENCE_RTOL,
        window=1 - JUDGED_PERIODS / periods,
        record_from=float(np.min(end)) / 2,
        least_swing=np.inf,
        threads=stages.threads,
        cancel=stages.cancel,
    )
    flat = {**stages.flat, **begin.motion, "motion.duration": end}
    swings, completed = np.zeros(stages.count, bool), np.zeros(stages.count, bool)
    for runs in run_chunks(kernel(stages.structure), flat, stages.count, options, begin.starts):
        completed[runs.numbers] = np.equal(runs.results.statuses, Status.DONE)
        lasting = lasts(swing_of(runs), 0.0, RESTING_BAND * stages.length[runs.numbers])
        swings[runs.numbers] = completed[runs.numbers] & lasting
    return swings, completed


def swings_from_any_distance(
    stages: Ensemble, periods: float = RUN_PERIODS, distances: np.ndarray = START_DISTANCES
) -> tuple[np.ndarray, np.ndarray]:
    """Return which stages swing for ever from any of the distances, and for which this is known.

    Both results have the shape (count,). Simulations last `periods` periods of a slow cycle. If a run of a stage
    failed, and no other run keeps swinging, its result is unknown.
    """
    several = stages.take(np.repeat(np.arange(stages.count), len(distances)))
    runs = still_swings(several, from_rest(several, np.tile(distances, stages.count)), periods)
    swings, completed = (runs_of_stages.reshape(stages.count, -1) for runs_of_stages in runs)
    swinging = np.any(swings, axis=1)
    return np.asarray(swinging), np.asarray(swinging | np.all(completed, axis=1))


OF = (
    "the symmetric cycle (of stages that are not symmetric, that over a whole period); others may attract beyond, and "
    "friso check looks for them"
)
"""Description of the cycle whose edges these are."""

EDGE_BISECTIONS = 6
"""Number of bisections of the grid step that contains the edge."""

FLIP_BOUNDS = 0.9, 1.1
"""Bounds of the multiplier's size below and above a flip. A multiplier beyond its bound belongs to another cycle. The
final bracket of an edge is less than 1 % wide."""

CROSSOVER_STEP, MOST_STEPS = 1.02, 16
"""Factor and largest number of upward steps in crossover, if another cycle has taken over above an edge. The steps
continue while simulations hunt, at most to the next crossover of the grid."""

LONG_RUN_PERIODS = 2000.0
"""Length of simulations of small cycles, in periods of these cycles. Transients near an unstable cycle may be long."""

FLIP, JUMP, FOLD, LOST = "flip", "jump", "fold", "lost"
BELOW, ABOVE, UNKNOWN = "below the range", "above the range", "unknown"

KINDS = {
    FLIP: "the cycle continues, but repels (its multiplier has passed -1)",
    JUMP: "the cycle is replaced by another, which repels (the multipliers do not meet at -1), and simulations settle",
    FOLD: "no cycle exists beyond: from every distance the stage swings back less far than it started",
    LOST: "no orbit could be closed beyond, near the fixed point of the return map, and simulations settle",
    BELOW: "no cycle attracts at any crossover tried",
    ABOVE: "a cycle attracts up to the highest crossover tried",
    UNKNOWN: "a decisive simulation failed, or after a jump hunting did not end within the steps allowed",
}
"""Kinds of edges in words, and reasons why a stage has no edge in the range."""

Stages = Callable[[np.ndarray, np.ndarray], Ensemble]
"""Function that makes stages from their numbers and crossovers, both of shape (count,)."""


@dataclass(frozen=True)
class Edges(ArrayColumns):
    """The edge of each stage, all of shape (count,).

    - `crossover`: in the unit of the grid (NaN without an edge).
    - `kind`: one of `KINDS`.
    - `inside`: multiplier just below the edge, where a cycle attracts (NaN: only a simulation shows it).
    - `outside`: multiplier just above (NaN: no known cycle).
    - `windows`: number of separate ranges of the grid with an attractor; the edge ends the highest.
    """

    crossover: np.ndarray
    kind: np.ndarray
    inside: np.ndarray
    outside: np.ndarray
    windows: np.ndarray

    @property
    def located(self) -> np.ndarray:
        """Return which stages have an edge in the range, shape (count,)."""
        return np.isfinite(self.crossover)


@dataclass(frozen=True)
class _AtCrossovers(ArrayColumns):
    """What was found at some crossovers of some stages, as arrays of one shape.

    - `attracts`: something attracts.
    - `multiplier`: that of the cycle (NaN: no cycle).
    - `uncertain`: a cycle may exist that could not be closed.
    - `failed`: a simulation failed that was to show whether the stage keeps hunting.
    """

    attracts: np.ndarray
    multiplier: np.ndarray
    uncertain: np.ndarray
    failed: np.ndarray


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def _at_crossovers(stages: Stages, which: np.ndarray, crossover: np.ndarray) -> _AtCrossovers:
    """Search the stages with indices `which` for attractors, each at one crossover.

    Where an orbit may exist but could not be closed, a long simulation shows whether the stage keeps hunting.
    """
    part = stages(which, crossover)
    cycles = find_cycles(part)
    attracts, failed, unsure = cycles.attracting, np.zeros(part.count, bool), np.flatnonzero(cycles.uncertain)
    if unsure.size:
        attracts[unsure], decided = swings_from_any_distance(part.take(unsure))
        failed[unsure] = ~decided
    return _AtCrossovers(attracts, cycles.multiplier, cycles.uncertain, failed)


def find_edges(stages: Stages, grid: np.ndarray, rounds: int = EDGE_BISECTIONS) -> Edges:
    """Find the edges of stages on a grid of crossovers, shape (count, points), ascending.

    The step above the last crossover at which a cycle attracts is halved `rounds` times. If another cycle takes over
    that still hunts, the search goes on upward. A flip is interpolated between the multipliers on both sides, if it
    lies within the remaining step. Otherwise the logarithmic middle of the step is taken.
    """
    count, points = grid.shape
    at_crossovers = _at_crossovers(stages, np.repeat(np.arange(count), points), grid.ravel()).shaped(count, points)
    last = points - 1 - at_crossovers.attracts[:, ::-1].argmax(axis=1)
    attracted = at_crossovers.attracts.any(axis=1)
    which = np.flatnonzero(attracted & (last < points - 1))
    nothing = [np.full(count, np.nan) for _ in range(3)]
    windows = (np.diff(at_crossovers.attracts, axis=1, prepend=False) & at_crossovers.attracts).sum(axis=1)
    kind = np.where(attracted, ABOVE, np.where(at_crossovers.failed.any(axis=1), UNKNOWN, BELOW)).astype(object)
    edges = Edges(nothing[0], kind, nothing[1], nothing[2], windows)
    if which.size:
        search = _Search(stages, which, grid, at_crossovers, last)
        for _ in range(rounds):
            search.halve()
        search.follow()
        for name, column in search.columns().items():
            getattr(edges, name)[which] = column
    return edges


class _Search:
    """Search of edges: for each stage a step in crossover that contains its edge and is halved.

    Arrays have the shape (stages,).

    - `low`: logarithm of a crossover at which a cycle attracts; `inside`: its multiplier.
    - `high`: logarithm of a crossover at which no cycle is known to attract; `outside`: multiplier there; `unsure`: an
      orbit there could not be closed.
    - `flip`: lowest known crossover at which the cycle is unstable (inf: none); `flipped`: its multiplier, which helps
      to locate the edge if orbits just above it cannot be closed.
    - `failed`: a simulation above failed.
    """

    def __init__(
        self, stages: Stages, which: np.ndarray, grid: np.ndarray, at_crossovers: _AtCrossovers, last: np.ndarray
    ) -> None:
        at = which, last[which]
        above = which, last[which] + 1
        self.stages, self.which = stages, which
        self.low, self.inside = np.log(grid[at]), at_crossovers.multiplier[at]
        self.high, self.outside, self.unsure = (
            np.log(grid[above]),
            at_crossovers.multiplier[above],
            at_crossovers.uncertain[above],
        )
        beyond = np.arange(grid.shape[1]) > last[which, None]
        flips = beyond & np.isfinite(at_crossovers.multiplier[which])
        first = flips.argmax(axis=1)
        self.flip = np.where(flips.any(axis=1), np.log(grid[which, first]), np.inf)
        self.flipped = at_crossovers.multiplier[which, first]
        self.failed = (beyond & at_crossovers.failed[which]).any(axis=1)

    def halve(self) -> None:
        """Halve the step above the last crossover at which a cycle attracts."""
        middle = (self.low + self.high) / 2
        at_crossovers = _at_crossovers(self.stages, self.which, np.exp(middle))
        inside, flips = at_crossovers.attracts, ~at_crossovers.attracts & np.isfinite(at_crossovers.multiplier)
        self.low, self.inside = (
            np.where(inside, middle, self.low),
            np.where(inside, at_crossovers.multiplier, self.inside),
        )
        self.high, self.outside = (
            np.where(inside, self.high, middle),
            np.where(inside, self.outside, at_crossovers.multiplier),
        )
        self.unsure = np.where(inside, self.unsure, at_crossovers.uncertain)
        self.flip, self.flipped = (
            np.where(flips, middle, self.flip),
            np.where(flips, at_crossovers.multiplier, self.flipped),
        )
        self.failed |= at_crossovers.failed

    @property
    def jumps(self) -> np.ndarray:
        """Return at which edges another cycle takes over, so that cycles above and below differ."""
        meets = (self.inside < -FLIP_BOUNDS[0]) & (-FLIP_BOUNDS[1] < self.outside) & (self.outside < 0)
        return np.isfinite(self.outside) & ~meets

    def follow(self) -> None:
        """Move the step upward where another cycle takes over, as long as simulations hunt there."""
        jumping = np.flatnonzero(self.jumps)
        for _ in range(MOST_STEPS):
            if not jumping.size:
                return
            hunts, decided = swings_from_any_distance(
                self.stages(self.which[jumping], np.exp(self.high[jumping])), LONG_RUN_PERIODS
            )
            self.failed[jumping] |= ~decided
            jumping = jumping[hunts]
            self.low[jumping] = self.high[jumping]
            self.high[jumping] += np.log(CROSSOVER_STEP)
        self.failed[jumping] = True

    def columns(self) -> dict[str, np.ndarray]:
        """Return the edges, within the last steps of the search, under the names of `Edges`."""
        excess = np.abs(self.inside) - 1, np.abs(self.flipped) - 1
        crossed = self.low - excess[0] * (self.flip - self.low) / (excess[1] - excess[0])
        within = (self.low <= crossed) & (crossed <= self.high)
        surely = np.isfinite(self.outside) & ~self.jumps
        flips = within & (surely | (self.unsure & (self.inside < -FLIP_BOUNDS[0]) & (self.flipped < 0)))
        kind = np.where(flips, FLIP, np.where(self.jumps, JUMP, np.where(self.unsure, LOST, FOLD)))
        edge = np.exp(np.where(flips, crossed, (self.low + self.high) / 2))
        return {
            "crossover": np.where(self.failed, np.nan, edge),
            "kind": np.where(self.failed, UNKNOWN, kind),
            "inside": self.inside,
            "outside": np.where(flips, self.flipped, self.outside),
        }
