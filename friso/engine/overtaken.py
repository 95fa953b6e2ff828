"""Work that nobody waits for any more ends: whoever asks for it has a flag, which another thread sets.

What runs when the flag is set is incomplete; so nothing is made of it, and nothing kept: `Overtaken` is raised at the
next batch of runs, through everything that handles errors.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import numpy as np


class Overtaken(BaseException):
    """Nobody waits for this work any more."""


_FLAG: ContextVar[np.ndarray | None] = ContextVar("flag", default=None)


def current_flag() -> np.ndarray:
    """The flag, shape (1,), by which runs are cancelled now: that of `ended_by`, or one that nobody sets."""
    flag = _FLAG.get()
    return np.zeros(1, np.int64) if flag is None else flag


@contextmanager
def ended_by(flag: np.ndarray) -> Iterator[None]:
    """Let all runs within end once another thread sets ``flag[0] = 1``; `flag` is of int64 and of shape (1,)."""
    token = _FLAG.set(flag)
    try:
        yield
    finally:
        _FLAG.reset(token)


def go_on() -> None:
    """Raises Overtaken once the flag is set."""
    flag = _FLAG.get()
    if flag is not None and flag[0]:
        raise Overtaken
