"""`friso tune`: from "it hunts" to the settings, or the isolator, that stop it."""

from __future__ import annotations

from typing import Annotated, get_args

import typer

from friso.cli.asking import Details, ask
from friso.cli.command import STOPS, Command
from friso.cli.common import AsJson, Overrides, StageFile
from friso.cli.output import OutFolder, Overwrite
from friso.platform.interrupts import answers_interrupts
from friso.remedies import Changeable

WithinOption = Annotated[
    str | None,
    typer.Option("--within", metavar="LENGTH", help="Deviation that counts as in position; 1 um if not given."),
]
Settle = Annotated[
    str | None,
    typer.Option("--settle", metavar="TIME", help="Time after the move in which 95 % of the machines are in position."),
]
ForceLimitOption = Annotated[
    str | None, typer.Option("--force-limit", metavar="FORCE", help="Largest force of the actuator during the moves.")
]
BandwidthLimit = Annotated[
    str | None,
    typer.Option(
        "--bandwidth-limit", metavar="FREQUENCY", help="Highest bandwidth that modes missing from the stage file allow."
    ),
]
MarginOption = Annotated[
    str | None,
    typer.Option("--margin", metavar="NUMBER", help="Least modulus margin of 95 % of the machines; 0.5 if not given."),
]
_PARTS = f"<{'|'.join(get_args(Changeable))}>"
OnlyOption = Annotated[str | None, typer.Option("--only", metavar=_PARTS, help="Change this part alone.")]
KeepOption = Annotated[str | None, typer.Option("--keep", metavar=_PARTS, help="Leave this part unchanged.")]
SeedOption = Annotated[
    int, typer.Option("--seed", metavar="NUMBER", help="Seed of the draws: the same seed gives the same machines.")
]


def tune(
    stage_file: StageFile,
    overrides: Overrides = None,
    within: WithinOption = None,
    settle: Settle = None,
    force_limit: ForceLimitOption = None,
    bandwidth_limit: BandwidthLimit = None,
    margin: MarginOption = None,
    only: OnlyOption = None,
    keep: KeepOption = None,
    seed: SeedOption = 1,
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
    details: Details = False,
) -> None:
    """What stops the hunting: the least change of controller or joint that settles 95 % of machines like this one.

    Example: friso tune examples/thesis_rig.toml --only controller --within "2 um" --out tuned
    """
    from friso.questions.tune.question import tune as question

    answers_interrupts()
    options = {"set": overrides, "within": within, "settle": settle, "force_limit": force_limit}
    options |= {"bandwidth_limit": bandwidth_limit, "margin": margin, "only": only, "keep": keep, "seed": seed}
    shown = {"out": out, "overwrite": overwrite, "as_json": as_json, "details": details}
    ask("tune", question, stage_file, **options, **shown, what="what attracts the stage")


COMMAND = Command(tune, 65, STOPS)
