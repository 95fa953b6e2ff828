"""Decide which motions swing for ever.

A run shows where a stage lands, that is, comes to stick; the return map predicts what follows.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import kernel
from friso.equations.motion import last_corner, returns
from friso.equations.structure import shared_structure
from friso.hunting.cycle.ensemble import Ensemble, done
from friso.hunting.return_map.landing_map import LandingMap
from friso.hunting.return_map.landings import LANDING_RTOL, find_landings
from friso.hunting.return_map.settings import settings


def motions_go_on(
    flat: Mapping[str, Any], count: int, landing_map: LandingMap, starts: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return which motions of one stage swing for ever, and which are certain, both (count,).

    `landing_map` is the stage's return map. `flat` has its keys in SI, and arrays (count,) where motions differ.
    Motions may also begin at the reference from initial states, `starts` (count, states). The result is uncertain if
    the reference does not come back to its start.
    """
    if starts is not None:
        return _go_on(Ensemble.held(flat, count), starts, landing_map)
    if not returns(flat):
        return np.zeros(count, bool), np.zeros(count, bool)
    shape = kernel(shared_structure(flat))
    long = {**flat, "motion.duration": np.broadcast_to(last_corner(flat) * (1 + 1e-9) + 1e-9, (count,))}
    ends, completed = np.zeros((count, len(shape.full_state))), np.zeros(count, bool)
    for runs in run_chunks(shape, long, count, RunOptions(rtol=LANDING_RTOL, least_swing=np.inf)):
        ends[runs.numbers], completed[runs.numbers] = runs.results.ends, done(runs.results)
    goes_on, decided = _go_on(Ensemble.held(flat, count), ends, landing_map)
    return goes_on & completed, decided & completed


@np.errstate(all="ignore")  # a stage that never lands is still at its reference
def _go_on(stages: Ensemble, starts: np.ndarray, landing_map: LandingMap) -> tuple[np.ndarray, np.ndarray]:
    """Return which runs swing for ever, and for which that is certain, both (runs,).

    Runs begin from the states `starts`; where they land decides.
    """
    count = len(starts)
    ends, decided, left = np.zeros(count, bool), np.zeros(count, bool), np.arange(count)
    states, most = starts, settings.first_landings
    for _ in range(settings.fate_rounds):
        landed = find_landings(stages.take(left), states, most)
        rows = np.arange(left.size)
        before, last = (
            landed.distances[rows, at] / stages.length[left] for at in (np.maximum(landed.count - 1, 0), landed.count)
        )
        fates = np.array(
            [
                landing_map.goes_on(last * share)
                for share in (1 - settings.unsure_landing_share, 1.0, 1 + settings.unsure_landing_share)
            ]
        )
        foretold = np.abs(landing_map.foretold(before) / last) - 1
        sure = (
            (fates == fates[1]).all(axis=0)
            & (np.abs(foretold) < settings.unsure_landing_share)
            & (landed.count == most)
        )
        sure = landed.rest | (sure & ~landed.lost)
        ends[left[sure]], decided[left[sure]] = fates[1][sure] & ~landed.rest[sure], True
        on = ~sure & ~landed.lost
        left, states, most = left[on], landed.ends[on], settings.more_landings
        if not left.size:
            break
    return ends, decided
