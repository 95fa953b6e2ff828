"""Find attractors of many stages of one structure at once, and judge the stages.

Stages are a mapping of keys such as "friction.static" to SI numbers, or to arrays (count,) where they differ. Fewer
starts are used than in `friso.hunting.check`, so an attractor with a narrow basin may be missed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.engine.batch import RunOptions
from friso.engine.kernel import KernelRequest
from friso.equations.structure import Structure, shared_structure
from friso.hunting.attractors import Attractors, Target, attractors
from friso.hunting.attractors.survey import Swinging
from friso.hunting.basin import ends_in, swings_seldom
from friso.hunting.criteria import verdicts
from friso.hunting.cycle.ensemble import ArrayRows, Ensemble
from friso.hunting.cycle.find import CYCLE_RTOL
from friso.hunting.cycle.hunting import surely_surveyed, why_not
from friso.hunting.loop import unstable_among, winds_up_at_a_limit
from friso.hunting.measures import bands_of, measuring_options
from friso.hunting.motions import (
    FollowedMotions,
    Motions,
    followed_motions,
    keeps_moving,
    resting,
    run_motions,
    some_of,
)
from friso.hunting.verdict import RUNAWAY_SWING_FACTOR
from friso.hunting.what_attracts import surveyed_roughly


@dataclass(frozen=True)
class StageAttractors(ArrayRows):
    """What keeps each of many stages swinging for ever, as arrays of shape (count,).

    - `attracts`: an attractor was found.
    - `decided`: no simulation failed that was needed to answer this.
    - `certain`: decided, and no attractor can exist beyond the range searched.
    - `amplitude` [m], half of peak to peak, `middle` [m] between the peaks, and `period` [s]: of the largest swing
      (NaN: no attractor).
    - `closed`: this swing was closed as an orbit; `multiplier`: its multiplier (NaN: it was not closed).
    - `target`: how far and how late a run must swing to count as hunting (None: these stages cannot hunt).
    """

    attracts: np.ndarray
    decided: np.ndarray
    certain: np.ndarray
    closed: np.ndarray
    amplitude: np.ndarray
    middle: np.ndarray
    period: np.ndarray
    multiplier: np.ndarray
    target: Target | None

    @classmethod
    def of(cls, survey: Attractors | None, certain: np.ndarray) -> StageAttractors:
        """Summarise a survey of stages, of which some are `certain`, shape (count,).

        A survey of None stands for stages that cannot hunt.
        """
        count = len(certain)
        closed, (amplitude, middle, period, multiplier) = np.zeros(count, bool), np.full((4, count), np.nan)
        if survey is None:
            nothing, decided = np.zeros(count, bool), np.ones(count, bool)
            return cls(nothing, decided, certain, closed, amplitude, middle, period, multiplier, None)
        for motion in sorted(survey.motions, key=lambda motion: motion.amplitude):  # the largest swing comes last
            k, orbit = motion.stage, motion.cycles
            closed[k], amplitude[k], middle[k] = orbit is not None, motion.amplitude, motion.middle
            period[k] = motion.period
            multiplier[k] = np.nan if orbit is None else orbit.multiplier[motion.number]
        swing = closed, amplitude, middle, period, multiplier
        return cls(survey.attracts, survey.decided, certain, *swing, survey.target)


def can_hunt(flat: Mapping[str, Any]) -> bool:
    """Tell whether stages of one structure may hunt; `flat` has their keys in SI.

    To hunt, stages need friction or a backlash, integral action that winds up, no dither, and a reference that stands
    still in the end.
    """
    return not why_not(shared_structure(flat)) and not keeps_moving(flat)


def kernels_to_judge(form: Structure) -> set[KernelRequest]:
    """Return the compiled equations that verdicts on stages of a structure need."""
    variational = set() if why_not(form) else {KernelRequest(form.standing, variational=True)}
    return {KernelRequest(form), KernelRequest(form.standing), *variational}


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def find_attractors(
    flat: Mapping[str, Any],
    count: int,
    rtol: float = CYCLE_RTOL,
    close_orbits: bool = True,
    threads: int | None = None,
    cancel: np.ndarray | None = None,
) -> StageAttractors:
    """Find one attractor of each stage, for stages of one structure, whatever their own motions.

    `flat` has the stages' keys in SI. Stages whose references never stand still cannot hunt. Orbits are closed to the
    relative tolerance. Without `close_orbits`, motions that have converged count as attracted. `threads` bounds the
    threads of runs, and setting `cancel` stops them. Raises Exhausted if an allowance of work is used up.
    """
    stages = Ensemble.held(flat, count, form=shared_structure(flat), threads=threads, cancel=cancel)
    survey = attractors(stages, rtol=rtol, cycles=close_orbits) if can_hunt(flat) else None
    return StageAttractors.of(survey, surely_surveyed(stages, survey))


@np.errstate(all="ignore")
def sketch_attractors(
    flat: Mapping[str, Any], count: int, threads: int | None = None, cancel: np.ndarray | None = None
) -> StageAttractors:
    """Sketch the attractors of stages of one structure by coarse return maps.

    Where these maps are not reliable, stages are simulated. A sketch is faster than `find_attractors`, and may miss an
    attractor with a narrow basin. `threads` bounds the threads of runs, and setting `cancel` stops them. Raises
    Exhausted if an allowance of work is used up.
    """
    stages = Ensemble.held(flat, count, form=shared_structure(flat), threads=threads, cancel=cancel)
    survey = surveyed_roughly(stages) if can_hunt(flat) else None
    return StageAttractors.of(survey, surely_surveyed(stages, survey))


def find_swings(flat: Mapping[str, Any]) -> tuple[Swinging, ...]:
    """Find all attractors of one stage as thoroughly as a check does; none if it cannot hunt.

    `flat` has the stage's keys, such as "friction.static", in SI. Its own motion does not matter. If an allowance of
    work is used up, the attractors found so far are returned.
    """
    return () if why_not(shared_structure(flat)) else attractors(Ensemble.held(flat, 1), thorough=True).motions


def loops_unstable(flat: Mapping[str, Any], count: int) -> np.ndarray:
    """Return which stages of one structure have an unstable loop whatever the friction.

    The result has the shape (count,). The loop is unstable while the stage sticks, or while it slides. `flat` has the
    stages' keys in SI.
    """
    states = unstable_among(Ensemble.held(flat, count, form=shared_structure(flat)))
    return np.any([*states.values()], axis=0)


@np.errstate(all="ignore")
def judge_many(
    flat: Mapping[str, Any], count: int, rtol: float, attracted: StageAttractors | None = None
) -> np.ndarray:
    """Judge stages of one structure, whose own motions are run to the relative tolerance `rtol`.

    Returns words of `friso.hunting.criteria.VERDICTS`, shape (count,). A stage has "failed" if its own motion was not
    completed. It is "undecided" if its attractors, or the end of its motion, are not certain. `flat` has the stages'
    keys in SI, and `attracted` their attractors if they are known.
    """
    attracted = attracted or find_attractors(flat, count)
    return judge_runs(flat, run_motions(flat, count, measuring_options(rtol, bands=bands_of(flat))), attracted, rtol)


@np.errstate(all="ignore")
def judge_runs(
    flat: Mapping[str, Any],
    motions: Motions,
    attracted: StageAttractors,
    rtol: float,
    threads: int | None = None,
    cancel: np.ndarray | None = None,
) -> np.ndarray:
    """Judge stages from motions and attractors that are already computed.

    Returns words of `friso.hunting.criteria.VERDICTS`, shape (count,). A stage has "failed" if its own motion was not
    completed. It is "undecided" if its attractors, or the end of its motion, are not certain. `rtol` is the relative
    tolerance of further runs. `threads` bounds the threads of runs, and setting `cancel` stops them.
    """
    count, target = len(motions.completed), attracted.target
    stages = Ensemble.held(flat, count, form=shared_structure(flat))
    decided = motions.completed & attracted.certain
    attracts = attracted.attracts.copy()
    in_cycle, rests = np.zeros(count, bool), np.zeros(count, bool)
    run_options = measuring_options(rtol, threads, cancel, bands_of(flat))
    chosen = np.flatnonzero(decided & attracts)
    if target is not None and chosen.size:
        targets = target.take(chosen)
        ends, completed, swing = ends_in(some_of(flat, chosen), chosen.size, targets, threads=threads, cancel=cancel)
        completed &= ~swings_seldom(targets, ends, swing)
        if winds_up_at_a_limit(stages):
            completed &= ~(ends & (swing > RUNAWAY_SWING_FACTOR * 2 * targets.amplitude))
        in_cycle[chosen], decided[chosen] = ends, completed
        settled = np.isfinite(motions.settling[chosen]) & (swing <= resting(flat, count)[chosen])
        restless = chosen[completed & ~ends & ~settled]
        if restless.size:  # another attractor may swing less than the one that was found
            moved = some_of(flat, restless), motions.take(restless)
            in_cycle[restless], decided[restless] = _swing_on(*moved, run_options)
    free = np.flatnonzero(decided & ~attracts)
    if free.size:
        rest = followed_motions(
            some_of(flat, free), motions.take(free), free.size, run_options, possible=target is not None
        )
        rests[free], attracts[free], in_cycle[free] = rest.rests, rest.steady, rest.steady
        if target is not None:
            decided[free] = rest.steady | _stands(some_of(flat, free), rest)
    return verdicts(motions.completed, decided, attracts, in_cycle, rests)


def _swing_on(flat: Mapping[str, Any], motions: Motions, run_options: RunOptions) -> tuple[np.ndarray, np.ndarray]:
    """Continue motions that do not end in an attractor of their stages, to see how they end.

    Returns which of them keep swinging with a smaller swing, and which certainly keep swinging or rest, both of shape
    (motions,).
    """
    rest = followed_motions(flat, motions, len(motions.completed), run_options, possible=True)
    return rest.steady, rest.steady | _stands(flat, rest)


def _stands(flat: Mapping[str, Any], rest: FollowedMotions) -> np.ndarray:
    """Return which motions come to rest for certain, or swing as little as at rest, (count,).

    `flat` has the stages' keys in SI, and `rest` how their motions end.
    """
    return ~rest.unknown & (~rest.moving | (rest.swing <= resting(flat, len(rest.moving))))
