"""`friso map`: parameters swept, results in a store, a figure and a page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from friso.cli.command import Command
from friso.cli.common import AsJson, Overrides, in_units_of, read_stage, read_tolerance, say
from friso.cli.map_options import (
    Axes,
    CheckStore,
    Confirmed,
    Exports,
    Latin,
    Links,
    Logarithmic,
    MapTolerance,
    Metric,
    Refine,
    ReplaceStore,
    Samples,
    Scheduler,
    Source,
    StoreFolder,
    Verify,
    Workers,
    X,
    Y,
)
from friso.cli.output import print_document, print_written, write
from friso.cli.progress import ProgressBar
from friso.errors import InputError
from friso.system import usable_cores

if TYPE_CHECKING:
    import xarray as xr

    from friso.cli.map_study import Varied
    from friso.stage import Stage
    from friso.studies.execute import Crew
    from friso.studies.study import Study
    from friso.views.files import Content

LARGE = 10_000_000
"""Cells from which on a study has to be confirmed: minutes of computation and a gigabyte."""


def map_cells(
    source: Source,
    x: X = None,
    y: Y = None,
    axis: Axes = None,
    link: Links = None,
    samples: Samples = None,
    latin: Latin = False,
    log: Logarithmic = False,
    overrides: Overrides = None,
    metric: Metric = None,
    rtol: MapTolerance = None,
    verify: Verify = 0.05,
    refine: Refine = False,
    workers: Workers = None,
    scheduler: Scheduler = None,
    export: Exports = None,
    out: StoreFolder = None,
    overwrite: ReplaceStore = False,
    check: CheckStore = False,
    yes: Confirmed = False,
    as_json: AsJson = False,
) -> None:
    """Sweep two (or more) keys: results in a Zarr store, a figure, and a page whose cells can be clicked.

    Example: friso map rig.toml --x controller.crossover="1 Hz..16 Hz:41" --y joint.stroke="0 m..1 mm:41"
    A study that was interrupted goes on: friso map thesis_rig_map.zarr
    """
    from friso.cli.map_study import Varied, as_stored, coloured_by, own_views, refuse_overwriting, stored_study
    from friso.studies.store import in_memory
    from friso.studies.verify import checked_share

    exports, share = _checked_exports(export), checked_share(verify)
    varied = Varied(x, y, tuple(axis or ()), tuple(link or ()), samples, latin, log)
    if check:
        return _check(source, as_json)
    with _crew(workers, scheduler) as crew:
        if source.is_dir():
            if varied != Varied() or overrides or rtol or refine or out:
                raise _another_study(source)
            store, (study, metric) = source, stored_study(source, metric)
        else:
            store, metric = out or Path(f"{source.stem}_map.zarr"), metric or "outcome"
            study = _new_study(read_stage(source, overrides), varied, metric, refine, yes, rtol or "1e-6", crew)
            study = as_stored(study, store, metric, overwrite)
        in_units_of(study.stage)
        refuse_overwriting(store, exports, overwrite)
        runs = _run(study, store, crew, share, overwrite, {"metric": metric, "views": own_views(store)})
    runs, colouring = in_memory(runs) if study.cells <= LARGE else runs, coloured_by(study, metric)
    files = _write(runs, study, store, exports, colouring)
    _report(runs, study, store, colouring, files, as_json)


def _another_study(store: Path) -> InputError:
    problem = "a store together with options that would make it another study"
    return InputError(str(store), problem, "the store alone: it contains its study", f"friso map {store}")


def _new_study(
    stage: Stage, varied: Varied, metric: str, refine: bool, large_too: bool, rtol: str, crew: Crew
) -> Study:
    """The study asked for, at its tolerance. Raises InputError."""
    from friso.cli.map_study import study_for

    study = study_for(stage, varied, metric, refine, None if large_too else LARGE, crew)
    return replace(study, rtol=_chosen_rtol(rtol, study, crew))


def _write(runs: xr.Dataset, study: Study, store: Path, exports: list[Path], metric: str) -> list[Path]:
    """Write figure and page, unless there are too many cells for them, and the exports."""
    from friso.cli.map_study import export_files, view_files

    views: dict[Path, Content] = {}
    if study.cells <= LARGE:
        views = view_files(runs, store, metric)
    else:
        say(f"no figure and no page of {study.cells:.3g} cells")
    return write({**views, **export_files(runs, exports)})


def _chosen_rtol(text: str, study: Study, crew: Crew) -> float:
    """The tolerance asked for; "auto" is chosen on a sample of the cells, and said."""
    if text != "auto":
        return read_tolerance(text)
    from friso.studies.verify import WANTED, loosest_rtol

    rtol, shares, cells = loosest_rtol(study, crew)
    surviving = f"of {cells} cells, " + ", ".join(f"{share:.1%} at {rtol_:g}" for rtol_, share in shares.items())
    if shares.get(rtol, 0.0) >= WANTED:
        say(f"rtol {rtol:g} is the loosest at which {WANTED:.0%} of the outcomes survive ({surviving})")
    else:
        say(f"at no tolerance do {WANTED:.0%} of the outcomes survive ({surviving}); rtol {rtol:g} is used")
    return rtol


@contextmanager
def _crew(workers: int | None, scheduler: str | None) -> Iterator[Crew]:
    if workers is not None and scheduler is not None:
        raise InputError("--workers", "--workers and --scheduler", "one of the two", "--workers 4")
    most = usable_cores()
    if workers is not None and not 1 <= workers <= most:
        expected = f"1 worker or more, up to the {most} cores that may be used"
        raise InputError("--workers", str(workers), expected, "--workers 1")
    if scheduler is not None:
        from friso.studies.distribute import connected

        with connected(scheduler) as crew:
            yield crew
    elif workers is not None:
        from friso.studies.processes import processes

        with processes(workers) as crew:
            yield crew
    else:
        from friso.studies.execute import local_crew

        with local_crew() as crew:
            yield crew


def _check(store: Path, as_json: bool) -> None:
    """Tell whether a store is whole; status 1 where it is not. Raises StoreError where it cannot be read at all."""
    from friso.studies.store import check_store

    state = check_store(store)
    damaged = [*state.damaged, *state.files]
    if as_json:
        counts = {"blocks": state.blocks, "done": state.done}
        print_document({"store": str(store), **counts, "damaged": state.damaged, "damaged_files": state.files})
    else:
        damage = f"damaged: {', '.join(damaged)} (friso map {store} recomputes the damaged blocks)"
        print(f"{store}: blocks done: {state.done} of {state.blocks}; {damage if damaged else 'nothing is damaged'}")
    if damaged:
        raise typer.Exit(1)


def _run(study: Study, store: Path, crew: Crew, share: float, overwrite: bool, notes: Mapping[str, Any]) -> xr.Dataset:
    """Run what the store lacks, and note there what is drawn of it. Whatever ends it early, the message says where the
    rest is."""
    from friso.studies.store import Store
    from friso.studies.sweep import fill

    stored = 0
    with ProgressBar(store.name) as bar:

        def progress(done: int, total: int, label: str) -> None:
            nonlocal stored
            stored = done
            bar(done, total, store.name)

        try:
            with Store.opened(store, study, overwrite) as opened:
                opened.note(metric=opened.notes.get("metric", notes["metric"]))
                runs = fill(opened, crew, share, progress)
                opened.note(views=notes["views"])
                return runs
        except (KeyboardInterrupt, OSError, RuntimeError):
            if store.exists():
                say(f"{stored} of {study.cells} cells are stored; to resume: friso map {store}")
            raise


def _checked_exports(export: list[Path] | None) -> list[Path]:
    for path in export or []:
        if path.suffix not in (".nc", ".csv"):
            raise InputError("--export", str(path), "a file that ends in .nc or .csv", "--export map.nc")
        if not path.parent.is_dir():
            raise InputError("--export", str(path), "a file in an existing folder", "--export map.nc")
    return list(export or [])


def _report(runs: xr.Dataset, study: Study, store: Path, metric: str, files: list[Path], as_json: bool) -> None:
    if as_json:
        from friso.views.map.document import map_document

        print_document(map_document(runs, study, store, metric), files)
    else:
        from friso.views.map.findings import sentences

        print("\n".join([*sentences(runs, study, metric), f"store: {store}"]))
        print_written(files)


COMMAND = Command(map_cells, 40)
