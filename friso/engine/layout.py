"""Lay out the numbers of all runs computed at once in one flat float64 buffer.

The buffer has one row after another. A row has a number of each run, in its lane, side by side.
"""

from __future__ import annotations

from collections import namedtuple
from dataclasses import dataclass
from itertools import accumulate

from friso.engine.processor import processor

LANES = processor().lanes
"""Number of runs side by side: the float64 that fit one register."""

SCALARS = (
    "time",
    "old_time",
    "stop",
    "start",
    "trial",
    "longest",
    "taken",
    "fraction",
    "rejected_last",
    "attempted",
    "rejected",
    "event",
    "next_sample",
    "record_from",
    "force_peak",
    "deviation_max",
    "deviation_min",
    "inner_exit",
    "outer_exit",
    "turns",
    "last_kind",
)
"""Names of rows of one number per lane. time, old_time, stop: present time, time before the step and next corner, all
since the last corner of the reference, which was at start; trial, longest, taken: step to try next, its limit, and
last step; fraction: its accepted part; event: 1 if the lane needs attention, 2 if a turning point or the entry into a
band is inside the step, 3 if the run diverged, otherwise 0; turns: number of stored turning points; last_kind: kind of
the last one, 1 for a maximum, -1 for a minimum."""

DRIVER = ("run", "segment", "inner_before", "outer_before")
"""Names of rows that only the driver uses: the number of the lane's run, negative for none, and of its piece of the
reference; and the longest times of entry into the two bands at places that the reference has left."""

CLOCK = ("period", "tick", "due", "ticked", "noted", "left")
"""Names of rows for a model with a sampling clock. period: sample time; tick: number of the next sample; due: when its
result acts, since the last corner of the reference; ticked: 1 if the last step ended there; noted: 1 if that sample
is to be written; left: 1 if a table cell was left."""

ROW = namedtuple("ROW", SCALARS + CLOCK + DRIVER)(*range(len(SCALARS + CLOCK + DRIVER)))
"""Numbers of the rows common to all models, at the beginning of the buffer."""

AXES = ("first", "density", "last")
"""Axis of a table: its first place or time, points per unit, and number of the last point."""

SIZES = (
    "lanes",
    "states",
    "dense_terms",
    "constants",
    "kinks",
    "inputs",
    "held",
    "modes",
    "tabled",
    "places",
    "clocked",
    "position",
    "velocity",
    "degree",
    "tones",
)
"""Names of the sizes of a model: lanes, states, terms of the dense output of each, constants, kinks, reference inputs,
held numbers, and how many of these are modes with memory; the first held number from tables, and the number of tables
over position; 1 for a drive with a clock; the indices of position and velocity of the stage; degree and tones of the
reference."""

LOOKED_UP = ("place_states", "walked")
"""Names of arrays of a model with a clock: states over which tables are looked up, and for each table the index of that
state (or of time, after them)."""

FUNCTIONS = ("step", "locate", "update")
"""Names of the functions written for each model, which the driver calls."""

BLOCKS = (
    "x",
    "old",
    "end",
    "dense",
    "tolerance",
    "constant",
    "mode",
    "reference",
    "seen",
    "axis",
    "piece_before",
    "cell",
    "base",
    "slope",
)
"""Names of blocks of rows whose first row depends on the model; the buffer ends after the last."""

ModelLayout = namedtuple("ModelLayout", (*SIZES, *BLOCKS, "rows", "stands_since", *LOOKED_UP, *FUNCTIONS))
"""Layout of a model for the driver: sizes, first rows of blocks, arrays, and addresses of functions. One further row
holds the time since which the reference stands."""


@dataclass(frozen=True)
class Layout:
    """Layout of the buffer with the runs that are computed at once.

    `walks` are the quantities over which tables are looked up: states, and time. For each, a `cell` is the interval
    between two points of its tables, with a `base` and a `slope` for every table. `seen` has the states and modes at
    the drive's sample. `piece_before` has the length and the inputs of the previous piece of the reference. A sample
    may lie there whose command acts only after the corner.
    """

    states: int
    dense: int
    constants: int
    kinks: int
    fixed: int
    seen: int
    tables: int
    walks: int
    inputs: int

    @property
    def first_rows(self) -> dict[str, int]:
        """Return the first row of each block, and how many `rows` there are."""
        axis, before = self.walks and 2 * len(AXES), self.walks and 1 + self.inputs
        sizes = (self.states, self.states, self.states, self.dense * self.states, self.states)
        sizes += (self.constants, self.kinks, self.fixed, self.seen, axis, before, self.walks, self.tables, self.tables)
        return dict(zip((*BLOCKS, "rows"), accumulate(sizes, initial=len(ROW)), strict=True))
