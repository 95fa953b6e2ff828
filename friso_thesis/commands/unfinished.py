"""Continue long work where it was interrupted, and say what is left."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Protocol

from friso.cli.terminal import say
from friso.platform.interrupts import hold_interrupts


class UnfinishedWork(Protocol):
    """Results of long work, kept in a folder until all of it is done."""

    @property
    def folder(self) -> Path | None: ...

    @property
    def count(self) -> int:
        """Return the number of pieces kept."""
        ...

    def clear(self) -> None:
        """Delete all pieces."""


@contextmanager
def kept_until_done(work: UnfinishedWork, piece: str, pieces: str) -> Iterator[None]:
    """Keep finished pieces of work within the block, so that the same command can resume.

    `piece` and `pieces` are the word for them in a message. If no piece is finished, no folder is left.
    """
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
                    with suppress(OSError):  # other files in the folder stay
                        folder.rmdir()
        raise
    work.clear()
