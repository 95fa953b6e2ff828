"""What becomes of stages that start from many states: followed in rounds, each longer than the one before, until they
rest or repeat themselves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from friso.engine.arrays import STATISTICS, Status
from friso.engine.batch import CAPACITY
from friso.hunting.attractors.recurrence import Recurrence, recurrence
from friso.hunting.cycle.ensemble import Ensemble, done
from friso.hunting.cycle.find import COARSE_RTOL
from friso.hunting.cycle.rest import wait
from friso.hunting.cycle.return_map import PATIENCE, trace_returns
from friso.hunting.cycle.swings import last_swings

RTOL, TIGHT = 1e-7, 1e-9
"""Relative tolerance of these runs, and that at which they are tried again where they alone tell."""

PERIODS, LONGER = 24.0, 3.0
"""Typical periods in the first round, and how many times as long as the last the next round is."""

TYPICAL = 0.3
"""Distance, in units of the deflection of the loop by the break-away force, whose cycle is typical."""

AT_MOST = 10.0
"""The same of runs that have not swung so far."""

KEPT = 32
"""Swings at the end of a round that are looked at."""

ROOM, MOST_SWINGS = 1 << 20, 1 << 14
"""Room for turning points of all runs of a round together, and of one: runs that need more are run again."""

BUDGET = 4_000_000
"""Steps that a run takes in a round at most."""

LEG = 0.25
"""Legs of a swing are at least this share of peak to peak."""

OFTEN = 3
"""How often a run turns in the second half of a round, after such legs, that swings: one that creeps home does not."""

RESOLVED = 0.0004
"""Least swing that is looked at, in units of the deflection of the loop by the break-away force."""

CREEPS = np.geomspace(0.001, 1.0, 16)
"""Distances, in the same units, that are tried for the one from which on a stage breaks away."""

ACROSS = 0.05
"""How far a stage that breaks away swings across its reference at least, as a share of the distance."""

WOUND = 4.0
"""For how many waits a stage has to stand still within half of the distance from which it would break away, until it
surely rests: the integrator has passed from one limit to the other twice by then."""

SHOWN = 24.0
"""For how many of the longest waits a stage is followed that has not swung in a round: swings that are nearly as slow
repeat themselves in the second half of that, and creeping home is over."""


@dataclass(frozen=True)
class Pending:
    """Runs on their way, each of a stage of the ensemble `stages`, one for each; their states (runs, kept) now; the
    durations of their next round [s], the distance from which they break away, `loose` [m], and whether their mirror
    images are motions too, `mirrored`, each of shape (runs,); and the relative tolerance."""

    stages: Ensemble
    states: np.ndarray
    durations: np.ndarray
    loose: np.ndarray
    mirrored: np.ndarray
    rtol: float = RTOL

    def take(self, numbers: np.ndarray) -> Pending:
        """The runs with these numbers."""
        arrays = (self.states, self.durations, self.loose, self.mirrored)
        return Pending(self.stages.take(numbers), *(array[numbers] for array in arrays), rtol=self.rtol)


@dataclass(frozen=True)
class Ends:
    """How a round ended, arrays of shape (runs,): in what `states`, (runs, kept), which runs were `completed`, which
    ran `away` from their reference instead, which surely `rest`, the `steps` that they took, and how their last swings
    repeat, with where these turn [m] and when [s], (runs, swings)."""

    states: np.ndarray
    completed: np.ndarray
    away: np.ndarray
    rest: np.ndarray
    steps: np.ndarray
    repeats: Recurrence
    values: np.ndarray
    times: np.ndarray

    @property
    def swing(self) -> np.ndarray:
        """Which runs swing, whether they repeat themselves yet or not, shape (runs,)."""
        return (self.repeats.swings > 0) | (np.isfinite(self.values).sum(axis=1) >= OFTEN)

    def take(self, numbers: np.ndarray) -> Ends:
        """Those of the runs with these numbers."""
        arrays = (self.values[numbers], self.times[numbers])
        flags = (self.completed[numbers], self.away[numbers], self.rest[numbers], self.steps[numbers])
        return Ends(self.states[numbers], *flags, self.repeats.take(numbers), *arrays)


def typical_period(stages: Ensemble) -> np.ndarray:
    """About the period of a cycle [s], shape (count,)."""
    return 2 * (wait(stages, TYPICAL * stages.length) + 2 * np.pi / stages.number("rate"))


def loose_from(stages: Ensemble) -> np.ndarray:
    """The distance [m] up to which a stage creeps home, and from which on it breaks away, shape (count,)."""
    distances = CREEPS * stages.length[:, None]
    sides = (1.0,) if stages.symmetric.all() else (1.0, -1.0)
    returns = np.max([trace_returns(stages, distances, COARSE_RTOL, side).returns for side in sides], axis=0)
    breaks = returns > ACROSS * distances
    first = np.where(breaks.any(axis=1), breaks.argmax(axis=1), len(CREEPS) - 1)
    return distances[np.arange(stages.count), first]


def one_round(runs: Pending, budget: float = BUDGET) -> tuple[Pending, Ends]:
    """Follow runs for their durations, in so many steps each at most: the runs from where they are then, and how they
    ended."""
    stages, count = runs.stages, runs.stages.count
    least = RESOLVED * stages.length
    results = stages.run(
        runs.states,
        runs.durations,
        runs.rtol,
        with_modes=True,
        window=0.5,
        record_from=np.inf,
        least_swing=least,
        room=max(CAPACITY, min(MOST_SWINGS, ROOM // count)),
        budget=int(min(budget, BUDGET)),
    )
    completed, away = done(results), np.equal(results.statuses, Status.DIVERGED)
    high, low, steps = (
        results.statistics[:, STATISTICS.index(name)] for name in ("deviation_max", "deviation_min", "attempted")
    )
    values, times = last_swings(results, np.maximum(LEG * (high - low), least), KEPT)
    standing = _stands_still(stages, results.ends, high - low, runs.durations, runs.loose)
    repeats = recurrence(values, times, runs.mirrored)
    rest = completed & standing & (repeats.swings == 0)  # one that repeats itself may do so about home for ever
    ends = Ends(results.ends, completed, away, rest, steps, repeats, values, times)
    return replace(runs, states=results.ends), ends


def _stands_still(
    stages: Ensemble, ends: np.ndarray, swing: np.ndarray, durations: np.ndarray, loose: np.ndarray
) -> np.ndarray:
    """Which runs have moved so little, for so long, that they will not break away again."""
    distances = np.abs(ends[:, stages.sticking])
    home = (swing < loose / 2) & (distances < loose / 2) & (durations / 2 > WOUND * wait(stages, loose))
    aside = (swing < 2 * RESOLVED * stages.length) & (durations / 2 > 2 * PATIENCE * wait(stages, distances))
    return home | aside


def lengthened(runs: Pending, swing: np.ndarray) -> Pending:
    """The same, with a longer round before them: of those that do not `swing`, shape (runs,), as long as shows that
    they rest, or swing slowly, but not so much longer that one which begins to swing does so for most of it."""
    least = np.where(swing, 0.0, np.minimum(SHOWN * wait(runs.stages, runs.loose), AT_MOST * runs.durations))
    return replace(runs, durations=np.maximum(LONGER * runs.durations, least))
