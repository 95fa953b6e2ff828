"""Write files completely or not at all."""

from __future__ import annotations

import os
import re
import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from friso.platform.system import delete_file, name_new_file, replace_file

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
