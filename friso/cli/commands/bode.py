"""`friso bode`: limit cases, margins, and how fast the controller may be."""

from __future__ import annotations

from typing import Annotated

import typer

from friso.cli.asking import ask
from friso.cli.command import WHY, Command
from friso.cli.common import AsJson, Overrides, StageFile
from friso.cli.output import OutFolder, Overwrite


def bode(
    stage_file: StageFile,
    overrides: Overrides = None,
    frequencies: Annotated[
        str | None,
        typer.Option(metavar='"FIRST..LAST"', help="Frequency range of the figures; default: all that is relevant."),
    ] = None,
    series: Annotated[
        bool, typer.Option("--series", help="Also show the thesis's formula for a touched limiter.")
    ] = False,
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Is the controller stable and robust, stuck or sliding, and how fast may it be: margins and Bode plots.

    Example: friso bode examples/thesis_rig.toml --frequencies "0.1 Hz..1 kHz" --out bode
    """
    from friso.questions.bode.question import bode as question

    options = {"set": overrides, "frequencies": frequencies, "series": series}
    shown = {"out": out, "overwrite": overwrite, "as_json": as_json}
    ask("bode", question, stage_file, **options, **shown, what="analysing all states")


COMMAND = Command(bode, 50, WHY)
