"""Make this interpreter look to friso like one on another system.

FRISO_FOREIGN_HOST names the system like `sys.platform`. Python imports this module at its start, also in child
processes, if its folder is in PYTHONPATH. friso's modules get `os`, `signal`, `sys` and `ctypes` without the names that
the other system lacks; other packages have versions of their own for it, and are left alone. For Windows, more is
imitated: open files cannot be renamed, replaced or deleted; in a folder called read-only nothing can be created; a file
called busy is used by another program at first; paths have at most 259 characters; a pipe without a reader is an
invalid argument; text files are cp1252 with CRLF unless opened otherwise.
"""

import builtins
import ctypes
import io
import locale
import multiprocessing
import os
import signal
import stat
import sys
from types import ModuleType

HOST = os.environ["FRISO_FOREIGN_HOST"]

LINUX = "sched_getaffinity sched_setaffinity memfd_create eventfd posix_fadvise splice O_DIRECT O_TMPFILE getrandom"
POSIX = (
    "geteuid getuid getegid getgid getgroups fork forkpty killpg setsid getpgid getpgrp mkfifo chown fchown fchmod "
    "statvfs sysconf uname wait3 wait4 getloadavg nice O_NOFOLLOW O_NONBLOCK O_DIRECTORY O_CLOEXEC"
)
SIGNALS = (
    "SIGKILL SIGHUP SIGALRM SIGUSR1 SIGUSR2 SIGCHLD SIGPIPE SIGQUIT SIGXFSZ pthread_sigmask pthread_kill setitimer "
    "ITIMER_REAL alarm sigwait SIG_BLOCK SIG_SETMASK"
)
MODULES = {"win32": {"fcntl", "resource", "pwd", "grp", "termios", "syslog"}, "darwin": set()}[HOST]


class Foreign(ModuleType):
    """A module without some of its names, and with others in their place."""

    def __init__(self, module, absent="", **others):
        super().__init__(module.__name__)
        vars(self).update(_module=module, _absent=frozenset(absent.split()), **others)

    def __getattr__(self, name):
        if name in self._absent:
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r} on {HOST}")
        return getattr(self._module, name)

    def __setattr__(self, name, value):
        setattr(self._module, name, value)

    def __dir__(self):
        return [name for name in dir(self._module) if name not in self._absent]


class Console:
    """The part of Windows' kernel32 that friso calls."""

    def __init__(self, name):
        assert name == "kernel32"

    def SetConsoleCtrlHandler(self, handler, ignored):
        assert handler is None
        signal.signal(signal.SIGINT, signal.SIG_IGN if ignored else signal.default_int_handler)
        return 1


FOREIGN = {
    "win32": {
        "os": Foreign(os, f"{LINUX} {POSIX}", name="nt"),
        "signal": Foreign(signal, SIGNALS),
        "sys": Foreign(sys, platform="win32"),
        "ctypes": Foreign(ctypes, WinDLL=Console),
    },
    "darwin": {"os": Foreign(os, LINUX), "signal": signal, "sys": Foreign(sys, platform="darwin")},
}[HOST]

_import = builtins.__import__


def _foreign_import(name, globals=None, locals=None, fromlist=(), level=0):
    importer = (globals or {}).get("__name__", "")
    if importer.partition(".")[0] == "friso" and level == 0:
        if name in MODULES:
            raise ModuleNotFoundError(f"No module named {name!r} on {HOST}", name=name)
        if name in FOREIGN:
            return FOREIGN[name]
    return _import(name, globals, locals, fromlist, level)


builtins.__import__ = _foreign_import
multiprocessing.set_start_method("spawn")


# Windows' files


def _opened_by():
    """Return all open files, and the folders above them, which cannot be renamed."""
    for process in filter(str.isdigit, os.listdir("/proc")):
        try:
            numbers = os.listdir(f"/proc/{process}/fd")
        except OSError:
            continue
        for number in numbers:
            try:
                yield os.readlink(f"/proc/{process}/fd/{number}")
            except OSError:
                continue


def _refuse_open(path, folder=None, below=False):
    where = os.readlink(f"/proc/self/fd/{folder}") if folder is not None else ""
    path = os.path.join(where, os.fsdecode(path))
    real = os.path.join(os.path.realpath(os.path.dirname(path)), os.path.basename(path))
    if real.startswith("/dev/shm/"):  # multiprocessing's own, which on Windows has no name in a folder
        return
    _refuse_busy(real)
    for file in _opened_by():
        if (file == real and not os.path.isdir(real)) or (below and file.startswith(real + os.sep)):
            raise PermissionError(13, "The process cannot access the file: it is open", path)


_TIMES = {}


def _refuse_busy(path):
    path = os.path.abspath(path)
    busy = os.path.basename(path).startswith("busy") and os.path.lexists(path)
    if busy and _TIMES.setdefault(path, 0) < 3:
        _TIMES[path] += 1
        raise PermissionError(13, "Permission denied", path)


def _renaming(real):
    def rename(source, target, *, src_dir_fd=None, dst_dir_fd=None):
        if real is _rename and os.path.lexists(target) and not os.path.samefile(source, target):
            raise FileExistsError(17, "Cannot create a file when that file already exists", os.fsdecode(target))
        _refuse_open(source, src_dir_fd, below=True)
        _refuse_open(target, dst_dir_fd)
        real(source, target, src_dir_fd=src_dir_fd, dst_dir_fd=dst_dir_fd)

    return rename


def _deleting(real):
    def delete(path, *, dir_fd=None):
        _refuse_open(path, dir_fd)
        real(path, dir_fd=dir_fd)

    return delete


class Pipe(io.FileIO):
    """A pipe without a reader, which counts as an invalid argument."""

    def write(self, data):
        try:
            return super().write(data)
        except BrokenPipeError:
            raise OSError(22, "Invalid argument") from None


def _within_reach(real):
    def done(path, *more, **others):
        if isinstance(path, str | os.PathLike):
            if len(os.path.abspath(path)) > 259:
                raise FileNotFoundError(2, "No such file or directory", os.fsdecode(path))
            if os.path.basename(os.path.dirname(path)) == "read-only" and not os.path.lexists(path):
                raise PermissionError(13, "Permission denied", os.fsdecode(path))
            _refuse_busy(os.fsdecode(path))
        return real(path, *more, **others)

    return done


def _making(real):
    def make(path, *more, **others):
        if os.path.abspath(os.fsdecode(path)) == os.sep:
            raise PermissionError(13, "Access is denied", path) if HOST == "win32" else IsADirectoryError(21, "", path)
        real(path, *more, **others)

    return make


def _windows_open(real):
    def opened(file, mode="r", buffering=-1, encoding=None, errors=None, newline=None, *more, **others):
        if mode == "wb" and isinstance(file, int) and stat.S_ISFIFO(os.fstat(file).st_mode):
            return io.BufferedWriter(Pipe(file, mode))
        if "b" not in mode:
            encoding = "cp1252" if encoding in (None, "locale") else encoding
            newline = "\r\n" if newline is None and not set(mode) & {"r", "+"} else newline
        return real(file, mode, buffering, encoding, errors, newline, *more, **others)

    return opened


def _wakeup(real):
    """Windows takes a pipe that blocks."""

    def set_wakeup_fd(fd, **named):
        if fd >= 0:
            os.set_blocking(fd, False)
        return real(fd, **named)

    return set_wakeup_fd


os.mkdir = _making(os.mkdir)
if HOST == "win32":
    _rename = os.rename
    os.rename, os.replace = _renaming(os.rename), _renaming(os.replace)
    signal.set_wakeup_fd = _wakeup(signal.set_wakeup_fd)
    os.unlink = os.remove = _deleting(os.unlink)
    os.open, os.mkdir = _within_reach(os.open), _within_reach(os.mkdir)
    builtins.open = io.open = _windows_open(_within_reach(io.open))
    if stat.S_ISFIFO(os.fstat(1).st_mode):
        sys.stdout = io.TextIOWrapper(io.BufferedWriter(Pipe(1, "wb", closefd=False)), sys.stdout.encoding)
    locale.getpreferredencoding = lambda do_setlocale=True: "cp1252"
