"""Try points of a search, one value for each variable, on many machines at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.engine.arrays import ArrayColumns, Status
from friso.engine.batch import RunOptions, part_of, run_chunks
from friso.engine.kernel import kernel
from friso.equations.bandwidth import faster
from friso.equations.settings import gain_states
from friso.equations.structure import shared_structure
from friso.hunting import find_attractors
from friso.hunting.criteria import settling_of_runs
from friso.remedies.catalogue import Remedy
from friso.remedies.loops import linear_flat, linear_loops
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

    `settling` [s] is the time until the stage stays within the tolerance (see `friso.hunting.criteria.settling`), and
    `looser` [s] the time for the looser tolerance. Both are infinite if the stage is not in position when the reference
    moves on or the run ends. `force` [N] is the largest force.
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
    options = RunOptions(rtol=rtol, bands=(goal.within, settings.looser_tolerance * goal.within), record_from=np.inf)
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
