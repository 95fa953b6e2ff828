"""Answer every command: call the friso function of its name and show the answer.

The conclusion comes first, then small tables and what to do next. Details follow if they are asked for.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from friso.axis import speak_of
from friso.cli.arguments import parted_path
from friso.cli.common import print_document, print_table, print_wrapped, print_written, say
from friso.cli.progress import ProgressBar
from friso.errors import InputError
from friso.platform.interrupts import answers_interrupts, whole_answer
from friso.platform.system import cause_of, path_of
from friso.progress import Progress

if TYPE_CHECKING:
    from friso.interface.answer import Answer
    from friso.interface.question import Question

DRAWING = "drawing the page"
"""Label of the progress bar once an answer is there."""


Write = Callable[[Progress], list[Path]]
"""Function that draws and writes the files of an answer, and returns their paths."""


@dataclass(frozen=True)
class Shown:
    """Options on showing an answer: the folder for its files, and what is printed.

    `overwrite` allows the command to replace files in the folder.
    """

    out: Path | None = None
    overwrite: bool = False
    as_json: bool = False
    details: bool = False


def ask(question: Question, about: Sequence[Any], options: Mapping[str, Any], shown: Shown, **kept: Any) -> None:
    """Ask a question `about` files, write its files, and show the answer.

    `options` are the command's options by name, and `kept` are further keywords of the function. Raises InputError for
    wrong input. Raises typer.Exit with the status of a failure.
    """
    if question.answers_interrupted:
        answers_interrupts()
    target = None
    if shown.out is not None:
        from friso.interface.output_folder import OutputFolder

        target = OutputFolder(question.name, shown.out, shown.overwrite, [*_paths([*about, *options.values()])])
        target.check(question.files)
    with ProgressBar(question.during) as progress, named_as_options(question.options):
        answer = question.function(*about, **options, **kept, progress=progress)
    speak_of(answer.axis_kind)
    with whole_answer():
        show(answer, shown, None if target is None else lambda progress: target.write(answer.files(), progress))


def tried(write: Callable[[], list[Path]], nothing: str) -> tuple[list[Path], str]:
    """Write files and return them, or return none and the reason why writing failed.

    The answer is shown even if writing fails; `nothing` says what is then missing.
    """
    try:
        return write(), ""
    except OSError as error:
        return [], f"{nothing}: {cause_of(error)}: {path_of(error)}".removesuffix(": ")
    except InputError as error:  # a file may have appeared since the check
        return [], f"{nothing}: {error.actual}; expected: {error.expected}"


def show(answer: Answer, shown: Shown, write: Write | None, nothing: str = "no file was written") -> None:
    """Print an answer, and write its files by `write`.

    The first sentences are printed before the files are drawn. If writing fails, `nothing` says what is missing. Raises
    typer.Exit with the status of a failure. Raises KeyboardInterrupt after an answer that was interrupted. Raises
    OSError, after writing the files, if the output cannot be printed.
    """
    unprinted: OSError | None = None
    try:
        for sentence in () if shown.as_json else answer.sentences():
            print_wrapped(sentence)
        sys.stdout.flush()
    except OSError as error:  # as by a pager that was closed: the files are still wanted
        unprinted = error
    written, unwritten = [], ""
    if write is not None:
        with ProgressBar(DRAWING) as progress:
            written, unwritten = tried(lambda: write(progress), nothing)
    if unprinted is not None:
        raise unprinted
    if shown.as_json:
        print_document(answer.to_dict(shown.details), written)
    else:
        details = shown.details
        for block in answer.blocks():
            if block.text:
                print(f"\n{block.text}\n")
        tables = answer.tables()
        behind = any(table.behind for table in tables)
        more = answer.details() if details or not behind else ()  # details may take work
        for table in tables:
            if details or not table.behind:
                print_table(table.title, table.labels, [(label, [*cells]) for label, cells in table.rows])
        for paragraph in more if details else ():
            print_wrapped(paragraph)
        print_written(written)
        for command in answer.next_steps(written):
            print(f"next: {command}")
        if not details and (more or behind):
            print("more: --details")
    failures = [failure for failure in (answer.failure, unwritten) if failure]
    for failure in failures:
        say(f"{failure}{parted_path(sys.argv[1:])}")
    if answer.interrupted:
        raise KeyboardInterrupt
    if failures:
        raise typer.Exit(answer.status if answer.failure else 1)


@contextmanager
def named_as_options(names: Collection[str]) -> Iterator[None]:
    """Let an InputError in the `with` block name a command-line option instead of a keyword.

    `names` are the keywords for which this holds.
    """
    try:
        yield
    except InputError as error:
        key = error.key
        if key not in names:
            raise
        option = option_of(key)
        example = error.example
        if example.startswith(f"{key}="):
            example = example.replace(f"{key}=", f"{option} ", 1).removesuffix(" True")  # a flag takes no value
        raise type(error)(option, error.actual, error.expected, example, error.origin, error.also) from None


def option_of(keyword: str) -> str:
    """Return the command-line option for a Python keyword.

    "sample_time" becomes "--sample-time".
    """
    return f"--{keyword.strip('_').replace('_', '-')}"


def _paths(about: Iterable[Any]) -> Iterator[Path]:
    """Yield the files among the arguments, also from nested lists."""
    for item in about:
        if isinstance(item, list | tuple):
            yield from _paths(item)
        elif isinstance(item, Path):
            yield item
