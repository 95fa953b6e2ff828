"""What differs between operating systems: Linux, macOS and Windows."""

import os
import signal
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

if sys.platform == "win32":

    @contextmanager
    def interrupts_held() -> Iterator[None]:
        """Nothing: a process does not pass on that Ctrl-C is held back."""
        yield

    def foreign_writers(status: os.stat_result) -> str:
        """Nobody: what is below a user's profile is the user's own by its access lists, which a mode does not tell."""
        return ""

    def is_open_to_others(status: os.stat_result) -> bool:
        """No: see `foreign_writers`."""
        return False

    def closed_to_others(folder: Path) -> os.stat_result:
        """The status of a folder, as it is: see `foreign_writers`."""
        return folder.lstat()

else:

    @contextmanager
    def interrupts_held() -> Iterator[None]:
        """Ctrl-C waits; processes started meanwhile never see it."""
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def foreign_writers(status: os.stat_result) -> str:
        """Who else than this user and root may write to a file, or exchange what this user has in a folder, in words;
        "" for nobody. In a folder with the sticky bit (/tmp) everybody may exchange but what is their own."""
        if status.st_uid not in (0, os.geteuid()):
            return "belongs to another user"
        sticky = stat.S_ISDIR(status.st_mode) and status.st_mode & stat.S_ISVTX
        if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH) and not sticky:
            return "can be written by other users"
        return ""

    def is_open_to_others(status: os.stat_result) -> bool:
        """Whether others than this user may read a file, or write to it."""
        return bool(status.st_mode & 0o077)

    def closed_to_others(folder: Path) -> os.stat_result:
        """The status of a folder, once nobody else may look into it if it is the user's own; another's is left as it
        is."""
        status = folder.lstat()
        if status.st_uid == os.geteuid() and stat.S_IMODE(status.st_mode) != 0o700:
            folder.chmod(0o700)
            return folder.lstat()
        return status


if sys.platform == "linux":

    def usable_cores() -> int:
        """Number of processor cores that this process may use."""
        return len(os.sched_getaffinity(0))

else:

    def usable_cores() -> int:
        """Number of processor cores; neither macOS nor Windows confines a process to some of them by default."""
        return os.cpu_count() or 1


LIMITS_MEMORY = sys.platform == "linux"
"""Whether a process can be held to an amount of memory: Windows has no such limit, and macOS does not keep it."""
