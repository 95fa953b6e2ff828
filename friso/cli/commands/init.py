"""`friso init`: a stage file to start from."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Annotated

import typer

from friso.cli.command import Command
from friso.cli.output import Overwrite, refuse_device, write
from friso.errors import InputError


def init(
    path: Annotated[Path, typer.Argument(metavar="STAGE.toml", help="The file to write.")] = Path("stage.toml"),
    overwrite: Overwrite = False,
) -> None:
    """Write a commented stage file to start from.

    Example: friso init my_stage.toml
    """
    template = files("friso").joinpath("templates/stage.toml").read_text(encoding="utf-8")
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
    print(f"wrote {path}; edit it, then: friso check {path}")


COMMAND = Command(init, 10)
