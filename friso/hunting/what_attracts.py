"""Find the attractors of stages by their return maps.

Where a map does not decide, stages are searched from many starts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from friso.hunting.attractors import Attractors, attractors
from friso.hunting.attractors.rounds import typical_period
from friso.hunting.attractors.survey import Swinging, of_cycles
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import CYCLE_RTOL, Cycles, families
from friso.hunting.cycle.held import held_beside
from friso.hunting.loop import winds_up_at_a_limit
from friso.hunting.return_map.attracting import MapSurvey, is_motion, survey_maps
from friso.hunting.return_map.confirmed import runs_land_as_foretold
from friso.hunting.return_map.landing_map import LandingMap
from friso.hunting.return_map.mapped import Mapped, map_stages
from friso.hunting.return_map.settings import settings
from friso.hunting.rows import ArrayRows
from friso.hunting.settings import ToleranceSettings
from friso.stage.controllers import NO_SETTINGS, SCHEDULES, dead_band

SKETCH_RTOL = ToleranceSettings().sketch_rtol
"""Relative tolerance of the runs of a sketch."""


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def what_attracts(
    stages: Ensemble,
    rtol: float = CYCLE_RTOL,
    distances: np.ndarray | None = None,
    confirm: Sequence[int] = (),
    suggested: tuple[Cycles, ...] = (),
) -> Attractors:
    """Find the attractors of stages as closed orbits, from return maps where these suffice.

    A map shows that there is no attractor under three conditions: no cycle that Newton's method closes from the map of
    stages at rest is stable; no unstable cycle has a lasting motion beside it; and, for the stages numbered `confirm`,
    runs land where the map predicts. All other stages are searched from many starts, beside these cycles and motions,
    and from `distances` [m], shape (count, n). `suggested` are the stages' `families`, if they are known. Orbits are
    closed to the relative tolerance `rtol`. Raises Exhausted if an allowance of work is used up.
    """
    if not has_a_map(stages):
        return _searched(stages, rtol, distances, _Cycles.of(stages, stages.searching_rtol(rtol), suggested))
    survey = survey_maps(stages, rtol)
    decided = survey.resolved | survey.attracts  # a stable closed orbit proves attraction
    quiet = np.array([number for number in confirm if decided[number] and not survey.attracts[number]], dtype=np.int64)
    if quiet.size:
        decided[quiet] = runs_land_as_foretold(survey, quiet)
    motions, left = survey.motions, np.flatnonzero(~survey.attracts)
    if left.size:
        cycles = _Cycles.of(stages.take(left), rtol, tuple(family.take(left) for family in suggested)).beside(
            survey, left
        )
        which = np.flatnonzero(~decided[left] | cycles.attract_or_hold)
        if (open_ := left[which]).size:
            begun = None if distances is None else distances[open_]
            answer = _searched(stages.take(open_), rtol, begun, cycles.take(which))
            motions += tuple(replace(motion, stage=int(open_[motion.stage])) for motion in answer.motions)
            decided[open_] = answer.decided
    nothing = np.zeros(stages.count, bool)
    return Attractors(motions, decided, typical_period(stages), (), nothing, decided, nothing)


def attractors_beside(stages: Ensemble, cycles: tuple[Cycles, ...], rtol: float = CYCLE_RTOL) -> Attractors:
    """Find the attractors of stages whose `families` of cycles are known, by return maps or by simulation.

    Orbits are closed to the relative tolerance `rtol`.
    """
    return what_attracts(stages, rtol, suggested=cycles) if has_a_map(stages) else attractors(stages, rtol=rtol)


@dataclass(frozen=True)
class _Cycles(ArrayRows):
    """Cycles closed by Newton's method from maps of stages at rest, with motions beside them.

    `held` [m], shape (count, n), are sticking distances of motions beside unstable cycles, NaN for none.
    """

    families: tuple[Cycles, ...]
    held: np.ndarray

    @classmethod
    def of(cls, stages: Ensemble, rtol: float, cycles: tuple[Cycles, ...] = ()) -> _Cycles:
        """Close the cycles of stages, if they are not known, and find lasting motions beside the unstable ones.

        Orbits are closed to the relative tolerance `rtol`.
        """
        cycles = cycles or families(stages, rtol)
        return cls(cycles, np.hstack([held_beside(stages, family) for family in cycles]))

    def beside(self, survey: MapSurvey, numbers: np.ndarray) -> _Cycles:
        """Add lasting motions beside the unstable orbits that a survey of return maps closed.

        `numbers` are the numbers of these stages in the survey.
        """
        more = [np.full((len(numbers), 1), np.nan)]
        for motion in survey.repelling:
            if motion.cycles is not None and (rows := np.flatnonzero(numbers == motion.stage)).size:
                stage = survey.mapped.stages.take(np.array([motion.stage]))
                holds = held_beside(stage, motion.cycles.take(np.array([motion.number])))
                more.append(np.full((len(numbers), holds.shape[1]), np.nan))
                more[-1][rows] = holds
        return _Cycles(self.families, np.hstack([self.held, *more]))

    @property
    def attract_or_hold(self) -> np.ndarray:
        """Return which stages have a stable cycle, or a lasting motion beside an unstable one.

        The result has the shape (count,).
        """
        return np.any([family.attracting for family in self.families], axis=0) | np.isfinite(self.held).any(axis=1)


def _searched(stages: Ensemble, rtol: float, distances: np.ndarray | None, cycles: _Cycles) -> Attractors:
    """Search the attractors of stages by simulation.

    Runs start from many states, from `distances` [m], and beside cycles.
    """
    starts = cycles.held if distances is None else np.hstack([cycles.held, distances])
    return attractors(stages, False, rtol, starts, suggested=cycles.families)


def resolved_map(stages: Ensemble, motions: Sequence[Swinging]) -> LandingMap | None:
    """Return the return map of one stage if its attractors are exactly the cycles `motions`.

    Returns None if they are not, or if the stage has no map that decides.
    """
    if not map_may_decide(stages):
        return None
    survey = survey_maps(stages)
    (landing_map,), length = survey.mapped.maps, float(stages.length[0])

    def on_map(motion: Swinging) -> bool:
        return any(motion.like(mapped) for mapped in survey.motions)

    attract = [any(is_motion(new, motion, length) for motion in motions) for new in landing_map.attractors]
    return landing_map if survey.resolved[0] and all(map(on_map, motions)) and all(attract) else None


@dataclass(frozen=True)
class Sketch:
    """Result of coarse return maps of stages, arrays of shape (count,).

    `attracts` is true if a stage seems to have an attractor, and `decided` if the map decides that.
    """

    attracts: np.ndarray
    decided: np.ndarray


@np.errstate(all="ignore")
def sketched(stages: Ensemble) -> Sketch:
    """Sketch the return maps of stages that may hunt, without closing orbits.

    An attractor with a narrow basin is missed. Stages without a map stay undecided. Raises Exhausted if an allowance of
    work is used up.
    """
    mapped, decided = _sketch(stages)
    if mapped is None:
        return Sketch(decided, decided)
    return Sketch(mapped.attracts, decided)


def _sketch(stages: Ensemble) -> tuple[Mapped | None, np.ndarray]:
    """Return coarse return maps of stages, and for which they decide what attracts, (count,).

    The maps are None if the stages have none.
    """
    if not has_a_map(stages):
        return None, np.zeros(stages.count, bool)
    mapped = map_stages(stages, settings.sketched_starts, 1, SKETCH_RTOL, sparse=True)
    return mapped, MapSurvey(mapped, (), (), np.zeros(stages.count, bool)).resolved


@np.errstate(all="ignore")
def surveyed_roughly(stages: Ensemble, rtol: float = CYCLE_RTOL, close: bool = True) -> Attractors:
    """Find at least one apparent attractor of each stage that may hunt, if it has one.

    This is many times faster than `what_attracts`, and may miss an attractor with a narrow basin. A coarse return map
    decides. If its attractor is weak, or sticking distances wander, the cycles that Newton's method closes from the map
    at rest decide instead, unless `close` is off. Stages whose maps are not resolved are simulated. Raises Exhausted if
    an allowance of work is used up.
    """
    mapped, decided = _sketch(stages)
    motions: list[Swinging] = []
    if mapped is not None:
        doubtful = decided & mapped.attracts & [close and _hardly_attracts(one) for one in mapped.maps]
        sure = np.flatnonzero(decided & mapped.attracts & ~doubtful)
        motions += [motion for number in sure.tolist() for motion in _seen_on_map(mapped, number)]
        if (numbers := np.flatnonzero(doubtful)).size:
            for family in families(stages.take(numbers), rtol, one_each=True):
                motions += of_cycles(numbers, family, stages.sticking)
    if (left := np.flatnonzero(~decided)).size:
        survey = attractors(stages.take(left), cycles=False)
        motions += [replace(motion, stage=int(left[motion.stage])) for motion in survey.motions]
        decided[left] = survey.decided
    nothing = np.zeros(stages.count, bool)
    return Attractors(tuple(motions), decided, typical_period(stages), (), nothing, decided, nothing)


def _hardly_attracts(landing_map: LandingMap) -> bool:
    """Tell whether a stage's coarse return map has no attractor that can be trusted.

    A trusted attractor is simple, strongly stable, and reached from enough points. Where a stage next sticks almost as
    far off as before, straight pieces between points create long cycles that the stage does not have.
    """
    swings = 1 if landing_map.symmetric else 2
    return not any(
        len(one.distances) == swings
        and one.basin.size >= settings.least_arriving_points
        and landing_map.slope(one) <= settings.hardly_attracting_share
        for one in landing_map.attractors
    )


def _seen_on_map(mapped: Mapped, stage: int) -> Iterator[Swinging]:
    """Yield the attractors on the return map of the stage numbered `stage`, as observed motions."""
    landing_map, length = mapped.maps[stage], float(mapped.stages.length[stage])
    for attractor in landing_map.attractors:
        distances, swings = np.abs(attractor.distances), len(attractor.distances)
        sides = (distances[::2].max(), distances[1::2].max()) if swings % 2 == 0 else (distances.max(),) * 2
        size, middle = sum(sides) / 2, np.sign(attractor.distances[0]) * (sides[0] - sides[1]) / 2
        times = mapped.landings.times[landing_map.run[attractor.basin]]
        swing = float(np.nanmedian(np.diff(times[:, 1:], axis=1)))
        whole = swings if swings % 2 == 0 or not attractor.periodic else 2 * swings
        period = whole * swing if attractor.periodic else 2 * swing
        time = swings * swing if attractor.periodic else np.nan
        first, slope = float(attractor.distances[0]) * length, landing_map.slope(attractor)
        yield Swinging(stage, size * length, time, period, first, whole, slope=slope, middle=float(middle) * length)


def map_may_decide(stages: Ensemble) -> bool:
    """Tell whether maps may decide what attracts stages: they have one, and remember no past.

    Friction that follows the drive's force lets stages land elsewhere than their distance foretells.
    """
    return has_a_map(stages) and not stages.remember and not stages.structure.follows_drive


def bends(stages: Ensemble) -> bool:
    """Tell whether gains of the stages follow a schedule, or windows of their controllers remember the past."""
    controller = stages.structure.controller
    against = controller.settings if controller else NO_SETTINGS
    return against.past_decides or any(name in against for name in SCHEDULES)


def has_a_map(stages: Ensemble) -> bool:
    """Tell whether the sticking distance alone may decide how stages go on.

    It does not in any of these cases:

    - A joint swings freely while the cart sticks.
    - A limiter chatters.
    - A force limit without anti-windup lets swings grow.
    - Integrals of several loops wind up separately.
    - The stage may stand anywhere within a dead band or a backlash.
    - A window of the controller remembers the past.
    - Gains follow a schedule: the map bends where they do, between landings that are too far apart to show it.

    The result is also false where the setting `maps_decide` is.
    """
    if not settings.maps_decide:
        return False
    stands_anywhere = stages.structure.plays or bool(np.any(dead_band(stages.flat) > 0))
    return not (
        stages.chatters or stands_anywhere or bends(stages) or winds_up_at_a_limit(stages) or stages.outer_integrals
    )
