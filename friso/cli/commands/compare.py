"""`friso compare`: isolator or firmware: the same drawn machines with a joint, and with other settings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from friso.cli.command import Command
from friso.cli.common import (
    AsJson,
    Overrides,
    StageFile,
    print_answer,
    print_table,
    print_wrapped,
    read_stage,
)
from friso.cli.output import OutFolder, Overwrite, output_folder, print_document, print_written
from friso.cli.progress import ProgressBar
from friso.errors import InputError
from friso.quantities import Quantity, positive
from friso.stage import Stage, load

if TYPE_CHECKING:
    from friso.stage.correlations import Correlations
    from friso.studies.compare.study import Comparison

Machines = Annotated[
    int, typer.Option("--machines", metavar="N", help="Number of machines drawn around the stage, 20 or more.")
]
Seed = Annotated[
    int, typer.Option("--seed", metavar="NUMBER", help="Seed of the draws: the same seed gives the same machines.")
]
Within = Annotated[
    str | None,
    typer.Option("--within", metavar="LENGTH", help="Deviation that counts as in position; 1 um if not given."),
]
Also = Annotated[
    list[str] | None,
    typer.Option(
        "--also",
        metavar="SETTING",
        help="Also a setting of drives against friction: limit, leak, hysteresis, standstill, push, dither, or all.",
    ),
]


def compare(
    stage_file: StageFile,
    overrides: Overrides = None,
    machines: Machines = 2000,
    seed: Seed = 1,
    within: Within = None,
    also: Also = None,
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Buy a joint or change settings: which of seven options brings machines like this one to rest, and at what cost.

    Example: friso compare examples/thesis_drive.toml --machines 200 --out compare
    """
    from friso.studies.compare.study import compare as compared

    stage = read_stage(stage_file, overrides, leaves_out=(), uncertain_too=True)
    tolerance, correlations = _tolerance(within, stage), _correlations(stage_file, stage)
    target = output_folder("compare", out, overwrite, [stage_file])
    files = []
    with ProgressBar() as progress:
        comparison = compared(stage, machines, seed, tolerance, correlations, progress, tuple(also or ()))
        if target is not None:
            from friso.views.compare.page import compare_files

            files = target.write(compare_files(comparison), progress)
    if as_json:
        from friso.views.compare.document import compare_document

        print_document(compare_document(comparison), files)
    else:
        _print(comparison, files)
    if any(result.failed for result in comparison.results):
        raise typer.Exit(1)


def _tolerance(text: str | None, stage: Stage) -> float:
    length = Quantity("m", positive, "1 um").on(stage.axis_kind)
    try:
        return float(length.read(text or length.example))
    except InputError as error:
        raise error.under("--within") from None


def _correlations(path: Path, stage: Stage) -> Correlations:
    """Those beside the stage file. Raises InputError."""
    from friso.stage.correlations import Correlations, beside, read_correlations

    correlations = read_correlations(beside(path), load(path)) if beside(path).exists() else Correlations()
    return correlations.among(stage.uncertain())


def _print(comparison: Comparison, files: Sequence[Path]) -> None:
    from friso.views.compare.words import (
        COLUMNS,
        PAIRED,
        answer,
        details,
        options_rows,
        paired_rows,
        population,
        table_rows,
    )

    print_answer(answer(comparison), comparison.stage.name, COLUMNS, table_rows(comparison))
    print_table("Compared with a, machine by machine", PAIRED, paired_rows(comparison))
    for label, text in options_rows(comparison):
        print_wrapped(f"{label}: {text}")
    notes = (f"note: {note}" for note in comparison.notes)
    for sentence in (*details(comparison), *population(comparison), *notes):
        print_wrapped(sentence)
    print_written(files)


COMMAND = Command(compare, 120)
