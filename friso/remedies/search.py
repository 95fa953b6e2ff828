"""The best points of one remedy: differential evolution over whole generations in the engine's lanes, then surveys of
what attracts the machines."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import differential_evolution

from friso.remedies.catalogue import Remedy
from friso.remedies.goal import Goal
from friso.remedies.machines import Fleet
from friso.remedies.trials import Moves, attraction, modulus_margins, moves_of_points, quantile
from friso.stage import Stage

SEED = 27
"""Of the optimiser: the same answer for the same input."""

WORST = 1e3
"""What a point is worth at best that breaks a constraint [s]."""

BATCH, MOST = 3, 8
"""Points whose machines are surveyed at once, and how often at most until the remedy is given up."""

APART = 0.03
"""Least distance of points that are surveyed one after the other, as a share of a range."""


@dataclass(frozen=True)
class Budget:
    """Points of a generation for each variable, and generations; machines in the moves that are tried and in the
    surveys; fresh machines on which an answer is measured."""

    points: int = 10
    generations: int = 10
    machines: int = 12
    surveyed: int = 8
    fresh: int = 40


@dataclass(frozen=True)
class TriedPoints:
    """Points that were tried, one a row: their `shares` of the ranges (n, variables), and, each of shape (n,), the
    settling time of the slowest twentieth [s] and within the looser tolerance, the same with the bandwidth lower by the
    distance from hunting, the largest force [N] and least modulus margin of all but a twentieth."""

    shares: np.ndarray
    settling: np.ndarray
    looser: np.ndarray
    slower: np.ndarray
    force: np.ndarray
    margin: np.ndarray

    def take(self, numbers: np.ndarray) -> TriedPoints:
        """The points with these numbers."""
        return TriedPoints(*(column[numbers] for column in vars(self).values()))

    def broken(self, goal: Goal) -> dict[str, np.ndarray]:
        """Which points break a constraint of the goal, by its name."""
        return {
            "margin": self.margin < goal.margin,
            "force": self.force > (np.inf if goal.force_limit is None else goal.force_limit),
            "settling": ~np.isfinite(self.settling),
            "distance": ~np.isfinite(self.slower),
            "settle": np.isfinite(self.settling) & (self.settling > (np.inf if goal.settle is None else goal.settle)),
        }

    def cost(self, goal: Goal) -> np.ndarray:
        """What is minimised: the settling time, or how far constraints are broken."""
        limit = np.inf if goal.force_limit is None else goal.force_limit
        late = np.inf if goal.settle is None else goal.settle
        excess = np.maximum(0, goal.margin - self.margin)
        excess += np.where(np.isfinite(self.force), np.maximum(0, np.nan_to_num(self.force) / limit - 1), 3.0)
        excess += ~np.isfinite(self.settling) * 3.0 + ~np.isfinite(self.slower) * 1.0
        time = np.where(np.isfinite(self.settling), self.settling, 100.0)
        excess += np.maximum(0, time / late - 1)
        return np.asarray(np.where(excess > 0, WORST * (1 + excess) + time, time))


@dataclass
class Search:
    """The search for the best points of a remedy: what was `tried` so far, and of how many points that were surveyed
    something `attracted` the machines, or may have."""

    remedy: Remedy
    goal: Goal
    machines: Fleet
    drive: Stage
    budget: Budget
    report: Callable[[str], None]
    tried: list[TriedPoints] = field(default_factory=list)
    attracted: int = 0

    @property
    def points(self) -> TriedPoints:
        """All points that were tried."""
        return TriedPoints(
            *(np.concatenate(column) for column in zip(*(vars(s).values() for s in self.tried), strict=True))
        )

    def optimise(self) -> None:
        """Try points until they get no better."""
        variables = len(self.remedy.variables)

        def cost(shares: np.ndarray) -> np.ndarray:
            self.report(f"{self.remedy.name}: settings")
            self.tried.append(self.measured(np.clip(shares.T, 0, 1)))
            return self.tried[-1].cost(self.goal)

        if variables == 1:
            cost(np.linspace(0, 1, self.budget.points * 6)[None])
            best = self.points
            at = best.shares[int(best.cost(self.goal).argmin()), 0]
            near = 1 / (self.budget.points * 6)
            cost(np.clip(np.linspace(at - near, at + near, self.budget.points * 2), 0, 1)[None])
            return
        size = min(self.budget.points * variables, 40)
        start = np.random.default_rng(SEED).random((max(size, 5), variables))
        differential_evolution(
            cost,
            [(0.0, 1.0)] * variables,
            maxiter=self.budget.generations - 1,
            init=start,  # pyright: ignore[reportArgumentType]  (the stubs know names alone)
            tol=0.01,
            rng=SEED,
            polish=False,
            vectorized=True,
            updating="deferred",
        )

    def measured(self, shares: np.ndarray) -> TriedPoints:
        """Points on the machines: the moves are run only where the loop is stable and has half of the margin."""
        goal, count = self.goal, len(shares)
        few = self.machines.take(np.arange(min(6, self.machines.count)))
        margin = quantile(-modulus_margins(self.remedy, shares, few, self.drive), goal.share) * -1
        stable = np.flatnonzero(margin > goal.margin / 2)
        columns = [np.full(count, np.inf) for _ in range(4)]
        if stable.size:
            moves: Moves = moves_of_points(self.remedy, shares[stable], self.machines, goal)
            slower_moves: Moves = moves_of_points(
                self.remedy, shares[stable], self.machines, goal, slower=goal.distance
            )
            values = (moves.settling, moves.looser, slower_moves.looser, moves.force)
            for column, value in zip(columns, values, strict=True):
                column[stable] = quantile(value, goal.share)
        settling, looser, slower, force = columns
        return TriedPoints(shares, settling, looser, slower, force, margin)

    def surveyed(self) -> Iterator[np.ndarray]:
        """The best points first, shape (variables,), as far as nothing attracts the machines with them; those that
        are alike are taken for one."""
        points = self.points
        free = np.flatnonzero(~np.any([*points.broken(self.goal).values()], axis=0))
        left = points.shares[free[np.argsort(points.settling[free], kind="stable")]]
        machines = self.machines.take(np.arange(min(self.budget.surveyed, self.machines.count)))
        for _ in range(MOST):
            if not len(left):
                return
            batch = _apart(left, BATCH)
            self.report(f"{self.remedy.name}: what attracts")
            clear = attraction(self.remedy, batch, machines, self.goal).clear.mean(axis=1) >= self.goal.share
            self.attracted += int(np.count_nonzero(~clear))
            yield from batch[clear]
            left = left[np.abs(left[:, None] - batch[None]).max(axis=2).min(axis=1) > APART]


def _apart(shares: np.ndarray, most: int) -> np.ndarray:
    """The first of points that are apart from each other, so many at most."""
    chosen: list[np.ndarray] = []
    for row in shares:
        if len(chosen) < most and all(np.abs(row - other).max() > APART for other in chosen):
            chosen.append(row)
    return np.array(chosen)
