"""Show the progress of a computation on the terminal."""

from __future__ import annotations

import logging
import math
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from threading import Event, Lock, Thread
from typing import TYPE_CHECKING, Self, TextIO

from friso.cli.terminal import console
from friso.escapes import one_line
from friso.progress import WORK_CLOCK

if TYPE_CHECKING:
    from rich.progress import Progress as Display
    from rich.progress import TaskID

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
