"""Folders that a process keeps locked, by a file in them, for as long as it uses them: one whose process was killed is
a leftover."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout


def is_leftover(folder: Path, lock: str) -> bool:
    """Whether nobody holds the file called `lock` in a folder, which is no link to one."""
    with _unless_locked(folder, lock) as free:
        return free


def remove_leftover(folder: Path, lock: str) -> None:
    """Remove a folder with all that is in it, as far as this user may, if it is a leftover."""
    with _unless_locked(folder, lock) as free:
        if free:
            shutil.rmtree(folder, ignore_errors=True)
    if free and folder.exists():  # Windows deletes no file that is open, such as the lock
        with suppress(OSError):
            (folder / lock).unlink(missing_ok=True)
            folder.rmdir()


@contextmanager
def _unless_locked(folder: Path, lock: str) -> Iterator[bool]:
    """Whether nobody else held the lock of a folder, which is held within."""
    try:
        if folder.is_symlink():
            raise NotADirectoryError(folder)
        held = FileLock(folder / lock)
        held.acquire(timeout=0)
    except (OSError, Timeout):
        yield False
        return
    try:
        yield True
    finally:
        held.release()
