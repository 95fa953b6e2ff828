"""`friso identify`: from measured logs to a stage file with uncertainties."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from friso.cli.common import AsJson, Overrides, made_folder, say, with_overrides
from friso.cli.progress import step_bar
from friso.quantities import Quantity, StageError, positive
from friso.stage import Stage, load

if TYPE_CHECKING:
    from friso.identify.logs.log import Log
    from friso.identify.logs.mapping import Mapping
    from friso.identify.method import Identification, Options, Source

STAGE, PAGE = "identified.toml", "identify.html"

Many = list[str] | None
_HERTZ, _SECONDS = Quantity("Hz", positive, "20 Hz"), Quantity("s", positive, "5 s")


def identify(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="CSV, TwinCAT, MAT, TDMS, UFF58 or LVM files.")],
    stage: Annotated[
        Path | None, typer.Option("--stage", metavar="STAGE.toml", help="What is known: structure, controller, drive.")
    ] = None,
    overrides: Overrides = None,
    kind: Annotated[
        str | None,
        typer.Option("--as", metavar="KIND", help="moves, frequency, steps, stick-slip, break-away, constant-speed."),
    ] = None,
    maps: Annotated[Many, typer.Option("--map", metavar="ROLE=CHANNEL", help='position="Axis1.ActPos"')] = None,
    units: Annotated[Many, typer.Option("--unit", metavar="CHANNEL=UNIT", help='Axis1.ActPos="mm"')] = None,
    scales: Annotated[Many, typer.Option("--scale", metavar="ROLE=SCALE", help='force="35.15 N/V"')] = None,
    dt: Annotated[str | None, typer.Option("--dt", metavar="TIME", help="Sample time, where no file tells it.")] = None,
    predict: Annotated[
        list[Path] | None, typer.Option("--predict", metavar="LOG", help="Another log, simulated with what was found.")
    ] = None,
    bandwidth: Annotated[
        str | None, typer.Option("--bandwidth", metavar="FREQUENCY", help="Of the moves, for the filters.")
    ] = None,
    band: Annotated[
        str | None, typer.Option("--band", metavar="RANGE", help='Of the response: "3 Hz .. 20 Hz".')
    ] = None,
    period: Annotated[str | None, typer.Option("--period", metavar="TIME", help="Of a periodic excitation.")] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files written.")] = Path(
        "identified"
    ),
    as_json: AsJson = False,
) -> None:
    """A stage file with uncertainties from measured logs: mass, friction, stiffness, and what the logs cannot show.

    Example: friso identify log.csv --stage stage.toml --map position=ActPos --scale force="35.15 N/V" --out identified
    """
    from friso.identify.logs.mapping import from_options
    from friso.identify.method import identify as found_in

    known = None if stage is None else with_overrides(load(stage), overrides)
    if known is None and overrides:
        raise StageError("--set", overrides[0], "a stage whose keys to override", "--stage stage.toml")
    options = _options(bandwidth, band, period)
    told = from_options(maps or (), units or (), scales or (), dt, _kind(kind))
    folder = _checked(out, (stage, *logs, *(predict or ())))
    sources = _read(logs, told, folder)
    others = _read(predict or [], told, folder)
    _warn_unused(told, [*logs, *(predict or [])])
    with step_bar() as bar:
        found = found_in(sources, known, options, lambda what, done, total: bar(done, total, what) if bar else None)
    predictions = _predictions(found, [log for log, _ in others], options)
    files = _write(found, predictions, folder)
    _answer(found, predictions, files, as_json)
