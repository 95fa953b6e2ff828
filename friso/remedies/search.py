"""Search the best points of one remedy, and survey whether the machines hunt there.

A point is one value for each variable of the remedy. The search is differential evolution (Storn and Price 1997,
doi:10.1023/A:1008202821328), as in SciPy. Whole generations of points are simulated at once, each on many machines.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.optimize import brentq, differential_evolution
from scipy.stats import qmc

from friso.engine.allowance import Allowance, Exhausted, allowance
from friso.engine.arrays import ArrayColumns, Status
from friso.engine.batch import RunOptions, part_of, run_chunks
from friso.engine.kernel import kernel
from friso.equations.bandwidth import faster
from friso.equations.settings import gain_states
from friso.equations.structure import shared_structure
from friso.frequency.bode import loop_bandwidths
from friso.hunting import find_attractors
from friso.hunting.criteria import settling_of_runs
from friso.remedies.catalogue import Remedy, linear_flat, linear_loops
from friso.remedies.machines import Fleet, Goal
from friso.remedies.settings import settings
from friso.stage import Stage
from friso.stage.controllers import FORCE_LIMIT

RANKING_RTOL = 1e-5
"""Relative tolerance of the moves by which settings are compared. It halves the number of steps; settling times are off
by at most a thousandth, usually by a tenth of that."""


@dataclass(frozen=True)
class Moves(ArrayColumns):
    """Moves of points on machines, all arrays of shape (points, machines).

    `settling` [s] is the time until the stage stays within the tolerance (see `friso.hunting.criteria.run_outcome`),
    and `looser` [s] the time for the looser tolerance. Both are infinite if the stage is not in position when the
    reference moves on or the run ends. `force` [N] is the largest force.
    """

    settling: np.ndarray
    looser: np.ndarray
    force: np.ndarray

    def slowest(self, share: float) -> np.ndarray:
        """Return the time [s] within which a fraction `share` of machines settles, shape (points,)."""
        return quantile(self.settling, share)


def quantile(values: np.ndarray, share: float) -> np.ndarray:
    """Return for each row the least value that a fraction `share` of the row does not exceed."""
    ordered = np.sort(values, axis=-1)
    return np.asarray(ordered[..., int(np.ceil(share * values.shape[-1])) - 1])


LOOSER_TOLERANCE = 10.0
"""Factor of a looser tolerance, which shows how near machines are to settling."""


@np.errstate(all="ignore")  # runs that fail leave infinities behind
def moves_of_points(
    remedy: Remedy, shares: np.ndarray, machines: Fleet, goal: Goal, slower: float = 1.0, rtol: float = RANKING_RTOL
) -> Moves:
    """Simulate the moves of all machines with the settings of each point of a search.

    `shares`, (points, variables), are coordinates from 0 to 1 over the remedy's ranges. The bandwidth is lower by the
    factor `slower`. `rtol` is the solver's relative tolerance.
    """
    count = len(shares) * machines.count
    flat = faster(machines.laid_over(remedy.stage, remedy.changes(shares), len(shares)), 1 / slower)
    settling, looser, force = (np.full(count, np.inf) for _ in range(3))
    options = RunOptions(rtol=rtol, bands=(goal.within, LOOSER_TOLERANCE * goal.within), record_from=np.inf)
    most = np.broadcast_to(flat.get(FORCE_LIMIT, np.inf), (count,))  # any excess is rounding
    for runs in run_chunks(kernel(shared_structure(flat)), flat, count, options):
        done = np.equal(runs.results.statuses, Status.DONE)
        settling[runs.numbers] = np.where(done, settling_of_runs(runs.part(flat), runs, "inner"), np.inf)
        looser[runs.numbers] = np.where(done, settling_of_runs(runs.part(flat), runs, "outer"), np.inf)
        largest = np.minimum(runs.statistic("force_peak"), most[runs.numbers])
        force[runs.numbers] = np.where(done, largest, np.inf)
    shape = len(shares), machines.count
    return Moves(settling.reshape(shape), looser.reshape(shape), force.reshape(shape))


def timing(drive: Stage) -> dict[str, float]:
    """Return the keys of a stage's [drive] as numbers in SI, such as sample time and delay."""
    return {key: value for key, value in drive.flat().items() if key.startswith("drive.")}


@np.errstate(all="ignore")
def modulus_margins(
    remedy: Remedy, shares: np.ndarray, machines: Fleet, drive: Stage, slower: float = 1.0
) -> np.ndarray:
    """Return the least modulus margin of the limit cases, (points, machines); 0 if unstable.

    `shares` are the points of a search, as coordinates. Sampling and delay are taken from the stage `drive`, and the
    bandwidth is lowered by the factor `slower`. Controllers with other gains at standstill get the smaller margin of
    both sets.
    """
    flat = {**machines.laid_over(remedy.stage, remedy.changes(shares), len(shares)), **timing(drive)}
    flat = faster(flat, 1 / slower)
    count = len(shares) * machines.count
    margins = [linear_loops(remedy.stage, linear_flat(drive, state), count).margin for state in gain_states(flat)]
    return np.min(margins, axis=0).reshape(len(shares), machines.count)


@dataclass(frozen=True)
class Attraction(ArrayColumns):
    """Which machines hunt at which points, as arrays of shape (points, machines).

    `attracts` is true if a machine hunts at its bandwidth, or at one lower by up to the goal's distance. `decided` is
    true if the simulations sufficed to say so. `certain` is true if, in addition, nothing can attract that no
    simulation starts from.
    """

    attracts: np.ndarray
    decided: np.ndarray
    certain: np.ndarray

    @classmethod
    def none(cls, machines: int) -> Attraction:
        """Return the result for one point at which none of so many `machines` hunts, for certain."""
        return cls(np.zeros((1, machines), bool), *(np.ones((1, machines), bool) for _ in range(2)))

    def of_some(self, other: Attraction, machines: np.ndarray) -> Attraction:
        """Return a copy in which the `machines` with these indices have the results of `other`."""
        columns = {name: column.copy() for name, column in vars(self).items()}
        for name, column in columns.items():
            column[:, machines] = getattr(other, name)
        return Attraction(**columns)

    @property
    def clear(self) -> np.ndarray:
        """Tell which machines do not hunt, as far as simulations show, shape (points, machines)."""
        return ~self.attracts & self.decided

    @property
    def surely_clear(self) -> np.ndarray:
        """Tell which machines certainly do not hunt, shape (points, machines)."""
        return ~self.attracts & self.certain


@np.errstate(all="ignore")
def attraction(
    remedy: Remedy, shares: np.ndarray, machines: Fleet, goal: Goal, enough: float | None = None, at_once: bool = False
) -> Attraction:
    """Survey whether machines hunt at points of a search, given by coordinates `shares`.

    Each machine is surveyed at the point's bandwidth and at lower ones, down to the goal's distance. The lowest
    bandwidth comes first, because most machines hunt there; or all come `at_once`, which is faster if hardly any
    machine hunts.

    An undecided bandwidth ends the survey of a machine. The survey of a point ends once fewer than the fraction
    `enough` of its machines are still quiet. Simulations start from many states; motions that have converged count as
    attracted.
    """
    flat = machines.laid_over(remedy.stage, remedy.changes(shares), len(shares))
    shape = len(shares), machines.count
    attracts, decided, certain = np.zeros(shape, bool), np.ones(shape, bool), np.ones(shape, bool)
    factors = np.array([1 / goal.distance, goal.distance**-0.5, 1.0])
    for some in factors[None] if at_once else factors[:, None]:
        left = ~attracts & decided
        if enough is not None:
            left &= left.mean(axis=1, keepdims=True) >= enough
        numbers = np.flatnonzero(left)
        if not numbers.size:
            break
        slowed = faster(part_of(flat, np.tile(numbers, some.size)), np.repeat(some, numbers.size))
        attracted = find_attractors(slowed, some.size * numbers.size, close_orbits=False)
        by_factor = some.size, numbers.size
        attracts.flat[numbers] |= attracted.attracts.reshape(by_factor).any(axis=0)
        decided.flat[numbers] &= attracted.decided.reshape(by_factor).all(axis=0)
        certain.flat[numbers] &= attracted.certain.reshape(by_factor).all(axis=0)
    return Attraction(attracts, decided, certain)


ALTERNATIVES_SHARE = 0.5
"""Fraction of generations and work of other searches once the speed of the controller works and no limit of it is
stated. They find alternatives near that speed, which need not be the very best."""


@dataclass(frozen=True)
class Budget:
    """Sizes of a search: points, generations and machines.

    `points` counts the points of a generation for each variable. `refined` further generations search around the best
    points. `machines` make the moves of the search, and `surveyed` of them are surveyed for hunting. An answer is
    measured on `fresh` machines, which are more. `further` machines are added if these leave the answer open.
    """

    points: int = 10
    generations: int = 16
    refined: int = 8
    machines: int = 12
    surveyed: int = 8
    fresh: int = 100
    further: int = 300

    def shortened(self) -> Budget:
        """Return the budget of searches for alternatives, once a remedy works."""
        some = ALTERNATIVES_SHARE
        return replace(self, generations=round(some * self.generations), refined=round(some * self.refined))


WORST_TIME = 1e3  # [s]
"""Settling time that ranks a point that breaks a constraint behind all others, longer than any move."""


@dataclass(frozen=True)
class TriedPoints(ArrayColumns):
    """The settings that were tried, one point in each row, and how the machines performed.

    `shares` are coordinates from 0 to 1 over the ranges, (n, variables); all other arrays have shape (n,). Three
    settling times [s] hold for the fraction `goal.share` of the machines: `settling` within the tolerance, `looser`
    within a looser one, and `slower` within the looser one at a bandwidth lower by the distance from hunting. Largest
    force [N] and least modulus margin hold for this fraction, too.

    The bandwidth [Hz] is that of the stage file's machine, where its loop last crosses 0 dB. `nearness`, from 0 to 1,
    grows with the number of machines that settle or nearly settle.

    Points that are not `whole` were stopped early, and their missing moves count as the best possible.
    """

    shares: np.ndarray
    settling: np.ndarray
    looser: np.ndarray
    slower: np.ndarray
    force: np.ndarray
    margin: np.ndarray
    bandwidth: np.ndarray
    nearness: np.ndarray
    whole: np.ndarray

    @classmethod
    def none(cls, variables: int) -> TriedPoints:
        """Return a table without any points, for `variables` variables."""
        none = np.zeros(0)
        return cls(np.zeros((0, variables)), none, none, none, none, none, none, none, np.zeros(0, bool))

    def broken(self, goal: Goal) -> dict[str, np.ndarray]:
        """Return for each part of the goal, by name, which points break it, shape (n,)."""
        return {
            "bandwidth": np.isfinite(_most(goal.bandwidth_limit)) & ~(self.bandwidth <= _most(goal.bandwidth_limit)),
            "margin": self.margin < goal.margin,
            "force": self.force > _most(goal.force_limit),
            "settling": ~np.isfinite(self.settling),
            "distance": ~np.isfinite(self.slower),
            "settle": np.isfinite(self.settling) & (self.settling > _most(goal.settle)),
        }

    def meets(self, goal: Goal) -> np.ndarray:
        """Return which settings meet every part of the goal, shape (n,)."""
        return ~np.any([*self.broken(goal).values()], axis=0)

    def cost(self, goal: Goal) -> np.ndarray:
        """Return the cost of points, (n,): the settling time.

        Points that break constraints cost more than all others, the more they break them.
        """
        excess = np.maximum(0, goal.margin - self.margin)
        excess += np.where(np.isfinite(self.force), _excess(np.nan_to_num(self.force), goal.force_limit), 3.0)
        excess += np.nan_to_num(_excess(self.bandwidth, goal.bandwidth_limit), nan=3.0)
        excess += 4.0 * (1 - self.nearness)
        time = np.where(np.isfinite(self.settling), self.settling, 100.0)
        excess += _excess(time, goal.settle)
        return np.asarray(np.where(self.meets(goal), time, WORST_TIME * (1 + excess) + time))


def _most(limit: float | None) -> float:
    return np.inf if limit is None else limit


@np.errstate(over="ignore")  # forces that are not finite are excluded elsewhere
def _excess(values: np.ndarray, limit: float | None) -> np.ndarray:
    """Return by which fraction values exceed a limit; 0 if they do not, or if there is none."""
    return np.maximum(0, values / _most(limit) - 1)


POINTS_LOOKED_AT = 12
"""Points tried together on fresh machines, enough to fill the lanes."""

LOOKING_WORK = 4.0
"""Work to inspect points on fresh machines, in units of the work of a search."""

SETTING_WORK_SHARE = 1 / 3
"""Fraction of the work of a search for one setting, because runs of a setting that fails go on to the end."""

GENERATION_POINTS = 40
"""Points of a generation of the optimiser. More cost moves and converge no better."""

OPTIMISER_SEED = 27
"""Seed of the optimiser. A fixed one gives equal answers for equal input."""

NEAR_RANGES = (0.12, 0.12, 0.03)
"""Widths of the ranges, relative to the whole range, in which the search continues around its best point, in
turn."""

HOPEFUL_NEARNESS = 0.9
"""Fraction of machines that settle with the best point from which the search continues around it."""

HOPELESS_GENERATIONS = 4
"""Generations after which a search may be abandoned. Fewer would end a search whose first points lie badly."""

HOPELESS_NEARNESS = 0.5
"""Fraction of machines that settle with the best point below which a search is abandoned."""

BANDWIDTH_RESERVE = 1e-3
"""Distance of bandwidths from their limit, below it, to allow for rounding."""

FAR_ABOVE_LIMIT = 1.5
"""Factor above the limit of the bandwidth beyond which a point is penalised as far above."""

FIRST_MACHINES = 3
"""Machines tried first. Three of them reject most failing points at a tenth of the cost."""

ALIKE_SHARE = 0.01
"""Distance within which points are the same settings for a drive, over the ranges."""

MOST_BATCHES = 8
"""Batches of surveyed points after which a remedy whose machines all hunt does not work."""

WIDENED_FACTOR = 1.5
"""Factor on the distance of the next points after a batch with hunting."""

SURVEY_BATCH = 3
"""Points whose machines are surveyed at once. Fewer leave cores idle; more are surveyed in vain."""

APART_SHARE = 0.03
"""Smallest distance between surveyed points, over the ranges. Nearer ones hunt if their neighbour does."""

MOST_CLOSER = 4
"""Halvings of that range. Nearer points are practically equal settings."""

AROUND_SHARE = 0.02
"""Half-width of the first range in which points are drawn around another, over the ranges."""

POINTS_AROUND = 64
"""Points drawn around a point beyond the limit of what works. Fewer miss the way back."""


@dataclass
class Search:
    """Search for the best settings of a remedy, called points, on `machines`.

    Points that the search returns must also work on `fresh` machines. `tried` has all points so far. `attracted` counts
    surveyed points at which machines hunt, or may hunt. `cut` is true if the search took too much work.
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
        """Return the settings tried, without those that were stopped before all machines had moved."""
        return (begun := self.begun).take(np.flatnonzero(begun.whole))

    @property
    def begun(self) -> TriedPoints:
        """Return all settings tried, if any, including those that were stopped early."""
        return TriedPoints.joined(self.tried or [TriedPoints.none(len(self.remedy.variables))])

    def optimise(self) -> None:
        """Try settings until they no longer settle sooner, or until that takes too much work (`cut`)."""
        with self._allowed(self._work):
            self._optimise()

    def tries(self, points: np.ndarray) -> Iterator[np.ndarray]:
        """Try settings, as points (points, variables), in batches; yield those that meet the goal."""
        for few in np.array_split(points, -(-len(points) // POINTS_LOOKED_AT)) if len(points) else ():
            self.report(f"{self.remedy.name}: trying settings")
            with self._allowed(self._work):
                self.tried.append(self.measured(few))
            if self.cut:
                return
            yield few[self.tried[-1].meets(self.goal)]

    def looked_at(self, points: Iterator[np.ndarray]) -> Iterator[np.ndarray]:
        """Yield points (variables,) for closer study, until finding one takes too much work.

        The search is marked as `cut` in that case.
        """
        left = LOOKING_WORK * self._work
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
        """Return the work allowed for this search, in the units of `Allowance`."""
        return settings.search_work * (SETTING_WORK_SHARE if self.remedy.of_setting else 1.0)

    @contextmanager
    def _allowed(self, work: float) -> Iterator[Allowance]:
        """Limit the work within the `with` block; if that is exceeded, mark the search as `cut`."""
        with allowance(work) as spent:
            try:
                yield spent
            except Exhausted:
                self.cut = True

    def _optimise(self) -> None:
        """Minimise the settling time over a remedy's variables.

        One variable is searched on a grid, which is then refined. Several variables are searched by differential
        evolution, then again in smaller ranges around the best point.
        """
        variables = len(self.remedy.variables)
        if variables == 0:
            self.tried.append(self.measured(np.zeros((1, 0))))
            return

        def cost(shares: np.ndarray, most: np.ndarray | float = np.inf) -> np.ndarray:
            self.report(f"{self.remedy.name}: trying settings")
            points = np.clip(shares.T, 0, 1)
            self.tried.append(self.measured(points, most))
            return self.tried[-1].cost(self.goal)

        if variables == 1:
            count = self.budget.points * 6
            grid = np.linspace(0, 1, count)
            cost(np.union1d(grid, self._at_the_limit(grid))[None])
            points = self.points
            at = points.shares[points.cost(self.goal).argmin(), 0]
            cost(np.clip(np.linspace(at - 1 / count, at + 1 / count, self.budget.points * 2), 0, 1)[None])
            return
        size = max(5, min(self.budget.points * variables, GENERATION_POINTS))
        drawn = np.random.default_rng(OPTIMISER_SEED).random((size, variables))
        _evolve(cost, drawn, [(0.0, 1.0)] * variables, self.budget.generations, self._is_hopeless)
        for away in NEAR_RANGES:
            points = self.points
            if not points.meets(self.goal).any() and points.nearness.max() < HOPEFUL_NEARNESS:
                return
            best = points.shares[points.cost(self.goal).argmin()]
            ends = [(max(0.0, at - away), min(1.0, at + away)) for at in best]
            low, high = np.array(ends).T
            near = low + (high - low) * drawn
            near[0] = best
            _evolve(cost, near, ends, self.budget.refined)

    def _is_hopeless(self, generation: int) -> bool:
        """Tell whether, after some generations, no settings let the machines nearly settle."""
        points = self.points
        return generation >= HOPELESS_GENERATIONS and points.nearness.max() < HOPELESS_NEARNESS

    def _at_the_limit(self, grid: np.ndarray) -> list[float]:
        """Return coordinates between grid points at which a variable reaches the bandwidth limit.

        The bandwidth rises through the limit there. The list is empty if the goal has no limit.
        """
        limit = self.goal.bandwidth_limit
        if limit is None:
            return []

        def above(shares: np.ndarray) -> np.ndarray:
            return np.log(self._bandwidth(shares[:, None]) / (limit * (1 - BANDWIDTH_RESERVE)))

        over = above(grid)
        passed = np.flatnonzero((over[:-1] < 0) & (over[1:] >= 0))
        roots: Any = [brentq(lambda share: above(np.array([share]))[0], grid[k], grid[k + 1]) for k in passed]
        return roots

    def _bandwidth(self, shares: np.ndarray) -> np.ndarray:
        """Return the bandwidths [Hz] of the stage file's machine at settings (points, variables)."""
        return loop_bandwidths(self.remedy.stage, self.remedy.changes(shares), len(shares))

    def measured(self, shares: np.ndarray, most: np.ndarray | float = np.inf) -> TriedPoints:
        """Simulate moves of the machines with each of several settings, and return how they perform.

        `shares` are the settings, as points (points, variables). Moves are simulated only if the loop is stable with
        half of the margin required. A remedy of several variables must also not exceed the bandwidth limit by far.
        Other moves chatter and take most of the work.

        A point is nearer to settling the more machines settle: within the tolerance, within the looser one, and within
        the looser one at the lower bandwidth. So progress shows before any machine is in position. A point is stopped
        as soon as it must cost more than `most`. The machines that are slowest most often are tried first.
        """
        goal, count, machines = self.goal, len(shares), self.machines.count
        margin = quantile(-modulus_margins(self.remedy, shares, self.machines, self.drive), goal.share) * -1
        bandwidth = self._bandwidth(shares)
        far = bandwidth > FAR_ABOVE_LIMIT * _most(goal.bandwidth_limit)
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
            goes_on = (so_far().cost(goal) <= most)[left]
            whole[left[~goes_on]] = False
            return left[goes_on]

        if self.slowest.size != machines:
            self.slowest = np.zeros(machines)
        parts = np.split(np.argsort(-self.slowest, kind="stable"), [FIRST_MACHINES])
        left = worth_it(stable)
        for part in parts:
            if left.size and part.size:
                moves: Moves = moves_of_points(self.remedy, shares[left], self.machines.take(part), goal)
                at = np.ix_(left, part)
                settling[at], looser[at], force[at] = moves.settling, moves.looser, moves.force
                left = worth_it(left)
        rests = np.isfinite(looser[left]).any(axis=1)
        slower[left[~rests]] = np.inf  # machines that settle nowhere are not run at a lower bandwidth
        left = left[rests]
        for part in parts:
            if left.size and part.size:
                some = self.machines.take(part)
                moves = moves_of_points(self.remedy, shares[left], some, goal, slower=goal.distance)
                slower[np.ix_(left, part)] = moves.looser
                left = worth_it(left)
        settle = stable[np.isfinite(settling[stable]).all(axis=1) & whole[stable]]
        self.slowest += np.bincount(settling[settle].argmax(axis=1), minlength=machines)
        return so_far()

    def _whole(self, batch: np.ndarray) -> np.ndarray:
        """Return the settings of a batch that meet the goal once all machines were run.

        Both batch and result are points (points, variables). Those that settle soonest come first.
        """
        left = ~_same(batch, self.points.shares).any(axis=1)
        if left.any():
            self.tried.append(self.measured(batch[left]))
        points = self.points
        at = _same(batch, points.shares).argmax(axis=1)
        at = at[points.meets(self.goal)[at]]
        return points.shares[at[np.argsort(points.settling[at], kind="stable")]]

    def clear(self, shares: np.ndarray) -> np.ndarray:
        """Tell with which settings, (points, variables), the surveyed machines do not hunt.

        The result has shape (points,). A fraction `goal.share` of these machines must be quiet.
        """
        self.report(f"{self.remedy.name}: what attracts the machines")
        machines = self.machines.take(np.arange(min(self.budget.surveyed, self.machines.count)))
        least = self.goal.share
        clear = attraction(self.remedy, shares, machines, self.goal, least).clear.mean(axis=1) >= least
        self.attracted += int(np.count_nonzero(~clear))
        return np.asarray(clear)

    def share(self, shares: np.ndarray) -> np.ndarray:
        """Return the fraction of fresh machines that meet the goal with each of several settings.

        Only moves and margins count. `shares` has shape (points, variables), the result (points,). If too many machines
        lack the margin, the fraction with enough margin is returned.
        """
        self.report(f"{self.remedy.name}: on other machines")
        goal = self.goal
        meets = modulus_margins(self.remedy, shares, self.fresh, self.drive) >= goal.margin
        robust = np.flatnonzero(meets.mean(axis=1) >= goal.share)
        if robust.size:
            moves = moves_of_points(self.remedy, shares[robust], self.fresh, goal)
            in_time = np.isfinite(moves.settling) & (moves.settling <= _most(goal.settle))
            meets[robust] &= in_time & (moves.force <= _most(goal.force_limit))
        return np.asarray(meets.mean(axis=1))

    def surveyed(self) -> Iterator[np.ndarray]:
        """Yield the best settings with which enough surveyed machines do not hunt (see `clear`).

        Settings are points of shape (variables,). Points that settle soonest come first. Enough fresh machines must
        meet the goal. Nearly equal points count as one. After a batch without success, the next points are taken
        farther away, because the best points are often at the limit of what works.

        If no point has enough fresh machines, the one with the most is yielded, unless surveyed machines hunt there.
        """
        points = self.begun
        free = np.flatnonzero(points.meets(self.goal))
        left, apart = points.shares[free[np.argsort(points.settling[free], kind="stable")]], ALIKE_SHARE
        away = np.full(len(left), np.inf)  # distance from the inspected points
        enough, any_clear = self.goal.surely(self.fresh.count), False
        best, most = np.zeros((0, points.shares.shape[1])), 0.0
        soonest = left[:1]
        for _ in range(MOST_BATCHES):
            left, away = left[away > ALIKE_SHARE], away[away > ALIKE_SHARE]
            if not len(left):
                break
            while (
                len(batch := _apart(left[away > apart], POINTS_LOOKED_AT, apart)) < POINTS_LOOKED_AT
                and apart > ALIKE_SHARE
            ):
                apart = max(ALIKE_SHARE, apart / WIDENED_FACTOR)
            looked_at, batch = batch, self._whole(batch)
            away = np.minimum(away, _distance(left, looked_at[~_same(looked_at, batch).any(axis=1)]))
            if not len(batch):
                continue
            share = self.share(batch)
            if share.max() > most:
                best, most = batch[[share.argmax()]], share.max()
            few = _apart(batch[share >= enough], SURVEY_BATCH, APART_SHARE)
            clear = self.clear(few) if len(few) else np.zeros(0, bool)
            any_clear |= bool(clear.any())
            if clear.any() and not _same(few[clear][:1], soonest).any():
                yield from self._closer(few[clear][0])
            yield from few[clear]
            apart = (
                ALIKE_SHARE if clear.any() else WIDENED_FACTOR * max(apart, APART_SHARE if len(few) else ALIKE_SHARE)
            )
            away = np.minimum(away, _distance(left, np.concatenate([batch[share < enough], few])))
            away[_distance(left, few[~clear]) <= APART_SHARE] = 0.0
        if not any_clear and len(best) and most < enough:
            yield from best[self.clear(best)]

    def _closer(self, point: np.ndarray) -> list[np.ndarray]:
        """Return settings near a point (variables,) that settle sooner, the soonest first.

        The `point` was taken because better ones failed: there machines hunted, or too few met the goal. New points are
        drawn at random around it. Once a better one works, further points are drawn around that one.
        """
        goal, closer = self.goal, list[np.ndarray]()
        cost = self.measured(point[None]).cost(goal)[0]
        for number in range(MOST_CLOSER):
            low, high = np.clip(point - AROUND_SHARE, 0, 1), np.clip(point + AROUND_SHARE, 0, 1)
            drawn = low + (high - low) * qmc.Sobol(point.size, rng=OPTIMISER_SEED + number).random(POINTS_AROUND)
            self.tried.append(tried := self.measured(drawn, cost))
            costs = np.where(tried.whole, tried.cost(goal), np.inf)
            better = _apart(
                drawn[np.argsort(costs, kind="stable")[: np.count_nonzero(costs < cost)]],
                POINTS_LOOKED_AT,
                ALIKE_SHARE,
            )
            robust = better[self.share(better) >= goal.surely(self.fresh.count)] if len(better) else better
            taken = next((one for one in robust if self.clear(one[None])[0]), None)
            if taken is None:
                continue
            point, cost = taken, costs[_same(taken[None], drawn)[0]][0]
            closer.insert(0, point)
        return closer


def _same(shares: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Tell which points are equal to which others, shape (points, others)."""
    return (shares[:, None] == others[None]).all(axis=2)


def _distance(shares: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return the distance of points from the nearest of the others, shape (points,).

    The distance is the largest difference of a coordinate; infinite without others.
    """
    return np.abs(shares[:, None] - others[None]).max(axis=2, initial=0.0).min(axis=1, initial=np.inf)


def _evolve(
    cost: Callable[[np.ndarray, np.ndarray | float], np.ndarray],
    start: np.ndarray,
    ends: list[tuple[float, float]],
    generations: int,
    is_hopeless: Callable[[int], bool] = lambda generation: False,
) -> None:
    """Run SciPy's differential evolution from points (points, variables) between `ends`.

    A new point replaces its rival only if it costs less; `cost` receives the rival's cost so that it can stop early.
    After each generation, `is_hopeless` receives its number and may end the search.
    """
    most: np.ndarray | float = np.inf

    def bounded(points: np.ndarray) -> np.ndarray:
        nonlocal most
        costs = cost(points, most)
        if not np.ndim(most):
            most = float(costs.max())  # until the first generation has ended, the order of its points is unknown
        return costs

    def ended(intermediate_result: Any) -> bool:
        nonlocal most
        most = intermediate_result.population_energies.copy()
        return _agree(intermediate_result) or is_hopeless(intermediate_result.nit)

    differential_evolution(
        bounded,
        ends,
        maxiter=generations - 1,
        init=start,  # pyright: ignore[reportArgumentType]  (the stubs know names alone)
        tol=0.0,
        atol=-1,  # never stop by this tolerance, even if all costs are equal
        callback=ended,
        rng=OPTIMISER_SEED,
        polish=False,
        vectorized=True,
        updating="deferred",
    )


AGREED_COST = 0.01
"""Relative difference of costs at which generations have converged."""


def _agree(intermediate_result: Any) -> bool:
    """Tell whether SciPy's search may stop: all points meet the constraints, at similar cost.

    Points that break constraints may all be equally bad; the search must then go on.
    """
    costs = intermediate_result.population_energies
    return bool(costs.max() < WORST_TIME and costs.std() <= AGREED_COST * costs.mean())


def _apart(shares: np.ndarray, most: int, apart: float) -> np.ndarray:
    """Return the first points, at most `most`, each farther than `apart` from all others taken.

    The distance of two points is the largest difference of a coordinate.
    """
    chosen: list[np.ndarray] = []
    for row in shares:
        if len(chosen) < most and all(np.abs(row - other).max() > apart for other in chosen):
            chosen.append(row)
    return np.array(chosen).reshape(len(chosen), shares.shape[1])
