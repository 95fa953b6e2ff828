"""What the return map shows of a stage, as data: the answers of `searched`, from `friso.hunting.return_map` alone."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from benchmarks.return_map.searched import edge_as_data, end_as_data, kick_as_data, motion_as_data
from friso.engine.allowance import Exhausted, allowance
from friso.hunting import Ensemble, cannot_hunt
from friso.hunting.return_map import (
    displacements_by_map,
    moves_by_map,
    own_motion_by_map,
    pushes_by_map,
    search_by_maps,
    survey_maps,
)
from friso.stage import Stage

WORK = 8e8
"""Work that an answer may take, as a check may."""


def mapped(stage: Stage) -> dict[str, Any]:
    """The answer about a stage whose joint is as given, the work of each part, and the CPU time [s]."""
    start = time.process_time()
    parts: dict[str, float] = {}
    said: dict[str, Any] = {"given_up": False, "possible": not cannot_hunt(stage)}
    if not said["possible"]:
        return said
    flat = stage.flat()
    with allowance(WORK) as spent:
        try:
            survey = survey_maps(Ensemble.held(flat, 1))
            (landing_map,), parts["survey"] = survey.mapped.maps, spent.used
            said |= {
                "attracts": bool(survey.attracts[0]),
                "resolved": bool(survey.resolved[0]),
                "doubt": str(survey.doubts[0]),
                "attractors": [motion_as_data(motion) for motion in survey.motions],
                "scatter": [min(value, 1e9) for value in np.nan_to_num(landing_map.scatter).tolist()],
                "points": len(landing_map.before),
            }
            if survey.attracts[0]:
                said["own_ends"], said["own_known"] = own_motion_by_map(stage, survey)
                said["kick"] = kick_as_data(displacements_by_map(Ensemble.held(flat, 1), survey))
                pushes_by_map(Ensemble.held(flat, 1), survey)
                moves = moves_by_map(stage, survey)
                said["moves"] = moves and [moves.hunting, moves.count]
            parts["kicks"] = spent.used - parts["survey"]
            sought = search_by_maps(flat, survey.motions)
            parts["bandwidths"] = spent.used - parts["survey"] - parts["kicks"]
            said["edge"] = sought.margin and edge_as_data(sought.margin)
            said["windows"] = [[end_as_data(window.low), end_as_data(window.high)] for window in sought.windows]
            said["lower"] = end_as_data(sought.lower)
        except Exhausted:
            said["given_up"] = True
    return said | {"work": spent.used, "parts": parts, "cpu": time.process_time() - start}
