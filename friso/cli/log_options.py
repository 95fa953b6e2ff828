"""What the commands that read logs share: the files, and what is said of their channels."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Logs = Annotated[list[Path], typer.Argument(metavar="LOG...", help="Log files; friso logs --help lists their formats.")]
Maps = Annotated[list[str] | None, typer.Option("--map", metavar="ROLE=CHANNEL", help='position="Axis1.ActPos"')]
Units = Annotated[list[str] | None, typer.Option("--unit", metavar="CHANNEL=UNIT", help='Axis1.ActPos="mm"')]
Scales = Annotated[list[str] | None, typer.Option("--scale", metavar="ROLE=SCALE", help='force="35.15 N/V"')]
AxisOption = Annotated[
    str | None, typer.Option("--axis", metavar="KIND", help="rotary: angles, torques and moments of inertia.")
]
SampleTime = Annotated[
    str | None, typer.Option("--dt", metavar="TIME", help="Sample time, if the file does not contain it.")
]
