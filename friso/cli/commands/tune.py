"""`friso tune`: from "it hunts" to the settings, or the isolator, that stop it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from friso.cli.command import Command
from friso.cli.common import (
    AsJson,
    Overrides,
    StageFile,
    print_answer,
    print_wrapped,
    read_stage,
)
from friso.cli.output import OutFolder, Overwrite, output_folder, print_document, print_written
from friso.cli.progress import ProgressBar
from friso.errors import InputError
from friso.quantities import Quantity, positive
from friso.stage import Stage, load

if TYPE_CHECKING:
    from friso.cure.goal import Goal
    from friso.cure.method import Advice
    from friso.stage.correlations import Correlations

Within = Annotated[
    str | None,
    typer.Option("--within", metavar="LENGTH", help="Deviation that counts as in position; 1 um if not given."),
]
Settle = Annotated[
    str | None,
    typer.Option("--settle", metavar="TIME", help="Time after the move in which 95 % of the machines are in position."),
]
ForceLimit = Annotated[
    str | None, typer.Option("--force-limit", metavar="FORCE", help="Largest force of the actuator during the moves.")
]
BandwidthLimit = Annotated[
    str | None,
    typer.Option(
        "--bandwidth-limit", metavar="FREQUENCY", help="Bandwidth that modes not in the stage file allow at most."
    ),
]
Part = Literal["controller", "joint"]
Only = Annotated[Part | None, typer.Option("--only", help="What alone may be changed.")]
Keep = Annotated[Part | None, typer.Option("--keep", help="What may not be changed.")]
Seed = Annotated[
    int, typer.Option("--seed", metavar="NUMBER", help="Seed of the draws: the same seed gives the same machines.")
]


def tune(
    stage_file: StageFile,
    overrides: Overrides = None,
    within: Within = None,
    settle: Settle = None,
    force_limit: ForceLimit = None,
    bandwidth_limit: BandwidthLimit = None,
    only: Only = None,
    keep: Keep = None,
    seed: Seed = 1,
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """What stops the hunting: the least change of controller or joint that settles 95 % of machines like this one.

    Example: friso tune examples/thesis_rig.toml --only controller --within "2 um" --out tuned
    """
    stage = read_stage(stage_file, overrides, leaves_out=("rail", "cable", "floor"), uncertain_too=True)
    goal = _goal(stage, within, settle, force_limit, bandwidth_limit, only, keep)
    if not 0 <= seed <= MOST_SEED:
        raise InputError("--seed", str(seed), f"a whole number from 0 to {MOST_SEED}", "--seed 1")
    correlations = _correlations(stage_file, stage)
    target = output_folder("tune", out, overwrite, [stage_file])
    from friso.cure.method import tune as tuned

    files = []
    with ProgressBar("what attracts the stage") as progress:
        tuning = tuned(stage, goal, seed, correlations, progress=progress)
        if target is not None:
            from friso.views.tune.page import tune_files

            files = target.write(tune_files(tuning), progress)
    if as_json:
        from friso.views.tune.document import tune_document

        print_document(tune_document(tuning), files)
    else:
        _print(tuning, files)
    if tuning.needed and not tuning.working:
        raise typer.Exit(2)


MOST_SEED = 2**31 - 1


def _goal(
    stage: Stage,
    within: str | None,
    settle: str | None,
    force_limit: str | None,
    bandwidth_limit: str | None,
    only: Part | None,
    keep: Part | None,
) -> Goal:
    """The goal of the options. Raises InputError."""
    from friso.cure.goal import Goal

    if only is not None and only == keep:
        raise InputError("--keep", str(keep), f"something else than --only {only}, or nothing is left to change", "")

    def read(option: str, text: str | None, unit: str, example: str) -> float | None:
        quantity = Quantity(unit, positive, example).on(stage.axis_kind)
        try:
            return None if text is None else float(quantity.read(text))
        except InputError as error:
            raise error.under(option) from None

    return Goal(
        within=read("--within", within, "m", "1 um") or Goal.within,
        settle=read("--settle", settle, "s", "0.3 s"),
        force_limit=read("--force-limit", force_limit, "N", "50 N"),
        bandwidth_limit=read("--bandwidth-limit", bandwidth_limit, "Hz", "25 Hz"),
        controller=only != "joint" and keep != "controller",
        joint=only != "controller" and keep != "joint",
    )


def _correlations(path: Path, stage: Stage) -> Correlations:
    """Those beside the stage file. Raises InputError."""
    from friso.stage.correlations import Correlations, beside, read_correlations

    correlations = read_correlations(beside(path), load(path)) if beside(path).exists() else Correlations()
    return correlations.among(stage.uncertain())


def _print(tuning: Advice, files: Sequence[Path]) -> None:
    from friso.views.tune.sensitivity_words import sensitivity_sentences
    from friso.views.tune.words import COLUMNS, answer, assumptions, failing, rows, window_lines

    print_answer([*answer(tuning), *failing(tuning)], tuning.stage.name, COLUMNS, rows(tuning))
    for sentence in (*window_lines(tuning), *sensitivity_sentences(tuning), *assumptions(tuning)):
        print_wrapped(sentence)
    print_written(files)
    for file in files:
        if file.name.startswith("tuned-isolator") and file.suffix == ".toml":
            print(f"leaf springs for it: friso design {file}")


COMMAND = Command(tune, 25)
