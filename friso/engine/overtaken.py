"""End work that nobody waits for, and let urgent work of the app go first.

Whoever asks for work has a flag, which another thread sets to cancel the work. Runs are incomplete once the flag is
set, so nothing may use them: `Overtaken` is raised at the next batch of runs, and passes through all error handling.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from threading import Condition

import numpy as np

from friso.engine.settings import build_settings


class Overtaken(BaseException):
    """Error: nobody waits for this work any more."""


_FLAG: ContextVar[np.ndarray | None] = ContextVar("flag", default=None)


ASKER: ContextVar[object] = ContextVar("asker", default=None)
"""The question of the app that a computation belongs to, which receives its messages; None on the command line."""


def current_flag() -> np.ndarray:
    """Return the flag that cancels runs, (1,): the one given to `ended_by`, or an unset one."""
    flag = _FLAG.get()
    return np.zeros(1, np.int64) if flag is None else flag


@contextmanager
def ended_by(flag: np.ndarray) -> Iterator[None]:
    """Let all runs within the `with` block end once another thread sets ``flag[0] = 1``.

    `flag` is of int64 and of shape (1,).
    """
    token = _FLAG.set(flag)
    try:
        yield
    finally:
        _FLAG.reset(token)


def go_on() -> None:
    """Wait while more urgent work runs.

    Raises Overtaken once the flag that was given to `ended_by` is set.
    """
    if _ahead and not is_first():
        _give_way()
    flag = _FLAG.get()
    if flag is not None and flag[0]:
        raise Overtaken


_FIRST: ContextVar[bool] = ContextVar("first", default=False)
_ahead: dict[object, float] = {}
_turn = Condition()


@contextmanager
def going_first() -> Iterator[None]:
    """Give priority to runs within the `with` block: other work waits at its next batch of runs."""
    token, own = _FIRST.set(True), object()
    with _turn:
        _ahead[own] = time.monotonic() + build_settings.priority_time
    try:
        yield
    finally:
        _FIRST.reset(token)
        with _turn:
            del _ahead[own]
            _turn.notify_all()


def is_first() -> bool:
    """Tell whether the present work has priority."""
    return _FIRST.get()


def _give_way() -> None:
    with _turn:
        while _ahead and (left := max(_ahead.values()) - time.monotonic()) > 0:
            _turn.wait(left)
