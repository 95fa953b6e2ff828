"""Check paths, read files up to a size, write them completely or not at all, and keep files of one user alone.

Names that no operating system accepts are found before use.

Files that others may have written are read only if they are regular ones, and only up to a size.

Private files are those that only this user and root can have written. A folder is checked from the root down: if it
belongs to the user or to root and nobody else may write to it, nobody else can exchange its contents. A file is opened
without following links and checked by its descriptor.
"""

from __future__ import annotations

import os
import re
import shutil
import stat
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from friso.platform.system import (
    closed_to_others,
    delete_file,
    foreign_writers,
    name_new_file,
    name_refused,
    open_file,
    replace_file,
)

LONGEST_NAME = 255
"""Longest name in bytes on Linux, macOS and Windows."""

LONGEST_PATH = 1024
"""Longest path in characters, as on macOS."""

LONGEST_WRITTEN = 200
"""Longest name in bytes of a file or store to be written; its draft has a longer name."""

EXPECTED = f"a path with names of at most {LONGEST_NAME} bytes, and of at most {LONGEST_PATH} characters"


def flaw_of(path: str | os.PathLike[str], longest_name: int = LONGEST_NAME) -> str:
    """Return why a path cannot name a file or a folder; "" if it can.

    Names in the path may have at most `longest_name` bytes.
    """
    text = os.fspath(path)
    if not text:
        return "an empty path"
    if "\0" in text:
        return "a path with a null character in it"
    try:
        longest = max(len(os.fsencode(part)) for part in Path(text).parts or [text])
    except UnicodeEncodeError:
        return "a path with half a character in it"
    if longest > longest_name:
        return f"a path with a name of {longest} bytes"
    if len(text) > LONGEST_PATH:
        return f"a path of {len(text)} characters"
    return ""


def unwritable(path: Path) -> tuple[str, str] | None:
    """Return why nothing can be written to a path, and what is expected instead; None if it can.

    Both are in words. The path may have no name, a name that is too long, or one that Windows does not accept.
    """
    if flaw := flaw_of(path, LONGEST_WRITTEN):
        return flaw, f"names of at most {LONGEST_WRITTEN} bytes"
    if why := name_refused(path):
        return str(path), f"another name: {why}"
    return None


_READING = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


class LargeFileError(OSError):
    """Error: a file of `size` [bytes] exceeds the allowed size."""

    def __init__(self, size: int) -> None:
        super().__init__(f"a file of {size / 1e6:.3g} MB")
        self.size = size


def content_of(path: Path, most: int, follow: bool = True) -> bytes:
    """Return the content of a file of at most `most` bytes; follow a symbolic link if `follow`.

    Raises LargeFileError, or another OSError where the file cannot be read, or is a device, a pipe or a socket.
    """
    flags = _READING if follow else _READING | getattr(os, "O_NOFOLLOW", 0)
    with open(open_file(path, flags), "rb") as file:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):
            raise OSError("a device or a pipe")
        content = b"" if status.st_size > most else file.read(most + 1)
        if (size := max(status.st_size, len(content))) > most:
            raise LargeFileError(size)
        return content


PARTIAL = ".partial"
"""Suffix of files being written, by friso and by Zarr, after 32 digits."""

_PARTIAL = re.compile(rf".*\.[0-9a-f]{{32}}{re.escape(PARTIAL)}")
FOR_ALL, FOR_USER = 0o666, 0o600


@contextmanager
def whole_file(path: Path, mode: int = FOR_ALL, new: bool = False, kept: bool = False) -> Iterator[BinaryIO]:
    """Return a stream whose content replaces a file when the `with` block ends.

    If the block fails, nothing is left. With `mode` FOR_ALL, a new file is readable for everyone whom the user's
    settings allow, with `FOR_USER` for this user alone; the permissions of a replaced file may be `kept`. Raises
    OSError, and FileExistsError if the file has to be `new` and something is there by then.
    """
    draft = path.with_name(f"{path.name}.{uuid.uuid4().hex}{PARTIAL}")
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    try:
        with open(os.open(draft, flags, mode), "wb") as stream:
            if kept and path.exists():
                shutil.copymode(path, draft)
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        (name_new_file if new else replace_file)(draft, path)
    except BaseException:
        with suppress(OSError):  # the first error is the one to report
            delete_file(draft)
        raise


def is_partial(file: Path) -> bool:
    """Tell by its name whether a file was still being written."""
    return _PARTIAL.fullmatch(file.name) is not None


def make_private(folder: Path) -> None:
    """Make a folder for this user alone, with missing parents.

    A folder of the user is closed to others. Raises PermissionError if another user could exchange the folder, or a
    parent: if it belongs to another user, others may write to it, or it is a symbolic link. Raises OSError if it cannot
    be made.
    """
    folder = folder.absolute()
    for path in [*reversed(folder.parents), folder]:
        if not os.path.lexists(path):  # for the root folder some systems report another error than that it exists
            with suppress(FileExistsError):
                path.mkdir(mode=0o700)
        status = path.lstat()
        if stat.S_ISLNK(status.st_mode) and path.parent == Path(path.anchor):
            status = path.stat()  # links of the system itself, as /var on macOS
        if stat.S_ISLNK(status.st_mode):
            raise PermissionError(f"{path} is a symbolic link")
        if not stat.S_ISDIR(status.st_mode):
            raise NotADirectoryError(20, "Not a directory", str(path))
        if path == folder:
            status = closed_to_others(path)
        if why := foreign_writers(status):
            raise PermissionError(f"{path} {why}")


def read_private(path: Path) -> bytes:
    """Read a private file.

    Raises PermissionError if another user can have written it, OSError if it cannot be read.
    """
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    with open(open_file(path, flags), "rb") as file:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):
            raise PermissionError(f"{path} is no file")
        if why := foreign_writers(status):
            raise PermissionError(f"{path} {why}")
        return file.read()


def write_private(path: Path, content: bytes) -> None:
    """Write a file for this user alone, completely or not at all.

    Raises OSError if the file cannot be written.
    """
    with whole_file(path, FOR_USER) as file:
        file.write(content)
