"""Whether runs end where the return maps say: from every basin, and from the widest gap between landings."""

from __future__ import annotations

import numpy as np

from friso.hunting.attractors.rounds import RESOLVED
from friso.hunting.cycle.rest import stuck
from friso.hunting.return_map.attracting import MapSurvey
from friso.hunting.return_map.landing_map import LandingMap
from friso.hunting.return_map.landings import RTOL, find_landings
from friso.hunting.return_map.mapped import NEAR_DISTANCES

PLACES = np.array([1 / 6, 1 / 2, 5 / 6])
"""Which of the starts in a basin, in order of distance, are followed to their ends."""

LEG_LANDINGS, LEGS = 12, 16
"""Landings of a run before the map is asked whether it has come to its end, and how often it is followed on."""

NEAR_ATTRACTOR = 0.02
"""Share by which landings differ at most from those of the attractor that a run has come to."""

TIGHTER = 0.01
"""Relative tolerance at which all is repeated, in units of that of the map."""


def runs_end_as_foretold(survey: MapSurvey, numbers: np.ndarray) -> np.ndarray:
    """Of which stages runs end where the map says, shape of the `numbers`.

    Runs begin stuck at three distances of every basin and in the widest gap between the starts of the map. Each is
    followed until it rests, or has come to the attractor that the map foretells for its start, at the tolerance of the
    map and at a hundredth of it.
    """
    begun = [_starts(survey, int(number)) for number in numbers]
    owners = np.repeat(np.arange(len(numbers)), [len(starts) for starts, _ in begun])
    starts, fates = (np.concatenate([pair[k] for pair in begun]) for k in (0, 1))
    right = np.ones(len(numbers), bool)
    for rtol in (RTOL, TIGHTER * RTOL):
        ends = _end_as(survey, numbers[owners], starts, fates, rtol)
        right[owners[~ends]] = False
    return right


def _starts(survey: MapSurvey, stage: int) -> tuple[np.ndarray, np.ndarray]:
    """Where runs of a stage begin, in units of the deflection of the loop by the break-away force, and the numbers of
    the attractors of its map that they come to, -1 where they rest."""
    mapped, landing_map = survey.mapped, survey.mapped.maps[stage]
    runs = np.flatnonzero((mapped.owners == stage) & np.isfinite(mapped.starts))
    runs = runs[np.argsort(mapped.starts[runs], kind="stable")]
    starts = mapped.starts[runs]
    fates = _fates(landing_map, _last_landings(survey, runs))
    chosen = [
        which[(PLACES * len(which)).astype(int)]
        for fate in set(fates.tolist())
        if (which := np.flatnonzero(fates == fate)).size
    ]
    numbers = np.unique(np.concatenate(chosen))
    near = np.flatnonzero(np.abs(starts[:-1] * starts[1:]) < NEAR_DISTANCES[-1] ** 2)
    near = near[(starts[near] * starts[near + 1] > 0) & (fates[near] == fates[near + 1])]
    if not near.size:
        return starts[numbers], fates[numbers]
    gap = near[np.abs(np.log(starts[near + 1] / starts[near])).argmax()]
    between = np.sign(starts[gap]) * np.sqrt(starts[gap] * starts[gap + 1])
    return np.append(starts[numbers], between), np.append(fates[numbers], fates[gap])


def _last_landings(survey: MapSurvey, runs: np.ndarray) -> np.ndarray:
    """The last landings of runs, signed, in units of the deflection by the break-away force; 0 where they rest."""
    mapped, landings = survey.mapped, survey.mapped.landings
    last = landings.distances[runs, landings.count[runs]] / mapped.stages.length[mapped.owners[runs]]
    return np.where(landings.rest[runs], 0.0, last)


@np.errstate(all="ignore")
def _fates(landing_map: LandingMap, distances: np.ndarray) -> np.ndarray:
    """The numbers of the attractors to which landings at signed distances lead, -1 where the stage rests."""
    paths = landing_map.followed_from(distances)
    fates = np.full(len(distances), -1)
    for number, attractor in enumerate(landing_map.attractors):
        fates[_about(paths[:, -1], attractor.distances)] = number
    return fates


def _about(distances: np.ndarray, landings: np.ndarray) -> np.ndarray:
    """Which distances are about one of the landings of an attractor."""
    apart = np.abs(distances[:, None] / landings[None, :] - 1)
    return np.asarray((apart < NEAR_ATTRACTOR).any(axis=1))


def _end_as(survey: MapSurvey, owners: np.ndarray, starts: np.ndarray, fates: np.ndarray, rtol: float) -> np.ndarray:
    """Which runs, each of a stage, come to the attractors with the numbers `fates`, -1 for rest, shape (runs,)."""
    stages = survey.mapped.stages.take(owners)
    states, left, right = stuck(stages, starts * stages.length), np.arange(len(owners)), np.zeros(len(owners), bool)
    for _ in range(LEGS):
        landed = find_landings(stages.take(left), states, LEG_LANDINGS, rtol)
        distances = landed.distances / stages.length[left, None]
        there = np.zeros(left.size, bool)
        for k, run in enumerate(left.tolist()):
            landing_map, last = survey.mapped.maps[owners[run]], distances[k, 1 : landed.count[k] + 1]
            rests = landed.rest[k] or (last.size > 0 and abs(last[-1]) < RESOLVED)
            if rests or landed.lost[k]:
                there[k], right[run] = True, rests and fates[run] < 0
            elif fates[run] >= 0 and last.size:
                attractor = landing_map.attractors[fates[run]]
                tail = np.abs(last) if landing_map.symmetric else last
                there[k] = right[run] = _about(tail[-len(attractor.distances) :], attractor.distances).all()
        left, states = left[~there], landed.ends[~there]
        if not left.size:
            break
    return right
