"""`friso export`: what a stage file says, in the terms of a drive."""

from __future__ import annotations

from typing import Annotated

import typer

from friso.cli.asking import ask
from friso.cli.command import STOPS, Choices, Command
from friso.cli.common import AsJson, StageFile
from friso.cli.output import OutFolder, Overwrite

What = Annotated[str, typer.Argument(metavar="gains", help="The gains of the controller.")]
ValuesOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help='Override a key, or say what no stage file does: travel_per_turn="10 mm".'
    ),
]
To = Annotated[str | None, typer.Option("--to", metavar="FORMAT", help="Also the parameters of a drive; see below.")]


def export(
    what: What,
    stage_file: StageFile,
    values: ValuesOption = None,
    to: To = None,
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """The gains in the units that drives use, a drawing of the loop they belong to, and a drive's parameters.

    travel_per_turn and motor_constant ("0.5 N*m/A") add the units of a motor.

    Example: friso export gains examples/twincat_cascade.toml --set travel_per_turn="10 mm"
    """
    from friso.questions.export.question import export as question

    shown = {"out": out, "overwrite": overwrite, "as_json": as_json}
    ask("export", question, what, stage_file, set=values, to=to, **shown)


def listed_formats() -> list[tuple[str, str]]:
    """The kinds of parameter files, each in one line."""
    from friso.drives.format import FORMATS

    return [(name, FORMATS.one_line(name)) for name in FORMATS]


COMMAND = Command(export, 85, STOPS, Choices("Formats of --to, and of friso init --from", listed_formats))
