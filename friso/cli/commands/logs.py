"""`friso logs`: what files of logs hold, before anything is identified."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from friso.cli.command import Command
from friso.cli.common import AsJson, print_table, print_wrapped
from friso.cli.log_options import Logs, Maps, SampleTime, Scales, Units
from friso.cli.output import OutFolder, Overwrite, output_folder, print_document, print_written
from friso.cli.progress import ProgressBar
from friso.errors import InputError

if TYPE_CHECKING:
    from friso.identification.contents import LogContent


def logs(
    logs: Logs,
    maps: Maps = None,
    units: Units = None,
    scales: Scales = None,
    dt: SampleTime = None,
    out: OutFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """What log files hold: channels, units, rates, ranges and small plots, and which channel would be what, and why.

    Example: friso logs log.csv --out logs
    """
    from friso.identification.logs.mapping import from_options

    options = from_options(maps or (), units or (), scales or (), dt)
    target = output_folder("logs", out, overwrite, logs)
    contents: list[LogContent] = []
    wrong: list[InputError] = []
    files: list[Path] = []
    with ProgressBar("reading") as progress:
        from friso.identification.contents import content_of

        for number, path in enumerate(logs):
            progress(number, len(logs), path.name)
            try:
                contents.append(content_of(path, options, out))
            except InputError as error:
                wrong.append(error)
        if target is not None and contents:
            from friso.views.logs.page import logs_files

            files = target.write(logs_files(contents), progress)
    if as_json and not wrong:
        from friso.views.logs.document import logs_document

        print_document(logs_document(contents), files)
        return
    _print(contents)
    print_written(files)
    if wrong:
        raise wrong[0] if len(wrong) == 1 else InputError("", "\n\n".join(map(str, wrong)), "files that can be read")


def _print(contents: Sequence[LogContent]) -> None:
    from friso.views.logs.words import COLUMNS, channel_rows, conclusions, next_command, open_questions

    for content in contents:
        for _, sentence in conclusions(content):
            print_wrapped(sentence)
        if content.channels:
            print_table("", COLUMNS, channel_rows(content))
        for line in open_questions(content):
            print_wrapped(f"open: {line}", "  ")
        for line in content.warnings:
            print_wrapped(f"note: {line}", "  ")
        print(f"next: {next_command(content)}\n")


COMMAND = Command(logs, 90)
