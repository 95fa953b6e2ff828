"""`friso compare`: isolator or firmware: the same drawn machines with a joint, and with other settings."""

from __future__ import annotations

from typing import Annotated

import typer

from friso.cli.asking import Details, ask
from friso.cli.command import STOPS, Command
from friso.cli.common import AsJson, Overrides, StageFile
from friso.cli.output import OutFolder, Overwrite

MachinesOption = Annotated[
    int, typer.Option("--machines", metavar="N", help="Number of machines drawn around the stage, 20 or more.")
]
SeedOption = Annotated[
    int, typer.Option("--seed", metavar="NUMBER", help="Seed of the draws: the same seed gives the same machines.")
]
WithinOption = Annotated[
    str | None,
    typer.Option("--within", metavar="LENGTH", help="Deviation that counts as in position; 1 um if not given."),
]

Also = Annotated[
    list[str] | None,
    typer.Option(
        "--also",
        metavar="SETTING",
        help="Also a setting of drives against friction (limit, leak, hysteresis, standstill, push, dither), active "
        "disturbance rejection (adrc), or all.",
    ),
]


def compare(
    stage_file: StageFile,
    overrides: Overrides = None,
    machines: MachinesOption = 2000,
    seed: SeedOption = 1,
    within: WithinOption = None,
    also: Also = None,
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
    details: Details = False,
) -> None:
    """Buy a joint or change settings: which of seven options brings machines like this one to rest, and at what cost.

    Example: friso compare examples/thesis_drive.toml --machines 200 --out compare
    """
    from friso.questions.compare.question import compare as question

    options = {"set": overrides, "machines": machines, "seed": seed, "within": within, "also": also or ()}
    shown = {"out": out, "overwrite": overwrite, "as_json": as_json, "details": details}
    ask("compare", question, stage_file, **options, **shown)


COMMAND = Command(compare, 120, STOPS)
