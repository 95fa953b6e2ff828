"""Build the study of a sweep, and write the files beside its store.

A study that is too large is refused with an estimate of its cost.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from friso.errors import InputError, StoreError
from friso.interface.inputs import axes_of, wrong
from friso.interface.output_folder import check_file, check_store_folder, refuse_place
from friso.platform.system import shell_word
from friso.quantities import quoted
from friso.stage import Stage
from friso.studies.axes import AxisValues, Samples
from friso.studies.metric import METRICS, metrics, with_usual
from friso.studies.study import Request, Study, study_of
from friso.studies.sweep import Crew

AXIS_EXAMPLE = 'masses.stage="0.2 kg..2 kg:41"'

USUAL_AXES = {"speed": "0.4..2.5:41:log", "friction": "0.3..3:41:log"}
"""Axes of a map for which none were named: what one may choose, and what nobody knows."""

BYTES_PER_NUMBER = 8
"""Bytes per number in a store before compression."""


@dataclass(frozen=True)
class Varied:
    """What the user asked to vary: axes, and how to sample them."""

    axes: Mapping[str, AxisValues] = field(default_factory=dict)
    samples: int | Samples | None = None

    @classmethod
    def of_texts(
        cls,
        axes: Mapping[str, AxisValues],
        x: str | None,
        y: str | None,
        more: Iterable[str],
        samples: int | Samples | None = None,
    ) -> Varied:
        """Collect axes from a dictionary and from texts KEY=RANGE, each key once.

        The texts are `x`, `y` and those in `more`. Raises InputError for an axis that is not usable.
        """
        named = {"x": x, "y": y} | {f"axis {k + 1}": text for k, text in enumerate(more)}
        return cls(axes_of(axes, named, AXIS_EXAMPLE), samples)


def study_for(stage: Stage, varied: Varied, metric: str, most: int | None, crew: Crew) -> Study:
    """Build the study that the options describe.

    Raises InputError for unusable options, or for a study of more than `most` cells; the message then gives its cost.
    """
    axes, samples = varied.axes, varied.samples
    if not axes and samples is None:
        axes = USUAL_AXES
    if not axes and not isinstance(samples, Samples):
        raise InputError("x", "no axis", "one axis or more", f"x={AXIS_EXAMPLE}")
    if isinstance(samples, int):
        if len(axes) == 1:
            raise InputError("samples", "samples of one key", "two keys or more; for one, a range with its points")
        axes, samples = {}, Samples(axes, samples)
    METRICS.checked(metric, "metric", "metric={}")
    request = Request(stage, axes, samples)
    if most is not None and (runs := request.size()) > most:
        raise _too_large(runs, request.trial(), crew)
    return request.study(with_usual(metric))


def stored_study(store: Path, metric: str | None, most: int | None) -> tuple[Study, str]:
    """Return the study of a store that is resumed, and the metric that colours its map.

    Without a `metric`, the store's own is used. Raises InputError for a metric that the store does not hold, or if more
    than `most` cells are unfinished.
    """
    from friso.studies.store import Store, own_at, read_store

    with read_store(store) as runs:
        study = study_of(runs)
    if most is not None and study.cells > most and not Store(store, study).is_done:
        actual = f"{study.cells:.3g} cells in {store}, not all of which were run"
        raise InputError("yes", actual, "--yes, if so many are meant; nothing was run", "yes=True")
    metric = metric or own_at(store).metric
    coloured = [name for name in study.metrics if name in metrics()]
    if metric in metrics() and metric not in coloured:
        actual, expected = f"{metric}, which {store} does not hold", "one that it holds, or a new map"
        example = f"friso map STAGE.toml ... --metric {metric} --out {shell_word(f'{store.stem}-{metric}.zarr')}"
        raise InputError("metric", actual, expected, example)
    if metric not in metrics():
        raise InputError("metric", quoted(metric), f"one of {', '.join(coloured)}", "metric=peak_to_peak")
    return study, metric


def as_stored(study: Study, store: Path, metric: str, overwrite: bool) -> Study:
    """Return the study with all metrics of its store, if the store differs in nothing else.

    Otherwise the study is returned as it is. Raises InputError if the store lacks some of the metrics asked for, unless
    `overwrite` is set.
    """
    from friso.studies.store import read_store
    from friso.studies.store_files import remove_leftovers

    remove_leftovers(store)  # a store that was being replaced is put back
    try:
        with read_store(store) as runs:
            stored, equations = study_of(runs), str(runs.attrs.get("equations"))
    except StoreError:  # there is no store, or it will be refused
        return study
    if replace(study, metrics=stored.metrics).differences(stored, equations):
        return study
    lacking = [name for name in study.metrics if name not in stored.metrics]
    if lacking and not overwrite:
        actual = f"{store}, which holds no {metric if metric in lacking else ', '.join(lacking)}"
        raise InputError(
            "--out", actual, "another --out, or --overwrite", f"--out {shell_word(f'{store.stem}-{metric}.zarr')}"
        )
    return study if lacking else stored


def coloured_by(study: Study, metric: str) -> str:
    """Return the variable that colours the map.

    It is the metric asked for or, if the study has it, the metric that maps show in its place (`Metric.shown_as`).
    """
    other = metrics()[metric].shown_as
    return other if other in study.metrics else metric


def _too_large(runs: int, trial: Study, crew: Crew) -> InputError:
    """Build the refusal of a large study, with its time and disk space estimated by a trial."""
    from friso.studies.sweep import run_scattered

    run_scattered(trial, np.arange(crew.size), crew)  # compiles the kernels
    start = time.perf_counter()
    run_scattered(trial, np.arange(trial.cells), crew)
    hours = (time.perf_counter() - start) / trial.cells * runs / 3600
    gigabytes = BYTES_PER_NUMBER * len(trial.metrics) * runs / 1e9
    size = f"{runs:.3g} runs: about {hours:.2g} hours on this machine, and up to {gigabytes:.2g} GB of disk"
    return InputError("yes", size, "--yes, or fewer points; nothing was run", "yes=True")


def place_of_store(folder: str | os.PathLike[str]) -> Path:
    """Return the absolute folder of a store, so that even "." or ".." has a name.

    Raises InputError for a folder without a name, such as the root.
    """
    path = Path(folder)
    path = path if path.name not in ("", "..") else Path(os.path.abspath(path))
    if not path.name:
        raise wrong("out", str(path), "the folder of a store, with a name", "map.zarr")
    refuse_place("out", path)
    return path


def refuse_overwriting(study: Study, store: Path, overwrite: bool, beside: str = "") -> None:
    """Refuse to write over the store of another study, and over files.

    If figure and page are written beside the store, `beside` is the example in a refusal. Raises InputError for files
    of others, and StoreError for a store with another study; `overwrite` allows both.
    """
    from friso.studies.store import refuse_other
    from friso.studies.store_files import is_store

    check_store_folder(store)
    if not overwrite and is_store(store):
        refuse_other(store, study)
    for view in _views(store) if beside else ():
        check_file("--out", view, overwrite, [store], example=beside)


def _views(store: Path) -> list[Path]:
    """Return the paths of the figure in all formats and of the page beside a store."""
    from friso.shown.drawing.figure import IMAGE_FORMATS

    return [path_beside(store, form) for form in (*IMAGE_FORMATS, "html")]


def path_beside(store: Path, form: str) -> Path:
    """Return the path of a store's figure or page by its format."""
    stem = store.with_suffix("") if store.suffix == ".zarr" else store
    return stem.with_name(f"{stem.name}.{form}")
