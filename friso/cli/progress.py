"""The progress bar on the terminal."""

from __future__ import annotations

import math
import sys
import time
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Self

from friso.cli.terminal import console
from friso.escapes import one_line

if TYPE_CHECKING:
    from rich.progress import Progress as Display
    from rich.progress import TaskID


class ProgressBar(AbstractContextManager["ProgressBar"]):
    """A bar on standard error for as long as the `with` block lasts; where that is no terminal, a line every so many
    seconds (`lines`), by default never.

    It is a `friso.progress.Progress`; before its first call, and without a total, it shows `what` and only moves.
    Where fewer steps are done than before, other work has begun, and its time counts from there.
    """

    def __init__(self, label: str = "", lines: float = math.inf) -> None:
        self.label, self.lines = label, lines
        self.begun = self.last = time.monotonic()
        self.done = self.before = 0
        self.display: Display | None = None
        self.task: TaskID | None = None

    def __enter__(self) -> Self:
        if sys.stderr.isatty():
            self.display = _display()
            self.task = self.display.add_task(one_line(self.label), total=None)
            self.display.start()
        return self

    def __exit__(self, *error: object) -> None:
        if self.display is not None:
            self.display.stop()
            self.display = None

    def __call__(self, done: int, total: int, label: str, /) -> None:
        if done < self.done:
            self.begun, self.before = time.monotonic(), done
        self.done = done
        if self.display is not None and self.task is not None:
            self.display.update(self.task, completed=done, total=total or None, description=one_line(label))
        elif time.monotonic() - self.last > self.lines:
            self.last = time.monotonic()
            share = f"{100 * done // total} %, " if total else ""
            print(f"friso: {share}{one_line(label)}{self._to_go(done, total)}", file=sys.stderr, flush=True)

    def _to_go(self, done: int, total: int) -> str:
        """The time that the rest takes, if it goes on as so far."""
        if not total or done == self.before:
            return ""
        seconds = (self.last - self.begun) * (total - done) / (done - self.before)
        return f", {seconds / 60:.0f} min to go" if seconds >= 100 else f", {seconds:.0f} s to go"


def _display() -> Display:
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        Task,
        TextColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class Rate(ProgressColumn):
        """Steps per second, where they are many."""

        def render(self, task: Task) -> Text:
            return Text(f"{task.speed:,.0f}/s" if task.speed and task.speed >= 1 else "")

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        Rate(),
        TimeRemainingColumn(),
    )
    return Progress(*columns, console=console(sys.stderr), transient=True)
