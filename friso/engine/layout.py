"""Where the lanes keep their numbers: one flat float64 buffer, row by row, with the lanes of a row side by side."""

from __future__ import annotations

from dataclasses import dataclass

LANES = 8
"""Runs side by side: one 512-bit register of float64, or two of 256 bits."""

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

CLOCK = ("period", "tick", "due", "ticked", "noted", "left")
"""Further rows, of use to a model that holds numbers between samples. period: time between them; tick: number of the
sample to be taken next; due: when what follows from it acts, since the last corner of the reference; ticked: 1 where
the last step ended there; noted: 1 where that sample is to be written down; left: 1 where a cell of a table has been
left."""

AXES = ("first", "density", "last")
"""Of the places and of the times of a table: where it begins, its points per unit, and the number of its last point."""


@dataclass(frozen=True)
class Layout:
    """Row numbers of the buffer for a model of the given size; the first row of each block.

    `walks` are what tables are looked up over: states, and time. Each is in a `cell` between two points of its tables,
    in which each of these has a `base` and a `slope`. `piece_before` holds length and inputs of the piece of the
    reference before: a sample may lie in it whose command acts after the corner.
    """

    states: int
    dense: int
    constants: int
    kinks: int
    given: int
    seen: int
    tables: int
    walks: int

    @property
    def blocks(self) -> dict[str, int]:
        sizes = {
            "x": self.states,
            "old": self.states,
            "end": self.states,
            "dense": self.dense * self.states,
            "tolerance": self.states,
            "constant": self.constants,
            "mode": self.kinks,
            "reference": self.given,
            "seen": self.seen,
            "axis": self.walks and 2 * len(AXES),
            "piece_before": self.walks and 4,
            "cell": self.walks,
            "base": self.tables,
            "slope": self.tables,
        } | dict.fromkeys(SCALARS + CLOCK, 1)
        rows, row = {}, 0
        for name, size in sizes.items():
            rows[name] = row
            row += size
        return rows | {"rows": row}
