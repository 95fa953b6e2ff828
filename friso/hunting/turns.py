"""Scan the turning points of many runs for peaks, period, and swing over the last half."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from friso.engine.building import built_entries
from friso.engine.cache import CodeRequest, code_digest
from friso.engine.machine_code import ArrayKind, Loops, load_object
from friso.equations import motion
from friso.hunting import turning
from friso.hunting.settings import check_settings
from friso.hunting.turning import LAST_HALF

_FLAT, _SQUARE = ArrayKind("float64", 1), ArrayKind("float64", 2)
_COUNTS, _MARKS = ArrayKind("int64", 1), ArrayKind("bool", 2)
KINDS = (_SQUARE, _SQUARE, _COUNTS, _FLAT, _FLAT, _FLAT, _COUNTS, _MARKS, _MARKS, _FLAT, _FLAT, _FLAT)
"""Kinds of the arguments of `friso.hunting.turning.run`, in their order."""


@dataclass(frozen=True)
class Turns:
    """Results from the turning points of runs.

    `peaks` and `distinct` mark counted and distinct peaks, shape (runs, room) (see
    `friso.hunting.criteria.peak_count`). All others have the shape (runs,): the `period` of the swing [s] (NaN: none),
    the time of the last turn, `turned` [s] (-inf: never), and the peak-to-peak deviation of the last half of the run,
    `earlier` [m] (see `friso.hunting.criteria.run_outcome`).
    """

    peaks: np.ndarray
    distinct: np.ndarray
    period: np.ndarray
    turned: np.ndarray
    earlier: np.ndarray


def scan_turning_points(
    times: np.ndarray,
    values: np.ndarray,
    counts: np.ndarray,
    swing: np.ndarray,
    ended: np.ndarray,
    corner: np.ndarray | float = 0.0,
) -> Turns:
    """Scan the turning points of runs for peaks, period and last turn.

    `times` [s] and `values` [m] of position minus reference have the shape (runs, room), valid up to `counts`, shape
    (runs,). `swing` [m], shape (runs,), is the peak-to-peak deviation of the last quarter. Legs of at least half of it
    make the period, so that ringing on top does not count. `ended` [s], shape (runs,), is the end of each run, and
    `corner` [s] the last time at which its reference moved.
    """
    runs = len(counts)
    since = motion.last_part(LAST_HALF, ended, corner)
    arrays = tuple(map(np.ascontiguousarray, (times, values, counts, swing, ended, since)))
    kinds = np.zeros(times.shape[1], np.int64)
    peaks, distinct = (np.zeros(times.shape, np.bool_) for _ in range(2))
    period, turned, earlier = (np.empty(runs) for _ in range(3))
    scan_runs: Callable[..., None] = turning.run if counts.sum() < check_settings.compiled_from_points else _compiled()
    scan_runs(*arrays, kinds, peaks, distinct, period, turned, earlier)
    return Turns(peaks, distinct, period, turned, earlier)


@cache
def _compiled() -> Loops:
    """Return the loops over turning points as machine code, built once on a machine."""
    version = code_digest("hunting/turning.py", "hunting/build.py")
    (entry,) = built_entries(
        [CodeRequest(f"turning points {version}", "loops over turning points", "friso.hunting.build")]
    )
    return Loops(load_object(entry.code, ["run"])["run"], KINDS)
