"""The best points of one remedy: differential evolution over whole generations in the engine's lanes, then surveys of
what attracts the machines.

Storn, Price 1997 (doi:10.1023/A:1008202821328), as SciPy has it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import brentq, differential_evolution
from scipy.stats import qmc

from friso.engine.allowance import Allowance, Exhausted, allowance
from friso.frequency.bandwidth import loop_bandwidths
from friso.remedies.catalogue import Remedy
from friso.remedies.goal import Goal
from friso.remedies.machines import Fleet
from friso.remedies.settings import RemedySettings
from friso.remedies.trials import Moves, attraction, modulus_margins, moves_of_points, quantile
from friso.stage import Stage


@dataclass(frozen=True)
class Budget:
    """Points of a generation for each variable, generations, and those about the best of these, each time; machines in
    the moves that are tried and in the surveys; fresh machines on which an answer is measured, and `further` ones where
    these leave open whether it is good enough."""

    points: int = 10
    generations: int = 16
    refined: int = 8
    machines: int = 12
    surveyed: int = 8
    fresh: int = 100
    further: int = 300


@dataclass(frozen=True)
class TriedPoints:
    """Points that were tried, one a row: their `shares` of the ranges (n, variables), and, each of shape (n,), the
    settling time of the slowest twentieth [s] and within the looser tolerance, the same with the bandwidth lower by the
    distance from hunting, the largest force [N] and least modulus margin of all but a twentieth, the bandwidth [Hz]
    (see `loop_bandwidth`) of the machine of the stage file, and how near all machines are to settling, from 0 to 1 (see
    `Search.measured`). Of those that are not `whole` moves were left out, which count as the best there may be."""

    shares: np.ndarray
    settling: np.ndarray
    looser: np.ndarray
    slower: np.ndarray
    force: np.ndarray
    margin: np.ndarray
    bandwidth: np.ndarray
    nearness: np.ndarray
    whole: np.ndarray

    def take(self, numbers: np.ndarray) -> TriedPoints:
        """The points with these numbers."""
        return TriedPoints(*(column[numbers] for column in vars(self).values()))

    def broken(self, goal: Goal) -> dict[str, np.ndarray]:
        """Which points break a constraint of the goal, by its name."""
        return {
            "bandwidth": np.isfinite(_most(goal.bandwidth_limit)) & ~(self.bandwidth <= _most(goal.bandwidth_limit)),
            "margin": self.margin < goal.margin,
            "force": self.force > _most(goal.force_limit),
            "settling": ~np.isfinite(self.settling),
            "distance": ~np.isfinite(self.slower),
            "settle": np.isfinite(self.settling) & (self.settling > _most(goal.settle)),
        }

    def meets(self, goal: Goal) -> np.ndarray:
        """Which points break no constraint."""
        return ~np.any([*self.broken(goal).values()], axis=0)

    def cost(self, goal: Goal, wanted: np.ndarray | None = None) -> np.ndarray:
        """What is minimised: the settling time, or what is `wanted` small instead; or how far it breaks constraints."""
        settings = RemedySettings.current()
        excess = np.maximum(0, goal.margin - self.margin)
        excess += np.where(np.isfinite(self.force), _excess(np.nan_to_num(self.force), goal.force_limit), 3.0)
        excess += np.nan_to_num(_excess(self.bandwidth, goal.bandwidth_limit), nan=3.0)
        excess += 4.0 * (1 - self.nearness)
        time = np.where(np.isfinite(self.settling), self.settling, 100.0)
        excess += _excess(time, goal.settle)
        minimised = time if wanted is None else wanted
        return np.asarray(np.where(self.meets(goal), minimised, settings.worst_time * (1 + excess) + time))


def _most(limit: float | None) -> float:
    return np.inf if limit is None else limit


@np.errstate(over="ignore")  # a force that is not finite counts otherwise
def _excess(values: np.ndarray, limit: float | None) -> np.ndarray:
    """By what share values are above a limit."""
    return np.maximum(0, values / _most(limit) - 1)


@dataclass
class Search:
    """The search for the best points of a remedy on `machines`, those that it takes having to do on `fresh` ones too:
    what was `tried` so far, of how many points that were surveyed something `attracted` the machines, or may have, and
    whether it was `cut`.
    """

    remedy: Remedy
    goal: Goal
    machines: Fleet
    fresh: Fleet
    drive: Stage
    budget: Budget
    report: Callable[[str], None]
    tried: list[TriedPoints] = field(default_factory=list)
    attracted: int = 0
    cut: bool = False
    slowest: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def points(self) -> TriedPoints:
        """The points that were tried on all machines."""
        return (begun := self.begun).take(np.flatnonzero(begun.whole))

    @property
    def begun(self) -> TriedPoints:
        """All points that were tried, those too that were given up before they had been tried on all machines."""
        return TriedPoints(
            *(np.concatenate(column) for column in zip(*(vars(s).values() for s in self.tried), strict=True))
        )

    def optimise(
        self, wanted: Callable[[np.ndarray], np.ndarray] | None = None, start: np.ndarray | None = None
    ) -> None:
        """Try points until they get no better, or until that takes too much work (`cut`): the settling time, or what is
        `wanted` small, from points (points, variables) to numbers (points,). A search of several variables begins with
        the points `start`, if any."""
        with self._allowed(self._work):
            self._optimise(wanted, start)

    def tries(self, points: np.ndarray) -> Iterator[np.ndarray]:
        """Try points (points, variables), a few at a time: those of them that break nothing."""
        tuning = RemedySettings.current()
        for few in np.array_split(points, -(-len(points) // tuning.points_looked_at)):
            self.report(f"{self.remedy.name}: trying settings")
            with self._allowed(self._work):
                self.tried.append(self.measured(few))
            if self.cut:
                return
            yield few[self.tried[-1].meets(self.goal)]

    def looked_at(self, points: Iterator[np.ndarray]) -> Iterator[np.ndarray]:
        """Points (variables,) that are looked at further, until finding the next one takes too much work (`cut`)."""
        settings = RemedySettings.current()
        left = settings.looking_work * self._work
        while True:
            point = None
            with self._allowed(left) as spent:
                point = next(points, None)
            if point is None:
                return
            yield point
            left -= spent.used

    @property
    def _work(self) -> float:
        """What a search may take."""
        settings = RemedySettings.current()
        return settings.search_work * (settings.setting_work_share if self.remedy.of_setting else 1.0)

    @contextmanager
    def _allowed(self, work: float) -> Iterator[Allowance]:
        """So much work; where it does not suffice, the search is `cut`."""
        with allowance(work) as spent:
            try:
                yield spent
            except Exhausted:
                self.cut = True

    def _optimise(self, wanted: Callable[[np.ndarray], np.ndarray] | None, start: np.ndarray | None) -> None:
        tuning = RemedySettings.current()
        variables = len(self.remedy.variables)
        if variables == 0:
            self.tried.append(self.measured(np.zeros((1, 0))))
            return

        def cost(shares: np.ndarray, most: np.ndarray | float = np.inf) -> np.ndarray:
            self.report(f"{self.remedy.name}: trying settings")
            points = np.clip(shares.T, 0, 1)
            small = None if wanted is None else wanted(points)
            self.tried.append(self.measured(points, most, small))
            return self.tried[-1].cost(self.goal, small)

        if variables == 1:
            count = self.budget.points * 6
            grid = np.linspace(0, 1, count)
            cost(np.union1d(grid, self._at_the_limit(grid))[None])
            points = self.points
            best = points.cost(self.goal, None if wanted is None else wanted(points.shares)).argmin()
            at = points.shares[int(best), 0]
            cost(np.clip(np.linspace(at - 1 / count, at + 1 / count, self.budget.points * 2), 0, 1)[None])
            return
        size = max(5, min(self.budget.points * variables, tuning.generation_points))
        drawn = np.random.default_rng(tuning.optimiser_seed).random((size, variables))
        if start is not None:
            few = start[: size // 2]
            drawn[: len(few)] = few
        _evolve(cost, drawn, [(0.0, 1.0)] * variables, self.budget.generations)
        for away in tuning.near_ranges:
            points = self.points
            costs = points.cost(self.goal, None if wanted is None else wanted(points.shares))
            best = points.shares[int(costs.argmin())]
            ends = [(max(0.0, at - away), min(1.0, at + away)) for at in best]
            low, high = np.array(ends).T
            near = low + (high - low) * drawn
            near[0] = best
            _evolve(cost, near, ends, self.budget.refined)

    def _at_the_limit(self, grid: np.ndarray) -> list[float]:
        """Where between shares of its range a remedy of one variable comes to the limit of the bandwidth from below."""
        settings = RemedySettings.current()
        limit = self.goal.bandwidth_limit
        if limit is None:
            return []

        def above(shares: np.ndarray) -> np.ndarray:
            return np.log(self._bandwidth(shares[:, None]) / (limit * (1 - settings.bandwidth_reserve)))

        over = above(grid)
        passed = np.flatnonzero((over[:-1] < 0) & (over[1:] >= 0))
        roots: Any = [brentq(lambda share: above(np.array([share]))[0], grid[k], grid[k + 1]) for k in passed]
        return roots

    def _bandwidth(self, shares: np.ndarray) -> np.ndarray:
        """The bandwidths of points (points, variables) on the machine of the stage file [Hz]."""
        return loop_bandwidths(self.remedy.stage, self.remedy.changes(shares), len(shares))

    def measured(
        self, shares: np.ndarray, most: np.ndarray | float = np.inf, wanted: np.ndarray | None = None
    ) -> TriedPoints:
        """Points on the machines: the moves are run only where the loop is stable and has half of the margin and, of
        remedies that vary more than the bandwidth, this is not far above its limit: such moves chatter and would take
        most of the work. A point is near to settling in so far as machines settle, within the tolerance, the looser
        one, and that at the lower bandwidth: where none is in position, the search sees where a few are. A point is
        given up as soon as it costs more than `most` whatever the moves bring that are left; those machines that are
        the slowest most often are tried first."""
        settings = RemedySettings.current()
        goal, count, machines = self.goal, len(shares), self.machines.count
        margin = quantile(-modulus_margins(self.remedy, shares, self.machines, self.drive), goal.share) * -1
        bandwidth = self._bandwidth(shares)
        far = bandwidth > settings.far_above_limit * _most(goal.bandwidth_limit)
        stable = np.flatnonzero((margin > goal.margin / 2) & ~(far & (len(self.remedy.variables) > 1)))
        settling, looser, slower, force = columns = [np.full((count, machines), np.inf) for _ in range(4)]
        for column in columns:
            column[stable] = 0.0
        whole = np.ones(count, bool)

        def so_far() -> TriedPoints:
            nearness = np.mean(np.isfinite(columns[:3]), axis=(0, 2))
            times, loosely, slowly, forces = (quantile(column, goal.share) for column in columns)
            return TriedPoints(shares, times, loosely, slowly, forces, margin, bandwidth, nearness, whole)

        def worth_it(left: np.ndarray) -> np.ndarray:
            goes_on = (so_far().cost(goal, wanted) <= most)[left]
            whole[left[~goes_on]] = False
            return left[goes_on]

        if self.slowest.size != machines:
            self.slowest = np.zeros(machines)
        order = np.argsort(-self.slowest, kind="stable")
        left = worth_it(stable)
        for part in (order[: settings.first_machines], order[settings.first_machines :]):
            if left.size and part.size:
                moves: Moves = moves_of_points(self.remedy, shares[left], self.machines.take(part), goal)
                at = np.ix_(left, part)
                settling[at], looser[at], force[at] = moves.settling, moves.looser, moves.force
                left = worth_it(left)
        rests = np.isfinite(looser[left]).any(axis=1)
        slower[left[~rests]] = np.inf  # those that settle nowhere are not asked whether they do at a lower bandwidth
        left = left[rests]
        for part in (order[: settings.first_machines], order[settings.first_machines :]):
            if left.size and part.size:
                some = self.machines.take(part)
                moves = moves_of_points(self.remedy, shares[left], some, goal, slower=goal.distance)
                slower[np.ix_(left, part)] = moves.looser
                left = worth_it(left)
        settle = stable[np.isfinite(settling[stable]).all(axis=1) & whole[stable]]
        self.slowest += np.bincount(settling[settle].argmax(axis=1), minlength=machines)
        return so_far()

    def _whole(self, batch: np.ndarray, wanted: Callable[[np.ndarray], np.ndarray] | None) -> np.ndarray:
        """Those of points that were tried which break nothing on all machines, the best first (see `surveyed`)."""
        left = ~_same(batch, self.points.shares).any(axis=1)
        if left.any():
            self.tried.append(self.measured(batch[left]))
        points = self.points
        at = _same(batch, points.shares).argmax(axis=1)
        at = at[points.meets(self.goal)[at]]
        return points.shares[at[np.argsort(_order(points, wanted)[at], kind="stable")]]

    def clear(self, shares: np.ndarray) -> np.ndarray:
        """With which points (points, variables) nothing attracts the machines, shape (points,)."""
        self.report(f"{self.remedy.name}: what attracts the machines")
        machines = self.machines.take(np.arange(min(self.budget.surveyed, self.machines.count)))
        clear = attraction(self.remedy, shares, machines, self.goal).clear.mean(axis=1) >= self.goal.share
        self.attracted += int(np.count_nonzero(~clear))
        return np.asarray(clear)

    def share(self, shares: np.ndarray) -> np.ndarray:
        """How large a share of the fresh machines meet the goal by their moves and margins with points (points,
        variables), shape (points,); of those with which too many lack the margin, the share that has it."""
        self.report(f"{self.remedy.name}: on other machines")
        goal = self.goal
        meets = modulus_margins(self.remedy, shares, self.fresh, self.drive) >= goal.margin
        robust = np.flatnonzero(meets.mean(axis=1) >= goal.share)
        if robust.size:
            moves = moves_of_points(self.remedy, shares[robust], self.fresh, goal)
            in_time = np.isfinite(moves.settling) & (moves.settling <= _most(goal.settle))
            meets[robust] &= in_time & (moves.force <= _most(goal.force_limit))
        return np.asarray(meets.mean(axis=1))

    def surveyed(self, wanted: Callable[[np.ndarray], np.ndarray] | None = None) -> Iterator[np.ndarray]:
        """The points first that settle soonest, or of which what is `wanted` small is least, shape (variables,), with
        which enough of the fresh machines meet the goal, as far as nothing attracts the machines with them; those that
        are alike are taken for one. After each batch without any, the next one is taken from farther away, as far as
        there are as many: the best points are often at the edge of what works. Where there are none at all, the one
        with which most of the fresh machines do."""
        settings = RemedySettings.current()
        if not self.tried:
            return
        points = self.begun
        free = np.flatnonzero(points.meets(self.goal))
        left, apart = points.shares[free[np.argsort(_order(points, wanted)[free], kind="stable")]], settings.alike_share
        away = np.full(len(left), np.inf)  # from those that were looked at
        enough, any_clear = self.goal.surely(self.fresh.count), False
        best, most = np.zeros((0, points.shares.shape[1])), 0.0
        soonest = left[:1]
        for _ in range(settings.most_batches):
            left, away = left[away > settings.alike_share], away[away > settings.alike_share]
            if not len(left):
                break
            while (
                len(batch := _apart(left[away > apart], settings.points_looked_at, apart)) < settings.points_looked_at
                and apart > settings.alike_share
            ):
                apart = max(settings.alike_share, apart / settings.widened_factor)
            looked_at, batch = batch, self._whole(batch, wanted)
            away = np.minimum(away, _distance(left, looked_at[~_same(looked_at, batch).any(axis=1)]))
            if not len(batch):
                continue
            share = self.share(batch)
            if share.max() > most:
                best, most = batch[[share.argmax()]], share.max()
            few = _apart(batch[share >= enough], settings.survey_batch, settings.apart_share)
            clear = self.clear(few) if len(few) else np.zeros(0, bool)
            any_clear |= bool(clear.any())
            if clear.any() and not _same(few[clear][:1], soonest).any():
                yield from self._closer(few[clear][0], wanted)
            yield from few[clear]
            apart = (
                settings.alike_share
                if clear.any()
                else settings.widened_factor * max(apart, settings.apart_share if len(few) else settings.alike_share)
            )
            away = np.minimum(away, _distance(left, np.concatenate([batch[share < enough], few])))
            away[_distance(left, few[~clear]) <= settings.apart_share] = 0.0
        if not any_clear and len(best) and most < enough:
            yield from best[self.clear(best)]

    def _closer(self, point: np.ndarray, wanted: Callable[[np.ndarray], np.ndarray] | None) -> list[np.ndarray]:
        """Better points than one, (variables,), that was taken since something attracts with those that are better, or
        too few machines meet the goal with them: of those drawn around it, and then around the one that is taken
        instead, the best first."""
        settings = RemedySettings.current()
        goal, closer = self.goal, list[np.ndarray]()
        cost = self.measured(point[None]).cost(goal, None if wanted is None else wanted(point[None]))[0]
        for number in range(settings.most_closer):
            low, high = np.clip(point - settings.around_share, 0, 1), np.clip(point + settings.around_share, 0, 1)
            drawn = low + (high - low) * qmc.Sobol(point.size, rng=settings.optimiser_seed + number).random(
                settings.points_around
            )
            small = None if wanted is None else wanted(drawn)
            self.tried.append(tried := self.measured(drawn, cost, small))
            costs = np.where(tried.whole, tried.cost(goal, small), np.inf)
            better = _apart(
                drawn[np.argsort(costs, kind="stable")[: np.count_nonzero(costs < cost)]],
                settings.points_looked_at,
                settings.alike_share,
            )
            robust = better[self.share(better) >= goal.surely(self.fresh.count)] if len(better) else better
            taken = next((one for one in robust if self.clear(one[None])[0]), None)
            if taken is None:
                continue
            point, cost = taken, costs[_same(taken[None], drawn)[0]][0]
            closer.insert(0, point)
        return closer


def _order(points: TriedPoints, wanted: Callable[[np.ndarray], np.ndarray] | None) -> np.ndarray:
    """By what points are sorted, shape (n,): their settling time, or what is `wanted` small instead."""
    return points.settling if wanted is None else wanted(points.shares)


def _same(shares: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Which points (points, variables) are which of others, shape (points, others)."""
    return (shares[:, None] == others[None]).all(axis=2)


def _distance(shares: np.ndarray, others: np.ndarray) -> np.ndarray:
    """How far points (points, variables) are from the nearest of others, shape (points,); infinitely without any."""
    return np.abs(shares[:, None] - others[None]).max(axis=2, initial=0.0).min(axis=1, initial=np.inf)


def _evolve(
    cost: Callable[[np.ndarray, np.ndarray | float], np.ndarray],
    start: np.ndarray,
    ends: list[tuple[float, float]],
    generations: int,
) -> None:
    """Differential evolution from points (points, variables) between `ends`. A point takes the place of the one that it
    is tried against only if it costs less than that, so `cost` is told how much that may be."""
    settings = RemedySettings.current()
    most: np.ndarray | float = np.inf

    def bounded(points: np.ndarray) -> np.ndarray:
        nonlocal most
        costs = cost(points, most)
        if not np.ndim(most):
            most = float(costs.max())  # before the first generation has ended, their order is not told
        return costs

    def ended(intermediate_result: Any) -> bool:
        nonlocal most
        most = intermediate_result.population_energies.copy()
        return _agree(intermediate_result)

    differential_evolution(
        bounded,
        ends,
        maxiter=generations - 1,
        init=start,  # pyright: ignore[reportArgumentType]  (the stubs know names alone)
        tol=0.0,
        atol=-1,  # never by itself, not even where all costs are the same
        callback=ended,
        rng=settings.optimiser_seed,
        polish=False,
        vectorized=True,
        updating="deferred",
    )


def _agree(intermediate_result: Any) -> bool:
    """Whether the points of a generation break no constraint and are as good as each other: before that, they may all
    be as bad."""
    settings = RemedySettings.current()
    costs = intermediate_result.population_energies
    return bool(costs.max() < settings.worst_time and costs.std() <= settings.agreed_cost * costs.mean())


def _apart(shares: np.ndarray, most: int, apart: float) -> np.ndarray:
    """The first of points that are so far apart from each other, so many at most."""
    chosen: list[np.ndarray] = []
    for row in shares:
        if len(chosen) < most and all(np.abs(row - other).max() > apart for other in chosen):
            chosen.append(row)
    return np.array(chosen).reshape(len(chosen), shares.shape[1])
