"""Define the arrays that go into a kernel and come out of it, with one row per run."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from enum import IntEnum
from typing import Any, NamedTuple, Self

import numpy as np


class ArrayColumns:
    """Base of dataclasses whose fields are all arrays over the same runs, stages or states."""

    def mapped(self, change: Callable[[np.ndarray], np.ndarray]) -> Self:
        """Apply a function to every array."""
        return type(self)(**{name: change(column) for name, column in vars(self).items()})

    def take(self, numbers: Any) -> Self:
        """Select the rows with these numbers, or those of a boolean array."""
        return self.mapped(lambda column: column[numbers])

    def shaped(self, *shape: int) -> Self:
        """Give every array a shape."""
        return self.mapped(lambda column: column.reshape(shape))

    @classmethod
    def joined(cls, parts: Iterable[Self]) -> Self:
        """Put the rows of several parts one after the other."""
        return cls(*map(np.concatenate, zip(*(vars(part).values() for part in parts), strict=True)))


class Tables(NamedTuple):
    """Tables that a drive with a clock looks up, evenly spaced.

    `places` are tables over position, shape (runs or 1, tables, points); `grid` has their first position and points per
    metre, (runs or 1, 2). `times` are tables over time, also (runs or 1, tables, points), with their points
    `per_second`, (1,).
    """

    places: np.ndarray
    grid: np.ndarray
    times: np.ndarray
    per_second: np.ndarray


NO_TABLES = Tables(np.zeros((1, 0, 2)), np.zeros((1, 2)), np.zeros((1, 0, 2)), np.zeros(1))


class Batch(NamedTuple):
    """Inputs of a batch of n runs of one model; a first dimension of 1 is shared by all runs.

    - `constants` (n, constants).
    - `starts` and absolute `tolerances` (n, states): initial states are followed by the values that a sampled
      controller holds between samples.
    - `modes` (n, kinks): initial modes, one for each kink of the equations.
    - `first_steps` and `longest` steps [s] (n,).
    - `segments` (n, pieces + 1, 1 + inputs): pieces of the reference; the last one only marks the end of the run.
    - `windows` (n,): index of the piece at which the window for extremes opens; negative if neither extremes nor
      turning points are wanted.
    - `clocks` (n, 2): sample time of the drive, and delay from a sample to its effect [s].
    - `least_swings` (n,): smallest swing [m] between two turning points for them to be recorded.
    - `tables`: lookup tables of the drive.
    """

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
    """Options of all runs in a batch.

    `budget` is the most steps of a run. `inner` and `outer` [m] are the two bands of settling. `record_from` [s] is the
    time from which turning points are kept, and `interval` [s] that between samples. Once the flag `cancel`, shape
    (1,), is set, no further run starts.
    """

    rtol: float
    budget: float
    inner: float
    outer: float
    record_from: float
    interval: float
    cancel: np.ndarray


class Results(NamedTuple):
    """Outputs of the n runs of a batch.

    - `statistics` (n, len(STATISTICS)) and `statuses` (n,).
    - `turn_times` [s] and `turn_values` [m] (n, capacity): turning points, of which `turn_counts` (n,) are valid.
    - `samples` (n, samples, states + held): states, and numbers held between samples; with a sampled drive, the
      numbers that it computed from each sample follow (`friso.engine.kernel.Kernel.sample_size`).
    - `ends` (n, states + held): states and held numbers at the end of the run.
    """

    statistics: np.ndarray
    statuses: np.ndarray
    turn_times: np.ndarray
    turn_values: np.ndarray
    turn_counts: np.ndarray
    samples: np.ndarray
    ends: np.ndarray


def new_queue() -> np.ndarray:
    """Return a queue, (1,), from which threads take the numbers of their runs, from 0 on."""
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
"""Names of the statistics of a run, in the order of their columns.

- Largest force [N], and extremes of the deviation in the window [m].
- Last time outside each of the two bands [s].
- Steps attempted and rejected, and time reached [s].
- For each band, the longest time [s] to enter it at a place that the reference left again. It is infinite if the
  deviation did not enter before the reference left, and 0 if there is no such place.

Extremes and times are NaN for a drive with a clock; its samples are examined instead.
"""


class Status(IntEnum):
    """Outcomes of a run of the solver."""

    NOT_RUN = 0
    DONE = 1
    BUDGET = 2
    UNDERFLOW = 3
    FULL = 4
    DIVERGED = 5

    @property
    def text(self) -> str:
        """Return the status in words."""
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
