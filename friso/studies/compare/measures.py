"""Measure machines (swing, settling, force, the loop's margin), and compare them in pairs.

Medians and paired differences have 95 % intervals.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import binom

from friso.engine.arrays import ArrayColumns, Status
from friso.equations.motion import Stand
from friso.frequency.family import about_resonances, for_poles
from friso.frequency.loops import Poles
from friso.frequency.members import limit_cases
from friso.hunting.criteria import FAILED, RESTS, SWINGS, end_of_traces, outcomes, peaks_in_traces, settling_of_traces
from friso.hunting.measures import LAST_QUARTER
from friso.intervals import NORMAL_COVERAGE
from friso.stage import Stage
from friso.virtual_rig.run import RecordedRuns


@dataclass(frozen=True)
class EstimatedValue:
    """A value and its 95 % interval; NaN if unknown."""

    value: float
    low: float
    high: float


def median(values: np.ndarray) -> EstimatedValue:
    """Return the median of values (n,) and its 95 % interval, from those that are not NaN.

    Infinite values are allowed.
    """
    numbers = values[~np.isnan(values)]
    if not numbers.size:
        return EstimatedValue(np.nan, np.nan, np.nan)
    return EstimatedValue(float(np.median(numbers)), *quantile_interval(numbers, 0.5))


def quantile_interval(values: np.ndarray, share: float) -> tuple[float, float]:
    """Return the 95 % interval of a quantile of a population, from values (n,) drawn from it.

    A fraction `share` of the population lies below the quantile. The interval by order statistics (David, Nagaraja
    2003, Order Statistics, Sec. 7.1) holds for any distribution. It is infinite for too few values.
    """
    ranked = np.concatenate([[-np.inf], np.sort(values), [np.inf]])
    low, high = (int(binom.ppf(tail, values.size, share)) for tail in (0.025, 0.975))
    return float(ranked[low]), float(ranked[high + 1])


def difference(flags: np.ndarray, before: np.ndarray) -> EstimatedValue:
    """Return how much more probable an event is with a change than `before`, on paired machines.

    `flags` and `before`, (count,), are true for machines with the event. The interval is Wald's, with half a machine
    added to every cell (Agresti, Min 2005, doi:10.1002/sim.1781). The result is NaN without machines.
    """
    count = len(flags)
    if not count:
        return EstimatedValue(np.nan, np.nan, np.nan)
    gained, lost = (int(np.count_nonzero(cell)) for cell in (flags & ~before, ~flags & before))
    more, less, total = gained + 0.5, lost + 0.5, count + 2
    centre = (more - less) / total
    half = NORMAL_COVERAGE * np.sqrt((more + less) - (more - less) ** 2 / total) / total
    return EstimatedValue((gained - lost) / count, max(-1.0, float(centre - half)), min(1.0, float(centre + half)))


FREQUENCIES_PER_DECADE, SLOWEST_FACTOR, FASTEST_FACTOR = 25, 0.1, 10.0
"""Frequencies at which loops are evaluated: per decade, apart from those near resonances; the lowest, over the slowest
pole; the highest, over the fastest pole, or half the sampling frequency."""

REFINEMENT_ROUNDS, REFINED_FREQUENCIES = 2, 9
"""Refinements of the frequency at which a loop comes closest to -1, and number of frequencies in each."""


@dataclass(frozen=True)
class MachineMeasures(ArrayColumns):
    """Measures of the runs of machines, arrays of shape (count,).

    Runs that were not completed have NaN, and no peaks. `outcome` are words of `friso.hunting.criteria.run_outcome`,
    with the tolerance as band, and `counted` the distinct peaks. `settling` [s] is the longest time to settle at a
    place (`friso.hunting.criteria.settling`); infinite if the machine swings, creeps, or is not in position at the far
    end of its motion when it returns.

    `in_position` [m] is the root mean square of the deviation in the last quarter of the run. `force` [N] is the root
    mean square of the commanded force over the whole run.
    """

    outcome: np.ndarray
    counted: np.ndarray
    settling: np.ndarray
    in_position: np.ndarray
    force: np.ndarray

    @property
    def done(self) -> np.ndarray:
        """Return which runs were completed, shape (count,)."""
        return self.outcome != FAILED

    @property
    def swings(self) -> np.ndarray:
        """Return which runs swing at their end, shape (count,)."""
        return self.outcome == SWINGS

    @property
    def rests(self) -> np.ndarray:
        """Return which runs are in position at their end, shape (count,)."""
        return self.outcome == RESTS


@np.errstate(all="ignore")  # runs that fail leave infinities and NaN behind
def measure_chunk(recorded: RecordedRuns, stands: list[Stand], within: float) -> MachineMeasures:
    """Measure a chunk of runs of machines, whose reference comes to stand at `stands`.

    A machine is in position `within` [m] of its reference. Peaks are counted in the drive's log; all else is measured
    on the true motion.
    """
    time, reference = recorded.time, recorded.logged["reference"]
    deviation = recorded.true["position"] - reference
    done = recorded.statuses == Status.DONE
    outcome = outcomes(end_of_traces(time, deviation, within, done, np.asarray(stands[-1].corner)), within)
    late = deviation[:, time >= LAST_QUARTER * time[-1]]
    settling = np.where(outcome == RESTS, settling_of_traces(stands, time, deviation, within), np.inf)
    return MachineMeasures(
        outcome=outcome,
        counted=np.where(done, peaks_in_traces(time, recorded.logged["position"] - reference), 0),
        settling=np.where(done, settling, np.nan),
        in_position=np.where(done, _rms(late), np.nan),
        force=np.where(done, _rms(recorded.logged["force"]), np.nan),
    )


@dataclass(frozen=True)
class Later(ArrayColumns):
    """Runs that were continued, arrays of shape (runs,).

    `done` is true for runs that were completed, and `stays` for machines in position throughout the last half.
    """

    done: np.ndarray
    stays: np.ndarray


@np.errstate(all="ignore")
def staying_in_position(recorded: RecordedRuns, within: float) -> Later:
    """Return which longer runs were completed, and which stay `within` [m] of the reference."""
    deviation = recorded.true["position"] - recorded.logged["reference"]
    done = recorded.statuses == Status.DONE
    words = outcomes(end_of_traces(recorded.time, deviation, within, done), within, hold=recorded.time[-1] / 2)
    return Later(done, words == RESTS)


def _rms(values: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(values**2, axis=1))


@dataclass(frozen=True)
class LoopRobustness:
    """Stability and margin of the linear loop of each machine, arrays of shape (count,).

    `stable` is true if the loop is stable in all limit cases of the joint and the friction. `margin` is the least
    modulus margin among the cases, 0 if it is not stable.
    """

    stable: np.ndarray
    margin: np.ndarray


def linear_loops(stage: Stage, flat: Mapping[str, Any], count: int) -> LoopRobustness:
    """Return stability and margin of machines' linear loops, in the limit cases of a stage.

    `flat` has the machines' keys, such as "masses.cart", with SI numbers or arrays (count,).
    """
    stable, margin = np.ones(count, bool), np.full(count, np.inf)
    for limit_case in limit_cases(stage.flat()).values():
        for which, (settles, distance) in for_poles(flat, limit_case.repeated(count), _robustness):
            stable[which] &= settles
            margin[which] = np.minimum(margin[which], distance)
    return LoopRobustness(stable, np.where(stable, margin, 0.0))


def _robustness(loops: Poles) -> tuple[np.ndarray, np.ndarray]:
    """Return which loops are stable, and the least distance of each from -1, both (loops,)."""
    size, rows = np.abs(loops.continuous), np.arange(len(loops.closed))
    low = SLOWEST_FACTOR * float(np.median(size.min(axis=1)))
    high = min(loops.drive.highest, FASTEST_FACTOR * float(size.max()))
    even = np.geomspace(low, high, int(FREQUENCIES_PER_DECADE * np.log10(high / low)) + 2)
    resonant = np.nan_to_num(about_resonances(loops), nan=high)
    omega = np.sort(np.concatenate([np.broadcast_to(even, (len(rows), len(even))), resonant], axis=1), axis=1)
    distance = loops.distance(omega)
    for _ in range(REFINEMENT_ROUNDS):
        closest = distance.argmin(axis=1)
        before, after = (omega[rows, np.clip(closest + step, 0, omega.shape[1] - 1)] for step in (-1, 1))
        omega = np.linspace(before, after, REFINED_FREQUENCIES, axis=1)
        distance = loops.distance(omega)
    return loops.abscissa < 0, distance.min(axis=1)
