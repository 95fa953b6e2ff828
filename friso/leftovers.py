"""Folders that a process keeps locked, by a file in them, for as long as it uses them: one whose process was killed is
a leftover."""

from __future__ import annotations

import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from friso.system import foreign_writers


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


def remove_leftovers(root: Path, prefix: str, lock: str) -> None:
    """Remove the leftovers of this user among the folders below `root` whose names begin with a prefix; what others put
    there, to have a lock made in a folder of this user, stays."""
    for folder in root.glob(f"{prefix}*"):
        try:
            status = folder.lstat()
        except OSError:  # another process was quicker
            continue
        if stat.S_ISDIR(status.st_mode) and not foreign_writers(status):
            remove_leftover(folder, lock)


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
