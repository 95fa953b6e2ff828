"""Find every motion that attracts a stage and swings for ever, for many stages at once.

A survey simulates from many starts and adds the cycles that the return map suggests. It finds cycles of any period, and
irregular swings.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.engine.allowance import Exhausted
from friso.hunting.attractors.rounds import TIGHT_SURVEY_RTOL, typical_period
from friso.hunting.attractors.settings import settings
from friso.hunting.attractors.starts import Starts
from friso.hunting.attractors.survey import Repelling, Survey, Swinging
from friso.hunting.cycle.ensemble import ArrayRows, Ensemble
from friso.hunting.cycle.find import CYCLE_RTOL, GUESS_RTOL, Cycles, families
from friso.hunting.loop import surely_run_away


@dataclass(frozen=True)
class Target(ArrayRows):
    """Motion that a run must reach to count as hunting: arrays of shape (count,), or numbers.

    A run hunts if it still swings after the time `lasting` [s], by at least `amplitude` [m], half of peak to peak. Its
    period must be at most `period` [s]. A run that swings this far after the time `early` [s] will also do so later.
    `observed` is true where attractors were only seen in simulations that do not tell how fast they attract; motions
    nearby may then swing as far, but less often.
    """

    amplitude: Any
    period: Any
    lasting: Any
    early: Any
    observed: Any = False


LONGEST_COUNTED_PERIOD = 3.0  # [typical periods]
"""Longest period used for arrival times. With a slower cycle, every motion would have to be followed for as
long."""

ARRIVAL_TIME_CONSTANTS = 8.0  # [time constants]
"""Waiting time near a stable cycle, in time constants of the cycle. After eight of them 0.03 % of a deviation is
left."""

OBSERVED_SWING_PERIODS = 24.0  # [periods]
"""Shortest wait for a swing that was only observed, whose time constant is unknown."""

CLOSED_ORBIT_PERIODS = 6.0  # [periods]
"""Shortest wait for a motion near a closed orbit, however fast the orbit attracts."""

ARRIVAL_PERIODS = (60.0, 600.0)  # [periods]
"""Shortest and longest time until a motion counts as arrived. If shorter, slow transients pass for attracted; if
longer, runs cost more and change nothing."""

EARLY_ARRIVAL_SHARE = 0.25
"""Time of an early check, as a fraction of the arrival time. Most motions have arrived by then, and their runs can
end."""


@dataclass(frozen=True)
class Attractors:
    """Result of surveying several stages; arrays have the shape (count,).

    - `motions`: the attractors; at least one of each stage that has any, all of them after a thorough survey.
    - `decided`: whether the stage has an attractor is known; no failed or stopped run left it open.
    - `typical`: typical period of hunting [s].
    - `families`: cycles that the return map suggests to a thorough survey, stable or not, the symmetric ones first.
    - `flips`: simulations at two tolerances disagree; the tighter one holds.
    - `complete`: every motion was followed to its attractor.
    - `runs_away`: motions from far off diverge, because there is no anti-windup.
    """

    motions: tuple[Swinging, ...]
    decided: np.ndarray
    typical: np.ndarray
    families: tuple[Cycles, ...]
    flips: np.ndarray
    complete: np.ndarray
    runs_away: np.ndarray

    @property
    def attracts(self) -> np.ndarray:
        """Return which stages have an attractor, shape (count,)."""
        attracted = np.zeros(len(self.decided), bool)
        attracted[[motion.stage for motion in self.motions]] = True
        return attracted

    @property
    def target(self) -> Target:
        """Return the motion that marks a run as hunting, shape (count,); NaN for stages without one."""
        amplitude, period, lasting, early = (np.full(len(self.decided), np.nan) for _ in range(4))
        observed = np.zeros(len(self.decided), bool)
        for motion in self.motions:
            observed[motion.stage] |= motion.observed
            k, unit = motion.stage, min(motion.period, LONGEST_COUNTED_PERIOD * self.typical[motion.stage])
            amplitude[k] = np.fmin(amplitude[k], motion.amplitude)
            period[k] = np.fmax(period[k], motion.period)
            constants = ARRIVAL_TIME_CONSTANTS * motion.time_constant / unit
            waited = (OBSERVED_SWING_PERIODS if motion.observed else CLOSED_ORBIT_PERIODS) * motion.period
            until = max(np.clip(np.nan_to_num(constants), *ARRIVAL_PERIODS) * unit, waited)
            lasting[k] = np.fmax(lasting[k], until)
            early[k] = np.fmax(early[k], EARLY_ARRIVAL_SHARE * until if constants < ARRIVAL_PERIODS[1] else until)
        return Target(amplitude, period, lasting, early, observed)

    def take(self, numbers: np.ndarray) -> Attractors:
        """Return the survey's results for the stages with these numbers, renumbered in their order."""
        motions_of: dict[int, list[Swinging]] = {}
        for motion in self.motions:
            motions_of.setdefault(motion.stage, []).append(motion)
        motions = (replace(motion, stage=k) for k, n in enumerate(numbers.tolist()) for motion in motions_of.get(n, ()))
        suggested = tuple(cycles.take(numbers) for cycles in self.families)
        columns = (array[numbers] for array in (self.flips, self.complete, self.runs_away))
        return Attractors(tuple(motions), self.decided[numbers], self.typical[numbers], suggested, *columns)


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def attractors(
    stages: Ensemble,
    thorough: bool = False,
    rtol: float = CYCLE_RTOL,
    distances: np.ndarray | None = None,
    cycles: bool = True,
    repelling: tuple[Repelling, ...] = (),
) -> Attractors:
    """Find the attractors of stages, by simulation from many starts and from the return map.

    One attractor of each stage is enough, unless the survey is `thorough`, which looks for all of them. A thorough
    survey repeats simulations at a hundredth of the tolerance for stages of which no orbit was closed. It closes orbits
    to the relative tolerance `rtol`; other surveys take a wider one for orbits that may chatter. Runs also start from
    the `distances` [m], (count, n), where they are finite. Without `cycles`, a motion that has converged counts as
    attracted, and orbits are closed only from runs that have not converged by the third round.

    Runs that leave one of the cycles `repelling` are not followed.

    A thorough survey runs all starts at once, because eight runs together take as long as one. It also starts runs
    beside unstable cycles.

    If its allowance of work is used up, a thorough survey returns the attractors it has by then; a stage counts as
    decided where an orbit was closed. Other surveys raise Exhausted.
    """
    rtol = rtol if thorough else stages.searching_rtol(rtol)
    survey = Survey(surely_run_away(stages), thorough, rtol, prove=cycles, decides=thorough, repelling=repelling)
    numbers = np.arange(stages.count)
    nothing, typical, suggested = np.zeros(stages.count, bool), typical_period(stages), tuple[Cycles, ...]()
    try:
        if thorough and cycles:
            suggested = families(stages, rtol)
        starts = Starts(stages) if cycles else Starts(stages, GUESS_RTOL)
        if distances is not None:
            starts.stuck_at(distances)
        starts.spread(thorough)
        _take_notice(starts, survey, numbers, suggested)
        for runs, owners in starts.waves(thorough):
            survey.follow(runs, owners)
        if stages.remember:
            _try_memories(starts, survey)
        if cycles and not thorough:
            _try_cycles(starts, survey, rtol)
        decided = survey.attracted | ~survey.unknown
        columns = (nothing, ~survey.unknown, survey.runs_away)
        surveyed = Attractors(tuple(survey.attracting), decided, typical, suggested, *columns)
        return _tried_again(stages, surveyed, rtol) if thorough else surveyed
    except Exhausted:
        if not thorough:
            raise
        proved = np.zeros(stages.count, bool)
        proved[[motion.stage for motion in survey.attracting if motion.cycles is not None]] = True
        return Attractors(tuple(survey.attracting), proved, typical, suggested, nothing, nothing, nothing)


def _take_notice(starts: Starts, survey: Survey, numbers: np.ndarray, suggested: tuple[Cycles, ...]) -> None:
    """Confirm suggested stable cycles by runs, and add runs that start beside unstable ones.

    `numbers` are the numbers of the stages in the survey.
    """
    for cycles in suggested:
        survey.note_unstable_cycles(numbers, cycles)
        starts.beside(cycles)
        if (attracting := np.flatnonzero(cycles.attracting)).size:
            survey.confirm(starts.on_cycles(cycles, attracting), numbers[attracting], cycles.take(attracting))


def _try_memories(begun: Starts, survey: Survey) -> None:
    """Survey stages that have no attractor yet, from starts with bristles bent by past motion.

    `begun` has the starts of all stages; the survey is extended.
    """
    left = np.flatnonzero(~survey.attracted)
    if left.size:
        starts = begun.take(left)
        starts.remembering(survey.thorough)
        for runs, owners in starts.waves(at_once=survey.thorough):
            survey.follow(runs, left[owners])


def _try_cycles(begun: Starts, survey: Survey, rtol: float) -> None:
    """Survey stages that have no attractor yet, from cycles that the return map suggests.

    `begun` has the starts of all stages; the survey is extended. Near a fold the basin of a stable cycle is narrower
    than the spacing of the usual starts.
    """
    left = np.flatnonzero(~survey.attracted)
    if not left.size:
        return
    starts = begun.take(left)
    _take_notice(starts, survey, left, families(starts.stages, rtol))
    for runs, owners in starts.waves(at_once=True):
        survey.follow(runs, left[owners])


def _tried_again(stages: Ensemble, first: Attractors, rtol: float) -> Attractors:
    """Survey stages without a closed orbit again at a tighter tolerance, which decides.

    `first` is the earlier survey, whose closed orbits are kept. A stage for which only one of both surveys finds an
    attractor is marked in `flips` and stays undecided.
    """
    proved = {motion.stage for motion in first.motions if motion.cycles is not None}
    which = np.array([k for k in range(stages.count) if k not in proved], dtype=np.int64)
    if not which.size:
        return first
    survey = Survey(surely_run_away(stages), False, rtol, decides=True)
    survey.attracting += [motion for motion in first.motions if motion.stage in proved]
    starts = Starts(stages, TIGHT_SURVEY_RTOL)
    starts.spread(thorough=False)
    observed = [motion for motion in first.motions if motion.stage not in proved]
    shares = np.array(settings.beside_motion_shares)
    for motion in observed:
        distances = np.full((stages.count, len(shares)), np.nan)
        distances[motion.stage] = shares * motion.distance
        starts.stuck_at(distances)
        if motion.seen is not None:
            starts.seen(motion.stage, motion.seen)
    for cycles in first.families:
        survey.note_unstable_cycles(np.arange(stages.count), cycles)
    for runs, owners in starts.waves(at_once=True):
        survey.follow(runs, owners)
    if stages.remember:
        _try_memories(starts, survey)
    resolved = survey.attracted | ~survey.unknown
    flips = resolved & (first.attracts != survey.attracted)
    confirmed_twice = [motion for motion in survey.attracting if flips[motion.stage] or motion.stage in proved]
    confirmed = [motion for motion in observed if not flips[motion.stage]]
    decided = first.decided & resolved & ~flips
    away = first.runs_away & survey.runs_away
    return replace(first, motions=(*confirmed_twice, *confirmed), decided=decided, flips=flips, runs_away=away)
