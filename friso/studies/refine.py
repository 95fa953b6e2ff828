"""Sample a map adaptively: a grid four times finer per axis, for a fifth of its runs.

A lattice of every second cell of the user's grid is run first. Where neighbouring cells differ, both are run, until
every change of outcome (or of verdict, if computed) has been seen from both sides. So a boundary that was met once is
followed to its end. Remaining runs go to the most uncertain cells: far from any run, near boundaries, and where runs
settle late.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from friso.errors import InputError
from friso.hunting.criteria import SWINGS
from friso.studies.axes import SAMPLE, SweptAxis
from friso.studies.cells import INFERRED, Columns, unfilled
from friso.studies.metric import in_order, usual_metrics, worded
from friso.studies.settings import settings
from friso.studies.study import Dimension, Study

Ask = Callable[[np.ndarray], Columns]
"""Function that returns the metrics of cells, by the cells' indices."""


def finer(study: Study) -> Study:
    """Return the study on a grid four times finer per axis.

    Raises InputError unless it has one to three axes of numbers, on a grid.
    """
    if len(study.shape) > 3 or not all(axis.numeric for axis in study.axes) or SAMPLE in study.names:
        expected = "one to three axes of numbers on a grid"
        raise InputError("--refine", f"axes: {', '.join(study.names)}", expected)
    dimensions = tuple(Dimension(dimension.name, (_finer(dimension.axes[0]),)) for dimension in study.dimensions)
    return replace(study, dimensions=dimensions, refined=True)


def _finer(axis: SweptAxis) -> SweptAxis:
    """Return the axis with more values between its own, finer by the setting `finer_factor`.

    An evenly divided range is divided anew, as if the user had asked for that many points.
    """
    log = axis.scale == "log"
    space, ends = np.geomspace if log else np.linspace, (axis.values[0], axis.values[-1])
    if np.array_equal(space(*ends, len(axis.values)), axis.values):
        return replace(axis, values=space(*ends, settings.finer_factor * (len(axis.values) - 1) + 1))
    values = np.log(axis.values) if log else axis.values
    places = np.arange(settings.finer_factor * (len(values) - 1) + 1) / settings.finer_factor
    between = np.interp(places, np.arange(len(values)), values)
    between = np.exp(between) if log else between
    between[:: settings.finer_factor] = axis.values
    return replace(axis, values=between)


def asked_for(study: Study) -> Study:
    """Return the study with the further metrics that its refinement needs."""
    return replace(study, metrics=in_order((*usual_metrics(), *study.metrics)))


def refine_cells(study: Study, ask: Ask) -> Columns:
    """Compute a fine study from some of its cells; return its metrics, each of shape (cells,).

    `ask` computes the metrics of cells. A cell that was not computed has the outcome (and the verdict) of the nearest
    computed one, a status that says so, and no numbers.
    """
    grid = _Grid(study)
    grid.learn(_lattice(study.shape), ask)
    while (left := grid.budget - grid.runs) > 0:
        cells = grid.unseen_changes()
        if not cells.size:
            batch = max(1, grid.budget // settings.refine_batches)
            # keep one batch to follow the changes that it shows
            cells = grid.likely_surprises(min(left - batch, batch))
        if not cells.size:
            break
        grid.learn(cells[:left], ask)
    return grid.filled()


def _lattice(shape: tuple[int, ...]) -> np.ndarray:
    """Return the indices of the cells of a coarse lattice, including the ends of the axes."""
    lines = [np.unique(np.append(np.arange(0, size, settings.lattice_step), size - 1)) for size in shape]
    return np.ravel_multi_index(np.meshgrid(*lines, indexing="ij"), shape).ravel()


class _Grid:
    """Results of the computed cells of a study on a fine grid, and which cells to compute next."""

    def __init__(self, study: Study) -> None:
        self.shape = study.shape
        coarse = math.prod(size // settings.finer_factor + 1 for size in study.shape)
        self.budget = max(int(settings.refined_share * study.cells), min(3 * coarse // 2, study.cells))
        self.columns: Columns = {}
        self.words = tuple(name for name in worded(verdicts=True) if name in study.metrics)
        self.computed = np.zeros(study.shape, bool)
        self.runs = 0

    def learn(self, cells: np.ndarray, ask: Ask) -> None:
        """Compute cells with `ask`, and store their results.

        Invalid cells do not count as runs.
        """
        columns = ask(cells)
        for name in columns:
            self.columns.setdefault(name, unfilled(name, self.computed.size))[cells] = columns[name]
        self.computed.flat[cells] = True
        self.runs += int(np.sum(columns["outcome"] != "invalid"))

    def _nearest(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the distance in cells to the nearest computed cell, and that cell's index.

        Both have the study's shape.
        """
        from scipy.ndimage import distance_transform_edt  # 0.2 s to import

        transform: Any = distance_transform_edt(~self.computed, return_indices=True)
        distance, places = transform
        return distance, np.asarray(np.ravel_multi_index(tuple(places), self.shape))

    def _changes(self, nearest: np.ndarray) -> np.ndarray:
        """Return which cells have a neighbour with another outcome or verdict.

        A cell has the words of its nearest computed cell, `nearest`.
        """
        both = np.sum([self.columns[name] + " " for name in self.words], axis=0).astype(str)
        words = np.unique(both, return_inverse=True)[1].ravel()[nearest]
        changes = np.zeros(self.shape, bool)
        for axis in range(changes.ndim):
            along, beside = np.moveaxis(words, axis, 0), np.moveaxis(changes, axis, 0)
            differ = along[1:] != along[:-1]
            beside[1:] |= differ
            beside[:-1] |= differ
        return changes

    def unseen_changes(self) -> np.ndarray:
        """Return the indices of cells at a change of outcome or verdict that are not computed yet."""
        _, nearest = self._nearest()
        return np.flatnonzero(self._changes(nearest) & ~self.computed)

    def likely_surprises(self, count: int) -> np.ndarray:
        """Return the indices of the cells, at most `count`, that are most worth a run.

        These are far from any computed cell, near changes, and where runs settle late.
        """
        from scipy.ndimage import distance_transform_edt

        distance, nearest = self._nearest()
        changes = self._changes(nearest)
        from_change: Any = distance_transform_edt(~changes) if changes.any() else np.ones(self.shape)
        settling = np.nan_to_num(self.columns["settling_time_10um"], nan=settings.late_settling)
        late = np.where(self.columns["outcome"] == SWINGS, 1.0, np.minimum(settling / settings.late_settling, 1.0))
        worth = np.where(self.computed, 0.0, distance * late[nearest] / np.cbrt(np.maximum(from_change, 1.0)))
        best = np.argsort(-worth, axis=None, kind="stable")[: max(count, 0)]
        return best[worth.flat[best] > 0]

    def filled(self) -> Columns:
        """Return the metrics of all cells; a cell not computed has the words of the nearest one.

        The status of such a cell says so.
        """
        _, nearest = self._nearest()
        guessed = ~self.computed.ravel()
        words = {name: self.columns[name][nearest.ravel()] for name in self.words}
        status = np.where(guessed, f"{INFERRED} from the nearest cell that was run", self.columns["status"])
        return self.columns | words | {"status": status}
