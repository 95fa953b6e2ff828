"""What today's search shows of a stage, as data: what attracts it, the edge and the windows of hunting, and kicks."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

from friso.engine.allowance import allowance
from friso.engine.batch import run_chunks
from friso.engine.kernel import kernel
from friso.equations.structure import structure
from friso.hunting.attractors.survey import Swinging
from friso.hunting.basin import Kick
from friso.hunting.cases import LONG_RUN_RTOL, RTOL
from friso.hunting.margin import Margin
from friso.hunting.measures import measure_runs, measuring_options
from friso.hunting.outward import AttractionEnd
from friso.hunting.verdict import ROOM, Judgement, judge
from friso.stage import Stage


def searched(stage: Stage) -> dict[str, Any]:
    """The answer about a stage whose joint is as given, the work of each part, and the CPU time [s]."""
    flat, parts, last = stage.flat(), {}, "own run"
    start = time.process_time()
    with allowance() as spent:

        def begin(part: str) -> None:
            nonlocal last
            parts[last], last = spent.used - sum(parts.values()), part

        (runs,) = run_chunks(kernel(structure(flat)), flat, 1, replace(measuring_options(RTOL), room=ROOM))
        said = judge(stage, measure_runs(flat, runs), LONG_RUN_RTOL, begin)
        begin("end")
    return _as_data(said) | {"work": spent.used, "parts": parts, "cpu": time.process_time() - start}


def _as_data(said: Judgement) -> dict[str, Any]:
    hunting, edge, kick = said.hunting, said.margin, said.displacement
    return {
        "verdict": "runs away" if said.runs_away else said.verdict,
        "certain": hunting.certain,
        "reason": hunting.reason,
        "possible": hunting.possible,
        "attractors": [
            motion_as_data(motion) for motion in (hunting.surveyed.motions if hunting.surveyed else ())
        ],
        "edge": edge and edge_as_data(edge),
        "windows": [[end_as_data(w.low), end_as_data(w.high)] for w in said.windows],
        "lower": end_as_data(said.lower),
        "kick": kick and kick_as_data(kick),
        "moves": said.moves and [said.moves.hunting, said.moves.count],
        "given_up": [str(part) for part in said.given_up],
    }


def edge_as_data(edge: Margin) -> dict[str, Any]:
    return {"factor": edge.factor, "certain": edge.certain, "quiet": edge.quiet, "reserve": edge.reserve}


def end_as_data(end: AttractionEnd | None) -> dict[str, Any] | None:
    return end and {
        "factor": end.inside,
        "certain": end.certain,
        "quiet": end.outside,
        "reserve": end.reserve,
    }


def kick_as_data(kick: Kick) -> dict[str, Any]:
    return {"windows": kick.windows, "searched": kick.searched, "unknown": kick.unknown}


def motion_as_data(motion: Swinging) -> dict[str, Any]:
    closed = motion.cycles is not None
    return {"amplitude": motion.amplitude, "period": motion.period, "swings": motion.swings, "closed": closed}
