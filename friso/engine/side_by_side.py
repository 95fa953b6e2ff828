"""Several things computed at once, in as many threads as there are cores: what runs leaves the interpreter to the
others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_EXCEPTION, Future, ThreadPoolExecutor, wait
from contextvars import ContextVar, copy_context
from typing import TypeVar

import numpy as np

from friso.engine.overtaken import ended_by, go_on
from friso.system import usable_cores

_T = TypeVar("_T")

_PATIENCE = 0.1
"""How long [s] is waited before it is looked again whether anybody waits for all of it still."""


_BESIDE: ContextVar[tuple[int, Sequence[Future]]] = ContextVar("beside", default=(1, ()))
"""Among how many tasks the present one is, and the jobs of these."""


def cores_to_use() -> int:
    """How many cores a batch of runs may take now: all, or its share beside the other tasks that still run. Fewer
    threads keep more of their lanes busy."""
    tasks, jobs = _BESIDE.get()
    ended = sum(job.done() for job in jobs)
    return max(1, usable_cores() // (tasks - ended))


def side_by_side(tasks: Sequence[Callable[[], _T]]) -> list[_T]:
    """What the tasks return, in their order, as many of them at a time as there are cores. What ends one of them early
    ends the others, too, at their next batch of runs, and is raised."""
    at_once = min(len(tasks), usable_cores())
    if at_once < 2:
        return [task() for task in tasks]
    flag = np.zeros(1, np.int64)
    jobs: list[Future[_T]] = []

    def beside_others(task: Callable[[], _T]) -> _T:
        _BESIDE.set((len(tasks), jobs))
        return task()

    with ThreadPoolExecutor(at_once) as pool:
        with ended_by(flag):
            jobs += [pool.submit(copy_context().run, beside_others, task) for task in tasks]
        try:
            while any(not job.done() for job in jobs):
                for job in wait(jobs, _PATIENCE, FIRST_EXCEPTION).done:
                    job.result()
                go_on()
            return [job.result() for job in jobs]
        except BaseException:
            flag[0] = 1
            pool.shutdown(wait=False, cancel_futures=True)
            raise
