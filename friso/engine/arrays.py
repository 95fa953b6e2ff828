"""What goes into a kernel and what comes out: arrays with one row per run."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np


class Tables(NamedTuple):
    """What a drive with a clock looks up, evenly spaced: over position (runs or 1, tables, points), its first place
    and points per metre (runs or 1, 2), over time (runs or 1, tables, points), and its points per second (1,)."""

    places: np.ndarray
    grid: np.ndarray
    times: np.ndarray
    per_second: np.ndarray


NO_TABLES = Tables(np.zeros((1, 0, 2)), np.zeros((1, 2)), np.zeros((1, 0, 2)), np.zeros(1))


class Batch(NamedTuple):
    """Runs of one model: constants (n, constants), start states, absolute tolerances (n, states), modes (n, kinks),
    first and longest steps [s] (n,), pieces of the reference (n, pieces + 1, 1 + inputs), of which the last one only
    ends the run (in the first dimension also 1: shared by all runs), the number of the piece that begins the window
    in which extremes are taken (n,), the period and the lateness of the drive's clock [s] (n, 2), the least swing [m]
    between two turning points that are kept (n,), and what is looked up. Start states go on with the numbers that are
    held."""

    constants: np.ndarray
    starts: np.ndarray
    tolerances: np.ndarray
    modes: np.ndarray
    first_steps: np.ndarray
    longest: np.ndarray
    segments: np.ndarray
    windows: np.ndarray
    clocks: np.ndarray
    least_swings: np.ndarray
    tables: Tables = NO_TABLES


class BatchOptions(NamedTuple):
    """What all runs share: relative tolerance, step budget, the two bands of settling [m], the time [s] from which
    turning points are kept, the sampling interval [s], and a flag, shape (1,), that is set to have no further run
    begun."""

    rtol: float
    budget: float
    inner: float
    outer: float
    record_from: float
    interval: float
    cancel: np.ndarray


class Results(NamedTuple):
    """What the runs leave: statistics (n, len(STATISTICS)), status (n,), turning points (n, capacity) with their
    count (n,), sampled states and numbers held (n, samples, states + held), and the same at the end."""

    statistics: np.ndarray
    statuses: np.ndarray
    turn_times: np.ndarray
    turn_values: np.ndarray
    turn_counts: np.ndarray
    samples: np.ndarray
    ends: np.ndarray


def new_queue() -> np.ndarray:
    """Return a queue from which threads take the numbers of their runs, one by one,
    so that all of them are busy to the end, shape (1,): next comes run 0."""
    return np.zeros(1, np.int64)


STATISTICS = (
    "force_peak",
    "deviation_max",
    "deviation_min",
    "inner_exit",
    "outer_exit",
    "attempted",
    "rejected",
    "ended",
    "inner_before",
    "outer_before",
)
"""Largest force [N], extremes of the deviation in the window [m], when it last was outside the two bands [s], steps
attempted and rejected, the time reached [s], and when, before the reference left the place where it stood, it last was
outside the two bands [s] (infinite: it still was; 0: the reference does not leave again). Extremes and moments are NaN
where a drive has a clock: its samples tell them."""


class Status(IntEnum):
    """How a run ended."""

    NOT_RUN = 0
    DONE = 1
    BUDGET = 2
    UNDERFLOW = 3
    FULL = 4
    DIVERGED = 5

    @property
    def text(self) -> str:
        return _TEXTS[self]


_TEXTS = {
    Status.NOT_RUN: "not run: the computation was interrupted",
    Status.DONE: "done",
    Status.BUDGET: "step budget used up: loosen rtol, shorten the motion, or check for a chattering contact",
    Status.UNDERFLOW: "step size too small or state not finite: the loop is unstable or rtol is below rounding; "
    "check the controller's gains, or loosen rtol",
    Status.DIVERGED: "the stage runs away from its reference: the loop is unstable; check the controller's gains",
    Status.FULL: "more turning points than can be kept: shorten the motion",
}
