"""What the commands share: their options, reading stages, and how mistakes are answered."""

from __future__ import annotations

import shutil
import sys
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated

import typer

from friso.axis import speak_of
from friso.cli.terminal import console
from friso.errors import InputError
from friso.escapes import one_line
from friso.quantities import Quantity, positive
from friso.stage import Stage, load, parse_set
from friso.stage.plausible import doubts

INTERRUPTED = 130

_NAMED = 3
"""Uncertain keys that are named, at most, where there are more."""

AS_BUILT = ("drive", "rail", "cable", "floor")
"""The tables of the machine as built, which the analyses of the ideal one leave out."""

StageFile = Annotated[Path, typer.Argument(metavar="STAGE.toml", help="The stage file.")]
Overrides = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help='Override a key: masses.stage="0.6 kg".')
]
RTOL_HELP = "Relative tolerance of the solver, 1e-12 to 1e-2."
Tolerance = Annotated[str, typer.Option("--rtol", metavar="NUMBER", help=RTOL_HELP)]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on standard output, nothing else.")]


def say(message: str) -> None:
    print(f"friso: {message}", file=sys.stderr)


def print_answer(
    sentences: Iterable[str], title: str, columns: Sequence[str], rows: Sequence[tuple[str, list[str]]]
) -> None:
    """What follows for the user, and below it the table from which it follows."""
    for sentence in sentences:
        print_wrapped(sentence)
    print_table(title, columns, rows)


def print_table(title: str, columns: Sequence[str], rows: Sequence[tuple[str, list[str]]]) -> None:
    """A table whose rows have names; columns that do not fit beside each other go into further tables below."""
    from rich.table import Table

    screen = console(sys.stdout, highlight=False, markup=False)
    lines = [["", *(label for label, _ in rows)], *zip(columns, *(row for _, row in rows), strict=True)]
    texts, title = [[*map(one_line, column)] for column in lines], one_line(title)
    narrow = [_narrow(column) for column in texts]
    for part in _side_by_side(narrow, screen.width - 1):
        table = Table(title=title or None, title_justify="left")
        spare = max(0, screen.width - 1 - sum(narrow[k] + _BORDER for k in part))
        for k in part:
            width = min(max(map(len, texts[k])), narrow[k] + spare)
            spare -= width - narrow[k]
            table.add_column(texts[k][0], width=width)
        for row in zip(*(texts[k][1:] for k in part), strict=True):
            table.add_row(*row)
        screen.print(table)
        title = ""


_BORDER = 3
"""Width of what separates two columns of a table."""


def _narrow(texts: Sequence[str]) -> int:
    """The least width in which each of the texts takes two lines at most, and no word is cut."""
    words = max((len(word) for text in texts for word in text.split()), default=1)
    widths = range(words, max(map(len, texts)) + 1)
    return next((width for width in widths if all(len(textwrap.wrap(text, width)) <= 2 for text in texts)), words)


def _side_by_side(narrow: Sequence[int], room: int) -> list[list[int]]:
    """Which columns stand in a table together: the first in each, and at least one beside it."""
    parts = [[0]]
    for k in range(1, len(narrow)):
        if len(parts[-1]) > 1 and sum(narrow[j] + _BORDER for j in [*parts[-1], k]) > room:
            parts.append([0])
        parts[-1].append(k)
    return parts


def print_wrapped(sentence: str, indent: str = "") -> None:
    """A sentence on the terminal, in lines as wide as that."""
    width = shutil.get_terminal_size().columns
    lines = textwrap.wrap(sentence, max(40, width - len(indent)), break_long_words=False, break_on_hyphens=False)
    print(textwrap.indent("\n".join(lines), indent))


def leave(done: bool) -> None:
    if not done:
        say("the computation could not be completed; see the status above")
        raise typer.Exit(1)


def read_stage(
    path: Path, overrides: list[str] | None, leaves_out: Sequence[str] = AS_BUILT, uncertain_too: bool = False
) -> Stage:
    """The stage of the file with the overrides; tables that the command leaves out are mentioned, and that the centres
    of uncertain keys are used, unless these are wanted too (`uncertain_too`). Raises InputError."""
    stage = with_overrides(load(path), overrides)
    for doubt in doubts(stage):
        say(doubt)
    keys = [] if uncertain_too else [*stage.uncertain()]
    if keys:
        several = f"{len(keys)} keys are" if len(keys) > 1 else "1 key is"
        named = ", ".join([*keys[:_NAMED], *(["..."] if len(keys) > _NAMED else [])])
        centres = "their centres are" if len(keys) > 1 else "its centre is"
        say(f"{several} uncertain ({named}): {centres} used; friso check --draws 1000 samples the whole range")
    left = [name for name in leaves_out if getattr(stage, name)]
    if left:
        tables = ", ".join(f"[{name}]" for name in left)
        bode = "; friso bode takes sampling and delay into account" if "drive" in left else ""
        say(f"{tables} {'are' if len(left) > 1 else 'is'} left out: friso rig simulates the machine as built{bode}")
    return stage


def with_overrides(stage: Stage, overrides: list[str] | None) -> Stage:
    """The stage with the KEY=VALUE of --set; from here on the command speaks of its kind of axis. Raises InputError."""
    changes = dict(parse_set(text) for text in overrides or [])
    return in_units_of(stage.replace(changes) if changes else stage)


def in_units_of(stage: Stage) -> Stage:
    """The stage, whose kind of axis decides on the units of all that the command shows from here on."""
    speak_of(stage.axis_kind)
    return stage


def key_values(options: list[tuple[str, str]], example: str) -> dict[str, str]:
    """Keys to values from options with their KEY=VALUE. Raises InputError."""
    pairs: dict[str, str] = {}
    for option, text in options:
        key, equals, value = text.partition("=")
        key = key.strip()
        if not (equals and key and value.strip()):
            raise InputError(option, text, "KEY=VALUE", example)
        if key in pairs:
            raise InputError(option, f"{key} given twice", "each key once", example)
        pairs[key] = value.strip()
    return pairs


def read_tolerance(text: str) -> float:
    from friso.engine.tolerance import checked_rtol

    try:
        return checked_rtol(float(text))
    except ValueError:
        raise InputError("--rtol", text, "a number from 1e-12 to 1e-2", "--rtol 1e-6") from None


def read_sample_time(text: str) -> float:
    try:
        return Quantity("s", positive, "1 ms").read(text)
    except InputError as error:
        raise error.under("--sample-time") from None
