"""Decide which of two different answers is right, by starts from everywhere.

Runs are followed as the adversary (`benchmarks.truth`) follows them.
"""

from typing import Any

import numpy as np

from benchmarks.return_map.compared import same_edge, same_verdict
from benchmarks.truth.refute import swinging
from benchmarks.truth.trials import Bench
from friso.equations.bandwidth import faster
from friso.stage import Stage

STARTS = 24, 12, 24, 12
"""Numbers of releases, pushes, stuck and drawn starts."""


def decided(record: dict[str, Any], stage: Stage) -> str:
    """Return what swings where the answers differ: at the stage's bandwidth, or between edges."""
    search, by_map = record["searched"], record["mapped"]
    if not by_map["certain"] or not search["certain"]:
        return ""
    if not same_verdict(record):
        return _at(stage, 1.0)
    if search["edge"] and search["edge"]["certain"] and not same_edge(record):
        other = by_map["edge"]
        ends = search["edge"]["factor"], other["factor"] if other else 0.96 * search["edge"]["factor"]
        return _at(stage, float(np.sqrt(ends[0] * ends[1])))
    return ""


def _at(stage: Stage, factor: float) -> str:
    bench = Bench(faster(stage.flat(), factor))
    return f"at {factor:.4g} times the bandwidth {swinging(bench, bench.starts(*STARTS, 1)) or 'every start rests'}"
