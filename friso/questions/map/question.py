"""Sweep keys over ranges and map where a stage hunts.

Results stay in memory, or go into a store from which an interrupted study is resumed. Files of a map stand beside its
store. A study that is too large is refused with an estimate of its cost.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from friso.axis import speak_of
from friso.errors import InputError, StoreError
from friso.hunting import is_moved_evenly
from friso.interface import inputs
from friso.interface.answer import Answer, question
from friso.interface.inputs import (
    LOGGER,
    Address,
    AxisPoints,
    Changes,
    MetricName,
    StageLike,
    Tolerance,
    axes_of,
    wrong,
)
from friso.interface.output_folder import check_file, check_store_folder, refuse_place
from friso.platform.installed import need
from friso.platform.system import MOST_PROCESSES, cause_of, path_of, shell_word, usable_cores
from friso.progress import Progress, silent
from friso.quantities import quoted
from friso.stage import Stage
from friso.stage.rig import AS_BUILT
from friso.studies.axes import AxisValues, Samples
from friso.studies.cells import of_runs_alone, runs_as_built
from friso.studies.metric import METRICS, metrics, with_usual
from friso.studies.store import Store, holds_all, in_memory, read_store
from friso.studies.store_files import ReadOnlyStoreError
from friso.studies.study import Request, Study, study_of
from friso.studies.sweep import Crew, fill, local_crew, run_in_memory

if TYPE_CHECKING:
    import xarray as xr

    from friso.shown.blocks import AnswerBlock, Content, Files
    from friso.shown.drawing.figure import Figure
    from friso.shown.pages import Report
    from friso.studies.edges import MapEdges


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


CONFIRMED_FROM = 10_000_000
"""Number of cells above which a study must be confirmed: it takes minutes and a gigabyte."""


class SweepAnswer(Answer):
    """The runs of a sweep; `result` is an xarray.Dataset with a dimension for each axis.

    `metric` is the variable that colours the map, and `edges` are those of its verdicts. `store` is the
    folder of the runs, or None if they are in memory.
    """

    study: Study
    metric: str
    store: Path | None
    edges: MapEdges | None

    @property
    def varied(self) -> Sequence[str]:
        """Return the keys on the axes."""
        return [axis.name for dimension in self.study.dimensions for axis in dimension.axes]

    @property
    def condition(self) -> str:
        """Say on which unknown values the map rests, and that it leaves out a drive that makes the loop unstable."""
        from friso.shown.text import without_drive

        return super().condition + ("" if of_runs_alone([self.metric]) else without_drive(self.study.stage))

    @property
    def data(self) -> xr.Dataset:
        """Return outcome, peaks, amplitude, status and more over the axes, with coordinates in SI."""
        return self.result

    @property
    def drawable(self) -> bool:
        """Tell whether there are few enough cells for a figure and a page."""
        return self.study.cells <= CONFIRMED_FROM

    def cell(self, *numbers: int | str) -> Stage:
        """Return the stage of a cell, by the cell's indices along the axes.

        Both ``answer.cell(3, 4)`` and ``answer.cell("3 4")`` are understood.
        """
        parts = [int(part) for number in numbers for part in str(number).split()]
        return self.study.cell_stage(parts)

    def blocks(self) -> Sequence[AnswerBlock]:
        """Return which share of the map swings or hunts, and where; with the map, unless it has too many cells."""
        from friso.questions.map.figures import marked_figure
        from friso.questions.map.findings import details, facts, map_document, sentences
        from friso.shown.blocks import AnswerBlock

        again = f"friso simulate --cell {shell_word(str(self.store))} {{}}" if self.store else ""
        again = again or 'friso.simulate(runs.cell("{}"))'

        def draw() -> list[Figure]:
            """Draw the map, with the condition under which it holds."""
            figure = marked_figure(self.result, self.metric, self.edges, again, self.condition)
            return [figure] if self.drawable else []

        says = [
            *sentences(self.result, self.study, self.metric, self.edges),
            *([f"store: {self.store}"] if self.store else []),
        ]
        numbers = partial(map_document, self.result, self.study, self.store, self.metric, self.edges)
        more = partial(details, self.result, self.study, self.metric, self.edges)
        return [
            AnswerBlock(sentences=says, long_details=more, draw=draw, numbers=numbers),
            AnswerBlock(title="The map", columns=["Value"], rows=facts(self.result, self.metric), behind=True),
        ]

    def next_steps(self, files: Sequence[Path]) -> Sequence[str]:
        """Return the command that runs the cell with the largest swing at its end.

        There is none for a map in memory, without a store.
        """
        if self.store is None:
            return []
        swings = np.nan_to_num(self.result["peak_to_peak"].to_numpy(), nan=-np.inf)
        cell = " ".join(map(str, np.unravel_index(swings.argmax(), swings.shape)))
        return [f"friso simulate --cell {shell_word(str(self.store))} {cell}"]

    def page(self) -> Report:
        """Return the page, with the version of friso that made the runs."""
        from friso.questions.map.findings import basis

        return replace(super().page(), computed=basis(self.result), version=self.result.attrs["friso"])

    def files(self) -> Files:
        """Return the figure in all formats and the page, by name; nothing for too many cells."""
        from friso.shown.blocks import image_files

        if not self.drawable:
            return {}
        (figure,) = self.figures()
        return {**image_files(figure, "map"), "map.html": self.page().html()}

    def files_beside(self) -> Mapping[Path, Content]:
        """Return the figure and the page beside the store."""
        views = {} if self.store is None else self.files()
        return {path_beside(self.store, name.removeprefix("map.")): views[name] for name in views if self.store}


@question
def sweep(
    stage: StageLike,
    axes: Mapping[str, AxisValues] | None = None,
    samples: int | Samples | None = None,
    *,
    x: AxisPoints | None = None,
    y: AxisPoints | None = None,
    axis: Iterable[AxisPoints] = (),
    set: Changes = None,
    metric: MetricName | None = None,
    confirm: bool = False,
    rtol: Tolerance | None = None,
    workers: int | None = None,
    scheduler: Address | None = None,
    out: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    yes: bool = False,
    beside: bool = False,
    progress: Progress = silent,
) -> SweepAnswer:
    """Where does it hunt: two (or more) keys swept; a Zarr store, a figure, and a page whose cells name their runs.

    Parameters
    ----------
    stage : Stage, path or dict
        The stage, its file, or its tables; or the folder of a study that is to be resumed.
    axes : dict, optional
        Keys with their values: ``(np.linspace(1, 40, 41), "Hz")``, a range ``"1 Hz..40 Hz:41"`` (behind ":log",
        logarithmic), or a list of texts with units, bare numbers, words or booleans, where the key takes these.
    samples : int or Samples, optional
        Number of Sobol points over the ranges FIRST..LAST, instead of a grid.

        Or `friso.Samples`: several keys that vary at once.
    x : str, optional
        Horizontal axis, controller.crossover="1 Hz..40 Hz:41"; also a list: KEY="4 Hz, 8 Hz". Besides keys: speed (the
        controller so many times as fast) and friction (all of it so many times yours), the axes of a map without any.
    y : str, optional
        Vertical axis.
    axis : list of str, optional
        A further axis; may be repeated.
    metric : str, optional
        Quantity shown in colour, of the stage or of each run; default: sketch, whether the stage hunts by coarse return
        maps.
    confirm : bool
        Search every cell, instead of a sketch, which takes up to five times as long.
    rtol : float, optional
        Relative tolerance, default 1e-6.
    workers : int, optional
        Number of processes to run in; default: the threads of this one.
    scheduler : str, optional
        Address of a Dask scheduler to run on. Anyone who can reach the address can run code there and here; tls://,
        with the certificates of the configuration of Dask, keeps others out.
    out : path, optional
        Folder of the results, a Zarr store, resumed if it exists; of a store: folder of its figure and page.
    overwrite : bool
        Replace the store of another study, and figures of the same name.
    yes : bool
        Confirm a study of more than ten million cells.
    beside : bool
        Whether the caller writes figure and page (``answer.files_beside()``): that they can be is made sure before
        anything is run.

    Returns
    -------
    SweepAnswer
        An xarray.Dataset with a dimension per axis, ``answer.data``: outcome, peaks, peak_to_peak [m], period [s],
        settling_time [s], largest_force [N], status, ...; ``(answer.outcome == "swings").mean()``.

    Raises
    ------
    InputError
        For a stage, an axis, a store or an option that is not usable.

    Examples
    --------
    >>> import friso
    >>> runs = friso.sweep(friso.example("thesis_rig"), {"joint.stroke": "0.2 mm..1 mm:3"})
    >>> runs.sizes["joint.stroke"]
    3
    """
    if confirm and metric not in (None, "sketch", "verdict"):
        raise InputError("confirm", f"--confirm and --metric {metric}", "one of the two: it searches for verdicts", "")
    varied = Varied.of_texts(axes or {}, x, y, axis, samples)
    store = None if out is None else place_of_store(out)
    if scheduler is not None:
        need("cluster", "scheduler")
    with _crew(workers, scheduler) as crew:
        resumed = Path(stage) if isinstance(stage, str | os.PathLike) and Path(stage).is_dir() else None
        if resumed is not None:
            if varied != Varied() or set or rtol or out or confirm:
                raise _another_study(resumed)
            store = place_of_store(resumed)
            study, metric = stored_study(store, metric, None if yes else CONFIRMED_FROM)
        else:
            given = inputs.stage_of(stage, set)
            if metric is None and not confirm and is_moved_evenly(given):
                metric = "stick_slip"
            metric = ("verdict" if confirm else "sketch") if metric in (None, "sketch") else metric
            chosen = inputs.read_stage(given, leaves_out=() if of_runs_alone([metric]) else AS_BUILT)
            if runs_as_built(chosen, [metric]):
                inputs.mention_sampling(chosen)
            study = study_for(chosen, varied, metric, None if yes else CONFIRMED_FROM, crew)
            study = replace(study, rtol=inputs.tolerance_of(1e-6 if rtol is None else rtol))
            study = study if store is None else as_stored(study, store, metric, overwrite)
        speak_of(study.stage.axis_kind)
        if store is None:
            inputs.mention_unstable_loop(study.stage)
            runs = run_in_memory([study], crew, progress)[0]
        else:
            example = f"--out {shell_word(f'{store.stem}-2.zarr')}" if resumed is None else "--out figures"
            refuse_overwriting(study, store, overwrite, example if beside else "")
            inputs.mention_unstable_loop(study.stage)
            runs = _filled(study, store, crew, overwrite, metric, progress)
        held = in_memory(runs) if store is not None and study.cells <= CONFIRMED_FROM else runs
        from friso.questions.map.findings import own_values
        from friso.studies.edges import fine_edges

        shown = coloured_by(study, metric)
        edges = fine_edges(study, held, shown, own_values(held), crew, progress)
    return SweepAnswer(
        held,
        stage=study.stage,
        study=study,
        metric=shown,
        store=store,
        edges=edges,
    )


def _another_study(store: Path) -> InputError:
    """Build the refusal of options that would turn a stored study into another one."""
    problem = "a store together with options that would make it another study"
    resumed = f"friso map {shell_word(str(store))}"
    return InputError(str(store), problem, "the store alone: it contains its study", resumed)


@contextmanager
def _crew(workers: int | None, scheduler: Address | None) -> Iterator[Crew]:
    """Provide the workers that run the cells.

    They are threads of this process, or `workers` processes, or those of a Dask `scheduler`, given by its address.
    Raises InputError for a number of workers that cannot be had.
    """
    if workers is not None and scheduler is not None:
        raise InputError("workers", "--workers and --scheduler", "one of the two", "workers=4")
    most = min(usable_cores(), MOST_PROCESSES)
    if workers is not None and not 1 <= workers <= most:
        expected = f"1 worker or more, up to the {most} cores that may be used"
        raise inputs.wrong("workers", str(workers), expected, "1")
    if scheduler is not None:
        from friso.studies.sweep import connected

        with connected(scheduler) as crew:
            yield crew
    elif workers is not None:
        from friso.studies.sweep import processes

        with processes(workers) as crew:
            yield crew
    else:
        with local_crew() as crew:
            yield crew


def _filled(study: Study, store: Path, crew: Crew, overwrite: bool, metric: str, progress: Progress) -> xr.Dataset:
    """Run the cells that a store lacks, and return the runs.

    If the work ends early, a message says how much is stored and how to resume. A complete store that cannot be written
    is only read. Raises StoreError for a store that must be written and cannot be.
    """
    stored = 0

    def counted(done: int, total: int, what: str, /) -> None:
        """Report progress, and count the cells that are stored."""
        nonlocal stored
        stored = done
        progress(done, total, store.name)

    try:
        with Store.opened(store, study, overwrite, metric) as opened:
            return fill(opened, crew, counted)
    except ReadOnlyStoreError:
        if not holds_all(store, study):
            raise
        return read_store(store)
    except (KeyboardInterrupt, OSError, RuntimeError) as error:
        far, resumed = f"{stored} of {study.cells} cells are stored", f"friso map {shell_word(str(store))}"
        if isinstance(error, OSError):
            actual = f"{cause_of(error)}: {path_of(error)}".removesuffix(": ")
            raise StoreError(
                "", f"{actual}; {far}", "a disk that can be written, to resume", resumed, str(store)
            ) from None
        if store.exists():
            LOGGER.warning(f"{far}; to resume: {resumed}")
        raise
