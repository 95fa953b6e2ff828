"""`friso simulate`: a time response, of a stage file or of a cell of a study."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from friso.cli.asking import Details, ask
from friso.cli.command import HUNTS, Command
from friso.cli.common import RTOL_HELP, AsJson, Overrides
from friso.cli.output import DefaultFolder, Overwrite


def simulate(
    arguments: Annotated[
        list[str], typer.Argument(metavar="STAGE.toml", help="The stage file; with --cell, the cell's numbers: 3 4.")
    ],
    overrides: Overrides = None,
    cell: Annotated[Path | None, typer.Option(metavar="STORE", help="Run a single cell of a study again.")] = None,
    rtol: Annotated[str | None, typer.Option("--rtol", metavar="NUMBER", help=RTOL_HELP)] = None,
    sample_time: Annotated[str | None, typer.Option(metavar="TIME", help='Sampling interval, such as "1 ms".')] = None,
    out: DefaultFolder = Path("response"),
    overwrite: Overwrite = False,
    as_json: AsJson = False,
    details: Details = False,
) -> None:
    """What does one run do: time response of the stage to its motion, as NetCDF, CSV and a plot.

    Example: friso simulate examples/lugre_stick_slip.toml --sample-time "1 ms" --out response

    A cell of a map: friso simulate --cell rig_map.zarr 3 4
    """
    from friso.questions.simulate.question import simulate as question

    about = arguments if cell else [Path(argument) for argument in arguments]
    options = {"set": overrides, "cell": cell, "rtol": rtol, "sample_time": sample_time}
    shown = {"out": out, "overwrite": overwrite, "as_json": as_json, "details": details}
    ask("simulate", question, about, **options, **shown)


COMMAND = Command(simulate, 30, HUNTS)
