"""Cause faults at a chosen operation on files: a full disk, Ctrl-C, a kill.

Python reports each operation before it happens (`sys.addaudithook`).
"""

import errno
import os
import random
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_MAKES = {"os.rename": 1, "os.link": 1, "os.mkdir": 0}
"""Operations that create something, and the index of the argument that names it."""


@dataclass
class Fault:
    """A fault at the operation number `left` in a folder.

    If it lasts, like a full disk, it also strikes at all later operations that need room.
    """

    folder: str
    left: int
    strike: Callable[[], None]
    lasting: bool

    def operation(self, path: object, needs_room: bool) -> None:
        """Count an operation on a file, and strike."""
        try:
            name = os.path.abspath(os.fsdecode(path))  # type: ignore[arg-type]  # ty: a descriptor, for one
        except TypeError:
            return
        if not name.startswith(self.folder):
            return
        self.left -= 1
        if self.left == 0 or (self.left < 0 and self.lasting and needs_room):
            self.strike()


_fault: Fault | None = None


def _hook(event: str, arguments: tuple[Any, ...]) -> None:
    if _fault is None:
        return
    if event in _MAKES:
        _fault.operation(arguments[_MAKES[event]], event != "os.rename")
    elif event == "open" and (arguments[2] or 0) & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
        _fault.operation(arguments[0], True)


@contextmanager
def fault(folder: Path, number: int, strike: Callable[[], None], lasting: bool = False) -> Iterator[None]:
    """Call `strike` in the block before a numbered operation that creates something.

    The operation is one in a folder. Operations count from 1.
    """
    global _fault
    _install()
    _fault = Fault(str(folder.resolve()), number, strike, lasting)
    try:
        yield
    finally:
        _fault = None


_installed: list[bool] = []


def _install() -> None:
    if not _installed:
        sys.addaudithook(_hook)
        _installed.append(True)


def no_room() -> None:
    """Raise the error of a full disk."""
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def no_answer() -> None:
    """Raise the error of a disk that fails."""
    raise OSError(errno.EIO, os.strerror(errno.EIO))


def ctrl_c() -> None:
    """Send Ctrl-C as the terminal does."""
    os.kill(os.getpid(), signal.SIGINT)


def struck(work: Callable[[], object], folder: Path, rng: random.Random, operations: int) -> str:
    """Do some work under a random fault; return which fault it was.

    `operations` is roughly the number of operations on files.
    """
    kind = rng.choice(("none", "room", "room", "disk", "ctrl-c", "ctrl-c", "kill", "kill"))
    number = rng.randrange(1, operations + 1)
    if kind == "kill":
        _killed(work, folder, number)
        return f"{kind} at {number}"
    strike = {"none": lambda: None, "room": no_room, "disk": no_answer, "ctrl-c": ctrl_c}[kind]
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with suppress(OSError, KeyboardInterrupt, ValueError), fault(folder, number, strike, kind == "room"):
            work()
    finally:
        signal.signal(signal.SIGINT, before)
    return f"{kind} at {number}"


def _killed(work: Callable[[], object], folder: Path, number: int) -> None:
    """Do some work in a child process that is killed before an operation."""
    child = os.fork()
    if child:
        os.waitpid(child, 0)
        return
    try:
        with fault(folder, number, lambda: os.kill(os.getpid(), signal.SIGKILL)):
            work()
    finally:
        os._exit(0)
