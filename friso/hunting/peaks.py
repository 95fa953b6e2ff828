"""The thesis's hunting metric (Sec. 3.2.2), and the period of a cycle, from the turning points of many runs."""

from __future__ import annotations

from functools import cache
from types import ModuleType

import numpy as np

from friso.engine.cache import code_digest, load_or_build
from friso.hunting import turning
from friso.hunting.turning import COUNTED_ABOVE, COUNTED_AFTER, SWING, WINDOW

__all__ = ["COUNTED_ABOVE", "COUNTED_AFTER", "SWING", "WINDOW", "scan"]

MANY = 100
"""Turning points, of all runs together, from which on the compiled loops are loaded; they take as long as so many."""


def scan(
    times: np.ndarray, values: np.ndarray, counts: np.ndarray, amplitude: np.ndarray, ended: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Which turning points are counted peaks, shape (runs, room), and the period of each run [s], shape (runs,).

    `times` [s] and `values` [m], of position minus reference, have shape (runs, room) and are valid up to `counts`
    (runs,). Row sums of the first result are the peak counts: maxima after 10 s, above 0.1 mm, 0.5 s apart, the
    tallest kept first. The period, NaN where there is no cycle, is the mean time between the maxima (or minima) of
    the last quarter between which the deviation swings by half the peak-to-peak `amplitude` [m] (runs,), so that
    ringing on top of a cycle does not count; of a cycle longer than that the last two extrema of the last half are
    taken. `ended` [s] is the end of each run.
    """
    peaks = np.zeros(times.shape, np.bool_)
    period = np.empty(len(counts))
    loops = turning if counts.sum() < MANY else _compiled()
    loops.run(times, values, counts, amplitude, ended, peaks, period)
    return peaks, period


@cache
def _compiled() -> ModuleType:
    from friso.hunting.build import compile_run

    return load_or_build(f"turning points {code_digest('hunting')}", "friso.hunting.build", b"", compile_run)
