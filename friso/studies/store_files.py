"""Read and write files of a store safely, with the digests of its chunks and its folder.

A store may come from others, so only regular files of the store itself are read, and none larger than friso writes
them.

The digests of the chunks of each block stand in a file per block. They include the study, the block and the variable,
so they detect exchanged chunks, unlike checksums inside the chunks. The file of a block is written last: a block with a
file is complete.

The folder is made elsewhere, moved into place, exchanged and locked. The next process repairs what a killed process
left. Beside a store `a.zarr`, `.a.zarr.<32 digits>` is a store being made, in a folder with its lock. With the suffix
`.old` it is a store being replaced.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
import stat
import uuid
import zipfile
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from glob import escape
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout

from friso.errors import StoreError
from friso.platform.bounded_file import content_of
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
from friso.platform.whole_file import PARTIAL, is_partial, whole_file

MOST_BYTES = 64 << 20
"""Largest file of a store [bytes]: six times the largest chunk, which has incompressible texts."""


MOST_EXPANDED = 1 << 30
"""Most bytes of the arrays in an archive of results.

It limits them because a small archive may claim any size.
"""


def stored(file: Path) -> bytes:
    """Read a file of a store.

    Raises OSError, also for a link, a device, a pipe, or more than MOST_BYTES.
    """
    return content_of(file, MOST_BYTES, follow=False)


def digest_of(file: Path, most: int = MOST_BYTES) -> str | None:
    """Return the SHA-256 of a file, of a store or beside it, or None.

    The result is None if there is no such file, for anything but a regular file, and for more than `most` bytes. Raises
    PermissionError if the file cannot be read, which does not mean that it is damaged.
    """
    try:
        return hashlib.sha256(content_of(file, most, follow=False)).hexdigest()
    except PermissionError:
        raise
    except OSError:
        return None


def kept_arrays(file: Path) -> dict[str, np.ndarray] | None:
    """Return the arrays that `keep_arrays` wrote into a file, or None.

    The result is None if the arrays are missing or damaged. It is also None if they take more than MOST_EXPANDED bytes;
    no array is expanded then.
    """
    try:
        content = stored(file)
        digest, archive = content[:_DIGEST], io.BytesIO(content[_DIGEST:])
        if digest != _digest(file, archive.getvalue()):
            return None
        with zipfile.ZipFile(archive) as members:
            if sum(member.file_size for member in members.infolist()) > MOST_EXPANDED:
                return None
        archive.seek(0)
        with np.load(archive, allow_pickle=False) as arrays:
            return dict(arrays)
    except Exception:  # any error of NumPy in an archive that others gave a valid digest
        return None


def keep_arrays(file: Path, arrays: Mapping[str, Any]) -> None:
    """Store arrays in an archive, behind a digest that detects damage and exchanged files.

    The digest covers the arrays and the name of the file. Raises OSError if the file cannot be written.
    """
    archive = io.BytesIO()
    np.savez_compressed(archive, **arrays)
    content = archive.getvalue()
    file.parent.mkdir(parents=True, exist_ok=True)
    put(file, _digest(file, content) + content)


_DIGEST = hashlib.sha256().digest_size


def _digest(file: Path, content: bytes) -> bytes:
    return hashlib.sha256(f"{file.name}\n".encode() + content).digest()


def put(file: Path, content: bytes) -> None:
    """Write a file of a store completely or not at all, with the user's usual permissions.

    Raises OSError if the file cannot be written.
    """
    with whole_file(file) as stream:
        stream.write(content)


BLOCKS = ".blocks"
"""Folder of a store besides those of its arrays: records of blocks."""

_OF_ARRAY = re.compile(rf"\.z[a-z]+(\.copy)?|[0-9]+(\.[0-9]+)*|.*{re.escape(PARTIAL)}").fullmatch
"""Pattern of names that Zarr gives, of copies of metadata, and of partial files."""


def is_of_store(name: str) -> bool:
    """Tell whether a name within a store is one that friso or Zarr writes."""
    return _OF_ARRAY(name.rpartition("/")[2]) is not None


def refuse_foreign(path: Path, files: Collection[str]) -> None:
    """Refuse a store with entries that Zarr must not read, nor friso write to.

    `files` are its metadata files. Refused are links, devices, pipes, huge files, and files in place of folders or the
    reverse. Raises StoreError for the first such entry.
    """
    folders = {BLOCKS, *(name.partition("/")[0] for name in files if "/" in name)}
    for entry in _entries(path):
        status = entry.stat(follow_symlinks=False)
        name = Path(entry.path).relative_to(path).as_posix()
        remove = "rm"
        if stat.S_ISLNK(status.st_mode):
            actual = "is a link"
        elif stat.S_ISDIR(status.st_mode):
            if name not in files and not (name.rpartition("/")[0] in folders and is_of_store(name)):
                continue
            actual, remove = "is a folder", "rm -r"
        elif not stat.S_ISREG(status.st_mode):
            actual = "is a device or a pipe"
        elif status.st_size > MOST_BYTES:
            actual = f"has {status.st_size / 1e6:.3g} MB"
        elif name in folders:
            actual = "is no folder"
        else:
            continue
        expected = f"files of the store alone, of at most {MOST_BYTES / 1e6:.3g} MB: remove that one"
        raise StoreError(
            "", f"a store whose {name} {actual}", expected, f"{remove} {shell_word(str(path / name))}", str(path)
        )


def _entries(folder: Path | str, levels: int = 2) -> Iterator[os.DirEntry[str]]:
    """Yield the entries of a folder and its subfolders, down to `levels` levels.

    Each folder comes before its content. No link is followed.
    """
    with os.scandir(folder) as entries:
        for entry in entries:
            yield entry
            if levels > 1 and entry.is_dir(follow_symlinks=False):
                yield from _entries(entry.path, levels - 1)


@dataclass(frozen=True)
class Ledger:
    """The records of the blocks of a store at `path`: digests of their chunks.

    The records are for a `study`, by its digest, and its metrics.
    """

    path: Path
    study: str
    metrics: tuple[str, ...]

    def has(self, number: str) -> bool:
        """Tell whether a block, by its `number` as in Zarr, is recorded as written."""
        return self._file(number).exists()

    def entered(self) -> list[str]:
        """Return the numbers of the recorded blocks, as texts, sorted.

        Raises OSError if the folder of records cannot be read.
        """
        return [] if not self._file("").exists() else sorted(file.name for file in self._file("").iterdir())

    def enter(self, number: str) -> None:
        """Record a block after its chunks were written.

        Raises OSError if the record cannot be written.
        """
        self._file(number).parent.mkdir(exist_ok=True)
        put(self._file(number), self._entry(number))

    def is_whole(self, number: str) -> bool:
        """Tell whether a block is recorded, and all of its chunks are unchanged since then.

        Raises PermissionError if the record or a chunk cannot be read.
        """
        try:
            return stored(self._file(number)) == self._entry(number)
        except PermissionError:
            raise
        except OSError:
            return False

    def digest(self, number: str, name: str) -> str | None:
        """Return the recorded digest of a metric's chunk in a block.

        The result is None if the block was not recorded, and "" if the record is damaged or of another study. Raises
        PermissionError if the record cannot be read.
        """
        try:
            entry = json.loads(stored(self._file(number)))
            return entry["sha256"][name] if (entry["study"], entry["block"]) == (self.study, number) else ""
        except PermissionError:
            raise
        except FileNotFoundError:
            return None
        except (OSError, ValueError, LookupError, TypeError, RecursionError):
            return ""

    def _entry(self, number: str) -> bytes:
        digests = {name: digest_of(self.path / name / number) for name in self.metrics}
        return json.dumps({"study": self.study, "block": number, "sha256": digests}, indent=1).encode()

    def _file(self, number: str) -> Path:
        return self.path / BLOCKS / number


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
