"""Ask questions on the command line: check arguments, call the friso function of the command's name, show the answer.

Arguments of every command are checked before it runs.

The conclusion comes first, then small tables and what to do next. Details follow if they are asked for.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps
from inspect import signature
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args, get_type_hints

import typer
from typer import BadParameter
from typer.models import ArgumentInfo

from friso.axis import speak_of
from friso.cli.terminal import ProgressBar, print_document, print_table, print_wrapped, print_written, say
from friso.errors import InputError
from friso.platform import files
from friso.platform.interrupts import whole_answer
from friso.platform.system import cause_of, path_of, shell_word
from friso.progress import Progress

if TYPE_CHECKING:
    from friso.interface.answer import Answer
    from friso.interface.question import Question


def refuse_empty(arguments: Iterable[str]) -> None:
    """Raise InputError for an empty argument, as a shell passes for a variable that is not set."""
    option = ""
    for argument in arguments:
        name, _, value = argument.partition("=")
        of_option = name.startswith("--") and "=" in argument
        if not (value if of_option else argument):
            place = name if of_option else option or "the arguments"
            raise InputError(place, "an empty text", "a value, or to be left out", f"{option or name} VALUE".lstrip())
        option = argument if argument.startswith("-") else ""


def with_checked_paths(function: Callable[..., None]) -> Callable[..., None]:
    """Wrap a command so that it refuses malformed paths with InputError."""

    @wraps(function)
    def command(**options: Any) -> None:
        """Check every path among the options, then call the function."""
        for name, value in options.items():
            for path in value if isinstance(value, list) else [value]:
                if isinstance(path, Path) and (flaw := files.flaw_of(path)):
                    key, example = _named(function, name)
                    raise InputError(key, flaw, files.EXPECTED, example)
        function(**options)

    return command


def _named(function: Callable[..., None], name: str) -> tuple[str, str]:
    """Return the name of a path's option on the command line, and an example of its use.

    `function` is the command, and `name` the option's name in Python.
    """
    (info,) = get_type_hints(function, include_extras=True)[name].__metadata__
    if isinstance(info, ArgumentInfo):
        return str(info.metavar), "rig.toml"
    option = next(iter(info.param_decls or ()), f"--{name.replace('_', '-')}")
    return option, f"{option} report"


_NUMBERS = {int: "a whole number", float: "a number"}


def number_refused(
    error: BaseException, arguments: Sequence[str], function_of: Callable[[str], Callable[..., None] | None]
) -> InputError | None:
    """Return friso's error for an option with a missing number, or one out of range.

    `function_of` returns the function of a command by its name (None: no such command). Returns None for any other
    error.
    """
    parameter, context = (getattr(error, name, None) for name in ("param", "ctx"))
    function = function_of(getattr(context, "info_name", None) or "")
    if not isinstance(error, BadParameter) or parameter is None or function is None:
        return None
    name = str(parameter.name)
    asked = get_type_hints(function, include_extras=True)[name]
    wanted, info = asked.__origin__, asked.__metadata__[0]
    kind = next((kind for kind in (wanted, *get_args(wanted)) if kind in _NUMBERS), None)
    if kind is None:
        return None
    option, expected = parameter.opts[0], _NUMBERS[kind]
    if info.min is not None and info.max is not None:
        expected += f" from {info.min:g} to {info.max:g}"
    default = signature(function).parameters[name].default
    example = default if isinstance(default, int | float) else info.max or 4
    return InputError(option, _value_of(option, arguments), expected, f"{option} {example}")


def _value_of(option: str, arguments: Sequence[str]) -> str:
    """Return the last value of an option on the command line, in quotes."""
    values = [value for before, value in pairwise(arguments) if before == option]
    values += [argument.partition("=")[2] for argument in arguments if argument.startswith(f"{option}=")]
    from friso.quantities import quoted  # imported only here, because it is rarely needed

    return quoted(values[-1]) if values else "no number"


def parted_path(words: Sequence[str]) -> str:
    """Return a hint to use quotes if several words together are the path of an existing file.

    Such a path contains blanks and lacks its quotes. Otherwise the hint is empty.
    """
    paths = (" ".join(words[first : first + count]) for first in range(len(words) - 1) for count in range(2, 7))
    path = next((path for path in paths if os.path.isfile(path)), "")
    return f"\n  a path with blanks needs quotes: {shell_word(path)}" if path else ""


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
