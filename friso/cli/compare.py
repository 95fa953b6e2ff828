"""`friso compare`: isolator or firmware: the same drawn machines settled by a joint, and by settings."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from friso.cli.common import (
    AsJson,
    OutFolder,
    Overrides,
    StageFile,
    check_place,
    made_folder,
    print_table,
    print_wrapped,
    read_stage,
)
from friso.cli.progress import step_bar
from friso.errors import InputError
from friso.quantities import Quantity, positive
from friso.stage import Stage, load

if TYPE_CHECKING:
    from friso.stage.correlations import Correlations
    from friso.studies.compare.study import Comparison

PAGE = "compare.html"

Machines = Annotated[
    int, typer.Option("--machines", metavar="N", help="Number of machines drawn around the stage, 20 or more.")
]
Seed = Annotated[
    int, typer.Option("--seed", metavar="NUMBER", help="Seed of the draws: the same seed gives the same machines.")
]
Within = Annotated[str, typer.Option("--within", metavar="LENGTH", help="Deviation that counts as in position.")]


def compare(
    stage_file: StageFile,
    overrides: Overrides = None,
    machines: Machines = 2000,
    seed: Seed = 1,
    within: Within = "1 um",
    out: OutFolder = None,
    as_json: AsJson = False,
) -> None:
    """Buy a joint or change settings: seven ways to settle the same machines, drawn around a stage.

    Takes about a quarter of an hour for 2000 machines and a run of 20 s on two cores.

    Example: friso compare examples/thesis_drive.toml --machines 200 --out compare
    """
    from friso.studies.compare.study import compare as compared
    from friso.studies.rig.outcome import silent

    stage = read_stage(stage_file, overrides, leaves_out=(), drawn=True)
    tolerance, known = _tolerance(within), _correlations(stage_file, stage)
    if out is not None:
        check_place(out, [PAGE], PAGE, [stage_file])
    with step_bar() as bar:
        found = compared(stage, machines, seed, tolerance, known, bar or silent)
    files = [] if out is None else _written(found, out)
    if as_json:
        from friso.views.compare.document import document

        print(json.dumps(document(found), allow_nan=False))
    else:
        _print(found, files)
    if any(result.failed for result in found.results):
        raise typer.Exit(1)


def _tolerance(text: str) -> float:
    try:
        return float(Quantity("m", positive, "1 um").read(text))
    except InputError as error:
        raise error.under("--within") from None


def _correlations(path: Path, stage: Stage) -> Correlations:
    """Those beside the stage file. Raises InputError."""
    from friso.stage.correlations import Correlations, beside, read_correlations

    known = read_correlations(beside(path), load(path)) if beside(path).exists() else Correlations()
    return known.among(stage.uncertain())


def _print(found: Comparison, files: Sequence[Path]) -> None:
    from friso.views.compare.words import (
        COLUMNS,
        PAIRED,
        options_rows,
        paired_rows,
        population,
        sentences,
        table_rows,
    )

    for label, text in options_rows(found):
        print_wrapped(f"{label}: {text}")
    print_table(found.stage.name, COLUMNS, table_rows(found), [])
    print_table("Compared with a, machine by machine", PAIRED, paired_rows(found), [])
    notes = (f"note: {note}" for note in found.notes)
    for sentence in (*population(found), *notes, *sentences(found), *(f"wrote {file}" for file in files)):
        print_wrapped(sentence)


def _written(found: Comparison, folder: Path) -> list[Path]:
    """Figures and page, drawn before any of them is written."""
    from friso.views.compare.document import page
    from friso.views.compare.figures import figures
    from friso.views.drawing.matplotlib_renderer import FORMATS, image

    drawn = figures(found)
    contents = {f"{figure.name}.{form}": image(figure, form) for figure in drawn for form in FORMATS}
    contents[PAGE] = page(found, drawn).encode()
    return _put(contents, made_folder(folder))


def _put(contents: Mapping[str, bytes], folder: Path) -> list[Path]:
    """Write files, each whole or not at all."""
    written = []
    for name, content in contents.items():
        draft = folder / f".{name}.{os.getpid()}"
        try:
            draft.write_bytes(content)
            written.append(draft.replace(folder / name))
        finally:
            draft.unlink(missing_ok=True)
    return written
