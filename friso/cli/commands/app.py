"""`friso app`: check a stage live in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from friso.cli.command import Command
from friso.interface.question import HUNTS

BeginArgument = Annotated[Path | None, typer.Argument(metavar="STAGE.toml", help="The stage file to start with.")]
Port = Annotated[
    int | None,
    typer.Option(
        "--port", metavar="N", min=0, max=65535, help="Port to listen on; default: 8741, or the next free one."
    ),
]
Browser = Annotated[bool, typer.Option("--browser/--no-browser", help="Whether to open the browser.")]


def app(
    stage_file: BeginArgument = None,
    port: Port = None,
    browser: Browser = True,
) -> None:
    """Everything live in the browser, served to this machine alone: drag a value and see whether it hunts.

    Example: friso app examples/thesis_rig.toml
    """
    from friso.app.serve import serve

    serve(stage_file, port, browser)


COMMAND = Command(app, 22, HUNTS)
