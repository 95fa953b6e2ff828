"""Read and write the files of a store safely: its folder, and a record of each block.

A store may come from others, so only regular files of the store itself are read, and none larger than friso writes
them.

The record of a block has a checksum of each of its chunks, which begins with the store's checksum, the variable and the
block. So it detects exchanged chunks, too, unlike Zarr's own at the end of each chunk. It is written last: a block with
a record is done.

The folder is made elsewhere, moved into place, exchanged and locked. The next process repairs what a killed process
left. Beside a store `a.zarr`, `.a.zarr.<32 digits>` is a store being made, in a folder with its lock. With the suffix
`.old` it is a store being replaced.
"""

from __future__ import annotations

import os
import re
import uuid
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from glob import escape
from pathlib import Path

from filelock import FileLock, Timeout
from pydantic import TypeAdapter

from friso.errors import StoreError
from friso.platform.files import PARTIAL, content_of, is_partial, whole_file
from friso.platform.interrupts import hold_interrupts
from friso.platform.leftovers import is_leftover, remove_leftover
from friso.platform.system import (
    DRAFT_MODE,
    MOVES_OPEN_FOLDERS,
    cause_of,
    delete_file,
    remove_folder,
    rename_folder,
    shell_word,
)

MOST_BYTES = 64 << 20
"""Largest file of a store [bytes]: six times the largest chunk, which has incompressible texts."""


def stored(file: Path) -> bytes:
    """Read a file of a store.

    Raises OSError, also for a link, a device, a pipe, or more than MOST_BYTES.
    """
    return content_of(file, MOST_BYTES, follow=False)


OWN = ".friso"
"""Folder of a store with the records of its blocks and its lock; for Zarr an empty group."""

LOCK = f"{OWN}/lock"
"""File that is locked while a store is written to."""

DESCRIPTION, CHUNK = "zarr.json", "c."
"""Name of Zarr's description of a group or an array, and what the names of chunks begin with."""

_NAMES = re.compile(rf"zarr\.json|(c\.)?[0-9.]+|(\.friso\.)?lock|\.z[a-z]+(\.copy)?|.*{re.escape(PARTIAL)}")
"""Pattern of names of files of stores, also those of friso 0.3, and of partial files."""


def is_store(path: Path) -> bool:
    """Tell whether a version of friso made the folder as a store, damaged or not."""
    return (path / OWN).is_dir() or is_old_store(path)


def is_old_store(path: Path) -> bool:
    """Tell whether friso 0.3 or earlier made the folder as a store."""
    return any(all(_mentions(path / name, words) for words in _OLD_WORDS) for name in (".zmetadata", ".zattrs"))


_OLD_WORDS = b'"equations"', b'"friso"'
"""Texts that occur together only in the descriptions of stores."""


def _mentions(file: Path, words: bytes) -> bool:
    """Tell whether a file can be read and contains these words."""
    try:
        return words in stored(file)
    except OSError:
        return False


def strangers(path: Path) -> list[Path]:
    """Return what is in the store at `path` besides friso's files: other names, links, and folders in folders."""
    return [
        item
        for folder in (path, *(part for part in path.iterdir() if part.is_dir() and not part.is_symlink()))
        for item in sorted(folder.iterdir())
        if item.is_symlink()
        or (folder != path if item.is_dir() else not (item.is_file() and _NAMES.fullmatch(item.name)))
    ]


@dataclass(frozen=True)
class Records:
    """The records of the blocks of the store at `path`; `checksum` is the store's."""

    path: Path
    checksum: int

    def file(self, number: str) -> Path:
        """Return the file of a block's record, by its number as in Zarr."""
        return self.path / OWN / number

    def chunk(self, name: str, number: str) -> bytes | None:
        """Return the chunk of a variable in a block; None if the block is not done.

        Raises ValueError if it differs from what was recorded or is lost, and another OSError if it cannot be read.
        """
        try:
            record = _RECORD.validate_json(stored(self.file(number)))
        except FileNotFoundError:
            return None
        try:
            content = stored(self._chunk(name, number))
        except FileNotFoundError:
            raise ValueError("lost") from None
        if record.get(name) != self._sum(name, number, content):
            raise ValueError("not what was recorded")
        return content

    def is_whole(self, number: str, names: Iterable[str]) -> bool:
        """Tell whether a block is done, and all of its chunks are as recorded.

        Raises PermissionError if one cannot be read.
        """
        try:
            return all(self.chunk(name, number) is not None for name in names)
        except PermissionError:
            raise
        except (OSError, ValueError):
            return False

    def enter(self, number: str, names: Iterable[str]) -> None:
        """Record a block after its chunks were written. Raises OSError if that fails."""
        sums = {name: self._sum(name, number, stored(self._chunk(name, number))) for name in names}
        with whole_file(self.file(number)) as stream:
            stream.write(_RECORD.dump_json(sums))

    def _chunk(self, name: str, number: str) -> Path:
        return self.path / name / f"{CHUNK}{number}"

    def _sum(self, name: str, number: str, content: bytes) -> int:
        return zlib.crc32(content, zlib.crc32(f"{self.checksum} {name} {number}".encode()))


_RECORD = TypeAdapter(dict[str, int])

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
    if others := [item.relative_to(path).as_posix() for item in strangers(path)]:
        more = f" and {len(others) - 1} more" if len(others) > 1 else ""
        actual = f"a store with {others[0]}{more} in it, which friso did not write"
        raise StoreError("", actual, "nothing else in it: move that away, or another --out", origin=str(path))


def refuse_links(path: Path) -> None:
    """Refuse to write into a store with links in it, which may lead to files of others. Raises StoreError."""
    for item in strangers(path):
        if item.is_symlink():
            name = item.relative_to(path).as_posix()
            raise StoreError(
                "", f"a store whose {name} is a link", "no links in it", f"rm {shell_word(str(item))}", str(path)
            )


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
def lock_store(path: Path) -> Iterator[FileLock]:
    """Lock the store at `path` against other processes; yield the lock.

    Raises StoreError if another one has it, ReadOnlyStoreError if nothing can be written.
    """
    lock = FileLock(path / LOCK)
    try:
        lock.acquire(timeout=0)
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
