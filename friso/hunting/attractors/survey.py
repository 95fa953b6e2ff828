"""A survey of stages: simulated from many starts, to everything that attracts them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from friso.hunting.attractors.closing import closed
from friso.hunting.attractors.rounds import Ends, Pending, lengthened, one_round
from friso.hunting.cycle.find import Cycles

ROUNDS = 5
"""Rounds at most: the last takes two thousand typical periods."""

STEPS, FEWER = 10_000_000, 6_000_000
"""Steps that all runs of a stage take together at most until they are given up, in a thorough survey and in others."""

ALIKE = 0.05
"""Share by which the time and the peak to peak of two motions differ at most that are the same."""

CLOSE = 0.01
"""The same share of the peak to peak of runs that do not repeat themselves."""

SAME = 1e-3
"""The same of two orbits that are the same."""

KINDS = 32
"""Kinds of runs of a stage that are followed after the second round."""

ENOUGH = 3
"""Rounds after which no more motions that attract are looked for where one is known."""

SETTLED, PATIENCE = 0.005, 3
"""Share of peak to peak up to which swings repeat themselves that an orbit is closed from at once, and the round from
which on one is tried to be closed from all others."""

REGULAR, UNCHANGED = 2, 2e-3
"""The round from which on a motion is taken for attracted, although no orbit could be closed, if it repeats itself, and
the share by which its mean swing may change over that round, of two hundred typical periods and more."""

EXACT = 1e-7
"""Share of peak to peak up to which a motion repeats itself that is taken for attracted at once: so near a cycle that
repels no run comes by chance."""

CONVERGED, APPROACHES = 1e-4, 0.7
"""The same where nothing has to be proved, and the share of what it was some swings before below which it does for
motions that are about to repeat themselves (`SETTLED`)."""

CLOSED = 3
"""Orbits that are tried to be closed for a stage after one round of a thorough survey, of others one."""

LEAVES, LONGEST = 15.0, 20.0
"""Time constants of a cycle that repels after which a run has left it, and the longest that it is followed for that, in
units of the last round."""

STEADY = 0.8
"""Share of its mean swing that a motion which swings on keeps at least over the last round, three times as long as all
before: a decay that is slower than this looks like a cycle."""


@dataclass(frozen=True)
class Swinging:
    """A motion that a stage does not leave: the number of the `stage`; half of peak to peak, `amplitude` [m]; the
    `time` in which it repeats itself [s] (NaN: it does not) and its `period` [s], twice that if it is its mirror image
    by then (of one that does not repeat itself, about the time from one swing to the next but one); a `distance` [m] at
    which it sticks; the number of `swings`, to one side or the other, in a period; and the cycle, closed as an orbit,
    with its number among `cycles` (None: it was observed, in a simulation)."""

    stage: int
    amplitude: float
    time: float
    period: float
    distance: float
    swings: int
    cycles: Cycles | None = None
    number: int = 0

    def like(self, other: Swinging) -> bool:
        """Whether two motions of a stage are the same, or mirror images."""
        if self.stage != other.stage:
            return False
        same = abs(self.amplitude / other.amplitude - 1) < SAME and abs(self.period / other.period - 1) < SAME
        return same and (self.cycles is None) == (other.cycles is None)

    @property
    def time_constant(self) -> float:
        return float("nan") if self.cycles is None else float(self.cycles.time_constant[self.number])


_Kind = tuple[int, float, float]
"""The number of a stage, and peak to peak [m] and time [s] of a motion of it that repeats itself."""


def _like(kinds: list[_Kind], of: np.ndarray, ends: Ends) -> np.ndarray:
    """Which runs, of the stages with the numbers `of`, repeat themselves like one of some kinds of motion."""
    motions_of: dict[int, list[tuple[float, float]]] = {}
    for stage, size, time in kinds:
        motions_of.setdefault(stage, []).append((size, time))
    like = np.zeros(len(of), bool)
    for stage, motions in motions_of.items():
        which = np.flatnonzero(of == stage)
        for size, time in motions:
            same = np.abs(ends.repeats.size[which] / size - 1) < ALIKE
            like[which] |= same & (np.abs(ends.repeats.time[which] / time - 1) < ALIKE)
    return like


def of_cycles(numbers: np.ndarray, cycles: Cycles, sticking: int) -> list[Swinging]:
    """The cycles of the stages with some numbers as motions, where they attract."""
    return [
        Swinging(
            int(numbers[k]),
            float(cycles.amplitude[k]),
            float(cycles.orbits.times[k]),
            float(cycles.period[k]),
            float(cycles.states[k, sticking]),
            cycles.swings * (2 if cycles.sign < 0 else 1),
            cycles,
            int(k),
        )
        for k in np.flatnonzero(cycles.attracting)
    ]


@dataclass
class Survey:
    """What has been learned of stages so far, by a `thorough` survey, or by one that has to `prove` what attracts, or
    takes motions that have converged for attracted. The motions that attract; and of which stages that is `unknown`,
    because a run failed or had to be given up, the time constant of the cycle that repels most slowly, `slowest` [s]
    (0: none), and the steps that its runs may take still, `left`, all of shape (count,)."""

    count: int
    thorough: bool
    rtol: float
    prove: bool = True
    attracting: list[Swinging] = field(default_factory=list)
    unknown: np.ndarray = field(init=False)
    slowest: np.ndarray = field(init=False)
    left: np.ndarray = field(init=False)
    _attracting_kinds: list[_Kind] = field(default_factory=list)
    _closed: list[_Kind] = field(default_factory=list)
    _others: list[_Kind] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.unknown, self.slowest = np.zeros(self.count, bool), np.zeros(self.count)
        self.left = np.full(self.count, float(STEPS if self.thorough else FEWER))

    @property
    def attracted(self) -> np.ndarray:
        """Which stages something attracts, shape (count,)."""
        some = np.zeros(self.count, bool)
        some[[motion.stage for motion in self.attracting]] = True
        return some

    def add(self, motions: list[Swinging]) -> None:
        """Add motions that attract, but those that are there already."""
        for motion in motions:
            if not (self.thorough and any(motion.like(other) for other in self.attracting)):
                self.attracting.append(motion)
                self._attracting_kinds.append((motion.stage, 2 * motion.amplitude, motion.time))

    def slow_down(self, numbers: np.ndarray, cycles: Cycles) -> None:
        """Take notice of the cycles that repel, of the stages with some numbers: runs take long to leave these."""
        repel = np.flatnonzero(cycles.closed & ~cycles.attracting)
        for k in repel:
            size, time = 2 * float(cycles.amplitude[k]), float(cycles.orbits.times[k])
            self._closed += [(int(numbers[k]), size, time), (int(numbers[k]), size, 2 * time)]
        np.maximum.at(self.slowest, numbers[repel], cycles.time_constant[repel])

    def follow(self, runs: Pending, of: np.ndarray) -> None:
        """Follow runs, each of the stage with the number `of`, (runs,), to what attracts them."""
        before = np.full(len(of), np.nan)
        for number in range(ROUNDS):
            enough = ENOUGH if self.thorough else 0
            keep = np.flatnonzero(~self.attracted[of] | (number < enough))
            if not keep.size:
                return
            of, before = of[keep], before[keep]
            runs, ends = one_round(runs.take(keep), self.left[of].max())
            on = self._on(runs, of, ends, early=number < PATIENCE)
            on = self._within_budget(on, of, ends)
            if not on.size:
                return
            if number > 0:
                on = on[self._kinds(of[on], ends.take(on), KINDS)]
            if number == ROUNDS - 1:
                return self._last(runs.take(on), of[on], ends.take(on), before[on])
            regular = self._exact(of[on], ends.take(on))
            if number >= REGULAR:
                regular |= self._regular(of[on], ends.take(on), before[on])
            self._observe(of[on[regular]], ends.take(on[regular]), before[on[regular]])
            on = on[~regular]
            if not on.size:
                return
            before, of = ends.repeats.mean[on], of[on]
            runs = lengthened(runs.take(on), ends.repeats.swings[on] > 0)

    def _on(self, runs: Pending, of: np.ndarray, ends: Ends, early: bool = False) -> np.ndarray:
        """The numbers of the runs that swing on without having come to an attractor, once orbits were closed: `early`
        from those alone that repeat themselves well, and unlike any cycle that is known to repel."""
        self.unknown[of[~ends.completed]] = True
        on = ends.completed & ~ends.rest & ~self._alike(of, ends)
        ready = on & (ends.repeats.swings > 0)
        if early:
            ready &= (ends.repeats.off < SETTLED) & ~self._repels(of, ends)
        if not self.prove:
            ready &= ~self._exact(of, ends)
        self._close(runs, of, ends, np.flatnonzero(ready))
        return np.flatnonzero(on & ~self._alike(of, ends))

    def _within_budget(self, on: np.ndarray, of: np.ndarray, ends: Ends) -> np.ndarray:
        """Those of the runs with the numbers `on` whose stages have steps left after a round."""
        np.subtract.at(self.left, of, ends.steps)
        spent = self.left[of[on]] <= 0
        self.unknown[of[on[spent]]] = True
        return on[~spent]

    def _kinds(self, of: np.ndarray, ends: Ends, most: int) -> np.ndarray:
        """The numbers of runs that are followed on for all of their kind; of stages with more kinds than may be it is
        unknown what the others come to."""
        chosen, others = _kinds(of, ends, most)
        self.unknown[of[others]] = True
        return chosen

    def _repels(self, of: np.ndarray, ends: Ends) -> np.ndarray:
        """Which runs repeat themselves like a cycle that repels, or like what no orbit that attracts could be closed
        from."""
        return _like(self._closed, of, ends) | _like(self._others, of, ends)

    def _alike(self, of: np.ndarray, ends: Ends) -> np.ndarray:
        """Which runs repeat themselves like a motion that is known already to attract their stage."""
        if not self.thorough:
            return self.attracted[of]
        return _like(self._attracting_kinds, of, ends)

    def _close(self, runs: Pending, of: np.ndarray, ends: Ends, which: np.ndarray) -> None:
        """Close orbits from one of each kind of runs, of those with some numbers."""
        most, repeats = CLOSED if self.thorough else 1, ends.repeats
        kinds = which[_kinds(of[which], ends.take(which), most)[0]]
        pairs = runs.mirrored & (repeats.swings == 2)  # as swings about a symmetric cycle that approach it, too, seem
        tries = (
            (np.where(pairs, 1, 0), repeats.time / 2),
            (repeats.swings, repeats.time),
            (np.where(repeats.better > repeats.swings, repeats.better, 0), repeats.better_time),
        )
        for swings, times in tries:
            on = kinds[(swings[kinds] > 0) & ~self._alike(of[kinds], ends.take(kinds))]
            if on.size:
                self._close_after(runs, of, ends, on, swings[on], times[on])

    def _close_after(
        self, runs: Pending, of: np.ndarray, ends: Ends, on: np.ndarray, swings: np.ndarray, times: np.ndarray
    ) -> None:
        """Close orbits from the runs with the numbers `on`, after numbers of swings and times [s]."""
        repeats = ends.repeats
        for group, cycles in closed(runs.take(on), swings, times, repeats.size[on], self.rtol):
            numbers = on[group]
            self.add(of_cycles(of[numbers], cycles, runs.stages.sticking))
            self.slow_down(of[numbers], cycles)
            for kinds_of, which in ((self._attracting_kinds, cycles.attracting), (self._others, ~cycles.attracting)):
                columns = (column[numbers[which]].tolist() for column in (of, repeats.size, repeats.time))
                kinds_of += zip(*columns, strict=True)  # the runs are not as exact as their orbits

    def _last(self, runs: Pending, of: np.ndarray, ends: Ends, before: np.ndarray) -> None:
        """Take runs that swing to the end for attracted, if they have not decayed; those that may be about to leave a
        cycle that repels are followed for as long as that takes."""
        kinds = self._kinds(of, ends, CLOSED)
        leave = LEAVES * self.slowest[of]
        slow = kinds[leave[kinds] > runs.durations[kinds]]
        if slow.size:
            kinds = np.setdiff1d(kinds, slow)
            longest = LONGEST * runs.durations[slow]
            longer = replace(runs.take(slow), durations=np.minimum(leave[slow], longest))
            self.unknown[of[slow[leave[slow] > longest]]] = True
            after, last = one_round(longer)
            on = self._on(after, of[slow], last)
            self._observe(of[slow[on]], last.take(on), before[slow[on]])
        self._observe(of[kinds], ends.take(kinds), before[kinds])

    def confirm(self, runs: Pending, of: np.ndarray, cycles: Cycles) -> None:
        """Add those cycles, of the stages with the numbers `of`, (runs,), that a run which begins on them stays on."""
        _, ends = one_round(runs)
        size = np.abs(ends.repeats.size / (2 * cycles.amplitude) - 1) < ALIKE
        stays = size & (np.abs(ends.repeats.time / cycles.orbits.times - 1) < ALIKE)
        which = np.flatnonzero(stays)
        self.add(of_cycles(of[which], cycles.take(which), runs.stages.sticking))

    def _regular(self, of: np.ndarray, ends: Ends, before: np.ndarray) -> np.ndarray:
        """Which runs repeat themselves so well, and have changed so little in the last round, that they will not leave
        where they are: unless that is beside a cycle that repels."""
        same = np.abs(ends.repeats.mean / before - 1) < UNCHANGED
        return same & (ends.repeats.off < SETTLED) & ~self._repels(of, ends)

    def _exact(self, of: np.ndarray, ends: Ends) -> np.ndarray:
        """Which runs repeat themselves as exactly as they do on what attracts alone, or approach that where nothing
        has to be proved, and unlike any closed cycle that repels."""
        repeats, unlike = ends.repeats, (ends.repeats.swings > 0) & ~_like(self._closed, of, ends)
        if self.prove:
            return unlike & (repeats.off < EXACT)
        approaches = (repeats.off < SETTLED) & (repeats.off < APPROACHES * repeats.earlier)
        return unlike & ((repeats.off < CONVERGED) | approaches)

    def _observe(self, of: np.ndarray, ends: Ends, before: np.ndarray) -> None:
        repeats = ends.repeats
        steady = (repeats.mean > 0) & ~(repeats.mean < STEADY * before)  # there is nothing before the first round
        self.unknown[of[~steady]] = True
        for k in np.flatnonzero(steady):
            if self._alike(of[k : k + 1], ends.take(np.array([k])))[0]:
                continue
            there_and_back = ends.times[k, 2:] - ends.times[k, :-2]
            swings, time = int(repeats.swings[k]), float(repeats.time[k])
            if swings:
                twice = 2 if swings % 2 else 1  # it is its mirror image by then
                period, swings = twice * time, twice * swings
            elif np.isfinite(there_and_back).any():
                period, swings = float(np.nanmean(there_and_back)), 2
            else:
                self.unknown[of[k]] = True
                continue
            motion = Swinging(int(of[k]), float(repeats.size[k] / 2), time, period, float(ends.values[k, -1]), swings)
            self.add([motion])


def _kinds(of: np.ndarray, ends: Ends, most: int) -> tuple[np.ndarray, np.ndarray]:
    """The numbers of runs that stand for all, no two of a stage that are alike and not more than `most` of each, and of
    those that are like none of these. Runs that do not repeat themselves are on their way, and soon apart."""
    chosen: dict[int, list[int]] = {}
    others: list[int] = []
    repeats = ends.repeats.swings > 0
    sizes, times = ends.repeats.size, np.nan_to_num(ends.repeats.time)
    near = np.where(repeats, ALIKE, CLOSE)

    def alike(k: int, j: int) -> bool:
        same = abs(sizes[k] - sizes[j]) <= near[k] * sizes[j] and abs(times[k] - times[j]) <= ALIKE * times[j]
        return bool(same and repeats[k] == repeats[j])

    for k in np.argsort(ends.repeats.swings, kind="stable").tolist():
        same_stage = chosen.setdefault(int(of[k]), [])
        if not any(alike(k, j) for j in same_stage):
            (same_stage if len(same_stage) < most else others).append(k)
    stand = [k for numbers in chosen.values() for k in numbers]
    return np.array(stand, dtype=np.int64), np.array(others, dtype=np.int64)
