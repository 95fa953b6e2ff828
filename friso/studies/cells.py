"""Runs of cells: stages that differ from one another in some keys, from columns of values to columns of measures."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from friso.engine.arrays import Status
from friso.engine.batch import Runs, run_chunks
from friso.engine.kernel import kernel
from friso.equations.structure import Structure, decisive_keys, structure
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import Cycles, hunting_cycles
from friso.hunting.cycle.hunting import why_not
from friso.hunting.measures import BANDS, Measures, measure, options
from friso.stage import Stage, numeric_keys, violations
from friso.studies.links import linked

Columns = dict[str, np.ndarray]
"""Names to arrays of shape (cells,)."""

RUN_UNITS = {
    "peaks": "1",
    "peak_to_peak": "m",
    "period": "s",
    "settling_time": "s",
    "settling_time_10um": "s",
    "largest_force": "N",
    "steps": "1",
    "rejected": "1",
}
"""The numeric measures of a cell's run and their units."""

CYCLE_UNITS = {"multiplier": "1", "amplitude": "m", "cycle_period": "s"}
"""Those of its hunting cycle, which are computed if asked for: NaN where there is none, or none could be closed."""

UNITS = RUN_UNITS | CYCLE_UNITS
"""All numeric measures and their units."""

WORDS = {"verdict": "<U9", "status": "<U160"}
"""The measures that are words, and how they are stored; a status longer than that is cut."""

USUAL = (*RUN_UNITS, *WORDS)
"""What is known of every cell."""

METRICS = (*RUN_UNITS, *CYCLE_UNITS, *WORDS)
"""Everything that may be known of a cell."""

INFERRED = "inferred"
"""How the status of a cell begins that was not run, but lies among cells that agree."""


def attributes_of(metric: str) -> dict[str, Any]:
    """The attributes of the variable of a metric."""
    attributes: dict[str, Any] = {"units": UNITS[metric]} if metric in UNITS else {}
    bands = dict(zip(("settling_time", "settling_time_10um"), BANDS, strict=True))
    return attributes | ({"band_m": bands[metric]} if metric in bands else {})


def run_cells(
    stage: Stage,
    links: Mapping[str, str],
    columns: Mapping[str, np.ndarray],
    rtol: float,
    cycles: bool = False,
    threads: int | None = 1,
    cancel: np.ndarray | None = None,
) -> Columns:
    """Run one stage per entry of the columns: axis names to SI values, words or booleans, each of shape (cells,).

    The result holds `USUAL`, with `cycles` also the measures of the hunting cycle, each of shape (cells,). A cell that
    no stage may have has the verdict "invalid" and the reason in its status; one that a run did not complete for has
    "failed". Setting cancel[0] from another thread ends the work early: cells not run by then keep the verdict "".
    """
    table = _Table(len(next(iter(columns.values()))), UNITS if cycles else RUN_UNITS)
    for part, cells in _by_words(stage, columns):
        flat = flat_cells(part, links, {name: column[cells] for name, column in columns.items()})
        table.invalidate(cells, flat)
        for shape, members in _by_structure(flat, table.valid(cells), len(cells)):
            keys = {key: value[members] if np.ndim(value) else value for key, value in flat.items()}
            for runs in run_chunks(kernel(shape), keys, len(members), options(rtol, threads, cancel)):
                table.write(cells[members[runs.numbers]], measure(runs.part(keys), runs), runs)
    if cycles:
        valid = table.valid(np.arange(table.count))
        for which, described in cell_cycles(stage, links, columns, valid, threads, cancel):
            table.write_cycles(which, described)
    return table.columns


def cell_cycles(
    stage: Stage,
    links: Mapping[str, str],
    columns: Mapping[str, np.ndarray],
    valid: np.ndarray,
    threads: int | None = None,
    cancel: np.ndarray | None = None,
) -> Iterator[tuple[np.ndarray, Cycles]]:
    """The hunting cycles of the cells that are valid, shape (cells,), and may hunt: numbers of cells, and their cycles.

    The motion plays no part: of cells that differ in it alone one is computed.
    """
    for part, cells in _by_words(stage, columns):
        flat = flat_cells(part, links, {name: column[cells] for name, column in columns.items()})
        for shape, members in _by_structure(flat, valid[cells], len(cells)):
            if why_not(shape):
                continue
            varied = [np.zeros(len(members))]
            varied += [
                value[members] for key, value in flat.items() if np.ndim(value) and not key.startswith("motion.")
            ]
            _, first, again = np.unique(np.stack(varied), axis=1, return_index=True, return_inverse=True)
            keys = {key: value[members[first]] if np.ndim(value) else value for key, value in flat.items()}
            stages = Ensemble.held(keys, len(first), form=shape, threads=threads, cancel=cancel)
            yield cells[members], hunting_cycles(stages).take(again.ravel())


def allowed(stage: Stage, links: Mapping[str, str], columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Which cells a stage may have, shape (cells,)."""
    table = _Table(len(next(iter(columns.values()))), {})
    for part, cells in _by_words(stage, columns):
        table.invalidate(cells, flat_cells(part, links, {name: column[cells] for name, column in columns.items()}))
    return table.columns["verdict"] != "invalid"


def flat_cells(stage: Stage, links: Mapping[str, str], columns: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """The flat SI form of all cells, links followed; numeric columns only."""
    numeric = numeric_keys(stage.flat())
    keys = {name: column for name, column in columns.items() if name in numeric}
    if not links:
        return stage.flat(keys)
    return stage.flat(keys | linked(links, stage.flat(keys) | dict(columns)))


def _by_words(stage: Stage, columns: Mapping[str, np.ndarray]) -> Iterator[tuple[Stage, np.ndarray]]:
    """For each combination of words and booleans among the columns: the stage and the numbers of its cells."""
    words = {name: column for name, column in columns.items() if column.dtype.kind in "bU"}
    count = len(next(iter(columns.values())))
    if not words:
        yield stage, np.arange(count)
        return
    codes = np.stack([np.unique(column, return_inverse=True)[1] for column in words.values()], axis=1)
    kinds, which = np.unique(codes, axis=0, return_inverse=True)
    for k in range(len(kinds)):
        cells = np.flatnonzero(which.ravel() == k)
        yield stage.replace({name: column[cells[0]].item() for name, column in words.items()}), cells


def _by_structure(flat: Mapping[str, Any], valid: np.ndarray, count: int) -> Iterator[tuple[Structure, np.ndarray]]:
    """The places of the valid cells, grouped by the equations they need.

    Only a few keys determine the structure; cells are grouped by those.
    """
    decisive = [key for key in decisive_keys(flat) if np.ndim(flat.get(key, 0.0))]
    groups: dict[Structure, list[np.ndarray]] = {}
    columns = np.stack([flat[key] for key in decisive], axis=1) if decisive else np.zeros((count, 1))
    kinds, which = np.unique(columns, axis=0, return_inverse=True)
    for k in range(len(kinds)):
        members = np.flatnonzero((which.ravel() == k) & valid)
        if members.size:
            example = {**flat, **{key: kinds[k][i] for i, key in enumerate(decisive)}}
            groups.setdefault(structure(example), []).append(members)
    for shape, members in groups.items():
        yield shape, np.sort(np.concatenate(members))


_STATUS = np.array([status.text for status in Status], dtype=object)


class _Table:
    """The growing measures, one entry per cell."""

    def __init__(self, count: int, numeric: Iterable[str]) -> None:
        self.count = count
        self.columns: Columns = {name: np.full(count, np.nan) for name in numeric}
        self.columns |= {name: np.full(count, "", dtype=object) for name in WORDS}

    def invalidate(self, cells: np.ndarray, flat: Mapping[str, Any]) -> None:
        """Mark the cells that no stage may have, each with the first reason found."""
        for broken, why in violations(flat):
            which = cells[np.broadcast_to(broken, cells.shape) & self.valid(cells)]
            self.columns["verdict"][which], self.columns["status"][which] = "invalid", f"invalid: {why}"

    def valid(self, cells: np.ndarray) -> np.ndarray:
        return self.columns["verdict"][cells] != "invalid"

    def write(self, which: np.ndarray, measures: Measures, runs: Runs) -> None:
        """Write the measures of the cells that were run."""
        ran = runs.results.statuses != Status.NOT_RUN
        inner, outer = measures.settling_time
        numbers = (measures.peaks, measures.peak_to_peak, measures.period, inner, outer, measures.largest_force)
        words = (measures.verdict, _STATUS[measures.status])
        for name, column in zip(USUAL, (*numbers, measures.steps, measures.rejected, *words), strict=True):
            self.columns[name][which[ran]] = column[ran]

    def write_cycles(self, which: np.ndarray, cycles: Cycles) -> None:
        """Write the measures of hunting cycles."""
        for name, column in zip(CYCLE_UNITS, (cycles.multiplier, cycles.amplitude, cycles.period), strict=True):
            self.columns[name][which] = column
