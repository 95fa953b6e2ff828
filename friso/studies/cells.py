"""Runs of cells: stages that differ from one another in some keys, from columns of values to columns of measures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from friso.axis import AxisKind
from friso.engine.arrays import Status
from friso.engine.batch import Runs, run_chunks
from friso.engine.kernel import kernel
from friso.equations.structure import Structure, decisive_keys, structure
from friso.hunting import Motions, StageAttractors, find_attractors, judge_runs, sketch_attractors
from friso.hunting.criteria import (
    BAND,
    DISTINCT_CRITERION,
    FAILED,
    OUTCOME_CRITERION,
    PEAK_CRITERION,
    VERDICT_CRITERION,
)
from friso.hunting.measures import BANDS, Measures, measure_runs, measuring_options
from friso.stage import Stage, violations
from friso.studies.links import linked
from friso.studies.scalings import scaled

Columns = dict[str, np.ndarray]
"""Names to arrays of shape (cells,)."""

RUN_UNITS = {
    "peaks": "1",
    "distinct_peaks": "1",
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
"""Those of what attracts its stage, which are computed if asked for: of the largest swing where several are found; NaN
where nothing attracts, the multiplier also where no orbit could be closed."""

UNITS = RUN_UNITS | CYCLE_UNITS
"""All numeric measures and their units."""

CYCLE, SWING, NOTHING, UNKNOWN = "cycle", "swing", "nothing", "unknown"
"""What attracts a stage: a cycle that was closed as an orbit; a swing that simulations do not leave, of which no orbit
could be closed; nothing; or it is not certain, because simulations failed or had not settled when they were stopped, or
because something may attract beyond them."""

SKETCH = "sketch"
"""The verdict on a stage by a sketch of what attracts it (see `friso.hunting.sketch_attractors`)."""

WORDS = {"outcome": "<U9", "verdict": "<U9", SKETCH: "<U9", "attractor": "<U9", "status": "<U160"}
"""The measures that are words, and how they are stored; a status longer than that is cut."""

ALWAYS = ("outcome", "status")
"""The words of every cell; the verdict and what attracts are found if asked for."""

USUAL = (*RUN_UNITS, *ALWAYS)
"""What is known of every cell."""

BY_ATTRACTORS = (*CYCLE_UNITS, "attractor", "verdict")
"""What needs a survey of what attracts, and is computed if asked for."""

VERDICTS = ("verdict", SKETCH)
"""The measures that are verdicts on the stage."""

METRICS = (*RUN_UNITS, *CYCLE_UNITS, *WORDS)
"""Everything that may be known of a cell."""

OF_ATTRACTORS = (
    "what attracts the stage, by a survey of simulations from many starts: of several swings that attract the largest "
    "that was found"
)

CRITERIA = {
    "outcome": OUTCOME_CRITERION,
    "verdict": VERDICT_CRITERION,
    SKETCH: f"sketch of the {VERDICT_CRITERION}: what attracts from a narrow range of distances may be missed",
    **dict.fromkeys(("attractor", *CYCLE_UNITS), OF_ATTRACTORS),
    "peaks": PEAK_CRITERION,
    "distinct_peaks": DISTINCT_CRITERION,
}
"""By which criterion (`friso.hunting.criteria`) a measure says what hunts."""

INFERRED = "inferred"
"""How the status of a cell begins that was not run, but lies among cells that agree."""


def attributes_of(metric: str, kind: AxisKind) -> dict[str, Any]:
    """The attributes of the variable of a metric, of stages with that kind of axis."""
    attributes: dict[str, Any] = {"units": kind.unit(UNITS[metric])} if metric in UNITS else {}
    bands = {"settling_time": BANDS[0], "settling_time_10um": BANDS[1], "outcome": BAND}
    attributes |= {kind.suffix("band_m"): bands[metric]} if metric in bands else {}
    return attributes | ({"criterion": kind.text(CRITERIA[metric])} if metric in CRITERIA else {})


def run_cells(
    stage: Stage,
    links: Mapping[str, str],
    columns: Mapping[str, np.ndarray],
    rtol: float,
    metrics: Sequence[str] = USUAL,
    threads: int | None = 1,
    cancel: np.ndarray | None = None,
) -> Columns:
    """Run one stage per entry of the columns: axis names to SI values, words or booleans, each of shape (cells,).

    The result holds `USUAL`, and of `BY_ATTRACTORS` and `SKETCH` what is among the metrics, each of shape (cells,). A
    cell that no stage may have has the outcome (and the verdicts) "invalid" and the reason in its status; one that a
    run did not complete for has "failed". Setting cancel[0] from another thread ends the work early: cells not run by
    then keep the outcome "".
    """
    more = (name for name in (*BY_ATTRACTORS, SKETCH) if name in metrics)
    table = _Table(len(next(iter(columns.values()))), (*USUAL, *more))
    parts = list(by_words(stage, links, columns))
    for flat, cells in parts:
        table.invalidate(cells, flat)
    for flat, cells, shape in by_equations(parts, table.valid):
        for runs in run_chunks(kernel(shape), flat, len(cells), measuring_options(rtol, threads, cancel)):
            table.write(cells[runs.numbers], measure_runs(runs.part(flat), runs), runs)
    if SKETCH in metrics:
        for flat, cells, attracted in cell_attractors(parts, table.ran, sketch_attractors, threads, cancel):
            words = judge_runs(flat, table.motions(cells), attracted, rtol, threads, cancel)
            table.columns[SKETCH][cells] = words
    if any(name in metrics for name in BY_ATTRACTORS):
        for flat, cells, attracted in cell_attractors(parts, table.ran, find_attractors, threads, cancel):
            table.write_attractors(cells, attracted)
            if "verdict" in metrics:
                words = judge_runs(flat, table.motions(cells), attracted, rtol, threads, cancel)
                table.columns["verdict"][cells] = words
    return table.columns


Parts = Iterable[tuple[dict[str, Any], np.ndarray]]
"""The flat SI form and the numbers of cells, by their words and booleans."""


def cell_attractors(
    parts: Parts,
    chosen: np.ndarray,
    find: Callable[..., StageAttractors] = find_attractors,
    threads: int | None = None,
    cancel: np.ndarray | None = None,
) -> Iterator[tuple[dict[str, Any], np.ndarray, StageAttractors]]:
    """What attracts the stages of the cells that are chosen, shape (cells,), by the equations they need: their flat SI
    form, their numbers, and what attracts them, by a function as `find_attractors`.

    The motion plays no part: of cells that differ in it alone one is surveyed.
    """
    for flat, cells, _ in by_equations(parts, chosen):
        yield flat, cells, _once(flat, len(cells), find, threads, cancel)


def _once(
    flat: Mapping[str, Any],
    count: int,
    find: Callable[..., StageAttractors],
    threads: int | None,
    cancel: np.ndarray | None,
) -> StageAttractors:
    """What attracts stages of one structure, looked for once for all that differ in their motion alone."""
    varied = [np.zeros(count)]
    varied += [value for key, value in flat.items() if np.ndim(value) and not key.startswith("motion.")]
    _, first, again = np.unique(np.stack(varied), axis=1, return_index=True, return_inverse=True)
    different = {
        key: value[first] if np.ndim(value) and not key.startswith("motion.") else value for key, value in flat.items()
    }
    return find(different, len(first), threads=threads, cancel=cancel).take(again.ravel())


def allowed_cells(stage: Stage, links: Mapping[str, str], columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Which cells a stage may have, shape (cells,)."""
    table = _Table(len(next(iter(columns.values()))), ALWAYS)
    for flat, cells in by_words(stage, links, columns):
        table.invalidate(cells, flat)
    return table.valid


def flat_cells(stage: Stage, links: Mapping[str, str], columns: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """The flat SI form of all cells, links followed, then scalings; numeric columns only."""
    numeric = stage.numeric_keys()
    keys = {name: column for name, column in columns.items() if name in numeric}
    keys |= linked(links, stage.flat(keys) | dict(columns)) if links else {}
    return scaled(stage.flat(keys), columns, links)


def by_equations(parts: Parts, chosen: np.ndarray) -> Iterator[tuple[dict[str, Any], np.ndarray, Structure]]:
    """The cells that are chosen, shape (cells,), by the equations they need: their flat SI form, numbers, structure."""
    for flat, cells in parts:
        for shape, members in _by_structure(flat, chosen[cells], len(cells)):
            of_group = {key: value[members] if np.ndim(value) else value for key, value in flat.items()}
            yield of_group, cells[members], shape


def by_words(
    stage: Stage, links: Mapping[str, str], columns: Mapping[str, np.ndarray]
) -> Iterator[tuple[dict[str, Any], np.ndarray]]:
    """For each combination of words and booleans among the columns: the flat SI form and the numbers of its cells."""
    words = {name: column for name, column in columns.items() if column.dtype.kind in "bU"}
    count = len(next(iter(columns.values())))
    if not words:
        yield flat_cells(stage, links, columns), np.arange(count)
        return
    codes = np.stack([np.unique(column, return_inverse=True)[1] for column in words.values()], axis=1)
    kinds, which = np.unique(codes, axis=0, return_inverse=True)
    for k in range(len(kinds)):
        cells = np.flatnonzero(which.ravel() == k)
        part = stage.replace({name: column[cells[0]].item() for name, column in words.items()})
        yield flat_cells(part, links, {name: column[cells] for name, column in columns.items()}), cells


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


_SAME = ("peaks", "distinct_peaks", "peak_to_peak", "period", "outcome", "largest_force", "steps", "rejected")
"""Measures that `Measures` has under the same name."""

_STATUS = np.array([status.text for status in Status], dtype=object)


class _Table:
    """The growing measures, one entry per cell; and when each run has settled within 10 um for good, wherever it is
    then, `settled` [s], shape (count,)."""

    def __init__(self, count: int, names: Iterable[str]) -> None:
        self.count, self.settled = count, np.full(count, np.nan)
        self.columns: Columns = {
            name: np.full(count, "", dtype=object) if name in WORDS else np.full(count, np.nan) for name in names
        }

    def invalidate(self, cells: np.ndarray, flat: Mapping[str, Any]) -> None:
        """Mark the cells that no stage may have, each with the first reason found."""
        for broken, why in violations(flat):
            which = cells[np.broadcast_to(broken, cells.shape) & self.valid[cells]]
            for name in ("outcome", *VERDICTS):
                if name in self.columns:
                    self.columns[name][which] = "invalid"
            self.columns["status"][which] = f"invalid: {why}"

    @property
    def valid(self) -> np.ndarray:
        """Which cells a stage may have, shape (cells,)."""
        return self.columns["outcome"] != "invalid"

    @property
    def ran(self) -> np.ndarray:
        """Which cells were run, to their end or not, shape (cells,)."""
        return ~np.isin(self.columns["outcome"], ("invalid", ""))

    def motions(self, cells: np.ndarray) -> Motions:
        """How the motions of the cells went."""
        peaks, swing = (self.columns[name][cells] for name in ("peaks", "peak_to_peak"))
        away = self.columns["status"][cells] == Status.DIVERGED.text
        return Motions(self.columns["outcome"][cells] != FAILED, away, peaks, swing, self.settled[cells])

    def write(self, which: np.ndarray, measures: Measures, runs: Runs) -> None:
        """Write the measures of the cells that were run."""
        ran = runs.results.statuses != Status.NOT_RUN
        inner, outer = measures.settling_time
        written = {
            "settling_time": inner,
            "settling_time_10um": outer,
            "status": _STATUS[measures.status],
        } | {name: getattr(measures, name) for name in _SAME}
        for name, column in written.items():
            self.columns[name][which[ran]] = column[ran]
        self.settled[which[ran]] = measures.in_the_end[1][ran]

    def write_attractors(self, cells: np.ndarray, attracted: StageAttractors) -> None:
        """Write those measures of what attracts the cells' stages that the table has: of the largest swing of each, as
        far as that is certain."""
        kind = np.where(attracted.attracts, np.where(attracted.closed, CYCLE, SWING), NOTHING)
        columns = {"attractor": np.where(attracted.certain, kind, UNKNOWN).astype(object)}
        swing = attracted.multiplier, attracted.amplitude, attracted.period
        columns |= {
            name: np.where(attracted.certain, column, np.nan) for name, column in zip(CYCLE_UNITS, swing, strict=True)
        }
        for name, column in columns.items():
            if name in self.columns:
                self.columns[name][cells] = column
