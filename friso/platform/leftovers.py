"""Manage folders that a process keeps locked while it uses them.

The lock is a file in the folder. The folder of a process that was killed is a leftover.
"""

from __future__ import annotations

import errno
import shutil
import stat
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from friso.platform.system import DRAFT_MODE, MOVES_OPEN_FOLDERS, foreign_writers, is_users_own, remove_folder

MOST_TRIES = 3


@contextmanager
def locked_folder(root: Path, prefix: str, lock: str) -> Iterator[Path]:
    """Make a new, locked folder that only this user may open; remove it in the end.

    The folder lies in `root`, and its name begins with `prefix`. The file `lock` in it is held, which shows that the
    folder is no leftover. Leftovers of killed processes are removed first. Raises OSError if no folder can be made and
    locked.
    """
    remove_leftovers(root, prefix, lock)
    folder, held = _made_and_locked(root, prefix, lock, MOST_TRIES)
    try:
        yield folder
    finally:
        held.release()
        remove_folder(folder)


def temporary_folder(prefix: str) -> AbstractContextManager[Path]:
    """Make a temporary folder, named by a prefix, where the system keeps temporary files."""
    return locked_folder(Path(tempfile.gettempdir()), prefix, "lock")


def _made_and_locked(root: Path, prefix: str, lock: str, tries: int) -> tuple[Path, FileLock]:
    """Return a new folder in `root`, whose name begins with `prefix`, and its lock.

    Before the lock is held, another process may remove the folder, and filelock makes it again, readable for others, or
    fails because it is removed once more. Then another folder is tried.
    """
    folder = root / f"{prefix}{uuid.uuid4().hex[:12]}"
    folder.mkdir(mode=DRAFT_MODE)  # mkdtemp tries for ever if Windows allows no folder (python/cpython#66305)
    held = FileLock(folder / lock)
    try:
        made = folder.lstat()
        held.acquire()
        now = folder.lstat()
        # an inode may be used again, or change on a network
        if (now.st_mode, now.st_uid) != (made.st_mode, made.st_uid):
            raise FileNotFoundError(errno.ENOENT, "another process removed it", str(folder))
        return folder, held
    except BaseException as error:
        held.release()
        remove_folder(folder)
        if isinstance(error, (FileNotFoundError, FileExistsError)) and tries > 1:
            return _made_and_locked(root, prefix, lock, tries - 1)
        raise


def is_leftover(folder: Path, lock: str) -> bool:
    """Tell whether nobody holds the file `lock` in a folder.

    The folder must not be a link.
    """
    with _unless_locked(folder, lock) as free:
        return free


def remove_leftover(folder: Path, lock: str) -> None:
    """Remove a folder with all its content, as far as this user may, if it is a leftover.

    A leftover is a folder of which nobody holds the file `lock`.
    """
    with _unless_locked(folder, lock) as free:
        if free:
            shutil.rmtree(folder, ignore_errors=True)
    if free and not MOVES_OPEN_FOLDERS:  # an open file, such as the lock, kept its folder
        shutil.rmtree(folder, ignore_errors=True)


def remove_leftovers(root: Path, prefix: str, lock: str) -> None:
    """Remove this user's leftover folders below `root` whose names begin with a prefix.

    A folder that others may write to stays, because they may have put a link there as a lock.
    """
    for folder in root.glob(f"{prefix}*"):
        with suppress(OSError):  # another process was quicker
            if not foreign_writers(folder.lstat()):
                remove_leftover(folder, lock)


@contextmanager
def _unless_locked(folder: Path, lock: str) -> Iterator[bool]:
    """Hold the lock of a folder within the block, and tell whether it was free.

    A folder of another user, or a link, counts as locked.
    """
    try:
        status = folder.lstat()
        if not (stat.S_ISDIR(status.st_mode) and is_users_own(status)):
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
