"""`friso init`: a stage file to start from."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Annotated

import typer

from friso.cli.command import Command
from friso.cli.output import Overwrite, refuse_device, write
from friso.errors import InputError
from friso.stage import load

STAGE = Path("stage.toml")
"""The file that is written where none is named."""


def init(
    path: Annotated[Path, typer.Argument(metavar="STAGE.toml", help="The file to write.")] = STAGE,
    spec_of: Annotated[
        Path | None,
        typer.Option("--spec", metavar="STAGE.toml", help="Write a specification for friso design of this stage."),
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Write a commented stage file to start from, or with --spec a specification.

    Example: friso init my_stage.toml
    """
    if spec_of is None:
        template = files("friso").joinpath("templates/stage.toml").read_text(encoding="utf-8")
    else:
        from friso.design_method.outline import outline

        template = outline(load(spec_of))
        path = Path("spec.toml") if path == STAGE else path
    refuse_device("STAGE.toml", path)
    if path.exists() and not overwrite:
        expected = "a new file, or --overwrite; nothing was overwritten"
        raise InputError("STAGE.toml", f"{path}, which already exists", expected, "friso init new.toml")
    try:
        path.parent.stat()  # a folder that is missing is a mistake, not one to make
        write({path: template})
    except OSError as error:
        expected = f"a new file in a folder that can be written ({error.strerror}); nothing was overwritten"
        raise InputError("STAGE.toml", str(path), expected, "friso init new.toml") from None
    then = f"friso check {path}" if spec_of is None else f"friso design {spec_of} {path}"
    print(f"wrote {path}; edit it, then: {then}")


COMMAND = Command(init, 10)
