"""Run stages in rounds, each longer than the last, until they rest or repeat themselves.

A run that repeats itself does so after any number of swings. How many, and after what time, is detected; an orbit is
then closed from it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from friso.engine.arrays import STATISTICS, Status
from friso.engine.batch import FIRST_TURNING_POINTS
from friso.hunting.cycle.ensemble import ArrayRows, Ensemble, done, wait
from friso.hunting.cycle.find import GUESS_RTOL, Cycles, described
from friso.hunting.cycle.guess import BREAKAWAY_WAITS, last_swings, trace_returns
from friso.hunting.cycle.shooting import Orbits, close


@dataclass(frozen=True)
class Recurrence(ArrayRows):
    """Whether and how runs repeat themselves, arrays of shape (runs,).

    - `swings`: smallest number of swings after which a run repeats (0: it does not); `time` [s]: how long they take.
    - `better`, `better_time` [s]: likewise for a larger number of swings that repeats much more closely, if there is
      one.
    - `size` [m]: peak-to-peak deviation, about its `middle` [m]; `deviation`: error of the repetition after `better`
      swings, over `size`.
    - `earlier`: this error, computed some swings earlier (NaN: too few swings).
    - `mean` [m]: mean size of single swings.

    Times and errors are NaN for a run that does not repeat.
    """

    swings: np.ndarray
    time: np.ndarray
    better: np.ndarray
    better_time: np.ndarray
    size: np.ndarray
    deviation: np.ndarray
    earlier: np.ndarray
    mean: np.ndarray
    middle: np.ndarray


MOST_REPEATING_SWINGS = 12  # [swings]
"""Longest repetition looked for. Motions that repeat after more swings count as irregular; detecting them costs
more."""

REPEATED_SWING_SHARE = 0.03  # [of the largest swing]
"""Largest difference between swings that repeat. If larger, irregular motion passes for periodic."""

CLOSER_REPETITION_SHARE = 0.2
"""Factor by which a longer repetition must reduce the error to replace a shorter one."""

COMPARED_SWINGS = 16  # [swings]
"""Number of swings compared to detect a repetition. With fewer, a slow approach to a cycle looks periodic."""


@np.errstate(all="ignore")  # swings that a run does not have are NaN
def recurrence(values: np.ndarray, times: np.ndarray, mirrored: np.ndarray) -> Recurrence:
    """Detect how the last swings of runs repeat.

    `values` [m] and `times` [s] are the turning points, shape (runs, swings), the last in the last column, NaN before
    the first. Where `mirrored`, shape (runs,), a motion may also repeat as its mirror image, after an odd number of
    swings.
    """
    runs, room = values.shape
    legs = np.abs(np.diff(values, axis=1))
    mean = np.nansum(legs, axis=1) / np.maximum(np.isfinite(legs).sum(axis=1), 1)
    finite = np.isfinite(values)
    high = np.max(values, axis=1, initial=-np.inf, where=finite)
    low = np.min(values, axis=1, initial=np.inf, where=finite)
    size, middle = high - low, (high + low) / 2
    swings, better = np.zeros(runs, np.int64), np.zeros(runs, np.int64)
    time, better_time, least, earlier = (np.full(runs, np.nan) for _ in range(4))
    for n in range(1, MOST_REPEATING_SWINGS + 1):
        compared = _compared(n)
        if room < compared + n:
            break
        deviations = _deviation(values, n, room) / size
        takes = (times[:, room - compared :] - times[:, room - compared - n : room - n]).mean(axis=1)
        same = (deviations <= REPEATED_SWING_SHARE) & (mirrored | (n % 2 == 0))
        first = same & (swings == 0)
        swings[first], time[first] = n, takes[first]
        closer = first | (same & (deviations < CLOSER_REPETITION_SHARE * least))
        better[closer], better_time[closer], least[closer] = n, takes[closer], deviations[closer]
        if room - COMPARED_SWINGS >= compared + n:
            earlier[closer] = (_deviation(values, n, room - COMPARED_SWINGS) / size)[closer]
    return Recurrence(swings, time, better, better_time, np.where(size > 0, size, 0.0), least, earlier, mean, middle)


def _deviation(values: np.ndarray, swings: int, end: int) -> np.ndarray:
    """Return how far the last turning points are from those `swings` earlier [m], shape (runs,).

    After an odd number of swings they are compared with mirror images. `values` [m], shape (runs, swings), are the
    turning points. The last are those before column `end`, and the largest difference counts.
    """
    compared = _compared(swings)
    last, before = values[:, end - compared : end], values[:, end - compared - swings : end - swings]
    return np.asarray(np.abs(last - (-1) ** swings * before).max(axis=1))


def _compared(swings: int) -> int:
    """Return how many swings to compare with earlier ones to detect a repetition after `swings`."""
    return max(swings, 4)


SURVEY_RTOL = 1e-7
"""Tolerance of surveys. In looser runs rounding errors break stuck stages away; tighter ones take longer and give
equal results."""

TIGHT_SURVEY_RTOL = 1e-9
"""Tolerance of repeated runs where only simulations show an attractor. A looser one would be no second opinion."""


@dataclass(frozen=True)
class Pending(ArrayRows):
    """Unfinished runs, one for each stage of the ensemble `stages`.

    `states`, shape (runs, kept), are the states, followed by the modes with memory. `durations` [s] are the lengths of
    the next round. `loose` [m] is the distance from which a stage breaks away. `mirrored` marks stages for which the
    mirror image of a motion is a motion too. Arrays have the shape (runs,) unless stated; `rtol` is the relative
    tolerance.
    """

    stages: Ensemble
    states: np.ndarray
    durations: np.ndarray
    loose: np.ndarray
    mirrored: np.ndarray
    rtol: float = SURVEY_RTOL


LEAST_TURNS = 3
"""Fewest turning points in the second half of a round of a stage that swings. With fewer it creeps."""


@dataclass(frozen=True)
class Ends(ArrayRows):
    """Results of a round of runs, arrays of shape (runs,).

    `states`, shape (runs, kept), are the final states, followed by the modes with memory. A run is `completed`, runs
    `away` from its reference, or certainly comes to `rest`; `steps` counts solver steps. `repeats` describes how the
    last swings repeat; `values` [m] and `times` [s] are the turning points, (runs, swings).
    """

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
        """Return which runs swing at the end of the round, shape (runs,), periodically or not."""
        return (self.repeats.swings > 0) | (np.isfinite(self.values).sum(axis=1) >= LEAST_TURNS)


TYPICAL_DISTANCE = 0.3  # [deflections at break-away]
"""Start distance of the swing whose period is the typical period, the unit of all durations."""


def typical_period(stages: Ensemble) -> np.ndarray:
    """Estimate the period of a hunting cycle [s], (count,).

    The estimate is based on the sticking time and the loop's frequency.
    """
    return 2 * (wait(stages, TYPICAL_DISTANCE * stages.length) + 2 * np.pi / stages.number("rate"))


CREEP_DISTANCES = (0.001, 1.0, 16)  # [deflections at break-away]
"""First and last distance, and number of starts, of the test for where a stage breaks away."""

LEAST_OVERSHOOT_SHARE = 0.05  # [of the distance]
"""Smallest overshoot of a stage that breaks away. A stage with less creeps to its reference."""


def loose_from(stages: Ensemble) -> np.ndarray:
    """Return the smallest tested distance [m] from which a stuck stage overshoots, (count,).

    From smaller distances it creeps home. If it overshoots from none, the result is the largest tested distance.
    """
    shares = np.geomspace(*CREEP_DISTANCES)
    distances = shares * stages.length[:, None]
    sides = (1.0,) if stages.symmetric.all() else (1.0, -1.0)
    returns = np.max([trace_returns(stages, distances, GUESS_RTOL, side).returns for side in sides], axis=0)
    breaks = returns > LEAST_OVERSHOOT_SHARE * distances
    first = np.where(breaks.any(axis=1), breaks.argmax(axis=1), len(shares) - 1)
    return distances[np.arange(stages.count), first]


LEAST_SWING = 0.0004  # [deflections at break-away]
"""Smallest swing that counts. Smaller ones are below the resolution of runs; a larger limit would miss small
cycles."""

RUN_TURNING_POINTS = 1 << 14
"""Turning points stored for a run at first. Runs that need more are repeated; a larger store slows down every run.
"""

TURNING_POINT_ROOM = 1 << 20
"""Turning points stored for all runs of a round together, limited by memory."""

ROUND_STEP_LIMIT = 4_000_000  # [steps]
"""Steps after which a run of a round is stopped. A run that chatters would hold up all others."""

SWING_LEG_SHARE = 0.25  # [of peak to peak]
"""Smallest leg of the zigzag that counts as a swing. Smaller legs are ringing of a stage that sticks."""

KEPT_SWINGS = 32  # [swings]
"""Last swings that are stored of each run. Fewer hide repetitions after several swings; more take memory."""


def one_round(runs: Pending, budget: float = np.inf) -> tuple[Pending, Ends]:
    """Run each stage for its duration, within a `budget` of steps.

    Returns the runs at their new states and how they ended.
    """
    room = FIRST_TURNING_POINTS
    stages, count = runs.stages, runs.stages.count
    least = LEAST_SWING * stages.length
    results = stages.run(
        runs.states,
        runs.durations,
        runs.rtol,
        with_modes=True,
        window=0.5,
        record_from=np.inf,
        least_swing=least,
        room=max(room, min(RUN_TURNING_POINTS, TURNING_POINT_ROOM // count)),
        budget=int(min(budget, ROUND_STEP_LIMIT)),
    )
    completed, away = done(results), np.equal(results.statuses, Status.DIVERGED)
    high, low, steps = (
        results.statistics[:, STATISTICS.index(name)] for name in ("deviation_max", "deviation_min", "attempted")
    )
    values, times = last_swings(results, np.maximum(SWING_LEG_SHARE * (high - low), least), KEPT_SWINGS)
    standing = _stands_still(stages, results.ends, high - low, runs.durations, runs.loose)
    repeats = recurrence(values, times, runs.mirrored)
    # a run that repeats itself may swing about its reference for ever
    rest = completed & standing & (repeats.swings == 0)
    ends = Ends(results.ends, completed, away, rest, steps, repeats, values, times)
    return replace(runs, states=results.ends), ends


REST_WAITS = 4.0  # [waits]
"""Standstill after which a stage certainly rests, because the integrator has passed twice from limit to limit."""


def _stands_still(
    stages: Ensemble, ends: np.ndarray, swing: np.ndarray, durations: np.ndarray, loose: np.ndarray
) -> np.ndarray:
    """Return which runs stood still so long that they cannot break away again, shape (runs,).

    `ends` are the final states, `swing` [m] the peak-to-peak deviations over half of the `durations` [s]. `loose` [m]
    is the distance from which a stage breaks away.
    """
    distances = np.abs(ends[:, stages.sticking])
    home = (swing < loose / 2) & (distances < loose / 2) & (durations / 2 > REST_WAITS * wait(stages, loose))
    aside = (swing < 2 * LEAST_SWING * stages.length) & (durations / 2 > 2 * BREAKAWAY_WAITS * wait(stages, distances))
    return home | aside


LONGEST_WAITS = 24.0  # [longest waits]
"""Longest round, in the longest sticking time. A slower swing repeats within half of it; longer runs only cost
time."""

QUIET_ROUND_FACTOR = 10.0
"""Length of the next round over the last one, for a run that has not swung yet."""

NEXT_ROUND_FACTOR = 3.0
"""Length of a round over that of the previous one. If smaller, slow transients take many rounds; if larger, the
last one wastes work."""


def lengthened(runs: Pending, swing: np.ndarray) -> Pending:
    """Return runs with a longer next round.

    `swing`, shape (runs,), marks runs that swing. For any other run the round is long enough to show that it rests or
    swings slowly. But it is not so long that a run which starts to swing does so for most of the round.
    """
    least = np.where(
        swing,
        0.0,
        np.minimum(
            LONGEST_WAITS * wait(runs.stages, runs.loose),
            QUIET_ROUND_FACTOR * runs.durations,
        ),
    )
    return replace(runs, durations=np.maximum(NEXT_ROUND_FACTOR * runs.durations, least))


CLOSED_SWING_SHARE = 0.2  # [of peak to peak]
"""Largest relative difference in size between a closed orbit and the run from which it was started."""


def close_orbits(
    runs: Pending, swings: np.ndarray, times: np.ndarray, sizes: np.ndarray, rtol: float
) -> list[tuple[np.ndarray, Cycles]]:
    """Close an orbit near each run that repeats itself, by Newton's method.

    Run k repeats after `swings[k]` swings and `times[k]` [s]; `sizes[k]` [m] is its peak-to-peak deviation, each of
    shape (runs,). Returns groups of runs with equal numbers of swings: the numbers of the runs, and their cycles. A
    cycle is not `closed` where no orbit of the run's size was reached. An orbit that passes through a simpler one
    several times is replaced by the simpler one.
    """
    states = _where_they_stick(runs, times)
    parts = []

    def close_from(group: np.ndarray, starts: np.ndarray, times: np.ndarray, n: int) -> Cycles:
        """Close orbits of `n` swings for the runs with the numbers `group`.

        `starts`, shape (group, states), are states near the orbits, and `times` [s] the approximate times of return.
        """
        sign = -1.0 if n % 2 else 1.0
        stages = runs.stages.take(group)
        if sign < 0:
            starts = starts * np.sign(starts[:, stages.sticking])[:, None]
        cycles = described(stages, close(stages, starts, times, sign, rtol, n), rtol)
        cycles.closed[~(np.abs(2 * cycles.amplitude / sizes[group] - 1) < CLOSED_SWING_SHARE)] = False
        parts.append((group, cycles))
        return cycles

    for n in np.unique(swings).tolist():
        group = np.flatnonzero(swings == n)
        cycles = close_from(group, states[group], times[group], n)
        for fewer in (m for m in range(1, n) if n % m == 0):
            which = np.flatnonzero(cycles.closed & (runs.mirrored[group] | (fewer % 2 == 0)))
            which = which[_repeat_after(runs.stages.take(group[which]), cycles.orbits.take(which), fewer, rtol)]
            if which.size:
                orbits = cycles.orbits.take(which)
                once = close_from(group[which], orbits.states, orbits.times * fewer / n, fewer)
                once.closed[~_alike(once.orbits, orbits, n / fewer, runs.stages.sticking)] = False
                cycles.closed[which] &= ~once.closed
    return parts


REPEATED_ORBIT_SHARE = 1e-3
"""Largest relative difference between an orbit and a simpler one that it passes through several times."""


def _repeat_after(stages: Ensemble, orbits: Orbits, fewer: int, rtol: float) -> np.ndarray:
    """Return which closed orbits, shape (count,), only repeat a simpler orbit of `fewer` swings.

    After `fewer` swings, such an orbit is back at the state in which the stage sticks. If `fewer` is odd, it is back at
    the mirror image of that state.
    """
    if not stages.count:
        return np.zeros(0, bool)
    ends = stages.run(orbits.states, orbits.times * fewer / orbits.swings, rtol).ends[:, stages.sticking]
    sign, sticks = -1.0 if fewer % 2 else 1.0, orbits.states[:, stages.sticking]
    return np.abs(sign * ends - sticks) < REPEATED_ORBIT_SHARE * np.abs(sticks)


def _alike(once: Orbits, orbits: Orbits, passes: float, sticking: int) -> np.ndarray:
    """Return which orbits, shape (count,), only repeat the simpler orbit `once`, `passes` times.

    Compared are the sticking distance, in the state numbered `sticking`, and the time of return.
    """
    distances = np.abs(once.states[:, sticking]) / np.abs(orbits.states[:, sticking])
    return (np.abs(distances - 1) < REPEATED_ORBIT_SHARE) & (
        np.abs(passes * once.times / orbits.times - 1) < REPEATED_ORBIT_SHARE
    )


SAMPLES_PER_REPETITION = 400
"""Samples of one repetition when a sticking instant is looked for. Fewer miss short standstills; more take longer.
"""


def _where_they_stick(pending: Pending, times: np.ndarray) -> np.ndarray:
    """Return a state in which each run sticks, (runs, states), within twice the `times` [s].

    At this instant the integrator balances the constant forces on a stage at rest. If there are several such instants,
    the one after the longest standstill is taken; if there is none, the state at the start. `pending` are the runs, and
    `times` has the shape (runs,).
    """
    stages, size = pending.stages, len(pending.stages.kernel.states)
    numbers, ahead = np.arange(stages.count), np.zeros(stages.count)
    octave = np.round(np.log2(times))  # runs of about the same length are sampled together
    for group in (numbers[octave == n] for n in np.unique(octave)):
        runs, step = pending.take(group), float(times[group].min()) / SAMPLES_PER_REPETITION
        paths = runs.stages.run(runs.states, 2 * times[group], pending.rtol, interval=step).samples
        for k, path in zip(group, paths, strict=True):
            residuals = stages.unbalanced(path, k)
            ahead[k] = step * _balanced(residuals, path[:, stages.sticking])
    return stages.run(pending.states, np.maximum(ahead, 1e-9 * times), pending.rtol).ends[:, :size]


STILL_MOVE_SHARE = 1e-3  # [of peak to peak]
"""Largest move between samples of a stage that sticks. If larger, slow sliding passes for sticking."""


def _balanced(residuals: np.ndarray, place: np.ndarray) -> float:
    """Return at which sample, with a fraction, the integrator balances the constant forces.

    At this sample `residuals`, their imbalance, passes zero. Among several such samples, the one with the longest
    standstill before it counts; 0 is returned if there is none. `place` [m] is the position that sticks. Both arrays
    have the shape (samples,).
    """
    if not np.isfinite(place).any():  # the run failed
        return 0.0
    standing = np.abs(np.diff(place)) < STILL_MOVE_SHARE * np.nanmax(place) - STILL_MOVE_SHARE * np.nanmin(place)
    moves = np.where(~standing, np.arange(len(standing)), -1)
    stood = np.arange(len(standing)) - np.maximum.accumulate(moves)
    crossed = np.flatnonzero((residuals[:-1] * residuals[1:] <= 0) & np.isfinite(residuals[1:]))
    if not crossed.size:
        return 0.0
    j = crossed[stood[crossed].argmax()]
    return float(j + residuals[j] / (residuals[j] - residuals[j + 1]))
