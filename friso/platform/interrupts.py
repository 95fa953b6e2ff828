"""End the command line with one line on Ctrl-C, termination or a closed terminal.

Importing friso and its libraries takes up to a second. An exception in this time is lost, or ends in a traceback from a
half-loaded library. So a signal raises KeyboardInterrupt only while no import is under way. Before the command begins,
`friso.platform.early` notes the signal. If the command does not end in time, the process is ended.
"""

from __future__ import annotations

import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from types import FrameType
from typing import Any

from friso.platform import early
from friso.platform.early import SIGNALS
from friso.platform.system import interrupts_held, no_signal_later, signal_later, signals_told

IMPORT_CHECK_INTERVAL = 0.02
"""Interval [s] between checks for the end of an import."""

ENDING_TIME = 10.0
"""Time [s] that a command may take to end after a signal."""

_raising = _said = False
_bounded = True
_waits = False
"""True if a signal came during an import; it is raised after the import."""

_held = 0
"""Number of nested blocks of `hold_interrupts`, in which signals wait."""

_whole = threading.RLock()
"""Lock that is held in blocks of `hold_interrupts`."""


def came() -> int:
    """Return the signal that came first, 0 for none."""
    return early.came[0] if early.came else 0


def last_word(number: int) -> str:
    """Return the last line of a command, which says that the signal `number` ended it."""
    global _said
    _said = True
    return "interrupted" if number in (0, signal.SIGINT) else "terminated"


def answers_interrupts() -> None:
    """Let this command end in its own time: it answers Ctrl-C with its results so far."""
    global _bounded
    _bounded = False


@contextmanager
def raising() -> Iterator[None]:
    """Raise KeyboardInterrupt on signals within the block, at once for an earlier one.

    Outside the main thread nothing changes.
    """
    global _raising, _waits
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before, ignored = _take(_arrived), sys.unraisablehook
    if early.IS_COMMAND:
        with interrupts_held():  # Ctrl-C is for the main thread, where it may wait
            threading.Thread(target=_end_in_time, args=(signals_told(),), daemon=True).start()
    sys.unraisablehook = partial(_lost, ignored)
    _raising = True
    try:
        if came():
            raise KeyboardInterrupt
        yield
    finally:
        _raising = _waits = False
        no_signal_later()
        if not early.IS_COMMAND:  # the command is ending, and must not be interrupted
            sys.unraisablehook = ignored
            early.came.clear()
            for number, handler in before.items():
                signal.signal(number, handler)


def raise_what_waits() -> None:
    """Raise KeyboardInterrupt for a signal that came during an import.

    Commands call this before work that must not be cut short, because a later signal would have to wait for its end.
    """
    while _waits and not _held:
        time.sleep(IMPORT_CHECK_INTERVAL)


@contextmanager
def hold_interrupts() -> Iterator[None]:
    """Make Ctrl-C and a termination wait for the end of the block.

    Outside the main thread, which signals do not reach, it has no effect.
    """
    global _held
    with _signals_wait() as waiting:
        _held += waiting
        try:
            with _whole if waiting else nullcontext():
                yield
        finally:
            _held -= waiting


@contextmanager
def whole_answer() -> Iterator[None]:
    """Make Ctrl-C wait until an answer is shown and its files are written, if the command has begun to answer it.

    Minutes of work would be lost for the seconds of a drawing. A second Ctrl-C does not wait.
    """
    with nullcontext() if _bounded else _signals_wait(most=1):
        yield


@contextmanager
def _signals_wait(most: float = math.inf) -> Iterator[bool]:
    """Make signals wait for the end of the block, but not after the first `most`.

    Yields whether they do: outside the main thread, which signals do not reach, they do not.
    """
    if threading.current_thread() is not threading.main_thread():
        yield False
        return
    arrived: list[int] = []

    def wait(number: int, frame: FrameType | None) -> None:
        arrived.append(number)
        if len(arrived) > most:
            _arrived(number, frame)

    before = _take(wait)
    try:
        yield True
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if arrived:
            signal.raise_signal(arrived[0])


def _take(handler: Callable[[int, FrameType | None], object]) -> dict[int, Any]:
    """Handle the signals by `handler`, except ignored ones (nohup); return the former handlers."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    taken = {number: earlier for number, earlier in before.items() if earlier is not signal.SIG_IGN}
    for number in taken:
        signal.signal(number, handler)
    return {number: earlier for number, earlier in taken.items() if earlier is not None}


def _arrived(number: int, frame: FrameType | None) -> None:
    global _waits
    if number in SIGNALS:
        early.came.append(number)
    if not _raising:
        return
    _waits = _imports(frame) or bool(_held)
    if _waits:  # the signal is sent again
        signal_later(IMPORT_CHECK_INTERVAL, _arrived)
        return
    raise KeyboardInterrupt


def _end_in_time(pipe: int) -> None:
    """End the process some time after a signal, whatever its main thread is doing.

    The main thread may be in an import that does not return, or in a library that keeps the interpreter for minutes or
    swallows the exception. Files that are being put in place are completed first. `pipe` is the descriptor from which
    signals can be read, a byte each, even while the main thread receives none.
    """
    number = came()
    while number not in SIGNALS:
        number = os.read(pipe, 1)[0]
    time.sleep(ENDING_TIME)
    while _bounded and not _whole.acquire(blocking=False):
        time.sleep(ENDING_TIME)
    if not _bounded:
        return
    threading.Timer(1.0, os._exit, (128 + number,)).start()  # a pipe without a reader takes no last word
    if not _said:
        with suppress(OSError):  # nor does a closed terminal
            os.write(2, f"friso: {last_word(number)}\n".encode())
    os._exit(128 + number)


def _lost(otherwise: Callable[[Any], object], what: Any) -> None:
    """Schedule a KeyboardInterrupt again that Python would lose in a finalizer or a callback.

    Python ignores exceptions there and prints a traceback. `what` describes the exception. Any other one goes to the
    handler `otherwise`, unless it is due to an interrupt that came before.
    """
    if _raising and isinstance(what.exc_value, KeyboardInterrupt):
        signal_later(IMPORT_CHECK_INTERVAL, _arrived)
    elif not came():
        otherwise(what)


def _imports(frame: FrameType | None) -> bool:
    """Tell whether an import is under way."""
    while frame is not None:
        if frame.f_code.co_filename == "<frozen importlib._bootstrap>":
            return True
        frame = frame.f_back
    return False
