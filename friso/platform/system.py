"""Hide the differences between operating systems: Linux, macOS and Windows."""

import errno
import math
import os
import re
import shlex
import shutil
import signal
import stat
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, partial
from pathlib import Path, PureWindowsPath
from types import FrameType
from typing import TypeVar

_T = TypeVar("_T")

OPEN_FILE_WAIT = 2.0
"""Time [s] to wait for a file that another program holds open.

Virus scanners and indexers open every new file."""


def _quoted(word: str) -> str:
    """Quote a word of a command; in KEY=VALUE, only the value is quoted."""
    return re.sub(r"([\w.]+=)?(.*)", r'\1"\2"', word, count=1, flags=re.DOTALL)


def path_of(error: OSError) -> str:
    """Return the path at which an error arose, "" for none.

    If there are two paths, it is the one to be written.
    """
    return next(iter(_paths_of(error)), "")


def _paths_of(error: OSError) -> list[str]:
    paths = (error.filename2, error.filename)
    return [os.fsdecode(path) for path in paths if path and isinstance(path, str | bytes | os.PathLike)]


if sys.platform == "win32":
    import _thread
    import ctypes

    _DEVICES = {
        *("CON", "PRN", "AUX", "NUL", "CONIN$", "CONOUT$"),
        *(f"{port}{number}" for port in ("COM", "LPT") for number in "123456789¹²³"),
    }

    _REFUSED = {*'<>:"|?*', *map(chr, range(32))}
    """Characters that no file name may have on Windows.

    A colon would make a hidden stream of a file, or an error."""

    _LONGEST = 247
    """Longest path of a folder that every Windows accepts; a file may have twelve characters more."""

    @contextmanager
    def interrupts_held() -> Iterator[None]:
        """Ignore Ctrl-C in the `with` block; processes started within ignore it for good."""
        console = ctypes.WinDLL("kernel32")
        console.SetConsoleCtrlHandler(None, True)
        try:
            yield
        finally:
            console.SetConsoleCtrlHandler(None, False)

    def signal_later(seconds: float, handler: Callable[[int, FrameType | None], object]) -> None:
        """Call a handler of SIGINT in the main thread after some time [s]."""
        timer = threading.Timer(seconds, _thread.interrupt_main, (signal.SIGINT,))
        timer.daemon = True
        timer.start()

    def no_signal_later() -> None:
        """Do nothing: on this system the timer ends with the process."""

    def signals_told() -> int:
        """Return a descriptor from which the numbers of signals can be read, a byte each."""
        outlet, inlet = os.pipe()
        signal.set_wakeup_fd(inlet, warn_on_full_buffer=False)
        return outlet

    def _may_be_held(error: OSError) -> bool:
        """Tell whether another program may hold a file that was refused.

        Windows gives one reason for files in use and for files without permission. A file that is deleted while another
        program reads it stays in its folder until it is closed.
        """
        refused = isinstance(error, PermissionError) and any(os.path.exists(path) for path in _paths_of(error))
        return refused or error.errno == errno.ENOTEMPTY

    def check_free(path: Path) -> None:
        """Raise OSError if a file cannot be replaced.

        That is so if the file is read-only, or if another program holds it open.
        """
        if not os.access(path, os.W_OK):
            raise OSError(errno.EROFS, "it is read-only", str(path))
        with suppress(FileExistsError):
            once_free(partial(path.rename, path))  # has no effect, but needs the same rights

    def name_new_file(draft: Path, path: Path) -> None:
        """Rename a draft to a path where nothing exists.

        Raises FileExistsError if something is there, and OSError if the renaming fails.
        """
        once_free(partial(draft.rename, path))

    def rename_folder(folder: Path, path: Path) -> None:
        """Rename a folder without open files.

        Raises OSError, also if anything but an empty folder is in the way.
        """
        with suppress(OSError):
            path.rmdir()  # other systems replace an empty folder by renaming
        once_free(partial(folder.rename, path))

    def name_refused(path: Path) -> str:
        """Return why Windows cannot make a file at a path, in words; "" if it can."""
        pure = PureWindowsPath(path)
        for name in pure.relative_to(pure.anchor).parts:
            if name.split(".")[0].rstrip().upper() in _DEVICES:
                return f"for Windows, {name} is a device whatever folder and suffix it has"
            if name != ".." and (set(name) & _REFUSED or name[-1] in ". "):
                return f'Windows takes no {name}: no name has one of <>:"|?* in it, or ends with a dot or a space'
        return ""

    def shell_word(word: str) -> str:
        """Return a word of a command quoted for cmd and PowerShell.

        cmd knows only double quotes. Within double quotes cmd still replaces %NAME%, and PowerShell $NAME and escapes
        after a backtick. No quotes prevent that in both.
        """
        if re.fullmatch(r"[\w.:/\\=+-]+", word):
            return word
        return _quoted(re.sub(r'(?<!\\)(\\+)(?="|\Z)', r"\1\1", word).replace('"', '\\"'))

    @contextmanager
    def closed_pipes_told() -> Iterator[None]:
        """Raise BrokenPipeError in the block for writing to a stream without a reader.

        Windows itself reports an invalid argument.
        """
        try:
            yield
        except OSError as error:
            if error.errno == errno.EINVAL:
                raise BrokenPipeError(errno.EPIPE, "nobody reads it any more") from error
            raise

    def cause_of(error: OSError) -> str:
        """Return why a file or a folder could not be used.

        Windows reports a path that is too long as missing.
        """
        cause, path = error.strerror or str(error), path_of(error)
        if _may_be_held(error):
            return f"{cause}; it may be open in another program"
        length = len(os.path.abspath(path)) if path else 0
        if length <= _LONGEST or not isinstance(error, FileNotFoundError):
            return cause
        return f"{cause}; a path of {length} characters, which Windows takes only if long paths are enabled"

    def foreign_writers(status: os.stat_result) -> str:
        """Return "", because on Windows it is not checked who else may write to a file."""
        return ""

    def is_users_own(status: os.stat_result) -> bool:
        """Return True, because on Windows it is not checked to whom a file belongs."""
        return True

    def is_open_to_others(status: os.stat_result) -> bool:
        """Return False, because on Windows it is not checked who may use a file."""
        return False

    def closed_to_others(folder: Path) -> os.stat_result:
        """Return the status of a folder, which is left as it is on Windows."""
        return folder.lstat()

else:

    @contextmanager
    def interrupts_held() -> Iterator[None]:
        """Hold Ctrl-C back until the `with` block ends; processes started within never see it."""
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def signal_later(seconds: float, handler: Callable[[int, FrameType | None], object]) -> None:
        """Call a handler of SIGALRM in the main thread after some time [s]."""
        signal.signal(signal.SIGALRM, handler)
        signal.setitimer(signal.ITIMER_REAL, seconds)

    def no_signal_later() -> None:
        """Cancel the timer of `signal_later`.

        Python removes its handlers as it ends, and SIGALRM would then kill the process.
        """
        signal.setitimer(signal.ITIMER_REAL, 0)

    def signals_told() -> int:
        """Return a descriptor from which the numbers of signals can be read, a byte each."""
        outlet, inlet = os.pipe()
        os.set_blocking(inlet, False)
        signal.set_wakeup_fd(inlet, warn_on_full_buffer=False)
        return outlet

    def _may_be_held(error: OSError) -> bool:
        """Return False: on this system no program keeps others from a file."""
        return False

    def check_free(path: Path) -> None:
        """Raise OSError if a file cannot be replaced because it is read-only, for root as well."""
        if not (os.access(path, os.W_OK) and path.stat().st_mode & 0o222):
            raise OSError(errno.EROFS, "it is read-only", str(path))

    def name_new_file(draft: Path, path: Path) -> None:
        """Rename a draft to a path where nothing exists.

        Raises FileExistsError if something is there, and OSError if the renaming fails.
        """
        try:
            os.link(draft, path)
        except OSError as error:
            if os.path.lexists(path):
                raise FileExistsError(errno.EEXIST, "it was not there before", str(path)) from error
            draft.replace(path)  # a disk without links
        else:
            draft.unlink()

    def rename_folder(folder: Path, path: Path) -> None:
        """Rename a folder. Raises OSError, also if anything but an empty folder is in the way."""
        folder.rename(path)

    def name_refused(path: Path) -> str:
        """Return "", because this system accepts any name."""
        return ""

    def shell_word(word: str) -> str:
        """Return a word of a command quoted for a shell, if possible also for cmd and PowerShell."""
        if re.fullmatch(r"[\w.,:/=@%+-]+", word):
            return word
        if re.search("[\ud800-\udfff]", word):  # bytes of a file name that are no UTF-8
            octal = "".join(f"\\{byte:03o}" if byte > 126 or byte < 32 else chr(byte) for byte in os.fsencode(word))
            return f"$'{octal}'" if "'" not in word else shlex.quote(word)
        return shlex.quote(word) if set('"$`\\!') & set(word) or not word else _quoted(word)

    @contextmanager
    def closed_pipes_told() -> Iterator[None]:
        """Do nothing: here, writing to a stream without a reader raises BrokenPipeError anyway."""
        yield

    def cause_of(error: OSError) -> str:
        """Return why a file or a folder could not be used."""
        return error.strerror or str(error)

    def foreign_writers(status: os.stat_result) -> str:
        """Return why others than this user and root may write to a file; "" if they may not.

        The answer is in words. For a folder this means replacing its files. In a folder with the sticky bit (/tmp),
        everybody may only replace their own files.
        """
        if status.st_uid not in (0, os.geteuid()):
            return "belongs to another user"
        sticky = stat.S_ISDIR(status.st_mode) and status.st_mode & stat.S_ISVTX
        if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH) and not sticky:
            return "can be written by other users"
        return ""

    def is_users_own(status: os.stat_result) -> bool:
        """Tell whether a file belongs to this user."""
        return status.st_uid == os.geteuid()

    def is_open_to_others(status: os.stat_result) -> bool:
        """Tell whether other users may read a file, or write to it."""
        return bool(status.st_mode & 0o077)

    def closed_to_others(folder: Path) -> os.stat_result:
        """Close a folder of this user to others, and return its status.

        The folder of another user is left as it is.
        """
        status = folder.lstat()
        if status.st_uid == os.geteuid() and stat.S_IMODE(status.st_mode) != 0o700:
            folder.chmod(0o700)
            return folder.lstat()
        return status


def once_free(use: Callable[[], _T]) -> _T:
    """Call `use`, and retry while another program may hold the file that it needs.

    Retries for up to `OPEN_FILE_WAIT`, then raises the last OSError. Other errors are raised at once.
    """
    end = time.monotonic() + OPEN_FILE_WAIT
    while True:
        try:
            return use()
        except OSError as error:
            if time.monotonic() > end or not _may_be_held(error):
                raise
            time.sleep(0.05)


def open_file(path: Path, flags: int) -> int:
    """Open a file once no other program holds it, and return its descriptor.

    Raises OSError, for a folder too.
    """
    if path.is_dir():  # Windows reports a folder as a file that may not be read
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    return once_free(partial(os.open, path, flags))


def replace_file(draft: Path, path: Path) -> None:
    """Rename a draft over a file, once no other program holds the file open. Raises OSError."""
    once_free(partial(draft.replace, path))


def delete_file(path: Path) -> None:
    """Delete a file, if it exists, once no other program holds it open. Raises OSError."""
    once_free(partial(path.unlink, missing_ok=True))


def remove_folder(folder: Path) -> None:
    """Remove a folder with its content, as far as this user may, once no program holds it."""
    with suppress(OSError):
        once_free(partial(shutil.rmtree, folder))
    shutil.rmtree(folder, ignore_errors=True)


if sys.platform == "linux":

    def usable_cores() -> int:
        """Return the number of processor cores that this process may use.

        It counts the cores that the process is confined to, and at most a container's quota of processor time.
        """
        return max(1, math.ceil(min(len(os.sched_getaffinity(0)), _share_of_time())))

    @cache  # reading takes half a millisecond, and many short batches need it
    def _share_of_time(proc: Path = Path("/proc/self/cgroup"), root: Path = Path("/sys/fs/cgroup")) -> float:
        """Return the quota of processor time of this process's control groups, in cores.

        Groups of version 1 and version 2 count. The quota is infinite without a limit.
        """
        try:
            lines = [line.split(":", 2) for line in proc.read_text(encoding="utf-8").splitlines()]
        except OSError:
            return math.inf
        tops = {"": root, "cpu": root / "cpu"}  # cgroup version 2, and version 1 with a folder for each controller
        groups = [tops[name] / path.strip("/") for _, names, path in lines for name in names.split(",") if name in tops]
        return min((_quota(above) for group in groups for above in (group, *group.parents)), default=math.inf)

    def _quota(group: Path) -> float:
        """Return the quota of processor time of one group, in cores.

        The quota is infinite without a limit ("max", or -1).
        """
        for names in (("cpu.max",), ("cpu.cfs_quota_us", "cpu.cfs_period_us")):
            with suppress(OSError, ValueError):
                quota, period = " ".join((group / name).read_text(encoding="ascii") for name in names).split()
                if float(quota) > 0:
                    return float(quota) / float(period)
        return math.inf

else:

    def usable_cores() -> int:
        """Return the number of processor cores.

        Neither macOS nor Windows confines a process to some of them by default.
        """
        return os.cpu_count() or 1


MODES_TELL = sys.platform != "win32"
"""True if the mode of a folder decides who may read it; on Windows its access list decides."""

MOVES_OPEN_FOLDERS = sys.platform != "win32"
"""True if a folder with an open file can be renamed or deleted: not on Windows."""

DRAFT_MODE = 0o700 if sys.platform != "win32" else 0o777
"""Mode of a folder for files that are made there and then moved elsewhere. On Windows 0o700 would give the files an
access list that keeps everybody else out, wherever they are (python/cpython#118486)."""

HAS_JIT_LINK = sys.platform != "win32"
"""True if llvmlite has LLVM's linker that places code and its constants close to each other (JITLink); not on Windows.
The older linker aborts a large process if they lie too far apart (numba/numba#8567, #9001)."""

MOST_PROCESSES = 61 if sys.platform == "win32" else 10_000
"""Largest number of processes to wait for at one time."""

LIBRARIES = (
    "install the Microsoft Visual C++ runtime, https://aka.ms/vs/17/release/vc_redist.x64.exe"
    if sys.platform == "win32"
    else "install friso anew in a new environment"
)
"""Advice if a compiled library, such as llvmlite's, cannot be loaded."""

LIMITS_MEMORY = sys.platform == "linux"
"""True if the memory of a process can be limited.

Windows has no such limit, and macOS ignores it."""
