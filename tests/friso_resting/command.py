"""`friso resting`: how far from its target friction may hold a stage."""

from __future__ import annotations

from friso.cli.asking import ask
from friso.cli.command import WHY, Command
from friso.cli.common import AsJson, Overrides, StageFile
from friso.cli.output import OutFolder, Overwrite


def resting(
    stage_file: StageFile,
    overrides: Overrides = None,
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """How far from its target may friction hold the stage.

    Example: friso resting rig.toml --out resting
    """
    from friso_resting.answer import resting as question

    ask("resting", question, stage_file, set=overrides, out=out, overwrite=overwrite, as_json=as_json)


COMMAND = Command(resting, 125, WHY)
