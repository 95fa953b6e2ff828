"""Simulate by brute force: many starts of a stage, followed for long in the engine."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from benchmarks.truth.swings import FAILED, RESTS, SWINGS, UNSURE, judge, legs
from friso.engine.arrays import STATISTICS, Status
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import Kernel, kernel
from friso.equations.continuous import slow_gains
from friso.equations.motion import last_corner
from friso.equations.roles import Role, Steady
from friso.equations.structure import structure

ROUGH, CLOSER, FINE = 1e-6, 1e-7, 1e-9
"""Relative tolerances: for many starts, and the two at which a swing is examined closely."""

DECADES = (1e-4, 1e3)
"""Range of releases in deflections of the loop by the break-away force, and of pushes in that deflection times the
natural frequency."""

LIMITED = 1e6
"""Largest release of a stage with a force limit, in deflections of the loop by the break-away force, because motions
driven by a limit are large."""

NEAR = (0.01, 10.0)
"""Range in which stuck stages begin, in deflections of the loop by the break-away force."""

SMALL = 2e-3
"""Swing, over the deflection of the loop by the break-away force and by the bias, that counts as rest."""

ROUNDS = (150.0, 800.0, 4000.0)
"""Periods for which a run is followed, round by round, until it is decided."""

BESIDE = np.array([0.001, 0.003, 0.01])
"""Relative changes of a state on a swing, larger and smaller. From both sides the swing has to be resumed."""

LINGERING = 12_000.0
"""Periods of a swing for which its neighbours are followed. In that time a deviation of 0.3 % from a cycle that repels
by 0.03 % a swing grows by a factor of a thousand. Errors of 1e-6 change such a multiplier by as much as it differs from
1: at the rough tolerance runs stay on the cycle for 60 000 periods."""

SOONER = 0.05
"""Share of that time after which neighbours that rest are looked for, if it is longer than the first round."""

FOLLOWED = 6
"""Number of runs that are followed further."""

BUDGET = 100_000_000
"""Most steps of a run."""


@dataclass(frozen=True)
class Trial:
    """Starts of one stage, (starts, states), with kinds and displacements or velocities.

    They are in [m] or [m/s].
    """

    states: np.ndarray
    kinds: tuple[str, ...]
    sizes: np.ndarray

    def take(self, numbers: np.ndarray) -> Trial:
        return Trial(self.states[numbers], tuple(self.kinds[k] for k in numbers), self.sizes[numbers])

    def and_more(self, states: np.ndarray, kind: str) -> Trial:
        """Return these starts and others of one kind, whose sizes are those of their positions."""
        kinds = self.kinds + (kind,) * len(states)
        return Trial(np.vstack([self.states, states]), kinds, np.append(self.sizes, states[:, 0]))


@dataclass(frozen=True)
class Outcome:
    """What became of starts.

    It has words of `swings`, half of peak to peak at the end [m], states at the end (positions relative to the resting
    reference), the time [s] for which each was followed, and the mean time [s] of two large legs in the last quarter.
    """

    words: np.ndarray
    amplitude: np.ndarray
    ends: np.ndarray
    followed: np.ndarray
    periods: np.ndarray

    @property
    def swinging(self) -> np.ndarray:
        return np.flatnonzero(self.words == SWINGS)


@dataclass(frozen=True)
class Bench:
    """A stage as flat keys, with its reference at 0 unless its own motion is followed.

    A claimed `swing` [m], half of peak to peak, does not count as rest.
    """

    flat: Mapping[str, Any]
    swing: float = np.inf

    @cached_property
    def kernel(self) -> Kernel:
        return kernel(structure(dict(self.flat)))

    def _number(self, name: str) -> float:
        flat = {**self.flat, "motion.size": 1.0, "motion.duration": np.inf}
        (value,) = getattr(self.kernel.module, name)(self.kernel.values(flat, 1))
        return float(np.ravel(value)[0])

    @cached_property
    def length(self) -> float:
        """Return the deflection of the loop by the break-away force [m]."""
        return self._number("breakaway") / self._number("stiffness")

    @cached_property
    def omega(self) -> float:
        """Return the natural frequency of mass and loop [1/s]."""
        return self._number("rate")

    @cached_property
    def period(self) -> float:
        """Return roughly the period [s] of a cycle that sticks at a third of `length`.

        It is twice the time to wind up, by the controller's integral gain, and an oscillation; infinite without an
        integral.
        """
        _, integral = slow_gains(self.flat)
        wait = 3 * self._number("stiffness") / abs(integral) if integral else np.inf
        return float(2 * (wait + 2 * np.pi / self.omega))

    @property
    def held(self) -> dict[str, Any]:
        still = {key: value for key, value in self.flat.items() if not key.startswith("motion.")}
        return {**still, "motion.kind": "release", "motion.displacement": self.length}

    def _settled(self, error: np.ndarray, position: np.ndarray, force: np.ndarray | float = 0.0) -> np.ndarray:
        flat = {**self.held, "motion.size": np.nan, "motion.duration": np.inf}
        return self.kernel.settled(flat, Steady(error, position, force=force), len(position))

    def starts(self, releases: int, pushes: int, stuck: int, drawn: int, seed: int) -> Trial:
        """Return starts of four kinds.

        Releases and pushes cover seven decades, to either side in turn; stuck stages have a wound-up integrator; some
        starts are drawn at random.
        """
        rng = np.random.default_rng([seed, 7])
        sign = np.where(np.arange(1000) % 2, -1.0, 1.0)
        farthest = LIMITED if "controller.force_limit" in self.flat else DECADES[1]
        released = np.geomspace(DECADES[0], farthest, releases) * self.length * sign[:releases]
        pushed = np.geomspace(*DECADES, pushes) * self.length * self.omega * sign[:pushes]
        stands = np.geomspace(*NEAR, stuck) * self.length * sign[:stuck]
        places, speeds = (
            np.exp(rng.uniform(np.log(NEAR[0]), np.log(NEAR[1]), drawn)) * unit * rng.choice([-1, 1], drawn)
            for unit in (self.length, self.length * self.omega)
        )
        forces = rng.uniform(-1, 1, drawn) * self._number("breakaway")
        blocks = [
            self._settled(np.zeros(releases), released),
            self._moving(np.zeros(pushes), pushed),
            self.stuck_at(stands),
            self._moving(places, speeds, forces),
        ]
        kinds = ["release"] * releases + ["push"] * pushes + ["stuck at"] * stuck + ["drawn at"] * drawn
        return Trial(np.vstack(blocks), tuple(kinds), np.concatenate([released, pushed, stands, places]))

    def _moving(self, places: np.ndarray, speeds: np.ndarray, force: np.ndarray | float = 0.0) -> np.ndarray:
        states = self._settled(-places, places, force)
        states[:, self.kernel.having(Role.VELOCITY)] = speeds[:, None]
        return states

    def released(self, displacements: np.ndarray) -> Trial:
        """Return releases from displacements [m], where the stage was held until filters of the error had settled."""
        count, free = len(displacements), {**self.held, "motion.size": np.nan, "motion.duration": np.inf}
        states = self.kernel.at_rest(free, displacements, count, displacements)
        return Trial(states, ("release",) * count, displacements)

    def follow(
        self,
        trial: Trial,
        rtol: float,
        rounds: tuple[float, ...] = ROUNDS,
        any_will_do: bool = True,
        patient: bool = True,
    ) -> Outcome:
        """Return what becomes of starts.

        A few of the starts that are undecided after a round are followed further, unless a single swinging one is
        enough. After the last round a start that is undecided is judged by how it has changed, if `patient`.
        """
        return self._follow(self.held, trial.states, 0.0, rtol, rounds, any_will_do, patient)

    def stuck_at(self, displacements: np.ndarray) -> np.ndarray:
        """Return states of the stage stuck at displacements [m], with no force exerted."""
        return self._settled(-displacements, displacements)

    def beside(self, end: np.ndarray, factors: np.ndarray) -> np.ndarray:
        """Return a state in which a run ended, made larger and smaller by factors, (factors, kept).

        Near a weakly unstable cycle a run lingers, the longer the finer the tolerance, and only its neighbours leave.
        """
        states = end * factors[:, None]
        states[:, len(self.kernel.states) :] = end[len(self.kernel.states) :]
        return states

    def sustains(self, beside: Callable[[np.ndarray], np.ndarray], time: float, words: Sequence[str]) -> bool:
        """Tell whether starts beside a swing end in one of some words after a time [s].

        `beside` makes the starts from factors. They must do so on both sides, at equal distances, and at both
        tolerances.
        """
        states = beside(1 + np.concatenate([-BESIDE, BESIDE]))
        trial = Trial(states, ("beside a swing",) * len(states), np.ones(len(states)))
        both, periods = np.ones(len(BESIDE), bool), time / self.period
        if SOONER * periods > ROUNDS[0]:  # most that leave a swing rest long before the end
            soon = self.follow(trial, CLOSER, (SOONER * periods,), patient=False)
            both = (soon.words.reshape(2, -1) != RESTS).all(axis=0)
            if not both.any():
                return False
        for rtol in (CLOSER, FINE):
            ended = np.isin(self.follow(trial, rtol, (periods,)).words.astype(str), words)
            both &= ended.reshape(2, -1).all(axis=0)
            if not both.any():
                return False
        return True

    def follow_own(self, rtol: float, longest: float = 100.0) -> Outcome:
        """Return the end of the stage's own motion, run for a multiple of its duration.

        It is then run for `ROUNDS`.
        """
        periods = max(ROUNDS[0], min(longest * self.flat["motion.duration"] / self.period, ROUNDS[1]))
        corner = float(np.max(last_corner(dict(self.flat))))
        return self._follow(self.flat, None, corner, rtol, (periods, *ROUNDS[1:]), False)

    def _follow(
        self,
        flat: Mapping[str, Any],
        states: np.ndarray | None,
        corner: float,
        rtol: float,
        rounds: tuple[float, ...],
        any_will_do: bool,
        patient: bool = True,
    ) -> Outcome:
        count = 1 if states is None else len(states)
        words = np.full(count, UNSURE, dtype=object)
        amplitude, followed, own_periods = np.zeros(count), np.zeros(count), np.full(count, self.period)
        ends = np.full((count, len(self.kernel.full_state)), np.nan)
        on, begin = np.arange(count), states
        for number, periods in enumerate(rounds):
            end = corner + periods * self.period
            own = {**flat, "motion.duration": end}
            for part in run_chunks(self.kernel, own, len(on), self._options(rtol), begin):
                which = on[part.numbers]
                words[which], amplitude[which], own_periods[which] = self._words(
                    part, end, patient and number == len(rounds) - 1
                )
                ends[which] = self._at_rest(part.results.ends, flat)
                followed[which] += end
            unsure = np.flatnonzero(words == UNSURE)
            if not unsure.size or (any_will_do and SWINGS in words):
                break
            on = unsure[np.unique(np.linspace(0, len(unsure) - 1, FOLLOWED).astype(int))]
            begin, corner = ends[on], 0.0
            flat = self._after(flat)
        return Outcome(words, amplitude, ends, followed, own_periods)

    def _after(self, flat: Mapping[str, Any]) -> dict[str, Any]:
        """Return the stage after its reference has come to rest; positions count from there."""
        return self.held if flat["motion.kind"] != "ramp" else dict(flat)

    def _at_rest(self, ends: np.ndarray, flat: Mapping[str, Any]) -> np.ndarray:
        """Return states to continue from.

        Positions, and filters of them, count from where the reference rests.
        """
        rest = flat["motion.size"] if flat["motion.kind"] == "step" else 0.0
        ends = ends.copy()
        ends[:, self.kernel.having(Role.POSITION)] -= rest
        names = [name for name in self.kernel.states if name.startswith("filtered_position")]
        ends[:, [self.kernel.states.index(name) for name in names]] -= rest
        return ends

    def _options(self, rtol: float) -> RunOptions:
        return RunOptions(
            rtol=rtol, window=0.75, record_from=np.inf, least_swing=self.small / 4, budget=BUDGET, threads=1
        )

    @property
    def small(self) -> float:
        return min(SMALL * self.length, self.swing / 2)

    def _words(self, part: Any, end: float, patient: bool) -> tuple[list[str], list[float], list[float]]:
        results = part.results
        high, low = (results.statistics[:, STATISTICS.index(f"deviation_{side}")] for side in ("max", "min"))
        words, sizes, periods = [], [], []
        for k, count in enumerate(results.turn_counts):
            seen = legs(results.turn_times[k, :count], results.turn_values[k, :count], end)
            done = results.statuses[k] == Status.DONE
            words.append(judge(seen, float(high[k] - low[k]), self.small, patient) if done else FAILED)
            sizes.append(float(high[k] - low[k]) / 2)
            periods.append(end / 2 / max(seen.count, 1))
        return words, sizes, periods
