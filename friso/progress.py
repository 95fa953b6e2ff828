"""Report the progress of long work: one signature for all studies and analyses."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock
from typing import Protocol


class Progress(Protocol):
    """Function called with the steps done, all steps (0: unknown), and a label of the current work."""

    def __call__(self, done: int, total: int, label: str, /) -> None: ...


class _Silent:
    """Progress without display."""

    def __call__(self, done: int, total: int, label: str, /) -> None:
        pass

    def __repr__(self) -> str:
        return "silent"

    def __reduce__(self) -> str:
        return "silent"  # the one there is, in other processes too


silent = _Silent()


def share_of(progress: Progress, number: int, count: int) -> Progress:
    """Return the progress of one of `count` equal pieces of work, within the progress of all.

    `number` counts the pieces from 0.
    """

    def report(done: int, total: int, label: str, /) -> None:
        progress(
            STEPS_OF_A_PIECE * number + (STEPS_OF_A_PIECE * done // total if total else 0),
            STEPS_OF_A_PIECE * count,
            label,
        )

    return report


def between(progress: Progress, first: float, last: float, label: str = "") -> Progress:
    """Return the progress of a piece of work from `first` to `last`, fractions of all work.

    A `label` replaces the labels of the piece.
    """

    def report(done: int, total: int, piece: str, /) -> None:
        share = first + (last - first) * (done / total if total else 0.0)
        progress(round(FINE_STEPS * share), FINE_STEPS, label or piece)

    return report


STEPS_OF_A_PIECE, FINE_STEPS = 100, 1000
"""Steps into which one of several equal pieces, and a piece of its own size, are divided."""


class Tally:
    """Counts the steps of work that is done in pieces, and reports each to a progress."""

    def __init__(self, progress: Progress, total: int) -> None:
        self.progress, self.total, self.done = progress, total, 0
        self._turn = Lock()

    def add(self, steps: int, label: str) -> None:
        """Count more steps as done; `label` says what is being done now.

        Several threads may call it.
        """
        with self._turn:
            self.done += steps
            self.progress(self.done, self.total, label)


def together(progress: Progress, count: int) -> list[Progress]:
    """Return the progresses of `count` equal pieces of work that run in parallel."""
    tally = Tally(progress, STEPS_OF_A_PIECE * count)

    def piece() -> Progress:
        before = 0

        def report(done: int, total: int, label: str, /) -> None:
            nonlocal before
            now = STEPS_OF_A_PIECE * done // total if total else 0
            tally.add(now - before, label)
            before = now

        return report

    return [piece() for _ in range(count)]


class WorkClock:
    """A clock of work in seconds that can be stopped.

    It is stopped during one-off work, such as compiling, which says nothing about the remaining time.
    """

    def __init__(self) -> None:
        self._stood = self._since = 0.0
        self._reasons = 0
        self._turn = Lock()

    def now(self) -> float:
        """Return the time [s] since an arbitrary origin."""
        with self._turn:
            return (self._since if self._reasons else time.monotonic()) - self._stood

    @contextmanager
    def stands(self) -> Iterator[None]:
        """Stop the clock in the `with` block. Several threads may stop it at once."""
        with self._turn:
            if not self._reasons:
                self._since = time.monotonic()
            self._reasons += 1
        try:
            yield
        finally:
            with self._turn:
                self._reasons -= 1
                if not self._reasons:
                    self._stood += time.monotonic() - self._since


WORK_CLOCK = WorkClock()
"""The clock of the work of this process."""
