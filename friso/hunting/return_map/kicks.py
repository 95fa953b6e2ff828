"""Which kicks end in hunting: a run shows where they land, the return map what follows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import kernel
from friso.equations.motion import last_corner
from friso.equations.roles import Steady
from friso.equations.structure import shared_structure
from friso.hunting.basin import Kick, MoveShare, kick_windows, move_share
from friso.hunting.cycle.ensemble import Ensemble, done
from friso.hunting.cycle.rest import pushed
from friso.hunting.return_map.attracting import MapSurvey
from friso.hunting.return_map.landing_map import LandingMap
from friso.hunting.return_map.landings import RTOL, find_landings
from friso.hunting.verdict import CHANGED
from friso.stage import Stage

FIRST, MORE, ROUNDS = 3, 3, 8
"""Landings of a run before the map is asked, more of one of which it is not sure, and how often."""

UNSURE = 0.02
"""Share by which a landing may be off: by more, the stage has not forgotten yet how it was kicked."""


def displacements_by_map(stages: Ensemble, survey: MapSurvey) -> Kick:
    """The displacements [m] from which one stage that is let go ends in what attracts it; something has to."""

    def hunts(kicks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        several = stages.take(np.zeros(len(kicks), np.int64))
        return _go_on(several, several.settled(Steady(0.0, kicks)), survey.mapped.maps[0])

    return kick_windows(hunts, _least(survey))


def pushes_by_map(stages: Ensemble, survey: MapSurvey) -> Kick:
    """The velocities [m/s] of all masses from which one stage ends in what attracts it; something has to."""

    def hunts(kicks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        several = stages.take(np.zeros(len(kicks), np.int64))
        return _go_on(several, pushed(several, kicks), survey.mapped.maps[0])

    return kick_windows(hunts, _least(survey) * float(stages.number("rate")[0]))


def motions_by_map(flat: Mapping[str, Any], count: int, survey: MapSurvey) -> tuple[np.ndarray, np.ndarray]:
    """Which motions of one stage, given as flat keys to numbers or arrays (count,), end in what attracts it, and of
    which that is known: none of those whose reference does not come back to where it began."""
    if flat["motion.kind"] not in ("there_and_back", "release", "hold"):
        return np.zeros(count, bool), np.zeros(count, bool)
    long = {**flat, "motion.duration": np.broadcast_to(last_corner(flat) * (1 + 1e-9) + 1e-9, (count,))}
    ends, completed = np.zeros((count, len(kernel(shared_structure(flat)).full_state))), np.zeros(count, bool)
    for runs in run_chunks(kernel(shared_structure(flat)), long, count, RunOptions(rtol=RTOL, least_swing=np.inf)):
        ends[runs.numbers], completed[runs.numbers] = runs.results.ends, done(runs.results)
    hunts, decided = _go_on(Ensemble.held(flat, count), ends, survey.mapped.maps[0])
    return hunts & completed, decided & completed


def own_motion_by_map(stage: Stage, survey: MapSurvey) -> tuple[bool, bool]:
    """Whether the motion of a stage's file ends in what attracts the stage, and whether that is known, as it ends in
    the same way with slightly other masses."""
    flat = stage.flat()
    masses = {key: value * CHANGED for key, value in flat.items() if key in ("masses.cart", "masses.stage")}
    ends, decided = motions_by_map({**flat, **masses}, len(CHANGED), survey)
    return bool(ends[0]), bool(decided.all() and np.all(ends == ends[0]))


def moves_by_map(stage: Stage, survey: MapSurvey) -> MoveShare | None:
    """The share of moves about that of the stage's file that end in what attracts it (see `moves_that_hunt`)."""
    return move_share(stage, lambda moved, count: motions_by_map(moved, count, survey))


def _least(survey: MapSurvey) -> float:
    return min(motion.amplitude for motion in survey.motions)


@np.errstate(all="ignore")  # a stage that never lands is still at its reference
def _go_on(stages: Ensemble, starts: np.ndarray, landing_map: LandingMap) -> tuple[np.ndarray, np.ndarray]:
    """Which runs go on for ever, by where they land, and of which that is known, both (runs,)."""
    count = len(starts)
    ends, decided, left = np.zeros(count, bool), np.zeros(count, bool), np.arange(count)
    states, most = starts, FIRST
    for _ in range(ROUNDS):
        landed = find_landings(stages.take(left), states, most)
        rows = np.arange(left.size)
        before, last = (
            landed.distances[rows, at] / stages.length[left] for at in (np.maximum(landed.count - 1, 0), landed.count)
        )
        fates = np.array([landing_map.goes_on(last * share) for share in (1 - UNSURE, 1.0, 1 + UNSURE)])
        foretold = np.abs(landing_map.foretold(before) / last) - 1
        sure = (fates == fates[1]).all(axis=0) & (np.abs(foretold) < UNSURE) & (landed.count == most)
        sure = landed.rest | (sure & ~landed.lost)
        ends[left[sure]], decided[left[sure]] = fates[1][sure] & ~landed.rest[sure], True
        on = ~sure & ~landed.lost
        left, states, most = left[on], landed.ends[on], MORE
        if not left.size:
            break
    return ends, decided
