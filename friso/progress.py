"""How long work reports its progress: one signature, for studies and analyses."""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    """Called with the steps done, the steps in all (0: not known), and what is being done now."""

    def __call__(self, done: int, total: int, what: str, /) -> None: ...


def silent(done: int, total: int, what: str) -> None:
    """The progress that nobody watches."""


class Tally:
    """Counts the steps of work that is done in pieces, and reports each to a progress."""

    def __init__(self, progress: Progress, total: int) -> None:
        self.progress, self.total, self.done = progress, total, 0

    def add(self, steps: int, what: str) -> None:
        """So many more steps are done; `what` is being done now."""
        self.done += steps
        self.progress(self.done, self.total, what)
