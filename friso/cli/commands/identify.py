"""`friso identify`: from measured logs to a stage file with uncertainties."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from friso.axis import speak_of
from friso.cli.asking import DRAWING, Details, named_as_options, show, tried
from friso.cli.command import MACHINE, Choices, Command
from friso.cli.common import AsJson, Overrides, say
from friso.cli.log_options import AxisOption, Logs, Maps, SampleTime, Scales, Units
from friso.cli.output import DefaultFolder, Overwrite
from friso.cli.progress import ProgressBar
from friso.errors import InputError
from friso.escapes import one_line
from friso.platform.system import shell_word

if TYPE_CHECKING:
    from friso.identification.logs.mapping import Mapping
    from friso.interface.output_folder import OutputFolder
    from friso.shown.files import Content


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
    axis: AxisOption = None,
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
    laws: Annotated[
        bool, typer.Option("--laws", help="Fit every friction law too, and say which of them the record supports.")
    ] = False,
    out: DefaultFolder = Path("identified"),
    overwrite: Overwrite = False,
    as_json: AsJson = False,
    details: Details = False,
) -> None:
    """A stage file with uncertainties from measured logs: mass, friction, stiffness, and what the logs cannot show.

    The exit status is 1 where a model does not describe its log.

    Example: friso identify log.csv --stage stage.toml --map position=ActPos --scale force="35.15 N/V" --out identified
    """
    from friso.identification.sources import OpenQuestions
    from friso.interface.output_folder import OutputFolder
    from friso.questions.identify.page import STAGE
    from friso.questions.identify.question import identify as question
    from friso.shown.drawing.images import drawing_beside

    target = OutputFolder("identify", out, overwrite, [*logs, *(predict or []), *([stage] if stage else [])])
    target.check([STAGE])
    options = {"stage": stage, "set": overrides, "as_": kind, "map": maps, "unit": units, "scale": scales, "dt": dt}
    options |= {"axis": axis, "predict": predict or [], "bandwidth": bandwidth, "band": band, "period": period}
    options |= {"laws": laws}
    kept: list[Path] = []
    with ProgressBar() as progress, named_as_options(options):
        try:
            answer = question(
                logs,
                **options,
                folder=target.folder,
                keep=lambda said: kept.extend(_keep(said, target)),
                progress=progress,
            )
        except OpenQuestions as error:
            _keep(error.mappings, target)
            raise InputError(error.key, error.actual, error.expected, _command(error.options), error.origin) from None
        speak_of(answer.axis_kind)
        progress(0, 0, DRAWING)
        with drawing_beside():
            files, unwritten = tried(lambda: target.write(answer.files(), progress))
    show(answer, [*files, *kept] if files else [], as_json, details, unwritten)


def _keep(mappings: dict[Path, Mapping], target: OutputFolder) -> list[Path]:
    """Keep what was said of logs, by file, for the next time, where it is not kept so already: the files written."""
    from friso.identification.logs.mapping import load_mapping, mapping_text
    from friso.identification.sources import kept_at
    from friso.interface.output_folder import write

    folder = target.folder
    new = {path: mapping for path, mapping in mappings.items() if mapping != load_mapping(path, folder)}
    texts: dict[Path, Content] = {
        place: mapping_text(mapping)
        for path, mapping in new.items()
        if (place := kept_at(path, mapping, folder)) is not None
    }
    if any(place.parent == folder for place in texts):
        target.write({}, beside=texts)  # so that the folder is known for its own next time
    else:
        write(texts, [*filter(Path.is_file, texts)])  # mappings too, as they could be read
    if texts:
        first, *more = texts
        others = f" and {len(more)} more" if more else ""
        say(f"kept for the next time, how the log was read (options override it): {one_line(str(first))}{others}")
    return [*texts]


def _command(options: Sequence[str]) -> str:
    """The command as it was called, with more options: to be copied."""
    return " ".join(["friso", *map(shell_word, sys.argv[1:]), *options])


def listed_kinds() -> list[tuple[str, str]]:
    """The kinds of experiment that `--as` takes, each in one line."""
    from friso.identification.kinds import KINDS

    return [(name, KINDS.one_line(name)) for name in KINDS]


COMMAND = Command(identify, 100, MACHINE, Choices("Kinds of experiment (--as)", listed_kinds))
