"""Choose the states from which a survey starts, so that runs reach every attractor."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.hunting.attractors.rounds import SURVEY_RTOL, Pending, loose_from, typical_period
from friso.hunting.attractors.settings import settings
from friso.hunting.cycle.ensemble import Ensemble, bent, pushed, spread_over, stuck
from friso.hunting.cycle.find import Cycles
from friso.stage.controllers import FORCE_LIMIT

THOROUGH_STARTS = ((0.001, 0.009, 12), (0.01, 3.0, 96), (4.0, 300.0, 16))  # [deflections at break-away]
"""Distances at which a stage sticks at first: first, last and number of each range. From the nearest ones most runs
creep home; from the farthest ones they do not stick. Attractors are missed between two of them."""

LIMITED_STARTS = (500.0, 30000.0, 8)  # [deflections at break-away]
"""Farther starts with a force limit. A cycle driven by the limit is as large as the limit moves the masses while
the integrator unwinds."""

OUTER_INTEGRAL_WINDUPS = (-10.0, -1.0, 1.0, 10.0)  # [loop times]
"""Initial windups of the outer integral of a cascade, of both signs. More multiply the starts."""

PUSHED_STARTS = (0.03, 300.0, 12)  # [speeds that deflect the loop to break-away]
"""Speeds of stages that start at their reference. They lead where starts at rest do not."""

WOUND_UP_STARTS = ((0.1, 100.0, 24), (0.0, 1.0, 10.0))
"""Starts without anti-windup: first, last and number of distances, and windups of the integrator."""

FARTHEST_START = 1e5  # [deflections at break-away]
"""Farthest start. It is a tenth of the deviation at which a run counts as diverged."""

REMEMBERING_STARTS = ((0.01, 10.0, 32), (0.01, 30.0, 128))  # [deflections at break-away]
"""Starts of stages with several bristles bent in many ways, for other surveys and for a thorough one. Each counts
seven times, once for each past."""

LEAST_BEND_BACK_SHARE = 1e-3  # [of the travel]
"""Smallest reversal after bending the bristles. A smaller one leaves them as they were."""

BENDING_TRAVELS = (1e-3, 10.0)  # [deflections at break-away]
"""Shortest and longest travel by which bristles are bent before a start, from presliding to far beyond it."""

BESIDE_CYCLE_SHARES = (-0.03, -0.003, 0.003, 0.03)  # [of the distance]
"""Offsets of starts from an unstable cycle, on both sides, that lead to the attractors next to it."""

START_STRIDES = (64, 16, 4, 1)
"""Strides through the starts of many stages. Every 64th start runs first, because a few starts decide most stages.
"""

FIRST_ROUND_PERIODS = 24.0  # [typical periods]
"""Length of the first round. If shorter, slow stages show no swing yet; if longer, stages at rest waste work."""


class Starts:
    """Runs to be started: initial states (runs, states) and the numbers of their stages (runs,)."""

    def __init__(self, stages: Ensemble, rtol: float = SURVEY_RTOL, loose: np.ndarray | None = None) -> None:
        self.stages, self.rtol = stages, rtol
        self.loose = loose_from(stages) if loose is None else loose
        self.period = typical_period(stages)
        self.owners: list[np.ndarray] = []
        self.states: list[np.ndarray] = []

    def take(self, numbers: np.ndarray) -> Starts:
        """Return an empty list of starts for the stages with these numbers."""
        return Starts(self.stages.take(numbers), self.rtol, self.loose[numbers])

    def spread(self, thorough: bool) -> None:
        """Add runs stuck at distances on both sides of the reference.

        Symmetric stages get one side only. A `thorough` survey has twice as many distances, and pushes as well.
        """
        controller = self.stages.structure.controller
        limited = controller is not None and controller.anti_windup is not None
        ranges = THOROUGH_STARTS if thorough else settings.usual_starts
        units = spread_over(*ranges, *([LIMITED_STARTS] if limited else []))
        for side in (1.0, -1.0):
            which = np.flatnonzero((side > 0) | ~self.stages.symmetric)
            if which.size:
                owners = np.repeat(which, len(units))
                stages = self.stages.take(owners)
                distances = side * np.tile(units, which.size) * stages.length
                self._add(owners, stuck(stages, distances))
                for wound in OUTER_INTEGRAL_WINDUPS if stages.outer_integrals else ():
                    self._add(owners, stuck(stages, distances, wound / stages.number("rate")))
                if controller is not None and controller.anti_windup == "none":
                    self._wound_up(which, side)
                if thorough:
                    pushes = spread_over(PUSHED_STARTS)
                    owners = np.repeat(which, len(pushes))
                    stages = self.stages.take(owners)
                    speeds = np.tile(pushes, which.size) * stages.length * stages.number("rate")
                    self._add(owners, pushed(stages, side * speeds))

    def _wound_up(self, which: np.ndarray, side: float) -> None:
        """Add runs released at distances on one side, with their integrators wound up.

        `which` are the numbers of the stages, which have a force limit; `side` is 1 or -1.
        """
        span, times = WOUND_UP_STARTS
        distances = spread_over(span)
        stages = self.stages.take(np.repeat(which, len(distances)))
        limit = stages.flat[FORCE_LIMIT] / stages.number("stiffness")
        begin = side * np.minimum(np.tile(distances, which.size) * limit, FARTHEST_START * stages.length)
        for wound in times:
            states = stages.at_rest(begin, begin)
            states[:, stages.integral] -= wound * stages.relaxed * begin
            self._add(np.repeat(which, len(distances)), states)

    def remembering(self, thorough: bool) -> None:
        """Add runs of stages with several bristles, bent in the ways in which motions leave them.

        Some runs begin with a displacement, a jump of the reference, or a push. Others stick, after one of three pasts:
        a travel outward over the distance itself, a long travel out or back, or random travels to and fro. A
        `thorough` survey gets more distances.
        """
        units = spread_over(REMEMBERING_STARTS[thorough])
        rng = np.random.default_rng(0)
        shares = np.exp(rng.uniform(np.log(LEAST_BEND_BACK_SHARE), 0.0, (2, len(units))))
        way = np.exp(rng.uniform(np.log(BENDING_TRAVELS[0]), np.log(BENDING_TRAVELS[1]), len(units))) * rng.choice(
            [-1.0, 1.0], len(units)
        )
        for side in (1.0, -1.0):
            which = np.flatnonzero((side > 0) | ~self.stages.symmetric)
            owners = np.repeat(which, len(units))
            if owners.size:
                stages = self.stages.take(owners)
                distances = side * np.tile(units, which.size) * stages.length
                to_and_fro = np.tile([way, -way * shares[0], way * shares.prod(axis=0)], which.size) * stages.length
                self._add(owners, stages.at_rest(distances, distances))
                self._add(owners, stages.at_rest(distances))
                self._add(owners, pushed(stages, distances * stages.number("rate")))
                for travels in ([distances], [np.inf * distances], [-np.inf * distances], to_and_fro):
                    self._add(owners, bent(stages, distances, *travels))

    def beside(self, cycles: Cycles) -> None:
        """Add runs that begin on both sides of unstable cycles."""
        which = np.flatnonzero(cycles.closed & ~cycles.attracting & np.isfinite(cycles.direction).all(axis=1))
        owners, away = (
            np.repeat(which, len(BESIDE_CYCLE_SHARES)),
            np.tile(BESIDE_CYCLE_SHARES, which.size),
        )
        size = np.abs(cycles.states[owners, self.stages.sticking])
        self._add(owners, cycles.states[owners] + (away * size)[:, None] * cycles.direction[owners])

    def stuck_at(self, distances: np.ndarray) -> None:
        """Add runs that begin stuck at distances [m].

        `distances` has the shape (count, n), for n runs per stage; NaN adds none.
        """
        owners, which = np.nonzero(np.isfinite(distances))
        if owners.size:
            self._add(owners, stuck(self.stages.take(owners), distances[owners, which]))

    def seen(self, owner: int, state: np.ndarray) -> None:
        """Add runs that begin slightly farther from rest, and slightly nearer, than a run ended.

        `state`, shape (kept,), is the final state of that run, and `owner` the number of its stage. A run from that
        state itself could stay on a weakly unstable cycle.
        """
        states = np.outer(1 + np.array(BESIDE_CYCLE_SHARES), state[: self.stages.kernel.initial_size])
        self._add(np.full(len(states), owner), states)

    def _add(self, owners: np.ndarray, states: np.ndarray) -> None:
        """Add runs with the initial `states` (runs, states); `owners` (runs,) number their stages."""
        self.owners.append(owners)
        self.states.append(states)

    def waves(self, at_once: bool) -> Iterator[tuple[Pending, np.ndarray]]:
        """Yield groups of runs, ready for their first round, with the numbers of their stages.

        There is one group if `at_once`, otherwise several, because a few runs suffice for most stages that hunt.
        """
        if not self.owners:
            return
        owners, states = np.concatenate(self.owners), np.concatenate(self.states)
        order = np.argsort(owners, kind="stable")
        rank = np.empty(len(owners), np.int64)
        rank[order] = np.arange(len(owners)) - np.searchsorted(owners[order], owners[order])
        left = np.ones(len(owners), bool)
        for step in START_STRIDES[-1:] if at_once else START_STRIDES:
            if (which := np.flatnonzero(left & (rank % step == step // 2))).size:
                yield self._begun(owners[which], states[which]), owners[which]
            left[which] = False

    def on_cycles(self, cycles: Cycles, which: np.ndarray) -> Pending:
        """Return runs that begin on the cycles of the stages numbered `which`."""
        return self._begun(which, cycles.states[which])

    def _begun(self, owners: np.ndarray, states: np.ndarray) -> Pending:
        """Make runs with the length of their first round and a mark for mirror-image motions.

        `owners`, shape (runs,), are the numbers of their stages, `states` (runs, states) their initial states.
        """
        stages, mirrored = self.stages.take(owners), self.stages.symmetric[owners]
        begins = stages.kernel.with_modes(states, np.zeros(3), stages.values)
        return Pending(
            stages, begins, FIRST_ROUND_PERIODS * self.period[owners], self.loose[owners], mirrored, self.rtol
        )
