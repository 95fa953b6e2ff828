"""Run parameter studies into an xarray Dataset, or into a store that can be resumed."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from friso.progress import Progress, Tally, silent
from friso.stage import Stage
from friso.studies.axes import AxisValues, Samples
from friso.studies.cells import Columns, unfilled
from friso.studies.execute import Crew, local_crew, run_scattered
from friso.studies.metric import attributes_of
from friso.studies.refine import Ask, asked_for, finer, refine_cells
from friso.studies.store import Store
from friso.studies.study import Request, Study, cells_of
from friso.studies.verify import checked_share, verify_cells

if TYPE_CHECKING:
    import xarray as xr

CELLS = "cells of the map"
"""Progress message of a sweep."""


def sweep(
    stage: Stage,
    axes: Mapping[str, AxisValues],
    samples: Samples | None = None,
    links: Mapping[str, str] | None = None,
    metrics: Sequence[str] | None = None,
    rtol: float = 1e-6,
    refine: bool = False,
    verify: float = 0.0,
    store: str | os.PathLike[str] | None = None,
    threads: int | None = None,
) -> xr.Dataset:
    """Run every combination of the axes' values.

    An axis is a stage-file key with its values, which are one of these:

    - an array with a unit, ``(np.linspace(1, 40, 41), "Hz")``;
    - a range, ``"1 Hz..40 Hz:41"``, with ``":log"`` behind it if it is logarithmic;
    - a list of texts with units;
    - bare numbers, words or booleans, if the key takes these.

    `samples` adds a dimension "sample" along which several keys vary at once (see `Samples`). `links` are SI
    expressions for keys that follow. With ``{"mass": (masses, "kg")}`` as axis, they may be
    ``{"masses.cart": "0.7 * mass", "masses.stage": "0.3 * mass"}``.

    The result has one dimension per axis, with SI coordinates. Its variables, or the `metrics` among them, are:

    - outcome: what the run did at its end, "swings", "creeps", "rests" or "failed";
    - peaks (the thesis's count), and distinct_peaks;
    - peak_to_peak [m] and period [s] at the end of the run;
    - settling_time [s] into 1 um, and settling_time_10um [s];
    - largest_force [N];
    - steps and rejected, the solver's attempted and rejected steps, and status.

    A cell that no stage may have is "invalid", with the reason in its status. If named in `metrics`, there are also
    those of what attracts the stage, whatever its motion does:

    - attractor: "cycle", "swing" where no orbit could be closed, "nothing", or "unknown" where it is not certain;
    - amplitude [m], cycle_period [s] and multiplier, of the largest swing that was found. They are NaN where nothing
      attracts, and the multiplier also where no orbit could be closed;
    - verdict on the stage: "hunts", "bistable", "transient", "settles", "undecided" or "failed".

    The attribute `criterion` of a variable names its criterion of hunting (`friso.hunting.criteria`).

    An outcome is as good as its tolerance. With `verify`, that fraction of the cells is run again at rtol/100. The
    attributes verified_cells and verified_surviving then count these cells and the outcomes that survived, and
    verified_rtol is the tighter tolerance. With `refine` the grid is made four times finer. A fifth of it is run, along
    the changes of outcome (and of verdict, if it is asked for). The other cells are inferred, which their status says.
    With `store`, a folder, results are written there in Zarr as they come, and a study that was interrupted resumes.
    Raises InputError for a wrong axis, link or store, ValueError for a tolerance that is not usable.
    """
    study = Request(stage, axes, samples, links or {}).study(metrics, rtol)
    study = finer(study) if refine else study
    checked_share(verify)
    with local_crew(threads) as crew:
        if store is None:
            return run_in_memory([study], crew, verify)[0]
        return run_in_store(study, Path(store), crew, verify)


def run_in_memory(
    studies: Sequence[Study], crew: Crew, verify: float = 0.0, progress: Progress = silent
) -> list[xr.Dataset]:
    """Run studies side by side, verify a fraction of each, and return them as datasets.

    `verify` is that fraction of cells. Refined studies are run one by one.
    """
    tally = Tally(progress, sum(study.cells for study in studies))
    refined = {id(study): _refined(study, crew, tally) for study in studies if study.refined}
    columns = [
        refined.get(id(study)) or {name: unfilled(name, study.shape) for name in study.metrics} for study in studies
    ]
    number = {id(study): k for k, study in enumerate(studies)}
    for study, block, columns_of_block in crew.compute(crew.jobs([study for study in studies if not study.refined])):
        for name in study.metrics:
            target = columns[number[id(study)]][name][block]
            target[...] = columns_of_block[name].reshape(target.shape)
        tally.add(len(columns_of_block["outcome"]), CELLS)
    results = [dataset(study, columns_of_study) for study, columns_of_study in zip(studies, columns, strict=True)]
    for study, runs in zip(studies, results, strict=True):
        runs.attrs |= verify_cells(study, runs, crew, verify)
    return results


def run_in_store(study: Study, path: Path, crew: Crew, verify: float = 0.0, progress: Progress = silent) -> xr.Dataset:
    """Run the missing blocks of a study's store, and return the study as read from the store.

    The store at `path` is created if necessary. `verify` is the fraction of cells to run again at a tighter tolerance.
    Raises InputError for a folder that cannot be this store.
    """
    with Store.opened(path, study) as store:
        return fill(store, crew, verify, progress)


def fill(store: Store, crew: Crew, verify: float = 0.0, progress: Progress = silent) -> xr.Dataset:
    """Run the missing blocks of an opened store, and return the study as read from it.

    `verify` is the fraction of cells to run again at a tighter tolerance.
    """
    study, missing = store.study, list(store.missing())
    tally = Tally(progress, study.cells)
    tally.add(study.cells - sum(map(cells_of, missing)), CELLS)
    if missing and study.refined:
        columns = _refined(study, crew, tally, store.answers.keeping)
        for block in missing:
            store.write(block, {name: columns[name][block] for name in study.metrics})
        store.answers.forget()
        missing = []
    for _, block, measures in crew.compute((study, block) for block in missing):
        store.write(block, measures)
        tally.add(len(measures["outcome"]), CELLS)
    runs = store.read()
    if verified := verify_cells(study, runs, crew, verify):
        store.annotate(verified)
    return store.read()


def _refined(study: Study, crew: Crew, tally: Tally, keeping: Callable[[Ask], Ask] = lambda ask: ask) -> Columns:
    """Return the metrics of a refined study, each of its shape.

    `keeping` changes the function that computes cells, to store the results of an unfinished study.
    """
    everything = asked_for(study)

    def ask(cells: np.ndarray) -> Columns:
        columns = run_scattered(everything, cells, crew)
        tally.add(len(cells), CELLS)
        return columns

    columns = refine_cells(study, keeping(ask))
    return {name: columns[name].reshape(study.shape) for name in study.metrics}


def dataset(study: Study, columns: Columns) -> xr.Dataset:
    """Return the dataset of a study from its metrics, each of the study's shape."""
    import xarray as xr

    variables = {
        name: (study.names, columns[name], attributes_of(name, study.stage.axis_kind)) for name in study.metrics
    }
    return xr.Dataset(variables, coords=study.coordinates(), attrs=study.attributes())
