"""Run commands that do more than show an answer.

- `friso design`: without a design, say which requirement to relax and by how much.
- `friso identify`: keep what the user said of logs, and ask for what is missing.
- `friso logs`: report files that cannot be read beside those that can.
- `friso map`: put results into a store, with the figure and the page beside it.
- `friso simulate`: take a stage file, or the numbers of a cell.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from friso.axis import speak_of
from friso.cli.asking import Shown, ask, named_as_options, show
from friso.cli.terminal import ProgressBar, print_document, say
from friso.errors import InputError, one_line
from friso.interface.question import Question
from friso.platform.interrupts import whole_answer
from friso.platform.system import shell_word
from friso.progress import Progress

if TYPE_CHECKING:
    from friso.identification.logs.roles import Mapping as LogMapping
    from friso.interface.output_folder import OutputFolder
    from friso.shown.blocks import Content


def run_design(question: Question, about: Sequence[Any], options: Mapping[str, Any], shown: Shown) -> None:
    """Ask for a design. Raises typer.Exit with status 2 where there is none."""
    from friso.design_method.method import NoDesign
    from friso.interface.inputs import stage_of
    from friso.questions.design.blocks import refused_document
    from friso.questions.design.question import specification_of
    from friso.questions.design.words import refusal
    from friso.shown.text import unknown_condition

    try:
        ask(question, about, options, shown)
    except NoDesign as failure:
        stage = stage_of(about[0], options.get("set"))
        if shown.as_json:
            print_document(refused_document(stage, specification_of(stage, about[1]).name, failure))
        say(unknown_condition(stage) + refusal(failure))
        raise typer.Exit(2) from None


def run_identify(question: Question, about: Sequence[Any], options: Mapping[str, Any], shown: Shown) -> None:
    """Identify a machine from logs, and keep what the user said of them for the next time.

    Raises InputError with the command to type if a question about a log is open.
    """
    from friso.identification.logs.roles import sidecar
    from friso.identification.sources import OpenQuestions
    from friso.interface.output_folder import OutputFolder
    from friso.questions.identify.words import STAGE

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
    with whole_answer():
        show(answer, shown, lambda progress: [*target.write(answer.files(), progress), *kept])


def _keep(mappings: dict[Path, LogMapping], target: OutputFolder) -> list[Path]:
    """Store what the user said of each log, and return the files written.

    A log whose stored mapping is unchanged is left out.
    """
    from friso.identification.logs.roles import load_mapping, mapping_text
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


def run_logs(question: Question, about: Sequence[Any], options: Mapping[str, Any], shown: Shown) -> None:
    """Show what the files hold, and write the page if there is anything to show."""
    from friso.interface.output_folder import output_folder

    target = output_folder(question.name, shown.out, shown.overwrite, about[0])
    with ProgressBar(question.during) as progress, named_as_options(question.options):
        answer = question.function(*about, **options, folder=shown.out, partly=True, progress=progress)
    folder = target if answer.result else None
    shown = replace(shown, as_json=shown.as_json and not answer.errors)
    show(answer, shown, None if folder is None else lambda progress: folder.write(answer.files(), progress))


def run_map(question: Question, about: Sequence[Any], options: Mapping[str, Any], shown: Shown) -> None:
    """Run or resume a study."""
    from friso.axis import speak_of
    from friso.interface.output_folder import output_folder, write

    (source,) = about
    store, elsewhere = shown.out or Path(f"{source.stem}_map.zarr"), None
    if source.is_dir():
        store, elsewhere = None, output_folder(question.name, shown.out, shown.overwrite)
    options = {**options, "overwrite": shown.overwrite, "out": store}
    with ProgressBar() as progress, named_as_options(question.options):
        answer = question.function(source, **options, beside=elsewhere is None, progress=progress)
    speak_of(answer.axis_kind)
    place = answer.store or source

    def written(progress: Progress) -> list[Path]:
        """Write figure and page, and return their paths.

        The files go beside the store, or into a folder given by --out.
        """
        if elsewhere is not None:
            return elsewhere.write(answer.files(), progress)
        return write(answer.files_beside(), shown.overwrite, progress)

    show(answer, shown, written, f"the runs are in {place}, but no figure was written")


def run_simulate(question: Question, about: Sequence[Any], options: Mapping[str, Any], shown: Shown) -> None:
    """Simulate the stage of a file or, with --cell, one cell of a map's store."""
    words = about[0] or []
    ask(question, [words if "cell" in options else [Path(word) for word in words]], options, shown)
