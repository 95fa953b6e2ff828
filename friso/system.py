"""What differs between operating systems: Linux, macOS and Windows."""

import os
import stat
import sys
from pathlib import Path

if sys.platform == "win32":

    def check_private(folder: Path) -> None:
        """Nothing to check: folders below a user's profile are the user's own by their access lists, which a mode
        does not tell."""

else:

    def check_private(folder: Path) -> None:
        """Close a folder to other users. Raises PermissionError where it belongs to one of them."""
        status = folder.stat()
        if status.st_uid != os.geteuid():
            raise PermissionError(f"{folder} belongs to another user")
        if stat.S_IMODE(status.st_mode) != 0o700:
            folder.chmod(0o700)


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
