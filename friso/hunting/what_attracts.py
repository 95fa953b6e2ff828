"""Find the attractors of stages by their return maps.

Where a map does not decide, stages are searched from many starts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from friso.hunting.attractors import Attractors, attractors
from friso.hunting.attractors.rounds import typical_period
from friso.hunting.attractors.survey import Repelling, Swinging
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import CYCLE_RTOL
from friso.hunting.loop import winds_up_at_a_limit
from friso.hunting.return_map.attracting import MapSurvey, is_motion, survey_maps
from friso.hunting.return_map.landing_map import SURE_ERRORS, LandingMap
from friso.hunting.return_map.mapped import Mapped, map_stages
from friso.hunting.return_map.settings import settings
from friso.stage.controllers import NO_SETTINGS, SCHEDULES, dead_band

SKETCH_RTOL = 1e-5
"""Tolerance of sketches, which separate hunting from settling but do not locate the edge."""


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def what_attracts(stages: Ensemble, rtol: float = CYCLE_RTOL, distances: np.ndarray | None = None) -> Attractors:
    """Find the attractors of stages as closed orbits, from return maps where these suffice.

    A stage has none if its map shows none and no run of a survey keeps swinging. Runs beside a cycle that surely repels
    by its slope on the map do not count: they leave it too slowly for a run to show. All other stages are searched
    from many starts, and from `distances` [m], shape (count, n). Orbits are closed to the relative tolerance `rtol`.
    Raises Exhausted if an allowance of work is used up.
    """
    if not has_a_map(stages):
        return attractors(stages, False, rtol, distances)
    survey = survey_maps(stages, rtol)
    motions, decided = survey.motions, survey.resolved | survey.attracts  # a stable closed orbit proves attraction
    left = np.flatnonzero(~survey.attracts)
    cycles = {number: _repelling(survey.mapped, number) for number in left[decided[left]].tolist()}
    quiet = np.array([number for number, repelling in cycles.items() if repelling is not None], np.int64)
    open_ = [np.setdiff1d(left, quiet)]
    if quiet.size:
        repelling = tuple(replace(cycle, stage=k) for k, n in enumerate(quiet.tolist()) for cycle in cycles[n] or ())
        runs = attractors(stages.take(quiet), cycles=False, distances=_some(distances, quiet), repelling=repelling)
        open_.append(quiet[runs.attracts | ~runs.decided])
    if (numbers := np.sort(np.concatenate(open_))).size:
        searched = attractors(stages.take(numbers), False, rtol, _some(distances, numbers))
        motions += tuple(replace(motion, stage=int(numbers[motion.stage])) for motion in searched.motions)
        decided[numbers] = searched.decided
    nothing = np.zeros(stages.count, bool)
    return Attractors(motions, decided, typical_period(stages), (), nothing, decided, nothing)


def _some(distances: np.ndarray | None, numbers: np.ndarray) -> np.ndarray | None:
    """Return the start distances of the stages with these numbers."""
    return None if distances is None else distances[numbers]


def _repelling(mapped: Mapped, stage: int) -> list[Repelling] | None:
    """Return the simple cycles on the map of a stage, by its number; None if one of them does not surely repel."""
    landing_map, length = mapped.maps[stage], float(mapped.stages.length[stage])
    cycles = []
    for point in landing_map.fixed_points():
        if not abs(point.slope) > 1 + SURE_ERRORS * point.error:
            return None
        size = abs(point.distance) + abs(float(landing_map.foretold(np.array([point.distance]))[0]))
        cycles.append(Repelling(stage, length * size, point.slope, point.scatter))
    return cycles


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


@np.errstate(all="ignore")
def sketched(stages: Ensemble) -> tuple[np.ndarray, np.ndarray]:
    """Sketch the return maps of stages that may hunt, without closing orbits.

    Returns which stages seem to have an attractor, and for which their map decides that, both (count,). An attractor
    with a narrow basin is missed. Stages without a map stay undecided. Raises Exhausted if an allowance of work is used
    up.
    """
    mapped, decided = _sketch(stages)
    return (decided if mapped is None else mapped.surely_attract), decided


SKETCHED_STARTS = ((0.003, 0.003, 1), (0.02, 3.0, 14))  # [deflections at break-away]
"""Starts near the reference for a sketch. With fewer, hunting from a usual range of distances is missed."""


def _sketch(stages: Ensemble) -> tuple[Mapped | None, np.ndarray]:
    """Return coarse return maps of stages, and for which they decide what attracts, (count,).

    The maps are None if the stages have none. A map whose attractors cannot be trusted does not decide, nor does one
    without any where a limiter may be touched: swings that reach it land in few places.
    """
    if not has_a_map(stages):
        return None, np.zeros(stages.count, bool)
    mapped = map_stages(stages, SKETCHED_STARTS, 1, SKETCH_RTOL, sparse=True)
    resolved = MapSurvey(mapped, (), np.zeros(stages.count, bool)).resolved
    quiet = [not (found or stages.chatters) for found in mapped.attractors]
    return mapped, resolved & (mapped.surely_attract | quiet)


@np.errstate(all="ignore")
def surveyed_roughly(stages: Ensemble) -> Attractors:
    """Find at least one apparent attractor of each stage that may hunt, if it has one.

    This is many times faster than `what_attracts`, and may miss an attractor with a narrow basin. Coarse return maps
    decide; stages whose maps do not are simulated. Raises Exhausted if an allowance of work is used up.
    """
    mapped, decided = _sketch(stages)
    motions: list[Swinging] = []
    if mapped is not None:
        sure = np.flatnonzero(decided & mapped.surely_attract)
        motions += [motion for number in sure.tolist() for motion in _seen_on_map(mapped, number)]
    if (left := np.flatnonzero(~decided)).size:
        survey = attractors(stages.take(left), cycles=False)
        motions += [replace(motion, stage=int(left[motion.stage])) for motion in survey.motions]
        decided[left] = survey.decided
    nothing = np.zeros(stages.count, bool)
    return Attractors(tuple(motions), decided, typical_period(stages), (), nothing, decided, nothing)


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

    - A force limit without anti-windup lets swings grow.
    - Integrals of several loops wind up separately.
    - The stage may stand anywhere within a dead band or a backlash.
    - A window of the controller remembers the past, or the controller pushes beyond it.
    - Gains follow a schedule: the map bends where they do, between landings that are too far apart to show it.

    The result is also false where the setting `maps_decide` is.
    """
    if not settings.maps_decide:
        return False
    stands_anywhere = stages.structure.plays or bool(np.any(dead_band(stages.flat) > 0))
    pushes = stages.chatters and stages.structure.joint != "free"
    return not (stands_anywhere or pushes or bends(stages) or winds_up_at_a_limit(stages) or stages.outer_integrals)
