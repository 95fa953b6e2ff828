"""`friso logs`: what files of logs hold, before anything is identified."""

from __future__ import annotations

from friso.cli.asking import named_as_options, show, tried
from friso.cli.command import MACHINE, Choices, Command
from friso.cli.common import AsJson
from friso.cli.log_options import AxisOption, Logs, Maps, SampleTime, Scales, Units
from friso.cli.output import OutFolder, Overwrite
from friso.cli.progress import ProgressBar


def logs(
    logs: Logs,
    maps: Maps = None,
    units: Units = None,
    scales: Scales = None,
    dt: SampleTime = None,
    axis: AxisOption = None,
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """What log files hold: channels, units, rates, ranges and small plots, and the role that friso gives each channel.

    Example: friso logs log.csv --out logs
    """
    from friso.interface.output_folder import output_folder
    from friso.questions.logs.question import logs as question

    target = output_folder("logs", out, overwrite, logs)
    options = {"map": maps, "unit": units, "scale": scales, "dt": dt, "axis": axis}
    files, unwritten = [], ""
    with ProgressBar("reading") as progress, named_as_options(options):
        answer = question(logs, **options, folder=out, partly=True, progress=progress)
        if target is not None and answer.result:
            files, unwritten = tried(lambda: target.write(answer.files(), progress))
    show(answer, files, as_json and not answer.errors, unwritten=unwritten)


def listed_formats() -> list[tuple[str, str]]:
    """The formats of logs that friso reads, each in one line."""
    from friso.identification.logs.format import FORMATS

    return [(FORMATS[name].title, FORMATS.one_line(name)) for name in FORMATS]


COMMAND = Command(logs, 90, MACHINE, Choices("Formats", listed_formats))
