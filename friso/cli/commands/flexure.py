"""`friso flexure`: how good the leaf springs of a joint are: stiffness, modes, stress."""

from __future__ import annotations

from typing import Annotated

import typer

from friso.cli.asking import ask
from friso.cli.command import STOPS, Command
from friso.cli.common import AsJson, Overrides, StageFile
from friso.cli.output import OutFolder, Overwrite


def flexure(
    stage_file: StageFile,
    stroke: Annotated[
        str | None, typer.Option(metavar='"LENGTH"', help="Deflection to one side; default: joint.stroke.")
    ] = None,
    overrides: Overrides = None,
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """How good are the leaf springs of a joint: stiffness, modes, stress, fatigue and buckling, with a drawing.

    Example: friso flexure rig.toml --stroke "1 mm" --out flexure
    """
    from friso.questions.flexure.question import flexure as question

    shown = {"out": out, "overwrite": overwrite, "as_json": as_json}
    ask("flexure", question, stage_file, stroke=stroke, set=overrides, **shown, what="bending the leaves")


COMMAND = Command(flexure, 70, STOPS)
