"""The verdict on one stage and what it rests on: whether a cycle attracts, and whether its own motion ends in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from friso.engine.allowance import Exhausted, allowance
from friso.equations.bandwidth import faster
from friso.equations.motion import last_corner
from friso.hunting.attractors import Target
from friso.hunting.attractors.rounds import RTOL
from friso.hunting.attractors.settings import SurveySettings
from friso.hunting.basin import (
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
    REACHED,
    Cycle,
    Hunting,
    Swing,
    cannot_hunt,
    hunting,
)
from friso.hunting.limits import SEARCH_LIMITS
from friso.hunting.loop import leaves_for_good, may_run_away
from friso.hunting.margin import NOT_SOUGHT, Margin, SearchedBandwidths, followed_on, search_bandwidths
from friso.hunting.measures import Measures, measuring_options
from friso.hunting.motions import Motions, followed_motions, keeps_moving, resting, run_motions
from friso.hunting.outward import AttractionEnd, BandwidthWindow
from friso.hunting.settings import BasinSettings, CheckSettings
from friso.hunting.what_attracts import resolved_map
from friso.stage import Stage

MOVING = "the reference never stands still"
"""Why a stage whose reference is a ramp does not hunt: it may stick and slip, but not about a place."""


LEFT_OVER = "not every motion that kept swinging was followed to its end: this one may end in another swing"
"""Why it is not certain that a motion comes to rest which does not end in what attracts."""

SWINGS_ON = "this motion was still swinging when it was given up, by less than half of what was found to attract"
"""Why it is not certain that a motion comes to rest which was seen to swing on."""

STILL_SWINGS = "this motion still swings a little at the end of the longest run, but nothing was found that attracts"

UNFOLLOWED = (
    "this motion was not followed for long enough to see it come to rest: that takes more work than a check may"
)
"""Why it is not certain that a motion comes to rest where nothing was found that attracts."""

CHANGED = 1 + np.array([0.0, -1e-5, -1e-6, -1e-7, 1e-7, 1e-6, 1e-5])
"""Masses, as multiples of the stage's own, with which its motion is run: no machine is known as closely."""


RUNS_AWAY = "this motion swings much farther at its end than what was found to attract, and may run away"
"""Why it is not certain that a motion hunts which swings much farther than what attracts."""

BY_CHANCE = "a change of its mass by a hundred-thousandth, or rounding, decides whether this motion ends in hunting"
"""Why it is not certain how a motion ends that ends otherwise with some of these masses."""

UNCHECKED = "runs with hardly different masses, which show whether chance decides how this motion ends, were given up"
"""Reason given when the runs with changed masses were not completed."""


class CheckPart(StrEnum):
    """A part of a check: what is reported as it begins, and named where it is given up (`Judgement.given_up`), because
    it would take more work than was allowed.

    The first three are computed in this order; without anything that attracts `STARTS` is left out. `LOWER_BANDWIDTHS`
    is what is given up of `BANDWIDTHS` where something attracts up to the highest one. `FRICTION` is computed behind
    these, and `FEEDING`, of a stage with a backlash that something attracts.
    """

    ATTRACTION = "what attracts the stage"
    STARTS = "kicks and moves"
    BANDWIDTHS = "other bandwidths"
    LOWER_BANDWIDTHS = "lower bandwidths"
    FRICTION = "other static friction"
    FEEDING = "what feeds it"

    @property
    def progress_word(self) -> str:
        """What the user reads while this part is computed: words of the glossary."""
        return _PROGRESS_WORDS.get(self, self.value)


_PROGRESS_WORDS = {
    CheckPart.BANDWIDTHS: "edge of hunting in bandwidth",
    CheckPart.FRICTION: "margin in static friction",
}


PARTS = CheckPart.ATTRACTION, CheckPart.STARTS, CheckPart.BANDWIDTHS
"""What is computed for a verdict, in this order."""


@dataclass(frozen=True)
class Judgement:
    """The verdict (see `friso.hunting.criteria.stage_verdict`) and what it rests on.

    `displacement`, `push` and `moves` tell what starts hunting, where there is a cycle that attracts; `margin` the edge
    of hunting in bandwidth, `windows` where else something attracts, and `lower` the end below the bandwidth of what
    attracts a stage that hunts (None: none was found); `settled_after` the time [s] after the last corner of the
    reference from which on this motion stays within 10 um, up to the time for which it was `followed` [s] (None: no
    longer than its own end, as the longer run was not needed or not completed). `observed`: what attracts was observed
    in long simulations, no orbit that attracts could be closed. `lasting` [m], peak to peak, is where this motion alone
    was seen to swing on, at the end of the time for which it was followed; it `runs_away` if it leaves its reference
    for good. `given_up`: the parts that would have taken more work than was allowed.
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
    def swing(self) -> Cycle | Swing | None:
        """What attracts: a cycle, or else a swing that was observed; None if nothing does."""
        return next(iter((*self.hunting.attracting, *self.hunting.observed)), None)

    @property
    def cycle(self) -> Cycle | None:
        """The cycle that matters most: the one that attracts, or else the first there is."""
        return next(iter((*self.hunting.attracting, *self.hunting.cycles)), None)


def judge(
    stage: Stage,
    ran: Measures,
    rtol: float,
    begin: Callable[[CheckPart], None] = lambda part: None,
    work: float | None = None,
    tell: Callable[[Verdict], None] = lambda verdict: None,
) -> Judgement:
    """The verdict on a stage whose motion was run and measured at a relative tolerance.

    `begin` is told what is begun (see `CheckPart`), and `tell` the verdict itself as soon as it is certain by all that
    was computed for it: kicks and other bandwidths follow, and a cycle that is followed here from another bandwidth may
    still contradict it. What cannot be settled by so much `work` (see `friso.engine.allowance`) is not certain.
    """
    settings = CheckSettings.current()
    work = settings.check_work if work is None else work
    motions = Motions.of(ran)
    begin(CheckPart.ATTRACTION)
    with allowance() as spent:
        moves_on = keeps_moving(stage.flat()) and not cannot_hunt(stage)
        attraction = (
            Hunting((), MOVING, True, None) if moves_on else hunting(stage, work=settings.survey_work_share * work)
        )
    if not motions.completed[0]:
        return Judgement("failed", attraction, runs_away=bool(motions.away[0]) and leaves_for_good(stage))
    if attraction.target:
        return _with_a_target(stage, motions, attraction, attraction.target, begin, work - spent.used, tell)
    begin(CheckPart.BANDWIDTHS)
    return _without_a_target(stage, motions, rtol, attraction, work - spent.used, tell)


def _without_a_target(
    stage: Stage,
    motions: Motions,
    rtol: float,
    attraction: Hunting,
    work: float,
    tell: Callable[[Verdict], None],
) -> Judgement:
    """Judge a stage that nothing attracts: whether its own motion comes to rest, and where hunting begins."""
    with allowance(CheckSettings.current().rest_work_share * work) as spent:
        rest = followed_motions(
            stage.flat(),
            motions,
            1,
            replace(measuring_options(rtol), room=SurveySettings.current().run_turning_points),
            possible=attraction.possible,
        )
    if rest.away[0] and leaves_for_good(stage):
        return Judgement("failed", attraction, runs_away=True)
    leaves = attraction.surveyed is not None and bool(attraction.surveyed.runs_away[0])
    runs_away, doubtful = leaves and bool(rest.away[0]), attraction.possible and attraction.certain
    if doubtful and not runs_away and rest.unknown[0]:
        attraction = replace(attraction, certain=False, reason=UNFOLLOWED)
    elif doubtful and not runs_away and rest.moving[0] and rest.swing[0] > resting(stage.flat())[0]:
        attraction = replace(attraction, certain=False, reason=STILL_SWINGS)
    observed = bool(rest.steady[0])
    word = verdicts(motions.completed, rest.steady, rest.steady, rest.rests)[0]
    if attraction.certain and word != "failed":
        tell(word)
    sought, given_up = NOT_SOUGHT, ()
    if attraction.possible and not observed:
        sought, given_up = _sought(stage, attraction, work - spent.used)
    if sought.contradicts:
        attraction = replace(attraction, certain=False, reason=REACHED)
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


def _with_a_target(
    stage: Stage,
    motions: Motions,
    attraction: Hunting,
    target: Target,
    begin: Callable[[CheckPart], None],
    work: float,
    tell: Callable[[Verdict], None],
) -> Judgement:
    """Judge a stage that something attracts: whether its own motion ends in that, and what starts hunting."""
    settings = CheckSettings.current()
    with allowance() as spent:
        own = own_motion(stage, target, settings.rest_work_share * work)
        if not own.completed:
            return Judgement("failed", attraction, runs_away=_runs_away(stage, target) and leaves_for_good(stage))
        within = float(motions.settling[0])
        doubt = "" if own.ends else _restless(stage, attraction, own.swing, within)
        doubt = own.doubt or doubt
        if own.ends and own.swing > settings.runaway_swing_factor * _widest(attraction):
            doubt = RUNS_AWAY
        word = verdicts(np.ones(1, bool), np.ones(1, bool), np.array([own.ends]), np.zeros(1, bool))[0]
        if attraction.certain and not doubt:
            tell(word)
        begin(CheckPart.STARTS)
        starts, started = _starts(stage, attraction, target, settings.kick_work_share * work)
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
    """Where a stage's own motion ends: whether in what attracts it, whether its run was completed, how far it swings at
    the end, peak to peak [m], and what makes that uncertain, "" if nothing does: a mass that is hardly another may."""

    ends: bool
    completed: bool
    swing: float
    doubt: str = ""


def own_motion(stage: Stage, target: Target, work: float) -> OwnMotion:
    """Where the stage's own motion ends (see `ends_in`). One that still swings then, by less than what attracts, or
    less often, is followed for longer, if that takes no more than so much work: it may be dying out."""
    settings = CheckSettings.current()
    flat = stage.flat()
    changed = {key: value * CHANGED for key, value in flat.items() if key in ("masses.cart", "masses.stage")}
    ends, completed, swing = ends_in({**flat, **changed}, len(CHANGED), target)
    doubt = BY_CHANCE if np.any(ends[completed] != ends[0]) else "" if completed.all() else UNCHECKED
    own = OwnMotion(ends[0], completed[0], float(swing[0]), doubt)
    if own.ends or own.doubt or not own.completed or own.swing <= resting(flat)[0]:
        return own
    longer = replace(
        target, early=settings.small_swing_factor * target.lasting, lasting=settings.small_swing_factor * target.lasting
    )
    try:
        with allowance(work):
            last = OwnMotion(*(column[0] for column in ends_in(flat, 1, longer)))
    except Exhausted:
        return own
    return last if last.completed else own


def _runs_away(stage: Stage, target: Target) -> bool:
    """Whether the stage's own motion leaves its reference farther than runs are followed, before it has come to what
    attracts it."""
    flat = stage.flat()
    longer = {**flat, "motion.duration": float(np.max(last_corner(flat)) + target.lasting)}
    return bool(run_motions(longer, 1, measuring_options(RTOL)).away[0])


def _widest(attraction: Hunting) -> float:
    """The largest swing that attracts, peak to peak [m]."""
    return 2 * max(swing.amplitude for swing in (*attraction.attracting, *attraction.observed))


def _starts(
    stage: Stage, attraction: Hunting, target: Target, work: float
) -> tuple[tuple[Kick | None, Kick | None, MoveShare | None], tuple[CheckPart, ...]]:
    """Which kicks and moves start hunting, as far as so much work shows, and what of that had to be given up."""
    settings = CheckSettings.current()
    starts: tuple[Kick | None, Kick | None, MoveShare | None] = (None, None, None)
    if attraction.passing:  # what swings less at its end may be passing as well
        return starts, ()
    widest = np.inf if attraction.lower_gains is None else settings.runaway_swing_factor * _widest(attraction)
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
    """Why a motion need not come to rest that does not end in what was found to attract, and at last swings by so much
    [m], peak to peak; `within` is the time from which on it stays near its reference [s] (NaN: not within its run).
    "" if it does."""
    if swing > resting(stage.flat())[0]:
        return SWINGS_ON
    surveyed = attraction.surveyed
    every = surveyed is None or bool(surveyed.complete[0])
    return "" if every or np.isfinite(within) else LEFT_OVER


def _some_unknown(displacement: Kick | None, push: Kick | None, moved: MoveShare | None) -> bool:
    """Whether no kick or no move of one kind was seen to start hunting, and runs of that kind were not completed."""
    kicks = [kick for kick in (displacement, push) if kick]
    lost = any(kick.unknown and not kick.windows for kick in kicks)
    return lost or (moved is not None and not moved.hunting and moved.count < BasinSettings.current().drawn_moves)


def _sought(stage: Stage, attraction: Hunting, work: float) -> tuple[SearchedBandwidths, tuple[CheckPart, ...]]:
    """What a search through the bandwidths shows that may use so much work, and what of it had to be given up."""
    attracting = attraction.target is not None
    with allowance(work) as search:
        sought = search_bandwidths(stage, attracting, attraction.surveyed)
    with allowance(CheckSettings.current().beyond_edge_work):
        sought = followed_on(stage, sought)
    left = CheckPart.LOWER_BANDWIDTHS if sought.to_the_top else CheckPart.BANDWIDTHS
    return sought, (left,) if search.exhausted or sought.undecided else ()


def _as_sure(stage: Stage, sought: SearchedBandwidths, attraction: Hunting) -> SearchedBandwidths:
    """Make the ends found by a search no more certain than the verdict, and uncertain where the stage may run away."""

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
