"""Ctrl-C, a termination and a closed terminal end the command line in one line, whenever they come.

Importing friso and its libraries takes up to a second, in which an exception is lost, or ends in a traceback out of a
library that is half there. So a signal raises KeyboardInterrupt only where no import is under way, and before the
command begins it is noted. Nothing is installed where friso is used as a library.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from types import FrameType
from typing import Any

from friso.system import no_signal_later, signal_later

SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name)]
"""The signals that end a command."""

_AGAIN = 0.02
"""After how long [s] it is looked again whether an import has ended."""

_came: list[int] = []
_raising = False
_held = 0
"""Blocks in which signals wait for the end (`hold_interrupts`), one within another."""


def came() -> int:
    """The signal that came first, 0 for none."""
    return _came[0] if _came else 0


@contextmanager
def raising() -> Iterator[None]:
    """Signals raise KeyboardInterrupt within, one that came before at once. In another thread than the main one they
    are as they were."""
    global _raising
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before, ignored = _install(), sys.unraisablehook
    sys.unraisablehook = partial(_lost, ignored)
    _raising = True
    try:
        if came():
            raise KeyboardInterrupt
        yield
    finally:
        _raising = False
        no_signal_later()
        if not _IS_COMMAND:  # which ends now, and is not to be interrupted in that
            sys.unraisablehook = ignored
            _came.clear()
            for number, handler in before.items():
                signal.signal(number, handler)


@contextmanager
def hold_interrupts() -> Iterator[None]:
    """Ctrl-C and a termination wait for the end of the block. In another thread than the main one, which they do not
    reach, nothing is done."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    global _held
    arrived: list[int] = []
    before = {number: signal.signal(number, lambda number, frame: arrived.append(number)) for number in SIGNALS}
    _held += 1
    try:
        yield
    finally:
        _held -= 1
        for number, handler in before.items():
            if handler is not None:  # not Python's
                signal.signal(number, handler)
        if arrived:
            signal.raise_signal(arrived[0])


def _install() -> dict[int, Any]:
    """Take the signals, but those that are ignored (nohup); what was done with them before."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    for number in (number for number, handler in before.items() if handler is not signal.SIG_IGN):
        signal.signal(number, _arrived)
    return {number: handler for number, handler in before.items() if handler is not None}


def _ignore() -> None:
    """Ignore the signals from now on: when Python takes its handlers away they would end a command that is done."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def _arrived(number: int, frame: FrameType | None) -> None:
    if number in SIGNALS:
        _came.append(number)
    if not _raising:
        return
    if _imports(frame) or _held:  # one that came during an import comes again
        signal_later(_AGAIN, _arrived)
        return
    raise KeyboardInterrupt


def _lost(otherwise: Callable[[Any], object], what: Any) -> None:
    """Python ignores what is raised while an object goes (a finalizer, the callback of a weak reference), and prints a
    traceback: a KeyboardInterrupt is raised again instead, and of what was cut short by one nothing is said."""
    if _raising and isinstance(what.exc_value, KeyboardInterrupt):
        signal_later(_AGAIN, _arrived)
    elif not came():
        otherwise(what)


def _imports(frame: FrameType | None) -> bool:
    """Whether an import is under way."""
    while frame is not None:
        if frame.f_code.co_filename == "<frozen importlib._bootstrap>":
            return True
        frame = frame.f_back
    return False


_IS_COMMAND = ("-m", "friso") in zip(sys.orig_argv, sys.orig_argv[1:], strict=False) or (
    os.path.splitext(os.path.basename(sys.argv[0]))[0] == "friso"
)
"""Whether this process was started as friso, or as python -m friso."""

if _IS_COMMAND:
    _install()
    atexit.register(_ignore)  # among the first, and so among the last that are called
