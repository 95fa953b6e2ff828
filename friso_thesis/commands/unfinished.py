"""Long work that goes on where it was interrupted: what is said of it, and what is left of it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Protocol

from friso.cli.common import say
from friso.platform.interrupts import hold_interrupts


class UnfinishedWork(Protocol):
    """Results of long work, kept in a folder until all of it is done."""

    @property
    def folder(self) -> Path | None: ...

    @property
    def count(self) -> int:
        """Return how many pieces are kept."""
        ...

    def clear(self) -> None:
        """Forget them."""


@contextmanager
def kept_until_done(work: UnfinishedWork, piece: str, pieces: str) -> Iterator[None]:
    """Within, finished `pieces` are kept, from which the same command resumes; where none is finished, no folder is
    left."""
    assert work.folder is not None
    missing = [folder for folder in (work.folder, *work.folder.parents) if not folder.exists()]
    try:
        yield
    except BaseException as error:
        if work.count and isinstance(error, KeyboardInterrupt):
            kept = f"1 {piece} is" if work.count == 1 else f"{work.count} {pieces} are"
            say(f"{kept} kept in {work.folder}; the same command resumes from there")
        elif not work.count and missing:
            with hold_interrupts():
                work.clear()
                for folder in missing:
                    with suppress(OSError):  # what others put there stays
                        folder.rmdir()
        raise
    work.clear()
