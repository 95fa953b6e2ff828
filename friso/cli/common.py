"""Print sentences and tables, and declare the option that commands without a question share."""

from __future__ import annotations

import json
import re
import shutil
import sys
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from friso.cli.terminal import console, spelled
from friso.escapes import one_line

INTERRUPTED_STATUS = 130

Overrides = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help='Override a key: masses.stage="0.6 kg".')
]


def say(message: str) -> None:
    """Print a message of friso on standard error."""
    print(f"friso: {message}", file=sys.stderr)


def print_table(title: str, columns: Sequence[str], rows: Sequence[tuple[str, list[str]]]) -> None:
    """Print a table with a title and named rows, each with one text per column.

    Columns that do not fit side by side are printed in further tables below.
    """
    from rich.table import Table

    screen = console(sys.stdout, highlight=False, markup=False)
    lines = [["", *(label for label, _ in rows)], *zip(columns, *(row for _, row in rows), strict=True)]
    texts = [[spelled(one_line(text), screen.encoding) for text in column] for column in lines]
    title = spelled(one_line(title), screen.encoding)
    names, *others = map(_narrow, texts)
    room = screen.width - 1
    names = min(names, room // 2)
    narrow = [names, *(min(width, max(LEAST_WIDTH, room - names - 2 * BORDER_WIDTH)) for width in others)]
    for part in _side_by_side(narrow, room):
        table = Table(title=title or None, title_justify="left")
        spare = max(0, room - sum(narrow[k] + BORDER_WIDTH for k in part))
        for k in part:
            width = min(max(map(len, texts[k])), narrow[k] + spare)
            spare -= width - narrow[k]
            table.add_column(texts[k][0], width=width, overflow="fold")
        for row in zip(*(texts[k][1:] for k in part), strict=True):
            table.add_row(*row)
        screen.print(table)
        title = ""


BORDER_WIDTH = 3
"""Width between two columns of a table, in characters."""

LEAST_WIDTH = 8
"""Smallest width, in characters, of a column beside the row names."""


def _narrow(texts: Sequence[str]) -> int:
    """Return the least width in which every text takes at most two lines and no word is cut."""
    words = max((len(word) for text in texts for word in text.split()), default=1)
    widths = range(words, max(map(len, texts)) + 1)
    return next((width for width in widths if all(len(textwrap.wrap(text, width)) <= 2 for text in texts)), words)


def _side_by_side(narrow: Sequence[int], room: int) -> list[list[int]]:
    """Group columns into tables that fit a width of `room` characters, by index.

    `narrow` has the least width of each column. The first column, which names the rows, is in every table, with at
    least one other column.
    """
    parts = [[0]]
    for k in range(1, len(narrow)):
        if len(parts[-1]) > 1 and sum(narrow[j] + BORDER_WIDTH for j in [*parts[-1], k]) > room:
            parts.append([0])
        parts[-1].append(k)
    return parts


def print_wrapped(sentence: str) -> None:
    """Print a sentence in lines as wide as the terminal."""
    width = max(40, shutil.get_terminal_size().columns)
    print("\n".join(textwrap.wrap(sentence, width, break_long_words=False, break_on_hyphens=False)))


Replace = Annotated[bool, typer.Option("--overwrite", help="Replace the file if it exists.")]


def print_document(document: Mapping[str, Any], files: Iterable[Path] = ()) -> None:
    r"""Print the JSON document of a command, with the files written and the plug-ins loaded.

    Bytes of a file name that are no UTF-8 are written out, such as "\xff"; JSON has no half characters.
    """
    from friso.stage.arguments import foreign

    written = {"files": [str(file) for file in files], "plug_ins": foreign()}
    print(_HALF.sub(r"\\\\x\1", json.dumps({**document, **written}, allow_nan=False)))


_HALF = re.compile(r"(?<!\\)(?<!\\ud[89ab][0-9a-f]{2})\\udc([89a-f][0-9a-f])")
"""Pattern of a byte that is no UTF-8, as JSON writes it."""


def print_written(files: Iterable[Path]) -> None:
    """Print every file written on a line of its own; many pictures share one line."""
    every = [*files]
    pictures = [file for file in every if file.suffix in _PICTURES]
    listed = every if len(pictures) <= FEW_PICTURES else [file for file in every if file not in pictures]
    for file in listed:
        print(f"wrote {one_line(str(file))}")
    if len(listed) < len(every):
        figures, forms = (
            len({file.stem for file in pictures}),
            ", ".join(sorted({f.suffix[1:].upper() for f in pictures})),
        )
        print(f"wrote {figures} figures as {forms}")


_PICTURES, FEW_PICTURES = (".png", ".svg", ".pdf"), 6
"""Suffixes of pictures, and the largest number of pictures listed one by one."""
