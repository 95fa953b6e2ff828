"""Run `friso identify`: keep what the user said of logs, and ask for what is missing."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from friso.axis import speak_of
from friso.cli.asking import Shown, named_as_options, show
from friso.cli.common import say
from friso.cli.progress import ProgressBar
from friso.errors import InputError
from friso.escapes import one_line
from friso.interface.question import Question
from friso.platform.system import shell_word

if TYPE_CHECKING:
    from friso.identification.logs.mapping import Mapping as LogMapping
    from friso.interface.output_folder import OutputFolder
    from friso.shown.blocks import Content


def run(question: Question, about: Sequence[Any], options: Mapping[str, Any], shown: Shown) -> None:
    """Identify a machine from logs, and keep what the user said of them for the next time.

    Raises InputError with the command to type if a question about a log is open.
    """
    from friso.identification.logs.mapping import sidecar
    from friso.identification.sources import OpenQuestions
    from friso.interface.output_folder import OutputFolder
    from friso.questions.identify.blocks import STAGE

    assert shown.out is not None  # the option has a default
    read = [*about[0], *options.get("predict", ()), *([options["stage"]] if "stage" in options else [])]
    kept_before = [sidecar(log, shown.out).name for log in about[0]]
    target = OutputFolder(question.name, shown.out, shown.overwrite, read, kept_before)
    target.check([STAGE])
    kept: list[Path] = []
    with ProgressBar() as progress, named_as_options(question.options):
        try:
            answer = question.function(
                *about,
                **options,
                folder=target.folder,
                keep=lambda said: kept.extend(_keep(said, target)),
                progress=progress,
            )
        except OpenQuestions as error:
            example = _command(error.options) if error.options else ""
            raise InputError(error.key, error.actual, error.expected, example, error.origin) from None
    speak_of(answer.axis_kind)
    show(answer, shown, lambda progress: [*target.write(answer.files(), progress), *kept])


def _keep(mappings: dict[Path, LogMapping], target: OutputFolder) -> list[Path]:
    """Store what the user said of each log, and return the files written.

    A log whose stored mapping is unchanged is left out.
    """
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
    write(texts, overwrite=True)  # mappings may be replaced, since they could be read
    if texts:
        first, *more = texts
        others = f" and {len(more)} more" if more else ""
        say(f"kept for the next time, how the log was read (options override it): {one_line(str(first))}{others}")
    return [*texts]


def _command(options: Sequence[str]) -> str:
    """Return the command as it was called, with further options, ready to be copied."""
    return " ".join(["friso", *map(shell_word, sys.argv[1:]), *options])
