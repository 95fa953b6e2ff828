"""Read and write files that only this user and root can have written.

A folder is checked from the root down: if it belongs to the user or to root and nobody else may write to it, nobody
else can exchange its contents. A file is opened without following links and checked by its descriptor.
"""

from __future__ import annotations

import os
import stat
from contextlib import suppress
from pathlib import Path

from friso.platform.system import closed_to_others, foreign_writers, open_file
from friso.platform.whole_file import FOR_USER, whole_file


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
