"""`friso identify`: from measured logs to a stage file with uncertainties."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from friso.cli.command import Choices, Command
from friso.cli.common import AsJson, Overrides, print_wrapped, with_overrides
from friso.cli.log_options import Logs, Maps, SampleTime, Scales, Units
from friso.cli.output import DefaultFolder, OutputFolder, Overwrite, print_document, write
from friso.cli.progress import ProgressBar
from friso.errors import InputError
from friso.quantities import Quantity, positive
from friso.stage import Stage, load

if TYPE_CHECKING:
    from friso.identification.kind import AnalysisSettings
    from friso.identification.logs.log import Log
    from friso.identification.logs.mapping import Mapping
    from friso.identification.method import Identification, Prediction
    from friso.identification.sources import LogFile
    from friso.views.files import Content

STAGE = "identified.toml"

PIPED = 10.0
"""Seconds between lines of progress where no terminal shows a bar."""

_HERTZ, _SECONDS = Quantity("Hz", positive, "20 Hz"), Quantity("s", positive, "5 s")


def identify(
    logs: Logs,
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
            help="Kind of experiment (see the list below); moves and frequency responses are recognised.",
        ),
    ] = None,
    maps: Maps = None,
    units: Units = None,
    scales: Scales = None,
    dt: SampleTime = None,
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
    out: DefaultFolder = Path("identified"),
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """A stage file with uncertainties from measured logs: mass, friction, stiffness, and what the logs cannot show.

    The exit status is 1 where a model does not describe its log.

    Example: friso identify log.csv --stage stage.toml --map position=ActPos --scale force="35.15 N/V" --out identified
    """
    from friso.identification.logs.mapping import from_options
    from friso.identification.method import check_predictions
    from friso.identification.method import identify as identification
    from friso.identification.method import predict as predict_log

    assumed, settings = _stage(stage, overrides), _settings(bandwidth, band, period)
    mapping = from_options(maps or (), units or (), scales or (), dt, kind)
    target = OutputFolder("identify", out, overwrite, [*logs, *(predict or []), *([stage] if stage else [])])
    target.check([STAGE])
    inputs = _read([*logs, *(predict or [])], mapping, target)
    sources = [(file.source, file.kind) for file in inputs[: len(logs)]]
    others = _others(inputs[len(logs) :])
    check_predictions(sources, others, assumed)
    with ProgressBar(lines=PIPED) as progress:
        identified = identification(sources, assumed, settings, progress)
        predictions = [predict_log(identified, log, settings, assumed) for log in others]
        from friso.views.identify.page import identify_files

        files = target.write(identify_files(identified, inputs, predictions), progress)
    _answer(identified, inputs, predictions, files, as_json)
    if identified.failed:
        raise typer.Exit(1)


def _read(paths: list[Path], options: Mapping, target: OutputFolder) -> list[LogFile]:
    """The logs; what was said of them is kept, also where more has to be said. Raises InputError, for all that is
    open with the command that tells it."""
    from friso.identification.sources import OpenQuestions, read_all

    try:
        files = read_all(paths, options, target.folder)
    except OpenQuestions as error:
        _keep(error.mappings, target)
        raise InputError(error.key, error.actual, error.expected, _command(error.options), error.origin) from None
    _keep({file.path: file.mapping for file in files}, target)
    return files


def _keep(mappings: dict[Path, Mapping], target: OutputFolder) -> None:
    """Keep what was said of logs, by file, for the next time, where it is not kept so already."""
    from friso.identification.logs.mapping import load, mapping_text
    from friso.identification.sources import kept_at

    folder = target.folder
    new = {path: mapping for path, mapping in mappings.items() if mapping != load(path, folder)}
    texts: dict[Path, Content] = {
        place: mapping_text(mapping)
        for path, mapping in new.items()
        if (place := kept_at(path, mapping, folder)) is not None
    }
    if any(place.parent == folder for place in texts):
        target.write({}, beside=texts)  # so that the folder is known for its own next time
    else:
        write(texts)


def _command(options: Sequence[str]) -> str:
    """The command as it was called, with more options: to be copied."""
    arguments = (argument if argument.isalnum() else shlex.quote(argument) for argument in sys.argv[1:])
    return " ".join(["friso", *arguments, *options])


def _stage(path: Path | None, overrides: list[str] | None) -> Stage | None:
    """What is known of the machine beforehand. Raises InputError, also for overrides without a stage."""
    if path is not None:
        return with_overrides(load(path), overrides)
    if overrides:
        raise InputError("--set", overrides[0], "a stage whose keys to override", "--stage stage.toml")
    return None


def _settings(bandwidth: str | None, band: str | None, period: str | None) -> AnalysisSettings:
    """What the user chose for the analyses. Raises InputError."""
    from friso.identification.kind import AnalysisSettings
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


def _others(inputs: Sequence[LogFile]) -> list[Log]:
    """The logs to be predicted. Raises InputError."""
    from friso.identification.logs.log import Log

    logs = [item.source for item in inputs if isinstance(item.source, Log)]
    if len(logs) < len(inputs):
        raise InputError("--predict", "a measured frequency response", "a log over time", "--predict other.mat")
    return logs


def _answer(
    identified: Identification,
    inputs: Sequence[LogFile],
    predictions: Sequence[Prediction],
    files: list[Path],
    as_json: bool,
) -> None:
    """The answer on standard output, and what to do next."""
    if as_json:
        from friso.views.identify.document import identify_document

        print_document(identify_document(identified, inputs, predictions), files)
        return
    from friso.views.identify.words import answer

    for line in answer(identified, inputs, predictions):
        print_wrapped(line)
    named = [file for file in files if file.suffix in (".toml", ".html")]
    print(f"\nwrote {', '.join(map(str, named))}, and {len({file.stem for file in files[len(named) :]})} figures")
    if identified.stage is not None:
        print(f"next: friso check {files[0]}{' --draws 1000' if identified.stage.uncertain() else ''}")


def listed_kinds() -> list[tuple[str, str]]:
    """The kinds of experiment that `--as` takes, each in one line."""
    from friso.identification.kinds import KINDS

    return [(name, KINDS.one_line(name)) for name in KINDS]


COMMAND = Command(identify, 100, Choices("Kinds of experiment (--as)", listed_kinds))
