"""Compute several things at once, in as many threads as there are cores.

Running code releases the interpreter's lock, so the threads do not wait for each other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_EXCEPTION, Future, ThreadPoolExecutor, wait
from contextvars import ContextVar, copy_context
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from friso.engine.overtaken import ended_by, go_on
from friso.engine.settings import build_settings
from friso.platform.system import usable_cores

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


def results_of(jobs: Sequence[Future[_T]]) -> list[_T]:
    """Wait for jobs and return their results in order; an error is raised at once.

    The wait is interrupted regularly, to check whether someone still waits for the results, and to notice Ctrl-C, which
    interrupts no wait on Windows.
    """
    while any(not job.done() for job in jobs):
        for job in wait(jobs, build_settings.waiting_interval, FIRST_EXCEPTION).done:
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
