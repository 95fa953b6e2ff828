"""The verdict on stages: whether there is a cycle that attracts, and whether their own motion ends in it.

`judge` tells of one stage what its verdict rests on; `judge_many` gives those of many stages at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.engine.allowance import Exhausted, allowance
from friso.engine.batch import RunOptions
from friso.equations.bandwidth import faster
from friso.equations.motion import last_corner
from friso.equations.structure import shared_structure
from friso.hunting.attractors import Attractors, Target, attractors
from friso.hunting.attractors.rounds import RTOL
from friso.hunting.basin import (
    MOVES,
    Kick,
    MoveShare,
    displacements_that_hunt,
    displacements_that_run_away,
    ends_in,
    moves_that_hunt,
    pushes_that_hunt,
    swings_seldom,
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
    surely_surveyed,
    why_not,
)
from friso.hunting.loop import leaves_for_good, may_run_away, winds_up_at_a_limit
from friso.hunting.margin import DISTANCE, NOT_SOUGHT, Margin, SearchedBandwidths, followed_on, search_bandwidths
from friso.hunting.measures import Measures, measuring_options
from friso.hunting.motions import FollowedMotions, Motions, followed_motions, resting, run_motions, some_of
from friso.hunting.outward import AttractionEnd, BandwidthWindow
from friso.stage import Stage

MOVING = "the reference never stands still"
"""Why a stage whose reference is a ramp does not hunt: it may stick and slip, but not about a place."""

WORK = 8e8
"""Work of a check (see `friso.engine.allowance`): about 10 s on one core."""

SURVEY, REST, KICKS = 0.4, 0.3, 0.3
"""Shares of the work of a verdict that the search for what attracts the stage may use at most, and of what that leaves
those for following a motion that has not come to rest, and for kicks and moves; the search for the edge of hunting may
use all that is left then."""

AGAIN = 1.5e8
"""Work beside that of a check in which cycles are followed beyond the edge of hunting."""

FARTHER = 12.0
"""How many times as long a motion is followed that still swings by less than what attracts."""

LEFT_OVER = "not every motion that kept swinging was followed to its end: this one may end in another swing"
"""Why it is not certain that a motion comes to rest which does not end in what attracts."""

SWINGS_ON = "this motion was still swinging when it was given up, by less than half of what was found to attract"
"""The same where it has been seen not to have done so."""

STILL_SWINGS = "this motion still swings a little at the end of the longest run, but nothing was found that attracts"

UNFOLLOWED = (
    "this motion was not followed for long enough to see it come to rest: that takes more work than a check may"
)
"""Why it is not certain that a motion comes to rest where nothing was found that attracts."""

CHANGED = 1 + np.array([0.0, -1e-5, -1e-6, -1e-7, 1e-7, 1e-6, 1e-5])
"""Masses, as multiples of the stage's own, with which its motion is run: no machine is known as closely."""

RUNNING_AWAY = 2.0
"""How many times as far as what attracts, peak to peak, a motion swings at its end that does not end there."""

RUNS_AWAY = "this motion swings much farther at its end than what was found to attract, and may run away"
"""Why it is not certain that such a motion hunts as is said."""

BY_CHANCE = "a change of its mass by a hundred-thousandth, or rounding, decides whether this motion ends in hunting"
"""Why it is not certain how a motion ends that ends otherwise with some of these masses."""

UNCHECKED = "runs with hardly different masses, which show whether chance decides how this motion ends, were given up"
"""The same where it is not known whether it does."""

ROOM = 1 << 14
"""Room for turning points of a motion that is followed for long: one that needs more is run again."""


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
    for good. `given_up`: what of `PARTS`, or `LOWER`, or `FEEDING`, would have taken more work than was allowed.
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
    given_up: tuple[str, ...] = ()

    @property
    def swing(self) -> Cycle | Swing | None:
        """What attracts: a cycle, or else a swing that was observed; None if nothing does."""
        return next(iter((*self.hunting.attracting, *self.hunting.observed)), None)

    @property
    def cycle(self) -> Cycle | None:
        """The cycle that matters most: the one that attracts, or else the first there is."""
        return next(iter((*self.hunting.attracting, *self.hunting.cycles)), None)


PARTS = ATTRACTION, STARTS, BANDWIDTHS = "what attracts the stage", "kicks and moves", "other bandwidths"
"""What is computed for a verdict, in this order; without a cycle that attracts the second is left out."""

LOWER = "lower bandwidths"
"""What is given up of the other bandwidths where something attracts up to the highest one."""

FEEDING = "what feeds it"
"""What is computed behind these of a stage with a backlash that something attracts."""


def judge(
    stage: Stage,
    ran: Measures,
    rtol: float,
    begin: Callable[[str], None] = lambda label: None,
    work: float = WORK,
) -> Judgement:
    """The verdict on a stage whose motion was run and measured at a relative tolerance; `begin` is told what is begun
    (see `PARTS`). What cannot be settled by so much `work` (see `friso.engine.allowance`) is not certain."""
    motions = Motions.of(ran)
    begin(ATTRACTION)
    with allowance() as spent:
        moves_on = _keeps_moving(stage.flat()) and not cannot_hunt(stage)
        attraction = Hunting((), MOVING, True, None) if moves_on else hunting(stage, work=SURVEY * work)
    if not motions.completed[0]:
        return Judgement("failed", attraction, runs_away=bool(motions.away[0]) and leaves_for_good(stage))
    if attraction.target:
        return _with_a_target(stage, motions, attraction, attraction.target, begin, work - spent.used)
    begin(BANDWIDTHS)
    return _without_a_target(stage, motions, rtol, attraction, work - spent.used)


def _without_a_target(stage: Stage, motions: Motions, rtol: float, attraction: Hunting, work: float) -> Judgement:
    with allowance(REST * work) as spent:
        rest = followed_motions(
            stage.flat(), motions, 1, replace(measuring_options(rtol), room=ROOM), possible=attraction.possible
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
    sought, given_up = NOT_SOUGHT, ()
    if attraction.possible and not observed:
        sought, given_up = _sought(stage, attraction, work - spent.used)
    if sought.contradicts:
        attraction = replace(attraction, certain=False, reason=REACHED)
    sought = _as_sure(stage, sought, attraction)
    after = float(rest.after[0]) if np.isfinite(rest.after[0]) else None
    word = verdicts(motions.completed, rest.steady, rest.steady, rest.rests)[0]
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
    begin: Callable[[str], None],
    work: float,
) -> Judgement:
    with allowance() as spent:
        own = own_motion(stage, target, REST * work)
        if not own.completed:
            return Judgement("failed", attraction, runs_away=_runs_away(stage, target) and leaves_for_good(stage))
        within = float(motions.settling[0])
        doubt = "" if own.ends else _restless(stage, attraction, own.swing, within)
        doubt = own.doubt or doubt
        if own.ends and own.swing > RUNNING_AWAY * _widest(attraction):
            doubt = RUNS_AWAY
        begin(STARTS)
        starts, started = _starts(stage, attraction, target, KICKS * work)
    begin(BANDWIDTHS)
    sought, given_up = _sought(stage, attraction, work - spent.used)
    sought = _as_sure(stage, sought, attraction)
    return Judgement(
        verdicts(np.ones(1, bool), np.ones(1, bool), np.array([own.ends]), np.zeros(1, bool))[0],
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
    flat = stage.flat()
    changed = {key: value * CHANGED for key, value in flat.items() if key in ("masses.cart", "masses.stage")}
    ends, completed, swing = ends_in({**flat, **changed}, len(CHANGED), target)
    doubt = BY_CHANCE if np.any(ends[completed] != ends[0]) else "" if completed.all() else UNCHECKED
    own = OwnMotion(ends[0], completed[0], float(swing[0]), doubt)
    if own.ends or own.doubt or not own.completed or own.swing <= resting(flat)[0]:
        return own
    longer = replace(target, early=FARTHER * target.lasting, lasting=FARTHER * target.lasting)
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
) -> tuple[tuple[Kick | None, Kick | None, MoveShare | None], tuple[str, ...]]:
    """Which kicks and moves start hunting, as far as so much work shows, and what of that had to be given up."""
    starts: tuple[Kick | None, Kick | None, MoveShare | None] = (None, None, None)
    if attraction.passing:  # what swings less at its end may be passing as well
        return starts, ()
    widest = np.inf if attraction.lower_gains is None else RUNNING_AWAY * _widest(attraction)
    try:
        with allowance(work):
            starts = (
                displacements_that_hunt(stage, target, widest),
                pushes_that_hunt(stage, target, widest),
                moves_that_hunt(stage, target, widest),
            )
    except Exhausted:
        return starts, (STARTS,)
    return starts, (STARTS,) if _some_unknown(*starts) else ()


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
    return lost or (moved is not None and not moved.hunting and moved.count < MOVES)


def _sought(stage: Stage, attraction: Hunting, work: float) -> tuple[SearchedBandwidths, tuple[str, ...]]:
    """What a search through the bandwidths shows that may use so much work, and what of it had to be given up."""
    attracting = attraction.target is not None
    with allowance(work) as search:
        sought = search_bandwidths(stage, attracting, attraction.surveyed)
    with allowance(AGAIN):
        sought = followed_on(stage, sought, attracting)
    left = LOWER if sought.to_the_top else BANDWIDTHS
    return sought, (left,) if search.exhausted else ()


def _as_sure(stage: Stage, sought: SearchedBandwidths, attraction: Hunting) -> SearchedBandwidths:
    """The same, no edge more certain than the verdict, nor certain where the stage may run away beyond it."""

    def sure(end: AttractionEnd) -> bool:
        if not (end.certain and attraction.certain):
            return False
        beyond = end.outside * (DISTANCE if end.outside > end.inside else 1 / DISTANCE)
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


def _keeps_moving(flat: Mapping[str, Any]) -> bool:
    return flat["motion.kind"] == "ramp" and bool(np.any(flat["motion.velocity"]))


def can_hunt(flat: Mapping[str, Any]) -> bool:
    """Whether stages of one structure may hunt: there is friction to stick to, integral action that winds up, and a
    reference that stands still."""
    return not why_not(shared_structure(flat)) and not _keeps_moving(flat)


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def judge_many(flat: Mapping[str, Any], count: int, rtol: float) -> np.ndarray:
    """The verdicts on stages of one structure, given as flat keys to SI numbers or arrays of shape (count,).

    As by `judge`, but from fewer starts, which may miss what attracts from a narrow range of them; simulations that
    fail leave the verdict "failed".
    """
    stages = Ensemble.held(flat, count, form=shared_structure(flat))
    survey = attractors(stages) if can_hunt(flat) else None
    motions = run_motions(flat, count, measuring_options(rtol))
    return judge_runs(flat, motions, survey, surely_surveyed(stages, survey), rtol)


@np.errstate(all="ignore")
def judge_runs(
    flat: Mapping[str, Any],
    motions: Motions,
    survey: Attractors | None,
    certain: np.ndarray,
    rtol: float,
    threads: int | None = None,
    cancel: np.ndarray | None = None,
) -> np.ndarray:
    """The same where the stages' own motions were run, and what attracts is known already (None: they cannot hunt), and
    of which that is `certain`, shape (count,); `threads` and `cancel` as in `RunOptions`."""
    count = len(motions.completed)
    stages = Ensemble.held(flat, count, form=shared_structure(flat))
    decided = motions.completed & certain
    attracts = np.zeros(count, bool) if survey is None else survey.attracts.copy()
    in_cycle, rests = np.zeros(count, bool), np.zeros(count, bool)
    run_options = measuring_options(rtol, threads, cancel)
    attracted = np.flatnonzero(decided & attracts)
    if survey is not None and attracted.size:
        target = survey.take(attracted).target
        ends, completed, swing = ends_in(
            some_of(flat, attracted), attracted.size, target, threads=threads, cancel=cancel
        )
        completed &= ~swings_seldom(target, ends, swing)
        if winds_up_at_a_limit(stages):
            completed &= ~(ends & (swing > RUNNING_AWAY * 2 * target.amplitude))
        in_cycle[attracted], decided[attracted] = ends, completed
        settled = np.isfinite(motions.settling[attracted]) & (swing <= resting(flat, count)[attracted])
        restless = attracted[completed & ~ends & ~settled]
        if restless.size:  # something may attract them that swings less than what was found
            moved = some_of(flat, restless), motions.take(restless)
            in_cycle[restless], decided[restless] = _swing_on(*moved, run_options)
    free = np.flatnonzero(decided & ~attracts)
    if free.size:
        rest = followed_motions(
            some_of(flat, free), motions.take(free), free.size, run_options, possible=survey is not None
        )
        rests[free], attracts[free], in_cycle[free] = rest.rests, rest.steady, rest.steady
        if survey is not None:
            decided[free] = rest.steady | _stands(some_of(flat, free), rest)
    return verdicts(decided, attracts, in_cycle, rests)


def _swing_on(flat: Mapping[str, Any], motions: Motions, run_options: RunOptions) -> tuple[np.ndarray, np.ndarray]:
    """Of motions that do not end in what was found to attract their stages, which swing on by less once they were
    followed for long, and of which that is decided: they do, or they have come to rest."""
    rest = followed_motions(flat, motions, len(motions.completed), run_options, possible=True)
    return rest.steady, rest.steady | _stands(flat, rest)


def _stands(flat: Mapping[str, Any], rest: FollowedMotions) -> np.ndarray:
    """Which motions were followed to where they do not swing any more, as far as they had to be, shape (count,)."""
    return ~rest.unknown & (~rest.moving | (rest.swing <= resting(flat, len(rest.moving))))
