"""`friso check`: the verdict."""

from __future__ import annotations

from typing import Annotated

import typer

from friso.cli.asking import Details, ask
from friso.cli.command import HUNTS, Command
from friso.cli.common import AsJson, Overrides, StageFile, Tolerance
from friso.cli.output import OutFolder, Overwrite

DrawsOption = Annotated[
    int | None,
    typer.Option(
        "--draws",
        metavar="N",
        help='Draw N stages from the uncertain keys ("20 N +/- 1 N", "1 N .. 3 N"), and report how many hunt; '
        "default: some tens.",
    ),
]
SeedOption = Annotated[
    int, typer.Option("--seed", metavar="K", help="Seed of the draws: the same seed gives the same stages.")
]

AcrossLaws = Annotated[
    bool,
    typer.Option("--laws", help="Also the verdict under every friction law that fits the same measurements."),
]


def check(
    stage_file: StageFile,
    overrides: Overrides = None,
    rtol: Tolerance = "1e-9",
    draws: DrawsOption = None,
    seed: SeedOption = 0,
    laws: AcrossLaws = False,
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
    details: Details = False,
) -> None:
    """Does the stage hunt: as given, and with its joint locked and free.

    Example: friso check examples/thesis_rig.toml --set controller.crossover="12 Hz" --out report
    """
    from friso.questions.check.question import check as question

    options = {"set": overrides, "rtol": rtol, "draws": draws, "seed": seed, "laws": laws}
    shown = {"out": out, "overwrite": overwrite, "as_json": as_json, "details": details}
    ask("check", question, stage_file, **options, **shown, what="what attracts the stage")


COMMAND = Command(check, 20, HUNTS)
