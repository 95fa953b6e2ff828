"""`friso init`: a stage file to start from."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Annotated

import typer

from friso.errors import InputError


def init(
    path: Annotated[Path, typer.Argument(metavar="STAGE.toml", help="The file to write.")] = Path("stage.toml"),
) -> None:
    """Write a commented stage file to start from.

    Example: friso init my_stage.toml
    """
    template = files("friso").joinpath("templates/stage.toml").read_text(encoding="utf-8")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(template)
    except OSError as error:
        expected = f"a new file in a folder that can be written ({error.strerror}); nothing was overwritten"
        raise InputError("STAGE.toml", str(path), expected, "friso init new.toml") from None
    print(f"wrote {path}; edit it, then: friso check {path}")
