"""Judge one stage: whether it has a stable limit cycle, and whether its motion ends in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from friso.engine.allowance import Exhausted, allowance
from friso.equations.bandwidth import faster
from friso.equations.motion import last_corner
from friso.hunting.attractors import Target
from friso.hunting.attractors.rounds import RUN_TURNING_POINTS, SURVEY_RTOL
from friso.hunting.basin import (
    DRAWN_MOVES,
    Kick,
    MoveShare,
    displacements_that_hunt,
    displacements_that_run_away,
    ends_in,
    moves_that_hunt,
    pushes_that_hunt,
)
from friso.hunting.criteria import Verdict, verdicts
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.hunting import (
    Cycle,
    Hunting,
    HuntingDoubt,
    Swing,
    cannot_hunt,
    hunting,
)
from friso.hunting.loop import leaves_for_good, may_run_away
from friso.hunting.margin import NOT_SOUGHT, Margin, SearchedBandwidths, search_bandwidths
from friso.hunting.measures import Measures, bands_of, measuring_options
from friso.hunting.motions import Motions, followed_motions, keeps_moving, resting, run_motions
from friso.hunting.path import SEARCH_LIMITS, AttractionEnd, BandwidthWindow
from friso.hunting.what_attracts import resolved_map
from friso.stage import Stage

MOVING = "the reference never stands still"
"""Reason why a stage whose reference never stands still does not hunt: it has no place to hunt about."""


class CheckPart(StrEnum):
    """Part of a check: reported as it begins, and by name if it runs out of work.

    The names are in `Judgement.given_up`. `ATTRACTION`, `STARTS` and `BANDWIDTHS` are computed in this order; `STARTS`
    is left out without an attractor. `LOWER_BANDWIDTHS` replaces `BANDWIDTHS` if the stage hunts up to the highest
    bandwidth. `FRICTION` comes after these, and `FEEDING` for a hunting stage with a backlash.
    """

    ATTRACTION = "what attracts the stage"
    STARTS = "kicks and moves"
    BANDWIDTHS = "other bandwidths"
    LOWER_BANDWIDTHS = "lower bandwidths"
    FRICTION = "other static friction"
    FEEDING = "what feeds it"

    @property
    def progress_word(self) -> str:
        """Return the words shown while this part is computed; they are in the glossary."""
        return _PROGRESS_WORDS.get(self, self.value)


_PROGRESS_WORDS = {
    CheckPart.BANDWIDTHS: "edge of hunting in bandwidth",
    CheckPart.FRICTION: "margin in static friction",
}


PARTS = CheckPart.ATTRACTION, CheckPart.STARTS, CheckPart.BANDWIDTHS
"""Parts of a check from which the verdict is computed, in order."""


@dataclass(frozen=True)
class Judgement:
    """The verdict (see `friso.hunting.criteria.run_outcome`) and the results behind it.

    - `displacement`, `push`, `moves`: starts of hunting, for a stage that has a stable cycle.
    - `margin`: edge of hunting in bandwidth; `windows`: other bandwidths at which the stage hunts.
    - `lower`: for a stage that hunts, the bandwidth below which it does not (None: none was found).
    - `settled_after` [s]: time after the last corner of the reference from which the motion stays within 10 um.
    - `followed` [s]: time for which the motion was continued (None: only to its own end, as the longer run was not
      needed or not completed).
    - `observed`: the attractor was seen in long simulations only, not closed as an orbit.
    - `lasting` [m]: peak-to-peak swing of the stage's own motion, if it lasts to the end but is no known attractor.
    - `runs_away`: the motion diverges from its reference.
    - `running_away`: displacements after which the stage diverges (None: not looked for).
    - `given_up`: parts that would have taken more work than was allowed.
    """

    verdict: Verdict
    hunting: Hunting
    displacement: Kick | None = None
    push: Kick | None = None
    moves: MoveShare | None = None
    margin: Margin | None = None
    windows: tuple[BandwidthWindow, ...] = ()
    lower: AttractionEnd | None = None
    settled_after: float | None = None
    followed: float | None = None
    observed: bool = False
    lasting: float | None = None
    runs_away: bool = False
    running_away: Kick | None = None
    given_up: tuple[CheckPart, ...] = ()

    @property
    def at_an_edge(self) -> bool:
        """Tell whether the stage lies between the ends of an edge of hunting in bandwidth."""
        ends = [
            self.margin and self.margin.end,
            self.lower,
            *(end for one in self.windows for end in (one.low, one.high)),
        ]
        return any(min(end.inside, end.outside) < 1 < max(end.inside, end.outside) for end in ends if end)

    @property
    def swing(self) -> Cycle | Swing | None:
        """Return the attractor: a cycle, or else an observed swing; None if there is none."""
        return next(iter((*self.hunting.attracting, *self.hunting.observed)), None)

    @property
    def cycle(self) -> Cycle | None:
        """Return the cycle that matters most: the stable one, or else the first; None without any."""
        return next(iter((*self.hunting.attracting, *self.hunting.cycles)), None)

    def uncertain(self, reason: str) -> Judgement:
        """Return the judgement with the verdict and all ends of hunting marked as not certain, for a `reason`."""

        def unsure(end: AttractionEnd | None) -> AttractionEnd | None:
            return end and replace(end, certain=False)

        hunting = self.hunting
        reason = f"{reason}; {hunting.reason}" if hunting.reason and not hunting.certain else reason
        return replace(
            self,
            hunting=replace(hunting, certain=False, reason=reason),
            margin=self.margin and replace(self.margin, certain=False),
            windows=tuple(BandwidthWindow(unsure(window.low), unsure(window.high)) for window in self.windows),
            lower=unsure(self.lower),
        )


CHECK_WORK = 8e8
"""Work of a check, about 10 s on one core. Stages that need more say what was left out."""

SURVEY_WORK_SHARE = 0.4
"""Fraction of the work for the search for attractors, which decides the verdict."""


def judge(
    stage: Stage,
    ran: Measures,
    rtol: float,
    begin: Callable[[CheckPart], None] = lambda part: None,
    work: float | None = None,
    tell: Callable[[Verdict], None] = lambda verdict: None,
) -> Judgement:
    """Judge a stage whose motion was run and measured with the relative tolerance `rtol`.

    `begin` is called as each part begins (see `CheckPart`). `tell` is called with the verdict as soon as it is certain.
    Kicks and other bandwidths are searched afterwards; a cycle followed from another bandwidth may still contradict the
    verdict. Parts that `work` does not suffice for (see `friso.engine.allowance`) are not certain.
    """
    work = CHECK_WORK if work is None else work
    motions = Motions.of(ran)
    begin(CheckPart.ATTRACTION)
    with allowance() as spent:
        moves_on = keeps_moving(stage.flat()) and not cannot_hunt(stage)
        attraction = (
            Hunting((), MOVING, True, None)
            if moves_on
            else hunting(stage, work=SURVEY_WORK_SHARE * work, side=float(ran.offset[0]))
        )
    if not motions.completed[0]:
        return Judgement("failed", attraction, runs_away=bool(motions.away[0]) and leaves_for_good(stage))
    if moves_on:
        return Judgement("none", attraction)
    if attraction.target:
        return _with_a_target(stage, motions, attraction, attraction.target, begin, work - spent.used, tell)
    begin(CheckPart.BANDWIDTHS)
    return _without_a_target(stage, motions, rtol, attraction, work - spent.used, tell)


REST_WORK_SHARE = 0.3
"""Fraction of the work for continuing a motion that has not come to rest."""


def _without_a_target(
    stage: Stage,
    motions: Motions,
    rtol: float,
    attraction: Hunting,
    work: float,
    tell: Callable[[Verdict], None],
) -> Judgement:
    """Judge a stage without an attractor: whether it rests, and at which bandwidths it hunts.

    `motions` has its own motion, and `attraction` the search for attractors. `tell` is called with the verdict.
    """
    with allowance(REST_WORK_SHARE * work) as spent:
        rest = followed_motions(
            stage.flat(),
            motions,
            1,
            replace(measuring_options(rtol, bands=bands_of(stage.flat())), room=RUN_TURNING_POINTS),
            possible=attraction.possible,
        )
    if rest.away[0] and leaves_for_good(stage):
        return Judgement("failed", attraction, runs_away=True)
    leaves = attraction.surveyed is not None and bool(attraction.surveyed.runs_away[0])
    runs_away, doubtful = leaves and bool(rest.away[0]), attraction.possible and attraction.certain
    if doubtful and not runs_away and rest.unknown[0]:
        attraction = replace(attraction, certain=False, reason=HuntingDoubt.WORK)
    elif doubtful and not runs_away and rest.moving[0] and rest.swing[0] > resting(stage.flat())[0]:
        attraction = replace(attraction, certain=False, reason=HuntingDoubt.MOTION)
    observed = bool(rest.steady[0])
    word = verdicts(motions.completed, motions.completed, rest.steady, rest.steady, rest.rests)[0]
    if attraction.certain and word != "failed":
        tell(word)
    sought, given_up = NOT_SOUGHT, ()
    if attraction.possible and not observed:
        sought, given_up = _sought(stage, attraction, work - spent.used)
    if sought.contradicts:
        attraction = replace(attraction, certain=False, reason=HuntingDoubt.RUNS)
    sought = _as_sure(stage, sought, attraction)
    after = float(rest.after[0]) if np.isfinite(rest.after[0]) else None
    return Judgement(
        word,
        attraction,
        margin=sought.margin,
        windows=sought.windows,
        settled_after=after,
        followed=float(rest.followed[0]) if np.isfinite(rest.followed[0]) else None,
        observed=observed,
        lasting=float(rest.swing[0]) if observed else None,
        runs_away=runs_away,
        running_away=displacements_that_run_away(stage) if leaves else None,
        given_up=given_up,
    )


RUNAWAY_SWING_FACTOR = 2.0
"""Swing beyond which a motion that does not come back diverges, as a multiple of the attractor's."""

KICK_WORK_SHARE = 0.3
"""Fraction of the work for kicks and moves; the search for the edge gets all that is left."""


def _with_a_target(
    stage: Stage,
    motions: Motions,
    attraction: Hunting,
    target: Target,
    begin: Callable[[CheckPart], None],
    work: float,
    tell: Callable[[Verdict], None],
) -> Judgement:
    """Judge a stage with an attractor: whether its own motion, or another start, leads there.

    `target` is how far and how late a run must swing to count as hunting. `begin` and `tell` are called as in `judge`.
    """
    with allowance() as spent:
        own = own_motion(stage, target, REST_WORK_SHARE * work)
        if not own.completed:
            return Judgement("failed", attraction, runs_away=_runs_away(stage, target) and leaves_for_good(stage))
        within = float(motions.settling[0])
        doubt = "" if own.ends else _restless(stage, attraction, own.swing, within)
        doubt = own.doubt or doubt
        if own.ends and own.swing > RUNAWAY_SWING_FACTOR * _widest(attraction):
            doubt = HuntingDoubt.MOTION
        sure = np.ones(1, bool)
        word = verdicts(sure, sure, sure, np.array([own.ends]), ~sure)[0]
        if attraction.certain and not doubt:
            tell(word)
        begin(CheckPart.STARTS)
        starts, started = _starts(stage, attraction, target, KICK_WORK_SHARE * work)
    begin(CheckPart.BANDWIDTHS)
    sought, given_up = _sought(stage, attraction, work - spent.used)
    sought = _as_sure(stage, sought, attraction)
    return Judgement(
        word,
        replace(attraction, certain=False, reason=doubt) if doubt else attraction,
        *starts,
        sought.margin,
        sought.windows,
        sought.lower,
        None if own.ends or not np.isfinite(within) else within,
        observed=not attraction.attracting,
        given_up=(*given_up, *started),
    )


@dataclass(frozen=True)
class OwnMotion:
    """How a stage's own motion ends.

    It `ends` in the attractor or not, its run was `completed`, and `swing` [m] is its final peak-to-peak swing. `doubt`
    is the reason why this is uncertain, "" for none: a tiny change of mass may change the end.
    """

    ends: bool
    completed: bool
    swing: float
    doubt: str = ""


MASS_CHANGES = (0.0, -1e-5, -1e-6, -1e-7, 1e-7, 1e-6, 1e-5)  # [of the mass]
"""Changes of the masses with which a stage's own motion is run, because no mass is known that exactly. The
first is 0, the motion itself."""

SMALL_SWING_FACTOR = 12.0
"""Factor by which a motion that swings by less than the attractor is continued, because it may still grow."""


def own_motion(stage: Stage, target: Target, work: float) -> OwnMotion:
    """Run the stage's own motion, also with slightly different masses, and find how it ends.

    The motion hunts if it ends in a swing of the size and period of `target`. A motion that still swings, but less far
    or less often, may be decaying. It is then continued, if the given work suffices.
    """
    flat = stage.flat()
    factors = 1 + np.array(MASS_CHANGES)
    changed = {key: value * factors for key, value in flat.items() if key in ("masses.cart", "masses.stage")}
    ends, completed, swing = ends_in({**flat, **changed}, len(factors), target)
    doubt = HuntingDoubt.RUNS if np.any(ends[completed] != ends[0]) else "" if completed.all() else HuntingDoubt.WORK
    own = OwnMotion(ends[0], completed[0], float(swing[0]), doubt)
    if own.ends or own.doubt or not own.completed or own.swing <= resting(flat)[0]:
        return own
    longer = replace(
        target,
        early=SMALL_SWING_FACTOR * target.lasting,
        lasting=SMALL_SWING_FACTOR * target.lasting,
    )
    try:
        with allowance(work):
            last = OwnMotion(*(column[0] for column in ends_in(flat, 1, longer)))
    except Exhausted:
        return own
    return last if last.completed else own


def _runs_away(stage: Stage, target: Target) -> bool:
    """Tell whether the stage's own motion diverges before a run would count as hunting.

    `target` has that time, from the last corner of the reference.
    """
    flat = stage.flat()
    longer = {**flat, "motion.duration": float(np.max(last_corner(flat)) + target.lasting)}
    return bool(run_motions(longer, 1, measuring_options(SURVEY_RTOL)).away[0])


def _widest(attraction: Hunting) -> float:
    """Return the largest attracting swing, peak to peak [m]."""
    return 2 * max(swing.amplitude for swing in (*attraction.attracting, *attraction.observed))


def _starts(
    stage: Stage, attraction: Hunting, target: Target, work: float
) -> tuple[tuple[Kick | None, Kick | None, MoveShare | None], tuple[CheckPart, ...]]:
    """Find the kicks and moves that start hunting, within an amount of work.

    Returns the displacements, the pushes and the moves. All are None if the attractor may be a passing swing, or if the
    work does not suffice. The second result names this part of the check if its answer is incomplete: for lack of work,
    or because runs failed.
    """
    starts: tuple[Kick | None, Kick | None, MoveShare | None] = (None, None, None)
    if attraction.passing:  # a swing that is smaller at its end may be transient as well
        return starts, ()
    widest = np.inf if attraction.lower_gains is None else RUNAWAY_SWING_FACTOR * _widest(attraction)
    try:
        with allowance(work):
            surveyed = attraction.surveyed
            landing_map = resolved_map(Ensemble.held(stage.flat(), 1), surveyed.motions) if surveyed else None
            starts = (
                displacements_that_hunt(stage, target, widest, landing_map),
                pushes_that_hunt(stage, target, widest, landing_map),
                moves_that_hunt(stage, target, widest, landing_map),
            )
    except Exhausted:
        return starts, (CheckPart.STARTS,)
    return starts, (CheckPart.STARTS,) if _some_unknown(*starts) else ()


def _restless(stage: Stage, attraction: Hunting, swing: float, within: float) -> str:
    """Return why a motion that ends in no attractor may not come to rest; "" if it does.

    `swing` [m] is its final peak-to-peak swing; `within` [s] is the time from which it stays near its reference (NaN:
    not within its run).
    """
    if swing > resting(stage.flat())[0]:
        return HuntingDoubt.MOTION
    surveyed = attraction.surveyed
    every = surveyed is None or bool(surveyed.complete[0])
    return "" if every or np.isfinite(within) else HuntingDoubt.MOTION


def _some_unknown(displacement: Kick | None, push: Kick | None, moved: MoveShare | None) -> bool:
    """Tell whether runs failed, so that kicks or moves that start hunting may have been missed.

    The result is true if no kick (or no move) was seen to start hunting, but runs failed.
    """
    kicks = [kick for kick in (displacement, push) if kick]
    lost = any(kick.unknown and not kick.windows for kick in kicks)
    return lost or (moved is not None and not moved.hunting and moved.count < DRAWN_MOVES)


def _sought(stage: Stage, attraction: Hunting, work: float) -> tuple[SearchedBandwidths, tuple[CheckPart, ...]]:
    """Search other bandwidths for hunting, within an amount of `work`.

    Returns the result, and as a second tuple this part of the check if its answer is incomplete, else nothing.
    """
    attracting = attraction.target is not None
    with allowance(work) as search:
        sought = search_bandwidths(stage, attracting, attraction.surveyed)
    left = CheckPart.LOWER_BANDWIDTHS if sought.to_the_top else CheckPart.BANDWIDTHS
    return sought, (left,) if search.exhausted or sought.undecided else ()


def _as_sure(stage: Stage, sought: SearchedBandwidths, attraction: Hunting) -> SearchedBandwidths:
    """Mark the ends found by a search through bandwidths as uncertain if the verdict is.

    Ends are uncertain too where the stage may diverge.
    """

    def sure(end: AttractionEnd) -> bool:
        if not (end.certain and attraction.certain):
            return False
        distance = SEARCH_LIMITS.edge_distance
        beyond = end.outside * (distance if end.outside > end.inside else 1 / distance)
        return not may_run_away(Ensemble.held(faster(stage.flat(), np.array([beyond])), 1))[0]

    def as_sure(end: AttractionEnd | None) -> AttractionEnd | None:
        return end and replace(end, certain=sure(end))

    edge = sought.margin
    return replace(
        sought,
        margin=edge and replace(edge, certain=sure(edge.end)),
        windows=tuple(BandwidthWindow(as_sure(window.low), as_sure(window.high)) for window in sought.windows),
        lower=as_sure(sought.lower),
    )
