"""Close orbits from runs that repeat themselves, after any number of swings."""

from __future__ import annotations

import numpy as np

from friso.hunting.attractors.rounds import Pending
from friso.hunting.attractors.settings import settings
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import Cycles, described
from friso.hunting.cycle.shooting import Orbits, close


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
        cycles.closed[~(np.abs(2 * cycles.amplitude / sizes[group] - 1) < settings.closed_swing_share)] = False
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


def _repeat_after(stages: Ensemble, orbits: Orbits, fewer: int, rtol: float) -> np.ndarray:
    """Return which closed orbits, shape (count,), only repeat a simpler orbit of `fewer` swings.

    After `fewer` swings, such an orbit is back at the state in which the stage sticks. If `fewer` is odd, it is back at
    the mirror image of that state.
    """
    if not stages.count:
        return np.zeros(0, bool)
    ends = stages.run(orbits.states, orbits.times * fewer / orbits.swings, rtol).ends[:, stages.sticking]
    sign, sticks = -1.0 if fewer % 2 else 1.0, orbits.states[:, stages.sticking]
    return np.abs(sign * ends - sticks) < settings.repeated_orbit_share * np.abs(sticks)


def _alike(once: Orbits, orbits: Orbits, passes: float, sticking: int) -> np.ndarray:
    """Return which orbits, shape (count,), only repeat the simpler orbit `once`, `passes` times.

    Compared are the sticking distance, in the state numbered `sticking`, and the time of return.
    """
    distances = np.abs(once.states[:, sticking]) / np.abs(orbits.states[:, sticking])
    return (np.abs(distances - 1) < settings.repeated_orbit_share) & (
        np.abs(passes * once.times / orbits.times - 1) < settings.repeated_orbit_share
    )


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
        runs, step = pending.take(group), float(times[group].min()) / settings.samples_per_repetition
        paths = runs.stages.run(runs.states, 2 * times[group], pending.rtol, interval=step).samples
        for k, path in zip(group, paths, strict=True):
            residuals = stages.unbalanced(path, k)
            ahead[k] = step * _balanced(residuals, path[:, stages.sticking])
    return stages.run(pending.states, np.maximum(ahead, 1e-9 * times), pending.rtol).ends[:, :size]


def _balanced(residuals: np.ndarray, place: np.ndarray) -> float:
    """Return at which sample, with a fraction, the integrator balances the constant forces.

    At this sample `residuals`, their imbalance, passes zero. Among several such samples, the one with the longest
    standstill before it counts; 0 is returned if there is none. `place` [m] is the position that sticks. Both arrays
    have the shape (samples,).
    """
    if not np.isfinite(place).any():  # the run failed
        return 0.0
    standing = np.abs(np.diff(place)) < settings.still_move_share * np.nanmax(
        place
    ) - settings.still_move_share * np.nanmin(place)
    moves = np.where(~standing, np.arange(len(standing)), -1)
    stood = np.arange(len(standing)) - np.maximum.accumulate(moves)
    crossed = np.flatnonzero((residuals[:-1] * residuals[1:] <= 0) & np.isfinite(residuals[1:]))
    if not crossed.size:
        return 0.0
    j = crossed[stood[crossed].argmax()]
    return float(j + residuals[j] / (residuals[j] - residuals[j + 1]))
