"""Run parameter studies into an xarray Dataset, or into a store that can be resumed."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from friso.progress import Progress, Tally, silent
from friso.stage import Stage
from friso.studies.axes import AxisValues, Samples
from friso.studies.cells import Columns, unfilled
from friso.studies.execute import Crew, local_crew
from friso.studies.metric import attributes_of
from friso.studies.store import Store
from friso.studies.study import Request, Study, cells_of

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

    With `store`, a folder, results are written there in Zarr as they come, and a study that was interrupted resumes.
    Raises InputError for a wrong axis, link or store, ValueError for a tolerance that is not usable.
    """
    study = Request(stage, axes, samples, links or {}).study(metrics, rtol)
    with local_crew(threads) as crew:
        if store is None:
            return run_in_memory([study], crew)[0]
        return run_in_store(study, Path(store), crew)


def run_in_memory(studies: Sequence[Study], crew: Crew, progress: Progress = silent) -> list[xr.Dataset]:
    """Run studies side by side, and return them as datasets."""
    tally = Tally(progress, sum(study.cells for study in studies))
    columns = [{name: unfilled(name, study.shape) for name in study.metrics} for study in studies]
    number = {id(study): k for k, study in enumerate(studies)}
    for study, block, columns_of_block in crew.compute(crew.jobs(studies)):
        for name in study.metrics:
            target = columns[number[id(study)]][name][block]
            target[...] = columns_of_block[name].reshape(target.shape)
        tally.add(len(columns_of_block["outcome"]), CELLS)
    return [dataset(study, columns_of_study) for study, columns_of_study in zip(studies, columns, strict=True)]


def run_in_store(study: Study, path: Path, crew: Crew, progress: Progress = silent) -> xr.Dataset:
    """Run the missing blocks of a study's store, and return the study as read from the store.

    The store at `path` is created if necessary. Raises InputError for a folder that cannot be this store.
    """
    with Store.opened(path, study) as store:
        return fill(store, crew, progress)


def fill(store: Store, crew: Crew, progress: Progress = silent) -> xr.Dataset:
    """Run the missing blocks of an opened store, and return the study as read from it."""
    study, missing = store.study, list(store.missing())
    tally = Tally(progress, study.cells)
    tally.add(study.cells - sum(map(cells_of, missing)), CELLS)
    for _, block, measures in crew.compute((study, block) for block in missing):
        store.write(block, measures)
        tally.add(len(measures["outcome"]), CELLS)
    return store.read()


def dataset(study: Study, columns: Columns) -> xr.Dataset:
    """Return the dataset of a study from its metrics, each of the study's shape."""
    import xarray as xr

    variables = {
        name: (study.names, columns[name], attributes_of(name, study.stage.axis_kind)) for name in study.metrics
    }
    return xr.Dataset(variables, coords=study.coordinates(), attrs=study.attributes())
