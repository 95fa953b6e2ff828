"""`friso identify`: from measured logs to a stage file with uncertainties."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from friso.cli.common import AsJson, Overrides, check_place, made_folder, print_wrapped, with_overrides
from friso.cli.progress import step_bar
from friso.errors import InputError
from friso.quantities import Quantity, positive
from friso.stage import load

if TYPE_CHECKING:
    from friso.identify.kind import AnalysisSettings
    from friso.identify.method import Identification, Prediction
    from friso.identify.sources import LogFile

STAGE, PAGE = "identified.toml", "identify.html"

Many = list[str] | None
_HERTZ, _SECONDS = Quantity("Hz", positive, "20 Hz"), Quantity("s", positive, "5 s")


def identify(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="CSV, TwinCAT, MAT, TDMS, UFF58 or LVM files.")],
    stage: Annotated[
        Path | None,
        typer.Option("--stage", metavar="STAGE.toml", help="What is known beforehand: structure, controller, drive."),
    ] = None,
    overrides: Overrides = None,
    kind: Annotated[
        str | None,
        typer.Option(
            "--as",
            metavar="KIND",
            help="Kind of experiment, one of those below; moves and frequency responses tell it themselves.",
        ),
    ] = None,
    maps: Annotated[Many, typer.Option("--map", metavar="ROLE=CHANNEL", help='position="Axis1.ActPos"')] = None,
    units: Annotated[Many, typer.Option("--unit", metavar="CHANNEL=UNIT", help='Axis1.ActPos="mm"')] = None,
    scales: Annotated[Many, typer.Option("--scale", metavar="ROLE=SCALE", help='force="35.15 N/V"')] = None,
    dt: Annotated[
        str | None, typer.Option("--dt", metavar="TIME", help="Sample time, if the file does not contain it.")
    ] = None,
    predict: Annotated[
        list[Path] | None,
        typer.Option("--predict", metavar="LOG", help="Another log, simulated with the identified stage."),
    ] = None,
    bandwidth: Annotated[
        str | None, typer.Option("--bandwidth", metavar="FREQUENCY", help="Bandwidth of the moves, for the filters.")
    ] = None,
    band: Annotated[
        str | None, typer.Option("--band", metavar="RANGE", help='Band of the response: "3 Hz .. 20 Hz".')
    ] = None,
    period: Annotated[
        str | None, typer.Option("--period", metavar="TIME", help="Period of a periodic excitation.")
    ] = None,
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
    from friso.identify.sources import keep, read_all

    known = None if stage is None else with_overrides(load(stage), overrides)
    if known is None and overrides:
        raise InputError("--set", overrides[0], "a stage whose keys to override", "--stage stage.toml")
    settings = _settings(bandwidth, band, period)
    told = from_options(maps or (), units or (), scales or (), dt, kind)
    check_place(out, (STAGE,), PAGE, [*logs, *(predict or []), *([stage] if stage else [])])
    given = read_all([*logs, *(predict or [])], told, out)
    with step_bar() as bar:

        def progress(what: str, done: int, total: int) -> None:
            if bar:
                bar(done, total, what)

        found = found_in([(each.source, each.kind) for each in given[: len(logs)]], known, settings, progress)
        predictions = _predictions(found, given[len(logs) :], settings)
        given = [keep(each, out) for each in given]
        files = _write(found, given, predictions, made_folder(out), progress)
    _answer(found, given, predictions, files, as_json)


def _settings(bandwidth: str | None, band: str | None, period: str | None) -> AnalysisSettings:
    """What the user chose for the analyses. Raises InputError."""
    from friso.identify.kind import AnalysisSettings
    from friso.intervals import Span

    values = []
    for name, text, quantity in (("--bandwidth", bandwidth, _HERTZ), ("--period", period, _SECONDS)):
        try:
            values.append(None if text is None else float(quantity.read(text)))
        except InputError as error:
            raise error.found_in(name) from None
    try:
        limits = None if band is None else Span(_HERTZ, "3 Hz .. 20 Hz").read(band)
    except InputError as error:
        raise error.found_in("--band") from None
    return AnalysisSettings(values[0], None if limits is None else (limits.low, limits.high), values[1])


def _predictions(found: Identification, given: Sequence[LogFile], settings: AnalysisSettings) -> list[Prediction]:
    """The other logs, predicted. Raises InputError."""
    from friso.identify.logs.log import Log
    from friso.identify.method import predict

    logs = [each.source for each in given if isinstance(each.source, Log)]
    if len(logs) < len(given):
        raise InputError("--predict", "a measured frequency response", "a log over time", "--predict other.mat")
    return [predict(found, log, settings) for log in logs]


def _write(
    found: Identification,
    given: Sequence[LogFile],
    predictions: Sequence[Prediction],
    folder: Path,
    progress: Callable[[str, int, int], None],
) -> list[Path]:
    """The stage file, the correlations beside it, the page, and every figure in all formats."""
    from friso.stage.correlations import beside, write_correlations
    from friso.stage.files import save as save_stage
    from friso.views.drawing.matplotlib_renderer import FORMATS, save
    from friso.views.identify.figures import identify_figures
    from friso.views.identify.page import identify_html

    figures = identify_figures(found, predictions)
    page, stage = folder / PAGE, folder / STAGE
    page.write_text(identify_html(found, given, predictions, figures), encoding="utf-8", newline="\n")
    files = [page]
    if found.stage is not None:
        save_stage(found.stage, stage, overwrite=True)
        files.insert(0, stage)
    else:
        stage.unlink(missing_ok=True)  # an earlier run's, as are the correlations below
    if found.stage is not None and found.correlations.keys:
        write_correlations(found.correlations, found.stage, beside(stage), overwrite=True)
        files.insert(1, beside(stage))
    else:
        beside(stage).unlink(missing_ok=True)
    pictures = {folder / f"{figure.name}.{form}": figure for figure in figures for form in FORMATS}
    for number, (path, figure) in enumerate(pictures.items()):
        progress("figures", number, len(pictures))
        save(figure, path)
    return [*files, *pictures]


def _answer(
    found: Identification, given: Sequence[LogFile], predictions: Sequence[Prediction], files: list[Path], as_json: bool
) -> None:
    """What was read and found, on standard output."""
    if as_json:
        from friso.views.identify.document import identify_document

        document = identify_document(found, given, predictions) | {"files": [str(file) for file in files]}
        print(json.dumps(document, allow_nan=False))
        return
    from friso.views.identify.words import answer

    for line in answer(found, given, predictions):
        print_wrapped(line)
    named = [file for file in files if file.suffix in (".toml", ".html")]
    print(f"\nwrote {', '.join(map(str, named))}, and {len({file.stem for file in files[len(named) :]})} figures")
    if found.stage is None:
        print(
            "no stage file: a frequency response or a stiffness alone does not make a machine; describe the rest with "
            "--stage"
        )
    else:
        print(f"next: friso check {files[0]}{' --draws 1000' if found.stage.uncertain() else ''}")


def listed_kinds() -> list[tuple[str, str]]:
    """The kinds of experiment that `--as` takes, each in one line."""
    from friso.identify.kinds import KINDS

    return [(name, KINDS.one_line(name)) for name in KINDS]
