"""What attracts stages: their return maps tell; where a map leaves that open, a search from many starts does."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.hunting.attractors import Attractors, attractors
from friso.hunting.attractors.rounds import typical_period
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import RTOL, Cycles, families
from friso.hunting.loop import winds_up_at_a_limit
from friso.hunting.return_map.attracting import MapSurvey, survey_maps
from friso.hunting.return_map.confirmed import runs_land_as_foretold
from friso.hunting.return_map.landing_map import LandingMap
from friso.hunting.return_map.mapped import map_stages
from friso.stage.standstill import dead_band

SKETCH_DISTANCES = np.concatenate([[0.003], np.geomspace(0.02, 3.0, 14)])
"""Distances at which stages are stuck at first for a sketch, in units of the deflection of the loop by the break-away
force."""

SKETCH_RTOL = 1e-5
"""Relative tolerance of the runs of a sketch."""


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def what_attracts(
    stages: Ensemble,
    rtol: float = RTOL,
    distances: np.ndarray | None = None,
    suggested: tuple[Cycles, ...] | None = None,
    confirm: Sequence[int] = (),
) -> Attractors:
    """What attracts stages that may hunt: closed orbits, by their return maps where these are resolved.

    All stages that the maps leave open are searched from many starts, beside cycles that Newton's method closes from
    the map of stages at rest, `suggested` (None: they are closed here), and from `distances` [m], shape (count, n).
    Of the stages to `confirm`, by number, runs have to land where the map says. Orbits are closed to a relative
    tolerance. Raises Exhausted where an allowance is used up.
    """
    if not has_a_map(stages):
        return attractors(stages, False, rtol, distances, suggested=suggested or families(stages, rtol))
    survey = survey_maps(stages, rtol)
    resolved = survey.resolved | survey.attracts  # a closed orbit that attracts is a proof
    quiet = np.array([number for number in confirm if resolved[number] and not survey.attracts[number]], dtype=np.int64)
    if quiet.size:
        resolved[quiet] = runs_land_as_foretold(survey, quiet)
    if suggested is None and stages.remember:
        suggested = families(stages, rtol)
    if suggested is not None:
        resolved &= survey.attracts | ~np.any([family.attracting for family in suggested], axis=0)
    answer = _by_map(stages, survey, suggested or (), resolved)
    if (left := np.flatnonzero(~resolved)).size:
        some = stages.take(left)
        cycles = tuple(family.take(left) for family in suggested) if suggested else families(some, rtol)
        starts = None if distances is None else distances[left]
        answer = _joined(answer, attractors(some, False, rtol, starts, suggested=cycles), left)
    return answer


def resolved_map(stages: Ensemble) -> LandingMap | None:
    """The return map of one stage that something attracts, if it tells what; else None."""
    if not has_a_map(stages) or stages.remember:
        return None
    survey = survey_maps(stages)
    return survey.mapped.maps[0] if survey.resolved[0] and survey.attracts[0] else None


@dataclass(frozen=True)
class Sketch:
    """What coarse return maps show of stages, arrays of shape (count,): which something seems to attract, `attracts`;
    of which that is `decided`; and which land as far off again from some distance, attracting or not, `returns`."""

    attracts: np.ndarray
    decided: np.ndarray
    returns: np.ndarray


@np.errstate(all="ignore")
def sketched(stages: Ensemble) -> Sketch:
    """Sketch the return maps of stages that may hunt: no orbit is closed, and what attracts from a narrow range of
    distances is missed. Nothing is decided of stages without a map. Raises Exhausted where an allowance is used up."""
    if not has_a_map(stages):
        nothing = np.zeros(stages.count, bool)
        return Sketch(nothing, nothing, nothing)
    mapped = map_stages(stages, SKETCH_DISTANCES, 1, SKETCH_RTOL, sparse=True)
    resolved = MapSurvey(mapped, (), (), np.zeros(stages.count, bool)).resolved
    return Sketch(mapped.attracts, resolved, np.array([landing_map.returns for landing_map in mapped.maps]))


_SEARCHES_ALONE = ContextVar("searches alone", default=False)


@contextmanager
def search_alone() -> Iterator[None]:
    """Within, no return map is asked: a search from many starts tells all, which shows whether maps are right."""
    token = _SEARCHES_ALONE.set(True)
    try:
        yield
    finally:
        _SEARCHES_ALONE.reset(token)


def has_a_map(stages: Ensemble) -> bool:
    """Whether the distance at which stages stick may tell all that follows: not where a joint is free to swing while
    the cart sticks, or a limiter chatters, where a force limit without anti-windup lets swings grow without bound,
    where the integrals of several loops wind up by themselves, or where a stage may stand anywhere within a dead band
    or a backlash."""
    if _SEARCHES_ALONE.get():
        return False
    stands_anywhere = stages.structure.plays or bool(np.any(dead_band(stages.flat) > 0))
    return not (stages.chatters or stands_anywhere or winds_up_at_a_limit(stages) or stages.outer_integrals)


def _by_map(stages: Ensemble, survey: MapSurvey, suggested: tuple[Cycles, ...], resolved: np.ndarray) -> Attractors:
    """The answer about the stages that are `resolved`, shape (count,); it is not decided what attracts the others."""
    motions = tuple(motion for motion in survey.motions if resolved[motion.stage])
    nothing = np.zeros(stages.count, bool)
    return Attractors(motions, resolved, typical_period(stages), suggested, nothing, resolved, nothing)


def _joined(answer: Attractors, other: Attractors, numbers: np.ndarray) -> Attractors:
    """An answer about stages, with that about those with some numbers in its place."""
    motions = tuple(replace(motion, stage=int(numbers[motion.stage])) for motion in other.motions)
    columns: dict[str, Any] = {}
    for name in ("decided", "flips", "complete", "runs_away"):
        columns[name] = getattr(answer, name).copy()
        columns[name][numbers] = getattr(other, name)
    kept = tuple(motion for motion in answer.motions if motion.stage not in set(numbers.tolist()))
    return replace(answer, motions=(*kept, *motions), **columns)
