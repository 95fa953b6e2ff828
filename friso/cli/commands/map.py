"""`friso map`: parameters swept, results in a store, a figure and a page."""

from __future__ import annotations

from pathlib import Path

import typer

from friso.cli.asking import named_as_options, show, tried
from friso.cli.command import WHERE, Command
from friso.cli.common import AsJson, Overrides
from friso.cli.map_options import (
    Axes,
    CheckStore,
    Confirm,
    ConfirmedOption,
    Exports,
    Latin,
    Links,
    Logarithmic,
    MapTolerance,
    MetricOption,
    Refine,
    ReplaceStore,
    SamplesOption,
    Scheduler,
    SourceArgument,
    StoreFolder,
    Verify,
    Workers,
    X,
    Y,
)
from friso.cli.output import print_document
from friso.cli.progress import ProgressBar
from friso.errors import InputError
from friso.platform.system import shell_word


def map_cells(
    source: SourceArgument,
    x: X = None,
    y: Y = None,
    axis: Axes = None,
    link: Links = None,
    samples: SamplesOption = None,
    latin: Latin = False,
    log: Logarithmic = False,
    overrides: Overrides = None,
    metric: MetricOption = None,
    confirm: Confirm = False,
    rtol: MapTolerance = None,
    verify: Verify = 0.05,
    refine: Refine = False,
    workers: Workers = None,
    scheduler: Scheduler = None,
    export: Exports = None,
    out: StoreFolder = None,
    overwrite: ReplaceStore = False,
    check: CheckStore = False,
    yes: ConfirmedOption = False,
    as_json: AsJson = False,
) -> None:
    """Where does it hunt: two (or more) keys swept; a Zarr store, a figure, and a page whose cells can be clicked.

    Example: friso map rig.toml --x controller.crossover="1 Hz..16 Hz:41" --y joint.stroke="0 m..1 mm:41"

    To resume an interrupted study: friso map thesis_rig_map.zarr
    """
    if check:
        return _check(source, as_json)
    from friso.axis import speak_of
    from friso.interface.output_folder import output_folder
    from friso.questions.map.question import sweep
    from friso.questions.map.study import write_beside
    from friso.shown.drawing.images import drawing_beside

    store, elsewhere = out or Path(f"{source.stem}_map.zarr"), None
    if source.is_dir():
        store, elsewhere = None, output_folder("map", out, overwrite)
    options = {"x": x, "y": y, "axis": axis or (), "link": link, "samples": samples, "latin": latin, "log": log}
    options |= {
        "set": overrides,
        "metric": metric,
        "confirm": confirm,
        "rtol": rtol,
        "verify": verify,
        "refine": refine,
    }
    options |= {
        "workers": workers,
        "scheduler": scheduler,
        "export": export or (),
        "overwrite": overwrite,
        "yes": yes,
        "out": store,
    }
    with ProgressBar() as progress, drawing_beside(), named_as_options(options):
        answer = sweep(source, **options, beside=elsewhere is None, progress=progress)
        speak_of(answer.axis_kind)
        place = answer.store or source

        def written() -> list[Path]:
            if elsewhere is not None:
                return [*elsewhere.write(answer.files(progress), progress), *answer.exports]
            return write_beside(answer.files_beside(progress), place, overwrite, progress)

        files, unwritten = tried(written, f"the runs are in {place}, but no figure was written")
    show(answer, files, as_json, unwritten=unwritten)


def _check(store: Path, as_json: bool) -> None:
    """Tell whether a store is whole; status 1 where it is not. Raises StoreError where it cannot be read at all."""
    from friso.questions.map.question import whole

    if store.is_file():
        raise InputError(
            "--check", f"{store}, a file", "the store of a study", f"friso map {store.stem}_map.zarr --check"
        )
    state = whole(store)
    damaged = [*state["damaged"], *state["damaged_files"]]
    if as_json:
        print_document(state)
    else:
        damage = f"damaged: {', '.join(damaged)} (friso map {shell_word(str(store))} recomputes the damaged blocks)"
        done = f"blocks done: {state['done']} of {state['blocks']}"
        unread = f"; may not be read: {', '.join(state['unreadable'])}" if state["unreadable"] else ""
        print(f"{store}: {done}; {damage if damaged else 'nothing is damaged'}{unread}")
    if damaged or state["unreadable"]:
        raise typer.Exit(1)


COMMAND = Command(map_cells, 40, WHERE)
