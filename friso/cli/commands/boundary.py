"""`friso boundary`: where hunting ends, over one key or in the plane of two."""

from __future__ import annotations

from typing import Annotated

import typer

from friso.cli.asking import Details, ask
from friso.cli.command import WHERE, Command
from friso.cli.common import AsJson, Overrides, StageFile, Tolerance
from friso.cli.output import OutFolder, Overwrite

RANGE = 'KEY="FIRST..LAST"'


def boundary(
    stage_file: StageFile,
    x: Annotated[
        str | None, typer.Option(metavar=RANGE, help="The key over which cycles are followed.  [required]")
    ] = None,
    y: Annotated[str | None, typer.Option(metavar=RANGE, help="A second key: curves in the plane of both.")] = None,
    link: Annotated[
        list[str] | None, typer.Option(metavar="KEY=EXPRESSION", help='A key tied to others: masses.cart="0.7 * mass".')
    ] = None,
    log: Annotated[
        bool, typer.Option("--log", help="Make both ranges logarithmic; for a single one, append :log.")
    ] = False,
    overrides: Overrides = None,
    rtol: Tolerance = "1e-9",
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
    details: Details = False,
) -> None:
    """Where hunting ends: the values at which the hunting cycle stops attracting, over one key or two.

    Example: friso boundary rig.toml --set joint.locked=true --x controller.crossover="1 Hz..40 Hz" --out edge
    """
    from friso.questions.boundary.question import boundary as question

    options = {"x": x, "y": y, "link": link, "log": log, "set": overrides, "rtol": rtol}
    shown = {"out": out, "overwrite": overwrite, "as_json": as_json, "details": details}
    ask("boundary", question, stage_file, **options, **shown, what="following cycles")


COMMAND = Command(boundary, 60, WHERE)
