"""Lay out the numbers of the lanes in one flat float64 buffer, row by row,
the lanes of a row side by side."""

from __future__ import annotations

from collections import namedtuple
from dataclasses import dataclass
from itertools import accumulate

from friso.engine.processor import processor

LANES = processor().lanes
"""Runs side by side: one register of float64."""

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
"""Rows of one number per lane. time, old_time, stop: now, before the step and at its next corner, all since the last
corner of the reference, which was at start; trial, longest, taken: step to try next, its limit, and step last tried;
fraction: the part of it that was accepted; event: the lane wants attention; turns: number of turning points kept;
last_kind: of the last one kept, 1 for a maximum, -1 for a minimum."""

DRIVER = ("run", "segment", "inner_before", "outer_before")
"""Rows of use to the driver alone: the number of the run in the lane, negative where there is none, and of the piece of
the reference it is in; and how long at most the deviation took to enter the two bands at places where the reference
stood and which it has left."""

CLOCK = ("period", "tick", "due", "ticked", "noted", "left")
"""Further rows, of use to a model that holds numbers between samples. period: time between them; tick: number of the
sample to be taken next; due: when what follows from it acts, since the last corner of the reference; ticked: 1 where
the last step ended there; noted: 1 where that sample is to be written down; left: 1 where a cell of a table has been
left."""

ROW = namedtuple("ROW", SCALARS + CLOCK + DRIVER)(*range(len(SCALARS + CLOCK + DRIVER)))
"""Numbers of the rows that are the same for every model: the first of the buffer."""

AXES = ("first", "density", "last")
"""The places and the times of a table: where it begins, its points per unit, and the number of its last point."""

SIZES = (
    "lanes",
    "states",
    "dense_terms",
    "constants",
    "kinks",
    "inputs",
    "held",
    "tabled",
    "places",
    "clocked",
    "position",
    "velocity",
    "degree",
    "tones",
)
"""Sizes of a model: lanes side by side, states, terms of the dense output of each, constants, kinks, inputs of the
reference, behind which numbers are held; the first of all these that comes from tables, and how many tables are over
places; 1 where the drive has a clock; which states are position and velocity of the stage; and the degree and the tones
of its reference."""

LOOKED_UP = ("seen_states", "place_states", "walked")
"""Arrays of a model whose drive has a clock: the states that it measures, those that tables are looked up over, and
over which of these, or time after them, each table is."""

FUNCTIONS = ("step", "locate", "update")
"""Functions written for each model, which the driver calls."""

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
"""Blocks of rows whose first row depends on the model; after the last of them the buffer ends."""

ModelLayout = namedtuple("ModelLayout", (*SIZES, *BLOCKS, "rows", "stands_since", *LOOKED_UP, *FUNCTIONS))
"""Layout of a model for the driver: sizes, first rows of blocks, arrays, and addresses of functions. Behind the rows
that a module numbers comes one of use to the driver alone: since when the reference stands."""


@dataclass(frozen=True)
class Layout:
    """Layout of the buffer in which the driver keeps the runs of a model.

    `walks` are the quantities over which tables are looked up: states, and time. For each, a `cell` is the interval
    between two points of its tables, in which every table has a `base` and a `slope`. `piece_before` holds the length
    and the inputs of the previous piece of the reference, because a sample may lie there whose command acts only after
    the corner.
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
