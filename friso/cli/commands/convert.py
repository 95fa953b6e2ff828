"""`friso convert`: the same stage under another friction law."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from friso.cli.asking import ask
from friso.cli.command import WHY, Choices, Command
from friso.cli.common import AsJson, Overrides, StageFile
from friso.cli.output import OutFolder, Overwrite

Law = Annotated[str, typer.Option("--friction", metavar="LAW", help="The friction law to convert to.")]
ElementsOption = Annotated[
    int, typer.Option("--elements", metavar="N", help="Elements of a law that has several, side by side, 1 to 12.")
]
VirginOption = Annotated[
    Path | None,
    typer.Option("--virgin", metavar="FILE", help="Measured force over displacement from rest, in place of the law's."),
]


def convert(
    stage_file: StageFile,
    law: Law,
    elements: ElementsOption = 6,
    virgin: VirginOption = None,
    overrides: Overrides = None,
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Convert friction to another law that fits the same measurements, and say what could not be kept.

    Example: friso convert examples/thesis_rig.toml --friction gms --elements 6 --out gms
    """
    from friso.questions.convert.question import convert as question

    options = {"friction": law, "elements": elements, "virgin": virgin, "set": overrides}
    shown = {"out": out, "overwrite": overwrite, "as_json": as_json}
    ask("convert", question, stage_file, **options, **shown)


def _laws() -> list[tuple[str, str]]:
    from friso.stage.tables import friction_law
    from friso.studies.laws.conversion import convertible

    return [(name, (friction_law(name).__doc__ or "").split(":")[0].split("\n")[0]) for name in convertible()]


COMMAND = Command(convert, 55, WHY, Choices("Laws", _laws))
