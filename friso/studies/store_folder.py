"""Manage the folder of a store: make it elsewhere, move it into place, exchange it, lock it.

The next process repairs what a killed process left. Beside a store `a.zarr`, `.a.zarr.<32 digits>` is a store being
made, in a folder with its lock. With the suffix `.old` it is a store being replaced.
"""

from __future__ import annotations

import os
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from glob import escape
from pathlib import Path

from filelock import FileLock, Timeout

from friso.errors import StoreError
from friso.platform.interrupts import hold_interrupts
from friso.platform.leftovers import is_leftover, remove_leftover
from friso.platform.system import DRAFT_MODE, MOVES_OPEN_FOLDERS, cause_of, delete_file, remove_folder, rename_folder
from friso.platform.whole_file import PARTIAL, is_partial
from friso.studies.store_files import is_of_store

LOCK = ".friso.lock"
"""Name of the file that is locked while a store is written to."""

_OLD = ".old"

_DIGITS = "[0-9a-f]" * 32


class ReadOnlyStoreError(StoreError):
    """Error: a store cannot be written."""


def where_links_lead(path: Path) -> Path:
    """Return the real place of the store at `path`, following links.

    Files are made and replaced there. Raises StoreError for a link that leads nowhere, such as to a missing disk.
    """
    if path.is_symlink() and not path.exists():
        actual = f"a link to {os.path.realpath(path)}, where nothing is"
        raise StoreError("", actual, "a store, or a new name", "--out study.zarr", str(path))
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def make(path: Path, fill: Callable[[Path], object]) -> None:
    """Create the folder `path`, complete or not at all.

    `fill` writes the content into a temporary folder beside it, which is then renamed to `path`. If another process has
    created `path` meanwhile, that folder stays. Raises OSError, and then leaves nothing behind.
    """
    remove_leftovers(path)
    with _made_aside(path, fill) as new:
        try:
            rename_folder(new, path)
        except OSError:
            if not path.exists():
                raise  # otherwise another process was quicker, and its study is checked later


def refuse_others_files(path: Path) -> None:
    """Refuse to replace a store whose folder has other files, which would be deleted with it.

    Raises StoreError, which names the first file that friso did not write.
    """
    others = []
    for item in sorted(path.iterdir()):
        if item.is_dir() and not item.is_symlink():
            names = {f"{item.name}/{part.name}": part for part in sorted(item.iterdir())}
            others += [name for name, part in names.items() if part.is_dir() or not is_of_store(name)]
        elif item.is_file() and not (is_of_store(item.name) or item.name == LOCK):
            others.append(item.name)
    if others:
        more = f" and {len(others) - 1} more" if len(others) > 1 else ""
        actual = f"a store with {others[0]}{more} in it, which friso did not write"
        raise StoreError("", actual, "nothing else in it: move that away, or another --out", origin=str(path))


def exchange(path: Path, fill: Callable[[Path], object], lock: FileLock) -> None:
    """Replace the store at `path` by one that `fill` writes.

    `lock` holds the old store, which is deleted once the new one is in place. Raises OSError, with the old store
    unchanged. Ctrl-C waits until one of the two is in place.
    """
    with _made_aside(path, fill) as new, hold_interrupts():
        old = _free_name(path, _OLD)
        if not MOVES_OPEN_FOLDERS:
            lock.release()  # a process that takes the lock now prevents the renaming
        rename_folder(path, old)
        try:
            rename_folder(new, path)
        except BaseException:
            rename_folder(old, path)
            raise
    remove_folder(old)


def remove_leftovers(path: Path) -> None:
    """Remove what killed processes left beside the store at `path`.

    A store that was being replaced is put back. Leftovers are recognised by locks that nobody holds. Raises OSError if
    a store cannot be put back.
    """
    path = Path(os.path.realpath(path))
    for old in path.parent.glob(f".{escape(path.name)}.{_DIGITS}{_OLD}"):
        if path.exists():
            remove_leftover(old, LOCK)
        elif is_leftover(old, LOCK):
            with suppress(FileNotFoundError):  # another process was quicker
                rename_folder(old, path)
    for draft in path.parent.glob(f".{escape(path.name)}.{_DIGITS}"):
        remove_leftover(draft, LOCK)


def remove_partial_files(path: Path) -> None:
    """Remove files that a killed process wrote only in part, from a locked store.

    No other process writes meanwhile, since every writer holds the lock.
    """
    for file in (*path.glob(f"*{PARTIAL}"), *path.glob(f"*/*{PARTIAL}")):
        if is_partial(file) and file.is_file():
            delete_file(file)


@contextmanager
def lock_store(path: Path, patience: float = 0.0) -> Iterator[FileLock]:
    """Lock the store at `path` against other processes; yield the lock.

    Raises StoreError if another one still has it after `patience` [s], ReadOnlyStoreError if nothing can be written.
    """
    lock = FileLock(path / LOCK)
    try:
        lock.acquire(timeout=patience)
    except Timeout:
        expected = "to wait, or another --out"
        raise StoreError("", "a store that another friso is writing to", expected, origin=str(path)) from None
    except OSError as error:
        expected = f"a copy of it that can be written to ({cause_of(error)})"
        raise ReadOnlyStoreError("", "a store that cannot be written to", expected, origin=str(path)) from None
    try:
        yield lock
    finally:
        lock.release()


@contextmanager
def _made_aside(path: Path, fill: Callable[[Path], object]) -> Iterator[Path]:
    """Yield the folder that `fill` has written, to be moved away.

    Ctrl-C waits until it is written: otherwise the threads of Zarr would write on into a deleted folder.
    """
    draft = _free_name(path)
    try:
        draft.mkdir(mode=DRAFT_MODE, parents=True)
        with FileLock(draft / LOCK):  # the lock shows that this is no leftover
            new = draft / "store"
            with hold_interrupts():
                fill(new)
            yield new
    finally:
        remove_folder(draft)


def _free_name(path: Path, suffix: str = "") -> Path:
    """Return an unused, hidden path beside a store's `path`, which ends in `suffix`."""
    return path.with_name(f".{path.name}.{uuid.uuid4().hex}{suffix}")
