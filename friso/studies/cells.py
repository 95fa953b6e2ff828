"""Run cells, stages that differ in some keys, on the ideal machine or with the real drive.

Values of keys go in as columns, and metrics come out as columns, with one entry per cell. With the real drive cells run
on the shaking floor of their stage file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from friso.engine.arrays import Results, Status
from friso.engine.batch import RunOptions, Runs, part_of, run_chunks, usual_interval
from friso.engine.kernel import empty_results, kernel
from friso.equations.structure import Structure, decisive_keys, structure
from friso.hunting import Motions, StageAttractors, find_attractors, judge_runs, sketch_attractors
from friso.hunting.criteria import FAILED
from friso.hunting.measures import Measures, measure_runs, measuring_options
from friso.stage import Stage, violations
from friso.stage.rig import is_as_built
from friso.studies.axes import linked, scaled
from friso.studies.metric import (
    STATUS,
    Metric,
    MetricBasis,
    RunEvidence,
    StageEvidence,
    in_order,
    is_text,
    metrics,
    usual_metrics,
    worded,
)

TIMING = (
    "motion.duration",
    *(
        f"drive.{name}"
        for name in ("sample_time", "delay", "velocity_samples", "velocity_sample_time", "position_sample_time")
    ),
)
"""Keys that are equal for all runs of the drive as built that are run together: how long they last, and keys that
change the drive's equations through whole numbers of samples."""


def runs_as_built(stage: Stage, names: Sequence[str]) -> bool:
    """Tell whether cells run with the real drive: if only metrics of runs are requested.

    `names` are the metrics. Verdicts, and the runs that they need, are those of the ideal machine.
    """
    return is_as_built(stage) and of_runs_alone(names)


def of_runs_alone(names: Sequence[str]) -> bool:
    """Tell whether all metrics in `names` are computed from runs; other names do not count."""
    every = metrics()
    return all(every[name].source == "run" for name in names if name in every)


def built_runs(
    stage: Stage, flat: Mapping[str, Any], count: int, threads: int | None, cancel: np.ndarray | None
) -> Iterator[tuple[Runs, Measures]]:
    """Run cells of one structure with their real drive, and yield runs and their measures.

    `flat` has keys such as "friction.static", with SI numbers or arrays (count,). All cells have the same noise. The
    runs hold only statistics and statuses: turning points come from the drive's samples, and are in the measures. Once
    `cancel` is set, no further chunk begins.
    """
    # 0.1 s to import, of use for real drives alone
    from friso.virtual_rig.run import measured_recording, run_flat, with_complete_drive
    from friso.virtual_rig.task import motion_task

    timing = [np.broadcast_to(flat[key], (count,)) for key in TIMING if key in flat]
    kinds, which = np.unique(np.stack([np.zeros(count), *timing]), axis=1, return_inverse=True)
    for kind in range(kinds.shape[1]):
        numbers = np.flatnonzero(which.ravel() == kind)
        part = part_of(flat, numbers)
        part = with_complete_drive(part | {key: float(np.ravel(part[key])[0]) for key in TIMING if key in part})
        task = motion_task(part, len(numbers))
        interval = max(1, round(usual_interval(task.duration) / part["drive.sample_time"])) * part["drive.sample_time"]
        for recorded in run_flat(part, stage.floor, task, [0] * len(numbers), interval, threads):
            if cancel is not None and cancel[0]:
                return
            results: Results = empty_results(len(recorded.numbers), 0, 0, 0)
            results = results._replace(statuses=recorded.statuses, statistics=recorded.statistics)
            yield (
                Runs(numbers[recorded.numbers], results),
                measured_recording(part_of(part, recorded.numbers), recorded),
            )


Columns = dict[str, np.ndarray]
"""Names to arrays of shape (cells,)."""


SURVEYS: Mapping[MetricBasis, Callable[..., StageAttractors]] = {"sketch": sketch_attractors, "survey": find_attractors}
"""Searches for attractors, by the source of the metrics that need them."""


def run_cells(
    stage: Stage,
    links: Mapping[str, str],
    columns: Mapping[str, np.ndarray],
    rtol: float,
    names: Sequence[str] = (),
    threads: int | None = 1,
    cancel: np.ndarray | None = None,
) -> Columns:
    """Run one stage per entry of the columns, shape (cells,) each, and return its metrics.

    Columns are axis names to SI values, words or booleans. `links` are SI expressions for further keys. If only metrics
    of runs are named and the file describes the drive, cells run with the real drive (`built_runs`). The
    result holds the usual metrics of a run and those in `names` (`friso.studies.metric`), each of shape (cells,). An
    invalid cell has the word "invalid", and the reason in its status. A cell whose run was not completed has the
    outcome "failed". Setting cancel[0] from another thread ends the work early: cells not run by then keep the outcome
    "".
    """
    table = _Table(len(next(iter(columns.values()))), in_order((*usual_metrics(), *names)))
    parts = list(by_words(stage, links, columns))
    for flat, cells in parts:
        table.invalidate(cells, flat)
    built = runs_as_built(stage, names)
    for flat, cells, shape in by_equations(parts, table.valid):
        options = measuring_options(rtol, threads, cancel)
        several = (
            built_runs(stage, flat, len(cells), threads, cancel)
            if built
            else ideal_runs(shape, flat, len(cells), options)
        )
        for runs, measures in several:
            table.write_runs(cells[runs.numbers], RunEvidence(runs.part(flat), runs, measures))
    for source, find in SURVEYS.items():
        if not table.of(source):
            continue
        for flat, cells, attracted in cell_attractors(parts, table.ran, find, threads, cancel):
            motions = table.motions(cells)
            verdicts = partial(judge_runs, flat, motions, attracted, rtol, threads, cancel)
            evidence = StageEvidence(flat, attracted, motions, verdicts)
            for name, metric in table.of(source).items():
                table.columns[name][cells] = metric.compute(evidence)
    return table.columns


def ideal_runs(
    shape: Structure, flat: Mapping[str, Any], count: int, options: RunOptions
) -> Iterator[tuple[Runs, Measures]]:
    """Run cells of one structure with the controller in continuous time, and measure them.

    Yields runs and their measures in chunks. `flat` has SI numbers or arrays (count,) by key.
    """
    for runs in run_chunks(kernel(shape), flat, count, options):
        yield runs, measure_runs(runs.part(flat), runs)


Parts = Iterable[tuple[dict[str, Any], np.ndarray]]
"""Keys of cells with SI values, and the cells' indices, for each combination of words.

Booleans count as words.
"""


def cell_attractors(
    parts: Parts,
    chosen: np.ndarray,
    find: Callable[..., StageAttractors] = find_attractors,
    threads: int | None = None,
    cancel: np.ndarray | None = None,
) -> Iterator[tuple[dict[str, Any], np.ndarray, StageAttractors]]:
    """Yield the attractors of the chosen cells, grouped by equations.

    `chosen`, shape (cells,), is true for these cells. For each group, keys with SI values, indices of cells, and the
    attractors are yielded, as `find` returns them. Of cells that differ only in their motion, one is searched. The work
    takes `threads` threads, and ends early once `cancel` is set.
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
    """Find the attractors of `count` stages of one structure with the function `find`.

    Stages that differ only in their motion are searched once. `threads` and `cancel` are passed on to `find`.
    """
    varied = [np.zeros(count)]
    varied += [value for key, value in flat.items() if np.ndim(value) and not key.startswith("motion.")]
    _, first, again = np.unique(np.stack(varied), axis=1, return_index=True, return_inverse=True)
    different = {
        key: value[first] if np.ndim(value) and not key.startswith("motion.") else value for key, value in flat.items()
    }
    return find(different, len(first), threads=threads, cancel=cancel).take(again.ravel())


def allowed_cells(stage: Stage, links: Mapping[str, str], columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return which cells are valid stages, shape (cells,).

    `columns` are axis names to values (cells,), and `links` SI expressions for further keys.
    """
    table = _Table(len(next(iter(columns.values()))), ("outcome", STATUS))
    for flat, cells in by_words(stage, links, columns):
        table.invalidate(cells, flat)
    return table.valid


def flat_cells(stage: Stage, links: Mapping[str, str], columns: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Return all keys of all cells, with SI numbers or arrays (cells,); columns are numeric.

    Links are applied first, then scalings.
    """
    numeric = stage.numeric_keys()
    keys = {name: column for name, column in columns.items() if name in numeric}
    keys |= linked(links, stage.flat(keys) | dict(columns)) if links else {}
    return scaled(stage.flat(keys), columns, links)


def by_equations(parts: Parts, chosen: np.ndarray) -> Iterator[tuple[dict[str, Any], np.ndarray, Structure]]:
    """Yield the chosen cells, shape (cells,), grouped by equations.

    For each group, keys with SI values, indices of cells, and the structure (what decides the equations) are yielded.
    """
    for flat, cells in parts:
        for shape, members in _by_structure(flat, chosen[cells], len(cells)):
            of_group = {key: value[members] if np.ndim(value) else value for key, value in flat.items()}
            yield of_group, cells[members], shape


def by_words(
    stage: Stage, links: Mapping[str, str], columns: Mapping[str, np.ndarray]
) -> Iterator[tuple[dict[str, Any], np.ndarray]]:
    """Yield keys with SI values, and cell indices, for each combination of words in the columns.

    Booleans count as words.
    """
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
    """Yield structures and the indices of their cells, for the valid ones of `count` cells.

    The structure decides the equations. Cells are grouped by the few keys that determine it.
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
    """The metrics and statuses of cells while they are filled in, one entry per cell.

    `settled` [s], shape (count,), is the time from which each run stays within 10 um of its reference.
    """

    def __init__(self, count: int, names: Iterable[str]) -> None:
        self.count, self.settled, every = count, np.full(count, np.nan), metrics()
        self.columns = {name: unfilled(name, count) for name in names}
        self.metrics = {name: every[name] for name in self.columns if name in every}

    def of(self, source: MetricBasis) -> dict[str, Metric]:
        """Return the metrics computed from one source: "run", "sketch" or "survey"."""
        return {name: metric for name, metric in self.metrics.items() if metric.source == source}

    def invalidate(self, cells: np.ndarray, flat: Mapping[str, Any]) -> None:
        """Mark the invalid ones of some cells, each with the first rule that it breaks.

        `flat` has the keys of these `cells`, with SI values.
        """
        for broken, why in violations(flat):
            which = cells[np.broadcast_to(broken, cells.shape) & self.valid[cells]]
            for name in worded():
                if name in self.columns:
                    self.columns[name][which] = "invalid"
            self.columns[STATUS][which] = f"invalid: {why}"

    @property
    def valid(self) -> np.ndarray:
        """Return which cells are valid stages, shape (cells,)."""
        return self.columns["outcome"] != "invalid"

    @property
    def ran(self) -> np.ndarray:
        """Return which cells were run, completed or not, shape (cells,)."""
        return ~np.isin(self.columns["outcome"], ("invalid", ""))

    def motions(self, cells: np.ndarray) -> Motions:
        """Return how the motions of some cells went: completion, peaks, swing and settling."""
        peaks, swing = (self.columns[name][cells] for name in ("peaks", "peak_to_peak"))
        away = self.columns[STATUS][cells] == Status.DIVERGED.text
        return Motions(self.columns["outcome"][cells] != FAILED, away, peaks, swing, self.settled[cells])

    def write_runs(self, cells: np.ndarray, evidence: RunEvidence) -> None:
        """Write status and metrics of those `cells` that were run before the work was cancelled."""
        measures, ran = evidence.measures, evidence.runs.results.statuses != Status.NOT_RUN
        columns = {name: metric.compute(evidence) for name, metric in self.of("run").items()}
        for name, column in (columns | {STATUS: _STATUS[measures.status]}).items():
            self.columns[name][cells[ran]] = column[ran]
        self.settled[cells[ran]] = measures.in_the_end[1][ran]


def unfilled(variable: str, shape: int | tuple[int, ...]) -> np.ndarray:
    """Return an array for a study's variable before any cell was run: empty texts or NaN."""
    return np.full(shape, "", dtype=object) if is_text(variable) else np.full(shape, np.nan)
