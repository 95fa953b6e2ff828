"""Compute several things at once, end work that nobody waits for, and let urgent work of the app go first.

There are as many threads as cores. Running code releases the interpreter's lock, so the threads do not wait for each
other.

Whoever asks for work has a flag, which another thread sets to cancel the work. Runs are incomplete once the flag is
set, so nothing may use them: `Overtaken` is raised at the next batch of runs, and passes through all error handling.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_EXCEPTION, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from dataclasses import dataclass
from threading import Condition
from typing import Any, TypeVar

import numpy as np

from friso.engine.settings import build_settings
from friso.platform.system import usable_cores


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


_T = TypeVar("_T")
_Other = TypeVar("_Other")


@dataclass(frozen=True)
class _Beside:
    """Tasks that run side by side: how many there are, and their jobs.

    `about` is the group of tasks from one of which they were started.
    """

    tasks: int
    jobs: Sequence[Future]
    about: _Beside | None

    @property
    def cores(self) -> int:
        """Return the cores that one task may use: all cores divided by the tasks that still run."""
        cores = self.about.cores if self.about else usable_cores()
        return max(1, cores // (self.tasks - sum(job.done() for job in self.jobs)))


_BESIDE: ContextVar[_Beside | None] = ContextVar("beside", default=None)


def cores_to_use() -> int:
    """Return how many cores a batch of runs may take now.

    It is all of them, or a share while other tasks run. With fewer threads, each has more runs to compute at once.
    """
    beside = _BESIDE.get()
    return beside.cores if beside else usable_cores()


WAITING_INTERVAL = 0.1  # [s]
"""Time between checks whether a result is still needed: shorter than a person notices."""


def results_of(jobs: Sequence[Future[_T]]) -> list[_T]:
    """Wait for jobs and return their results in order; an error is raised at once.

    The wait is interrupted regularly, to check whether someone still waits for the results, and to notice Ctrl-C, which
    interrupts no wait on Windows.
    """
    while any(not job.done() for job in jobs):
        for job in wait(jobs, WAITING_INTERVAL, FIRST_EXCEPTION).done:
            job.result()
        go_on()
    return [job.result() for job in jobs]


def side_by_side(tasks: Sequence[Callable[[], _T]]) -> list[_T]:
    """Run tasks side by side, one per core at a time, and return their results in order.

    An error of one task stops the others at their next batch of runs, and is raised.
    """
    at_once = min(len(tasks), usable_cores())
    if at_once < 2:
        return [task() for task in tasks]
    flag = np.zeros(1, np.int64)
    jobs: list[Future[_T]] = []

    def beside_others(task: Callable[[], _T]) -> _T:
        _BESIDE.set(_Beside(len(tasks), jobs, _BESIDE.get()))
        return task()

    with ThreadPoolExecutor(at_once) as pool:
        with ended_by(flag):
            jobs += [pool.submit(copy_context().run, beside_others, task) for task in tasks]
        try:
            return results_of(jobs)
        except BaseException:
            flag[0] = 1
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def both(first: Callable[[], _T], second: Callable[[], _Other]) -> tuple[_T, _Other]:
    """Run two tasks side by side, and return both results.

    An error of one task stops the other at its next batch of runs, and is raised.
    """
    tasks: list[Callable[[], Any]] = [first, second]
    one, other = side_by_side(tasks)
    return one, other
