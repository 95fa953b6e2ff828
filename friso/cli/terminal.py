"""Write sentences, tables and progress to the terminal, safely.

Commands without a question share an option, which is declared here.

Texts from files cannot steer the terminal (`friso.errors`); friso's own tables and bars can. Characters that the
terminal's encoding lacks are spelled out.
"""

from __future__ import annotations

import codecs
import json
import logging
import math
import re
import shutil
import sys
import textwrap
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from threading import Event, Lock, Thread
from typing import TYPE_CHECKING, Annotated, Any, Self, TextIO, cast

import typer

from friso.errors import escaped, one_line
from friso.platform.system import closed_pipes_told
from friso.progress import WORK_CLOCK

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress as Display
    from rich.progress import TaskID


class Piped:
    """A stream that raises BrokenPipeError when its reader has gone, on every system."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        """Write a text to the stream."""
        with closed_pipes_told():
            return self.stream.write(text)

    def flush(self) -> None:
        """Flush the stream."""
        with closed_pipes_told():
            self.stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


class Escaping(Piped):
    """A stream that escapes everything written to it."""

    def write(self, text: str) -> int:
        """Write a text, escaped."""
        super().write(escaped(text))
        return len(text)


@contextmanager
def escaping() -> Iterator[None]:
    """Escape everything that is printed or logged in the `with` block."""
    out, err = cast(TextIO, Escaping(sys.stdout)), cast(TextIO, Escaping(sys.stderr))
    with redirect_stdout(out), redirect_stderr(err):
        yield


def console(stream: TextIO, **options: Any) -> Console:
    """Return rich's console for a stream.

    Escape sequences of rich reach the stream, so texts must be escaped beforehand. Names such as ":x:" stay text.
    """
    from rich.console import Console

    plain = cast("TextIO", Piped(stream.stream)) if isinstance(stream, Escaping) else stream
    return Console(file=plain, emoji=False, **options)


SPELLED = "friso.spelled"
"""Name of the error handler of streams, which spells characters that the encoding lacks."""


def spelled(text: str, encoding: str) -> str:
    """Return a text with the characters that an encoding lacks spelled out."""
    return text.encode(encoding, SPELLED).decode(encoding)


def _spelled(error: UnicodeError) -> tuple[str, int]:
    """Return a replacement for characters that an encoding lacks, and where to go on.

    This is the error handler of streams. Any other error is raised again.
    """
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_spelling, error.object[error.start : error.end])), error.end


def _spelling(character: str) -> str:
    """Spell a character in ASCII.

    Exponents follow "^", Greek letters become their names, and unknown characters become "?".
    """
    if character.isascii() or character in _SPELLINGS:
        return _SPELLINGS.get(character, character)
    if unicodedata.decomposition(character).startswith("<super>"):
        return "^" + "".join(map(_spelling, unicodedata.normalize("NFKC", character)))
    match unicodedata.name(character, "").split():
        case ["GREEK", "SMALL" | "CAPITAL" as size, "LETTER", name]:
            return name.lower() if size == "SMALL" else name.capitalize()
    return "?"


_SPELLINGS = {
    **dict.fromkeys("−–—", "-"),
    **dict.fromkeys("“”", "'"),  # no JSON text ends there
    **{block: str(height) for height, block in enumerate("▁▂▃▄▅▆▇█", 1)},
    **{"…": "...", "×": "x", "·": "*", "±": "+-", "≤": "<=", "√": "sqrt ", "°": " deg", "µ": "u", "μ": "u"},
}

codecs.register_error(SPELLED, _spelled)


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


LINE_INTERVAL = 10.0
"""Time [s] between lines of progress where no terminal shows a bar."""

ESTIMATED_FROM_SHARE, ESTIMATED_FROM_STEPS = 0.05, 100
"""Work that must be done before the remaining time is estimated.

The work is a fraction of all steps (ESTIMATED_FROM_SHARE), or a number of steps (ESTIMATED_FROM_STEPS) if fewer.
"""


class ProgressBar(AbstractContextManager["ProgressBar"]):
    """A progress bar on standard error for as long as the `with` block lasts.

    Where standard error is no terminal, a line is printed every `LINE_INTERVAL` seconds.

    The bar is a `friso.progress.Progress`. Without a total it shows `label` and only moves. If fewer steps are done
    than before, or the total changes, new work has begun, and its time counts from there. The displayed time left never
    rises during one piece of work: slower steps only hold it. A line equal to the previous line is not printed.
    """

    def __init__(self, label: str = "") -> None:
        """Prepare a bar with a label; nothing is shown before the `with` block begins."""
        self.label = label
        self.begun = WORK_CLOCK.now()
        self.done = self.total = self.before = 0
        self.shortest = math.inf  # time left that was shown last [s]
        self.display: Display | None = None
        self.task: TaskID | None = None
        self.ended, self._turn = Event(), Lock()
        self.clock: Thread | None = None
        self._log = logging.getLogger("friso")
        self._level = self._log.level

    def __enter__(self) -> Self:
        """Start the bar, or the thread that prints lines where there is no terminal."""
        if sys.stderr.isatty():
            self.display = _display(self._to_go)
            self.task = self.display.add_task(one_line(self.label), total=None)
            self.display.start()
            self._log.setLevel(logging.INFO)  # a waiting user learns early what is certain
        else:
            self.clock = Thread(target=self._tell, args=(sys.stderr,), daemon=True)
            self.clock.start()
        return self

    def __exit__(self, *error: object) -> None:
        """Stop the bar or the thread, and restore the level of the log."""
        self.ended.set()
        if self.clock is not None:
            self.clock.join()
        if self.display is not None:
            self.display.stop()
            self.display = None
            self._log.setLevel(self._level)

    def __call__(self, done: int, total: int, label: str, /) -> None:
        """Report that `done` of `total` steps are finished; a `total` of 0 means unknown."""
        with self._turn:
            if done < self.done or total != self.total:
                self.begun, self.before, self.shortest = WORK_CLOCK.now(), done, math.inf
            self.done, self.total, self.label = done, total, label
        if self.display is not None and self.task is not None:
            self.display.update(self.task, completed=done, total=total or None, description=one_line(label))

    def line(self) -> str:
        """Return the fraction done, the current label, and the estimated time left."""
        with self._turn:
            share = f"{100 * self.done // self.total} %" if self.total else ""
            return ", ".join(part for part in (share, one_line(self.label) or "working", self._to_go()) if part)

    def _to_go(self) -> str:
        """Return the time left in words; empty until enough is done to estimate it."""
        done = self.done - self.before
        if (
            not self.total
            or done < min(ESTIMATED_FROM_SHARE * (self.total - self.before), ESTIMATED_FROM_STEPS)
            or not done
        ):
            return ""
        estimate = (WORK_CLOCK.now() - self.begun) * (self.total - self.done) / done
        seconds = self.shortest = min(self.shortest, estimate)
        return f"{seconds / 60:.0f} min to go" if seconds >= 100 else f"{seconds:.0f} s to go"

    def _tell(self, stream: TextIO) -> None:
        """Print a line of progress now and then, until the block ends or the stream is closed."""
        before = ("", 0)
        with suppress(OSError, ValueError):
            while not self.ended.wait(LINE_INTERVAL):
                with self._turn:
                    news = self.label, 100 * self.done // max(1, self.total)
                if news != before:
                    print(f"friso: {self.line()}", file=stream, flush=True)
                before = news


def _display(to_go: Callable[[], str]) -> Display:
    """Build the display of the library rich: description, bar, counts, rate and time left."""
    from rich import progress
    from rich.text import Text

    class Rate(progress.ProgressColumn):
        """The column of the progress bar with the steps per second."""

        def render(self, task: progress.Task) -> Text:
            """Write the steps per second, if there is one or more."""
            return Text(f"{task.speed:,.0f}/s" if task.speed and task.speed >= 1 else "")

    class ToGo(progress.ProgressColumn):
        """The column of the progress bar with the estimated time left."""

        def render(self, task: progress.Task) -> Text:
            """Write the time left."""
            return Text(to_go())

    columns = (
        progress.TextColumn("{task.description}", markup=False),
        progress.BarColumn(),
        progress.MofNCompleteColumn(),
        Rate(),
        ToGo(),
    )
    return progress.Progress(*columns, console=console(sys.stderr), transient=True)
