"""Survey stages: simulate them from many starts, and follow the runs to their attractors."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from friso.hunting.attractors.rounds import (
    COMPARED_SWINGS,
    Ends,
    Pending,
    Recurrence,
    close_orbits,
    lengthened,
    one_round,
)
from friso.hunting.attractors.settings import settings
from friso.hunting.cycle.ensemble import ArrayRows
from friso.hunting.cycle.find import Cycles

SAME_ORBIT_SHARE = 1e-3
"""Largest relative difference between two computations of the same closed orbit."""


@dataclass(frozen=True)
class Swinging:
    """A lasting swing of a stage, closed as an orbit or observed in a simulation.

    - `stage`: number of the stage; `amplitude` [m]: half of peak to peak, about the `middle` [m].
    - `time` [s]: after which the motion, or its mirror image, repeats; NaN if it does not.
    - `period` [s]: of a whole repetition, or about two swings of a motion that does not repeat.
    - `distance` [m]: at which the stage sticks; `swings`: to either side in a period.
    - `cycles`, `number`: the closed orbit and its row; None if only a simulation or a return map shows the motion.
    - `seen`: final state (states,) of the run that showed the motion.
    - `slope`: fraction of a deviation left after `time`, by the return map or a run that came close; NaN if unknown.
    """

    stage: int
    amplitude: float
    time: float
    period: float
    distance: float
    swings: int
    cycles: Cycles | None = None
    number: int = 0
    seen: np.ndarray | None = None
    slope: float = float("nan")
    middle: float = 0.0

    def like(self, other: Swinging) -> bool:
        """Tell whether two motions of a stage are equal, or mirror images, by size and period.

        Motions of different stages differ, and so do a closed orbit and a motion without one.
        """
        if self.stage != other.stage:
            return False
        same = (
            abs(self.amplitude / other.amplitude - 1) < SAME_ORBIT_SHARE
            and abs(self.period / other.period - 1) < SAME_ORBIT_SHARE
        )
        return same and (self.cycles is None) == (other.cycles is None)

    @property
    def observed(self) -> bool:
        """Tell whether only a simulation shows the motion, so that its time constant is unknown."""
        return self.cycles is None and not np.isfinite(self.slope)

    @property
    def time_constant(self) -> float:
        """Return the time [s] in which a deviation from the motion shrinks by e; NaN if unknown."""
        if self.cycles is not None:
            return float(self.cycles.time_constant[self.number])
        return -self.time / float(np.log(self.slope)) if 0 < self.slope < 1 else float("nan")


@dataclass(frozen=True)
class Repelling:
    """A simple cycle of the stage with this number that surely repels, by its slope on the return map.

    `size` [m] is its peak-to-peak deviation. The `slope` is the factor, with its sign, by which a deviation grows per
    repetition: after each swing, or after two if the stage is not symmetric. Swings scatter by the share `scatter`.
    """

    stage: int
    size: float
    slope: float
    scatter: float


_Kind = tuple[int, float, float]
"""A kind of motion: number of the stage, peak-to-peak deviation [m], and time of repetition [s]."""


OUTER_SHARE = 0.25
"""Outer fraction of the runs beside an unstable cycle that is followed, because these leave it first."""

RUNS_PER_SIDE = 4
"""Runs followed on either side of an unstable cycle. Fewer would miss the side on which runs leave."""


@dataclass(frozen=True)
class _Beside(ArrayRows):
    """Unstable cycles that runs resemble, arrays of shape (runs,).

    `cycles` are the numbers of the cycles (-1: none). `offsets` are how much farther each run swings than its cycle,
    relative to the cycle (0 without a cycle).
    """

    cycles: np.ndarray
    offsets: np.ndarray

    @classmethod
    def nothing(cls, count: int) -> _Beside:
        """Return the case in which none of `count` runs resembles an unstable cycle."""
        return cls(np.full(count, -1), np.zeros(count))

    @property
    def leave_first(self) -> np.ndarray:
        """Choose a few runs on either side of each unstable cycle, to stand for all on that side.

        They are among those farthest from the cycle, which leave it first. The result is true for them, shape (runs,).
        """
        chosen, far, sides = np.zeros(len(self.cycles), bool), np.abs(self.offsets), np.sign(self.offsets)
        for cycle, side in {*zip(self.cycles.tolist(), sides.tolist(), strict=True)} - {(-1, 0.0)}:
            group = np.flatnonzero((self.cycles == cycle) & (sides == side))
            group = group[np.argsort(-far[group], kind="stable")]
            group = group[far[group] >= OUTER_SHARE * far[group[0]]]
            chosen[group[np.linspace(0, len(group) - 1, RUNS_PER_SIDE).round().astype(int)]] = True
        return chosen


SAME_MOTION_SHARE = 0.05
"""Largest relative difference in time and size between runs on the same motion."""


def _like(kinds: list[_Kind], owners: np.ndarray, ends: Ends) -> np.ndarray:
    """Return which runs have the period and size of one of the motions `kinds`, shape (runs,).

    `owners`, shape (runs,), are the numbers of the runs' stages.
    """
    motions_of: dict[int, list[tuple[float, float]]] = {}
    for stage, size, time in kinds:
        motions_of.setdefault(stage, []).append((size, time))
    like = np.zeros(len(owners), bool)
    for stage, motions in motions_of.items():
        which = np.flatnonzero(owners == stage)
        for size, time in motions:
            same = np.abs(ends.repeats.size[which] / size - 1) < SAME_MOTION_SHARE
            like[which] |= same & (np.abs(ends.repeats.time[which] / time - 1) < SAME_MOTION_SHARE)
    return like


def of_cycles(numbers: np.ndarray, cycles: Cycles, sticking: int, which: np.ndarray | None = None) -> list[Swinging]:
    """Return cycles as motions that attract the stages with these numbers.

    Unstable cycles are left out. `which` has the rows of the cycles to take instead of the stable ones. `sticking` is
    the index of the state that is constant while a stage sticks.
    """
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
            middle=float(cycles.middle[k]),
        )
        for k in np.flatnonzero(cycles.attracting if which is None else which)
    ]


THOROUGH_STEP_LIMIT = 16_000_000  # [steps]
"""Most steps for all runs of a stage in a survey that decides; slow transients need most of them."""

MOST_PERIOD_MULTIPLE = 2
"""Longest repetition beside an unstable cycle, as a multiple of the cycle's time."""

MOST_ROUNDS = 5
"""Most rounds of a run. The last one takes two thousand typical periods."""

ENOUGH_ROUNDS = 3
"""Rounds in which a thorough survey looks for further attractors once one is certain."""

UNPROVED_ROUND_STEPS = 400_000  # [steps]
"""Most steps of a round of one of many stages, which would keep all others waiting if it chatters."""

CLOSE_FROM_ROUND = 3
"""Round from which an orbit is closed from every remaining run, if possible."""

REGULAR_FROM_ROUND = 2
"""Round from which regular motion is trusted. Before two hundred typical periods slow transients look regular."""

SETTLED_SWING_SHARE = 0.005  # [of peak to peak]
"""Largest error of a repetition from which Newton's method is started to close an orbit."""

LEFT_REPETITIONS = 8
"""Repetitions over which the growth of a deviation tells that a run leaves a cycle. Over fewer, noise hides it."""

ORBITS_PER_ROUND = 3
"""Orbits closed per round and stage. Further ones rarely show anything, and each costs as much as a round."""

LEAVING_TIME_CONSTANTS = 15.0  # [time constants]
"""Time for which runs are followed near an unstable cycle. Afterwards rounding errors have grown to the size of the
swing."""

LONGEST_LEAVING_ROUNDS = 20.0  # [of the last round]
"""Longest wait for runs to leave an unstable cycle. A cycle that needs longer leaves its stage undecided."""

UNCHANGED_SWING_SHARE = 2e-3
"""Largest change of the mean swing over a round. A motion that changes more still grows or decays."""

EXACT_REPETITION_SHARE = 1e-7  # [of peak to peak]
"""Largest error of a repetition that proves an attractor: no run stays so close to an unstable cycle by chance."""

APPROACH_SHARE = 0.7
"""Factor by which the error of a repetition must shrink over some swings for the run to approach an orbit."""

CONVERGED_SWING_SHARE = 1e-5  # [of peak to peak]
"""Largest error of a repetition that counts as converged where attraction need not be proved. Runs come closer than
a larger one to unstable cycles by chance."""

STEADY_SWING_SHARE = 0.8
"""Fraction of the swing that a motion must keep over the last round to count as a cycle."""


@dataclass
class Survey:
    """Progress of a survey of several stages: settings, the attractors so far, and work left.

    A `thorough` survey looks for every attractor. A survey that must `prove` attraction closes orbits; otherwise a
    motion that has converged counts as attracted. A survey that `decides` may take more steps. `unbounded` marks stages
    for which divergence is no failure. Runs that leave one of the cycles `repelling` are not followed.

    `attracting` lists the attractors so far. Arrays have the shape (count,). A stage is `unknown` if a run failed or
    was stopped. `slowest` [s] is the time constant of the most weakly unstable cycle (0: none). `left` counts the
    solver steps that a stage may still take. `rested` and `away` [m] are the farthest starts from which runs came to
    rest or diverged (0: none).
    """

    unbounded: np.ndarray
    thorough: bool
    rtol: float
    prove: bool = True
    decides: bool = False
    repelling: tuple[Repelling, ...] = ()
    attracting: list[Swinging] = field(default_factory=list)
    unknown: np.ndarray = field(init=False)
    slowest: np.ndarray = field(init=False)
    left: np.ndarray = field(init=False)
    rested: np.ndarray = field(init=False)
    away: np.ndarray = field(init=False)
    _attracting_kinds: list[_Kind] = field(default_factory=list)
    _closed: list[_Kind] = field(default_factory=list)
    _unclosed: list[_Kind] = field(default_factory=list)

    @property
    def count(self) -> int:
        """Return the number of stages."""
        return len(self.unbounded)

    def __post_init__(self) -> None:
        self.unknown, self.slowest = np.zeros(self.count, bool), np.zeros(self.count)
        self.left = np.full(self.count, float(THOROUGH_STEP_LIMIT if self.decides else settings.quick_step_limit))
        self.rested, self.away = np.zeros(self.count), np.zeros(self.count)

    @property
    def attracted(self) -> np.ndarray:
        """Return which stages have an attractor so far, shape (count,)."""
        attracted = np.zeros(self.count, bool)
        attracted[[motion.stage for motion in self.attracting]] = True
        return attracted

    @property
    def runs_away(self) -> np.ndarray:
        """Return which unbounded stages diverge from far off, shape (count,).

        Their farthest start from which a run diverges is farther than any from which a run comes to rest.
        """
        return self.unbounded & (self.away > self.rested)

    def add(self, motions: list[Swinging]) -> None:
        """Add attractors that are not in the survey yet."""
        for motion in motions:
            if not (self.thorough and any(motion.like(other) for other in self.attracting)):
                self.attracting.append(motion)
                self._attracting_kinds.append((motion.stage, 2 * motion.amplitude, motion.time))

    def note_unstable_cycles(self, numbers: np.ndarray, cycles: Cycles) -> None:
        """Store the unstable cycles of numbered stages, because runs take long to leave them."""
        repel = np.flatnonzero(cycles.closed & ~cycles.attracting)
        for k in repel:
            size, time = 2 * float(cycles.amplitude[k]), float(cycles.orbits.times[k])
            self._closed += [(int(numbers[k]), size, times * time) for times in range(1, MOST_PERIOD_MULTIPLE + 1)]
        np.maximum.at(self.slowest, numbers[repel], cycles.time_constant[repel])

    def follow(self, runs: Pending, owners: np.ndarray) -> None:
        """Follow runs round by round to their attractors; `owners`, (runs,), number their stages."""
        before, begun = np.full(len(owners), np.nan), np.abs(runs.states[:, runs.stages.sticking])
        for number in range(MOST_ROUNDS):
            enough = ENOUGH_ROUNDS if self.thorough else 0
            dropped = (self.attracted[owners] & (number >= enough)) | (self.left[owners] <= 0)
            self.unknown[owners[dropped]] = True
            keep = np.flatnonzero(~dropped)
            if not keep.size:
                return
            owners, before, begun = owners[keep], before[keep], begun[keep]
            most = self.left[owners].max()
            runs, ends = one_round(runs.take(keep), most if self.prove else min(most, UNPROVED_ROUND_STEPS))
            for farthest, which in ((self.rested, ends.rest), (self.away, ends.away)):
                np.maximum.at(farthest, owners[which], begun[which])
            close_from = CLOSE_FROM_ROUND if self.prove else REGULAR_FROM_ROUND
            swinging = self._still_swinging(runs, owners, ends, early=number < close_from)
            swinging = self._within_budget(swinging, owners, ends)
            swinging = swinging[~self._leaves(runs, owners, ends)[swinging]]
            if not swinging.size:
                return
            beside = self._beside(owners, ends)
            # each run moves elsewhere
            apart = ~ends.swing if number > 0 else (beside.cycles < 0) | runs.stages.remember
            still = swinging[apart[swinging]]
            moving = np.setdiff1d(swinging, still)
            most = self._affordable(owners, ends)[moving]
            kinds = moving[self._kinds(owners[moving], ends.take(moving), most, beside.take(moving))]
            swinging = np.union1d(kinds, still)
            if number == MOST_ROUNDS - 1:
                return self._last(runs.take(swinging), owners[swinging], ends.take(swinging), before[swinging])
            regular = self._exact(owners[swinging], ends.take(swinging))
            if number >= REGULAR_FROM_ROUND:
                regular |= self._regular(owners[swinging], ends.take(swinging), before[swinging])
            self._observe(owners[swinging[regular]], ends.take(swinging[regular]), before[swinging[regular]])
            swinging = swinging[~regular]
            if not swinging.size:
                return
            before, owners, begun = ends.repeats.mean[swinging], owners[swinging], begun[swinging]
            runs = lengthened(runs.take(swinging), ends.swing[swinging])

    def _still_swinging(self, runs: Pending, owners: np.ndarray, ends: Ends, early: bool = False) -> np.ndarray:
        """Close orbits from runs that repeat themselves; return the numbers of runs still to follow.

        The runs to follow swing, and have no attractor in the survey yet. `ends` is how the runs ended in the last
        round, and `owners`, shape (runs,), are the numbers of their stages. With `early`, orbits are closed only to
        prove attraction, from runs that repeat well and resemble no unstable cycle; else another round is cheaper.
        """
        self.unknown[owners[~ends.completed & ~(ends.away & self.unbounded[owners])]] = True
        swinging = ends.completed & ~ends.rest & ~self._known_to_attract(owners, ends)
        if early and not self.prove:
            return np.flatnonzero(swinging)
        ready = swinging & (ends.repeats.swings > 0)
        if early:
            leave = self._repels(owners, ends) & ~self._stay(owners, ends)
            ready &= (ends.repeats.deviation < SETTLED_SWING_SHARE) & ~leave
        if not self.prove:
            ready &= ~self._exact(owners, ends)
        self._close(runs, owners, ends, np.flatnonzero(ready))
        return np.flatnonzero(swinging & ~self._known_to_attract(owners, ends))

    def _within_budget(self, swinging: np.ndarray, owners: np.ndarray, ends: Ends) -> np.ndarray:
        """Return the numbers of the swinging runs whose stages have solver steps left.

        The steps of the last round, in `ends`, are charged to the stages. A stage without any left is marked unknown.
        """
        np.subtract.at(self.left, owners, ends.steps)
        spent = self.left[owners[swinging]] <= 0
        self.unknown[owners[swinging[spent]]] = True
        return swinging[~spent]

    def _affordable(self, owners: np.ndarray, ends: Ends) -> np.ndarray:
        """Return how many different motions of its stage may be followed on, for each run, (runs,).

        The number follows from the solver steps that its stage has left, and is never below `most_kinds`.
        """
        runs = np.bincount(owners, minlength=self.count)
        steps = np.bincount(owners, ends.steps, minlength=self.count) / np.maximum(runs, 1)
        most = np.where(self.attracted, 0, self.left / (settings.next_round_cost * np.maximum(steps, 1)))
        return np.maximum(most, settings.most_kinds)[owners]

    def _kinds(
        self, owners: np.ndarray, ends: Ends, most: np.ndarray | int, beside: _Beside | None = None
    ) -> np.ndarray:
        """Choose one run of each kind, that is with equal period and size, to stand for the others.

        At most `most` runs per stage are chosen; their numbers are returned. A stage with more kinds is marked unknown.
        Of the runs `beside` an unstable cycle, a few stand for all on that side.
        """
        chosen, surplus = _kinds(owners, ends, most, beside)
        self.unknown[owners[surplus]] = True
        return chosen

    def _beside(self, owners: np.ndarray, ends: Ends) -> _Beside:
        """Find the nearest unstable cycle that each run resembles, and its offset from the cycle.

        A run that resembles none gets the number -1 and an offset of 0.
        """
        cycles, offsets = np.full(len(owners), -1), np.full(len(owners), np.inf)
        for number, kind in enumerate(self._closed):
            offset = np.where(_like([kind], owners, ends), ends.repeats.size / kind[1] - 1, np.inf)
            nearer = np.abs(offset) < np.abs(offsets)
            cycles[nearer], offsets[nearer] = number // MOST_PERIOD_MULTIPLE, offset[nearer]
        return _Beside(cycles, np.where(cycles < 0, 0.0, offsets))

    def _repels(self, owners: np.ndarray, ends: Ends) -> np.ndarray:
        """Return which runs resemble an unstable cycle, or a motion without a stable orbit, (runs,)."""
        return _like(self._closed, owners, ends) | _like(self._unclosed, owners, ends)

    def _leaves(self, runs: Pending, owners: np.ndarray, ends: Ends) -> np.ndarray:
        """Return which runs leave a cycle that surely repels, so slowly that they look as if they repeated, (runs,).

        The difference between one swing and the next to the same side grows by the slope of the cycle each time. On
        another cycle beside it, as one of twice the period, it does not. Differences so small that scatter hides their
        growth count as growing.
        """
        leaves, repeats = np.zeros(len(owners), bool), ends.repeats
        slow = 1 + SETTLED_SWING_SHARE / SAME_MOTION_SHARE
        for cycle in self.repelling:
            off = np.abs(repeats.size / cycle.size - 1)
            near = (owners == cycle.stage) & (off < SAME_MOTION_SHARE)
            which = np.flatnonzero(near & (repeats.swings > 0))
            if which.size and abs(cycle.slope) < slow:
                sizes = np.abs(ends.values[which]) if runs.mirrored[which[0]] else ends.values[which][:, 1::2]
                apart, times = np.abs(np.diff(sizes, axis=1)), LEFT_REPETITIONS
                hidden = apart[:, -1] < cycle.size * cycle.scatter / (abs(cycle.slope) - 1)
                grows = apart[:, -1] > apart[:, -1 - times] * abs(cycle.slope) ** (times / 2)
                leaves[which] |= grows | (hidden & (off[which] < SETTLED_SWING_SHARE))
        return leaves

    def _known_to_attract(self, owners: np.ndarray, ends: Ends) -> np.ndarray:
        """Return which runs already have an attractor in the survey, shape (runs,).

        In a thorough survey the run must resemble it; in others any attractor of its stage will do.
        """
        if not self.thorough:
            return self.attracted[owners]
        return _like(self._attracting_kinds, owners, ends)

    def _close(self, runs: Pending, owners: np.ndarray, ends: Ends, which: np.ndarray) -> None:
        """Close orbits from one run of each kind among the runs numbered `which`.

        Runs of one kind have equal period and size.
        """
        most, repeats = ORBITS_PER_ROUND if self.thorough else 1, ends.repeats
        kinds = which[_kinds(owners[which], ends.take(which), most)[0]]
        pairs = runs.mirrored & (repeats.swings == 2)  # a slow approach to a symmetric cycle also repeats in pairs
        tries = (
            (np.where(pairs, 1, 0), repeats.time / 2),
            (repeats.swings, repeats.time),
            (np.where(repeats.better > repeats.swings, repeats.better, 0), repeats.better_time),
        )
        for swings, times in tries:
            swinging = kinds[(swings[kinds] > 0) & ~self._known_to_attract(owners[kinds], ends.take(kinds))]
            if swinging.size:
                self._close_after(runs, owners, ends, swinging, swings[swinging], times[swinging])

    def _close_after(
        self, runs: Pending, owners: np.ndarray, ends: Ends, swinging: np.ndarray, swings: np.ndarray, times: np.ndarray
    ) -> None:
        """Close orbits from the runs numbered `swinging`, and add them to the survey.

        These runs repeat after `swings` swings and `times` [s].
        """
        repeats = ends.repeats
        for group, cycles in close_orbits(runs.take(swinging), swings, times, repeats.size[swinging], self.rtol):
            numbers = swinging[group]
            self.add(of_cycles(owners[numbers], cycles, runs.stages.sticking))
            self.note_unstable_cycles(owners[numbers], cycles)
            for kinds_of, which in ((self._attracting_kinds, cycles.attracting), (self._unclosed, ~cycles.attracting)):
                columns = (column[numbers[which]].tolist() for column in (owners, repeats.size, repeats.time))
                kinds_of += zip(*columns, strict=True)  # the run's numbers, so that later runs are recognised

    def _last(self, runs: Pending, owners: np.ndarray, ends: Ends, before: np.ndarray) -> None:
        """Record runs that still swing in the last round as attracted, unless they decay.

        A run that may still be leaving an unstable cycle is first followed for as long as that takes. `before` [m] has
        the mean swing one round earlier.
        """
        kinds = self._kinds(owners, ends, ORBITS_PER_ROUND)
        leave = LEAVING_TIME_CONSTANTS * self.slowest[owners]
        slow = kinds[leave[kinds] > runs.durations[kinds]]
        if slow.size:
            kinds = np.setdiff1d(kinds, slow)
            longest = LONGEST_LEAVING_ROUNDS * runs.durations[slow]
            longer = replace(runs.take(slow), durations=np.minimum(leave[slow], longest))
            self.unknown[owners[slow[leave[slow] > longest]]] = True
            after, last = one_round(longer)
            swinging = self._still_swinging(after, owners[slow], last)
            self._observe(owners[slow[swinging]], last.take(swinging), before[slow[swinging]])
        self._observe(owners[kinds], ends.take(kinds), before[kinds])

    def confirm(self, runs: Pending, owners: np.ndarray, cycles: Cycles) -> None:
        """Add stable cycles on which a run that begins there stays.

        Run, stage number in `owners`, and cycle belong together row by row.
        """
        _, ends = one_round(runs)
        size = np.abs(ends.repeats.size / (2 * cycles.amplitude) - 1) < SAME_MOTION_SHARE
        stays = size & (np.abs(ends.repeats.time / cycles.orbits.times - 1) < SAME_MOTION_SHARE)
        which = np.flatnonzero(stays)
        self.add(of_cycles(owners[which], cycles.take(which), runs.stages.sticking))

    def _regular(self, owners: np.ndarray, ends: Ends, before: np.ndarray) -> np.ndarray:
        """Return which runs repeat so well, and with so little recent change, that they will go on.

        `before` [m], shape (runs,), has the mean swing one round earlier. Runs that resemble an unstable cycle, or a
        motion without a stable orbit, are left out.
        """
        same = np.abs(ends.repeats.mean / before - 1) < UNCHANGED_SWING_SHARE
        return same & (ends.repeats.deviation < SETTLED_SWING_SHARE) & ~self._repels(owners, ends)

    def _exact(self, owners: np.ndarray, ends: Ends) -> np.ndarray:
        """Return which runs repeat as exactly as only a motion on an attractor does, shape (runs,).

        A run that resembles an unstable cycle counts only if attraction must be proved and the run lies on another
        cycle beside that one (`_stay`). If no proof is needed, runs that clearly approach a repetition count as well.
        """
        repeats, unlike = ends.repeats, (ends.repeats.swings > 0) & ~_like(self._closed, owners, ends)
        if self.prove:
            return (unlike & (repeats.deviation < EXACT_REPETITION_SHARE)) | self._stay(owners, ends)
        approaches = (repeats.deviation < SETTLED_SWING_SHARE) & (repeats.deviation < APPROACH_SHARE * repeats.earlier)
        return unlike & ((repeats.deviation < CONVERGED_SWING_SHARE) | approaches)

    def _stay(self, owners: np.ndarray, ends: Ends) -> np.ndarray:
        """Return which runs near an unstable cycle stay there, because they lie on another cycle.

        Such a run repeats with an error far smaller than its offset from the unstable cycle. The shape is (runs,).
        """
        offsets = np.abs(self._beside(owners, ends).offsets)
        return (ends.repeats.swings > 0) & (ends.repeats.deviation < EXACT_REPETITION_SHARE * offsets)

    def _observe(self, owners: np.ndarray, ends: Ends, before: np.ndarray) -> None:
        """Add runs that swing steadily, but of which no orbit was closed, as observed attractors.

        The stages of other runs are marked unknown. `before` [m] has the mean swing one round earlier.
        """
        repeats = ends.repeats
        begun = (before == 0) & ~(repeats.deviation < CONVERGED_SWING_SHARE)  # it has swung for a few times by now
        steady = (
            (repeats.mean > 0) & ~begun & ~(repeats.mean < STEADY_SWING_SHARE * before)
        )  # or in the first round alone
        self.unknown[owners[~steady]] = True
        for k in np.flatnonzero(steady):
            if self._known_to_attract(owners[k : k + 1], ends.take(np.array([k])))[0]:
                continue
            there_and_back = ends.times[k, 2:] - ends.times[k, :-2]
            swings, time = int(repeats.swings[k]), float(repeats.time[k])
            if swings:
                turns = 2 if swings % 2 else 1  # after an odd number of swings the motion is mirrored
                period, swings = turns * time, turns * swings
            elif np.isfinite(there_and_back).any():
                period, swings = float(np.nanmean(there_and_back)), 2
            else:
                self.unknown[owners[k]] = True
                continue
            size, distance = float(repeats.size[k] / 2), float(ends.values[k, -1])
            slope = np.nan if self.prove else _slope(repeats.take(np.array([k])), ends.times[k])
            place = int(owners[k]), size, time, period, distance, swings
            self.add([Swinging(*place, seen=ends.states[k], slope=slope, middle=float(repeats.middle[k]))])


def _slope(repeats: Recurrence, times: np.ndarray) -> float:
    """Estimate which fraction of a deviation a run leaves after each repetition; NaN if unknown.

    `repeats` describes the end of the one run, and `times` [s] are its last turning points, shape (swings,). The error
    of the repetition shrinks over the last swings. Where rounding hides that, the error has become so small within the
    round.
    """
    (time,), (error,), (earlier,) = repeats.time, repeats.deviation, repeats.earlier
    shrinks = (error / earlier) ** (time / (times[-1] - times[-1 - COMPARED_SWINGS]))
    if shrinks < 1:
        return float(shrinks)
    return float(error ** (time / times[-1])) if error < CONVERGED_SWING_SHARE else float("nan")


SAME_IRREGULAR_SHARE = 0.01  # [of peak to peak]
"""Largest difference between irregular runs of the same kind over a long round."""


def _kinds(
    owners: np.ndarray, ends: Ends, most: np.ndarray | int, beside: _Beside | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Choose one run of each kind, that is with equal period and size, at most `most` per stage.

    Returns the numbers of the chosen runs, and of runs of further kinds. `most` is one number, or one for each run.
    Runs that do not repeat are of one kind only if they are very close. A few runs `beside` an unstable cycle stand for
    all on that side.
    """
    limits, beside = np.broadcast_to(most, (len(owners),)), beside or _Beside.nothing(len(owners))
    chosen: dict[int, list[int]] = {}
    surplus: list[int] = []
    repeats = ends.repeats.swings > 0
    sizes, times = ends.repeats.size, np.nan_to_num(ends.repeats.time)
    near = np.where(repeats, SAME_MOTION_SHARE, SAME_IRREGULAR_SHARE)
    cycles, leaves_first = beside.cycles, beside.leave_first

    def same_kind(k: int, j: int) -> bool:
        """Tell whether run `k` is of the kind of run `j`: equal swing, and equal time to repeat.

        Two runs that do not repeat may be of one kind. The result is false if run `j` resembles an unstable cycle.
        """
        same = (
            abs(sizes[k] - sizes[j]) <= near[k] * sizes[j] and abs(times[k] - times[j]) <= SAME_MOTION_SHARE * times[j]
        )
        return bool(same and repeats[k] == repeats[j] and cycles[j] < 0)

    for k in np.argsort(ends.repeats.swings, kind="stable").tolist():
        same_stage = chosen.setdefault(int(owners[k]), [])
        if cycles[k] < 0 and any(same_kind(k, j) for j in same_stage):
            continue
        if cycles[k] < 0 or leaves_first[k]:
            (same_stage if len(same_stage) < limits[k] else surplus).append(k)
    stand = [k for numbers in chosen.values() for k in numbers]
    return np.array(stand, dtype=np.int64), np.array(surplus, dtype=np.int64)
