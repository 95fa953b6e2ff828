"""Read files that others may have written: only regular ones, and only up to a size."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from friso.platform.system import open_file

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
