"""The options of `friso map`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from friso.studies.metric import METRICS

AXIS = 'KEY="FIRST..LAST:POINTS"'

SourceArgument = Annotated[Path, typer.Argument(metavar="STAGE.toml|STORE", help="A stage file, or a study to resume.")]
X = Annotated[
    str | None,
    typer.Option(
        "--x",
        metavar=AXIS,
        help='Horizontal axis; also a list: KEY="4 Hz, 8 Hz". Besides keys: speed (the controller so many times as '
        "fast) and friction (so many times yours).",
    ),
]
Y = Annotated[str | None, typer.Option("--y", metavar=AXIS, help="Vertical axis.")]
Axes = Annotated[list[str] | None, typer.Option("--axis", metavar=AXIS, help="A further axis; may be repeated.")]
Links = Annotated[
    list[str] | None,
    typer.Option("--link", metavar="KEY=EXPRESSION", help='A key tied to others: masses.cart="0.7 * mass".'),
]
SamplesOption = Annotated[
    int | None,
    typer.Option(
        "--samples", metavar="NUMBER", help="Number of Sobol points over the ranges FIRST..LAST, instead of a grid."
    ),
]
Latin = Annotated[bool, typer.Option("--latin", help="Latin hypercube samples.")]
Logarithmic = Annotated[bool, typer.Option("--log", help="Make all ranges logarithmic; for a single one, append :log.")]
MetricOption = Annotated[
    str | None,
    typer.Option(
        "--metric",
        metavar="NAME",
        help="Quantity shown in colour: sketch (whether the stage hunts, by coarse return maps; default), verdict (by "
        f"a search of every cell), or any other of {', '.join(METRICS)}.",
    ),
]
Confirm = Annotated[
    bool,
    typer.Option("--confirm", help="Search every cell, instead of a sketch, which takes up to five times as long."),
]
MapTolerance = Annotated[
    str | None,
    typer.Option("--rtol", metavar="NUMBER|auto", help="Relative tolerance, default 1e-6; auto: the loosest safe one."),
]
Verify = Annotated[float, typer.Option("--verify", metavar="SHARE", help="Share of the cells run again at rtol/100.")]
Refine = Annotated[bool, typer.Option("--refine", help="A grid 4 times finer, run only along its boundaries.")]
Workers = Annotated[int | None, typer.Option("--workers", metavar="N", help="Run in N processes of this machine.")]
Scheduler = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        metavar="ADDRESS",
        help="Run on the workers of a Dask scheduler. Anyone who can reach the address can run code there and here; "
        "tls://, with the certificates of Dask's configuration, keeps others out.",
    ),
]
Exports = Annotated[list[Path] | None, typer.Option("--export", metavar="FILE", help="Also write a .nc or .csv file.")]
StoreFolder = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="STORE",
        help="Folder of the results, resumed if it exists; of a STORE: of its figure and page.",
    ),
]
ReplaceStore = Annotated[
    bool,
    typer.Option("--overwrite", help="Replace the store of another study, and figures and exports of the same name."),
]
CheckStore = Annotated[bool, typer.Option("--check", help="Run nothing; report whether a STORE is intact.")]
ConfirmedOption = Annotated[bool, typer.Option("--yes", help="Confirm a study of more than ten million cells.")]
