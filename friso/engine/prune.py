"""Delete compiled code that has not been used for long."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, Timeout

from friso.engine.cache import ENTRY, REQUEST, SECONDS_OF_A_DAY, entry_lock, logger
from friso.engine.settings import build_settings
from friso.platform.whole_file import PARTIAL


def prune(folder: Path) -> None:
    """Delete compiled code that has not been used for long, and leftovers of killed processes.

    If the folder is still too large, the code unused for longest goes next. Files that another process is writing stay.
    """
    try:
        with FileLock(folder / "prune.lock", blocking=False, mode=0o600):
            size, now = 0, time.time()
            for used, file, length in sorted(_used(folder), reverse=True):
                size += length
                age = now - used
                unfinished = file.suffix == PARTIAL and age > SECONDS_OF_A_DAY
                if (
                    unfinished
                    or age > build_settings.kept_time
                    or (age > SECONDS_OF_A_DAY and size > build_settings.kept_size)
                ):
                    _delete(file)
    except (Timeout, OSError) as error:  # another process is pruning, too
        logger.debug("old kernels are left: %s", error)


def _used(folder: Path) -> Iterator[tuple[float, Path, int]]:
    """Yield each entry, request and draft: time of its last use [s], path, and size [bytes]."""
    for file in folder.iterdir():
        if file.suffix in (ENTRY, REQUEST, PARTIAL):
            status = file.lstat()
            yield status.st_mtime, file, status.st_size


def _delete(file: Path) -> None:
    try:
        with entry_lock(file).acquire(blocking=False):
            file.unlink()
    except (Timeout, PermissionError):  # it is in use
        return
