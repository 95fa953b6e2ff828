"""Reduce runs of cells to lines for drawing: extremes of the deviation over short times."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.engine.batch import run_chunks
from friso.engine.kernel import kernel
from friso.equations import motion
from friso.hunting.measures import measuring_options
from friso.progress import Progress, Tally, silent
from friso.studies.cells import allowed_cells, by_equations, by_words
from friso.studies.settings import settings
from friso.studies.study import Study

DRAWING = "drawing runs"
"""Progress message while traces are drawn."""


@dataclass(frozen=True)
class Traces:
    """Deviations of positions from their references [m], reduced for drawing.

    A run is cut into equal pieces over `duration` [s]. `deviations`, shape (cells, 2 pieces), has the least and the
    largest value in each piece, in order of time; NaN after the end of a run. `late`, shape (cells,), is the time [s]
    after which a run shows its final behaviour. It lies half-way between the last corner, or the start if that corner
    is very late, and the end of the run.
    """

    deviations: np.ndarray
    late: np.ndarray
    duration: float


def traces(study: Study, progress: Progress = silent) -> Traces:
    """Run all cells of a study once more, at its tolerance, and reduce them for drawing.

    Invalid cells are NaN throughout.
    """
    columns = study.columns(np.arange(study.cells))
    parts = list(by_words(study.stage, study.links, columns))
    allowed = allowed_cells(study.stage, study.links, columns)
    tally = Tally(progress, int(np.count_nonzero(allowed)))
    tally.add(0, DRAWING)
    duration = max(float(np.max(flat["motion.duration"])) for flat, _ in parts)
    interval = duration / (settings.trace_bins * settings.samples_per_bin)
    options = replace(measuring_options(study.rtol), interval=interval, chunk=settings.traces_together)
    time = np.arange(settings.trace_bins * settings.samples_per_bin) * interval
    drawn = Traces(np.full((study.cells, 2 * settings.trace_bins), np.nan), np.zeros(study.cells), duration)
    for flat, cells, shape in by_equations(parts, allowed):
        form, references = kernel(shape), _references(flat, time)
        end, corner = flat["motion.duration"], motion.last_corner(flat)
        drawn.late[cells] = (end + np.where(corner < 0.9 * end, corner, 0.0)) / 2
        for runs in run_chunks(form, flat, len(cells), options):
            for number, states in zip(runs.numbers, runs.results.samples, strict=True):
                drawn.deviations[cells[number]] = _extremes(_deviation(states[:, form.position], references(number)))
            tally.add(len(runs.numbers), DRAWING)
    return drawn


def _references(flat: Mapping[str, Any], time: np.ndarray) -> Callable[[int], np.ndarray]:
    """Return a function from the index of a run to its reference [m] at `time` [s].

    If all runs have the same motion, the reference is computed once.
    """
    moved = {key: value for key, value in flat.items() if key.startswith("motion.")}
    if not any(np.ndim(value) for value in moved.values()):
        reference = motion.reference(moved, time)
        return lambda number: reference
    return lambda number: motion.reference({k: v[number] if np.ndim(v) else v for k, v in moved.items()}, time)


def _deviation(position: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Return a run's position minus reference [m], NaN after its last sample."""
    deviation = np.full(reference.shape, np.nan)
    sampled = position[: len(reference)]
    deviation[: len(sampled)] = sampled - reference[: len(sampled)]
    return deviation


def _extremes(values: np.ndarray) -> np.ndarray:
    """Return the least and the largest value of each piece of a run, in order of time.

    `values` is cut into the pieces of the settings; the result has the shape (2 pieces,). Both values are NaN if a
    piece is not complete.
    """
    pieces = values.reshape(settings.trace_bins, settings.samples_per_bin)
    places = np.sort(np.stack([pieces.argmin(axis=1), pieces.argmax(axis=1)], axis=1), axis=1)
    return np.take_along_axis(pieces, places, axis=1).ravel()
