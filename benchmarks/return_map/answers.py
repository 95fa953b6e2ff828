"""Convert a check's results to data, by the return map or by the search alone."""

import time
from typing import Any

from friso.engine.allowance import allowance
from friso.hunting import AttractionEnd, CheckPart, Judgement, Kick, Margin, Swinging, check_given
from friso.stage import Stage


def checked(stage: Stage) -> dict[str, Any]:
    """Return the answer on a stage as given, the work of each part, and the CPU time [s]."""
    parts: dict[str, float] = {}
    last = str(CheckPart.ATTRACTION)
    start = time.process_time()
    with allowance() as spent:

        def ended(_done: int, _total: int, part: str) -> None:
            nonlocal last
            parts[last] = parts.get(last, 0.0) + spent.used - sum(parts.values())
            last = str(part)

        said = check_given(stage, progress=ended).judgement
        ended(1, 1, last)
    return _as_data(said) | {"work": spent.used, "parts": parts, "cpu": time.process_time() - start}


def _as_data(said: Judgement) -> dict[str, Any]:
    hunting, edge, kick = said.hunting, said.margin, said.displacement
    motions = hunting.surveyed.motions if hunting.surveyed else ()
    return {
        "verdict": "runs away" if said.runs_away else said.verdict,
        "certain": hunting.certain,
        "reason": hunting.reason,
        "possible": hunting.possible,
        "attractors": [motion_as_data(motion) for motion in motions],
        "edge": edge and edge_as_data(edge),
        "windows": [[end_as_data(window.low), end_as_data(window.high)] for window in said.windows],
        "lower": end_as_data(said.lower),
        "kick": kick and kick_as_data(kick),
        "moves": said.moves and [said.moves.hunting, said.moves.count],
        "given_up": [str(part) for part in said.given_up],
    }


def edge_as_data(edge: Margin) -> dict[str, Any]:
    """Return the edge of hunting as data: its factor of the bandwidth, and how certain it is."""
    return {"factor": edge.factor, "certain": edge.certain, "quiet": edge.quiet, "reserve": edge.reserve}


def end_as_data(end: AttractionEnd | None) -> dict[str, Any] | None:
    """Return an end of a window as data; None if it lies beyond the range searched."""
    return end and {"factor": end.inside, "certain": end.certain, "quiet": end.outside, "reserve": end.reserve}


def kick_as_data(kick: Kick) -> dict[str, Any]:
    """Return the windows of kicks that start hunting."""
    return {"windows": kick.windows, "searched": kick.searched, "unknown": kick.unknown}


def motion_as_data(motion: Swinging) -> dict[str, Any]:
    """Return an attracting motion as data."""
    closed = motion.cycles is not None
    return {"amplitude": motion.amplitude, "period": motion.period, "swings": motion.swings, "closed": closed}
