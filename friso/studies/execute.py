"""Compute the blocks of a study in the threads of this process, or in an executor."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from contextvars import copy_context
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Self, TypeVar

import numpy as np

from friso.engine.overtaken import go_on
from friso.studies.cells import Columns, run_cells
from friso.studies.settings import settings
from friso.studies.study import CellBlock, Study

_T = TypeVar("_T")


@dataclass
class Crew:
    """The workers of a study: an executor, with its size and a function that computes a block.

    `task` is that function, called with `arguments`. `size` is the number of blocks computed side by side, and `shares`
    the number of blocks that a study needs to keep all workers busy. `cancel`, a flag of shape (1,), ends blocks in
    progress early. `failures` are the errors that mean that the executor itself failed.
    """

    executor: Executor
    size: int
    shares: int
    task: Callable[..., Columns] = run_cells
    arguments: dict[str, Any] = field(default_factory=dict)
    cancel: np.ndarray = field(default_factory=lambda: np.zeros(1, np.int64))
    failures: tuple[type[BaseException], ...] = ()
    broken: bool = False
    """True once the executor has failed: blocks in progress then end without result."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *reason: object) -> None:
        self.executor.shutdown(wait=True, cancel_futures=True)

    def compute(self, jobs: Iterable[tuple[Study, CellBlock]]) -> Iterator[tuple[Study, CellBlock, Columns]]:
        """Yield the metrics of blocks of studies, in the order in which the blocks are completed.

        Only as many blocks are in progress as keep the workers busy, so a study of any length streams. Any early end
        (such as Ctrl-C) cancels them. Raises Overtaken once nobody waits for the result.
        """
        self.cancel[0] = 0
        upcoming = iter(jobs)
        flying: dict[Future[Columns], tuple[Study, CellBlock]] = {}
        try:
            while True:
                go_on()
                while len(flying) < 2 * self.size and (job := next(upcoming, None)):
                    flying[self._submit(*job)] = job
                if not flying:
                    return
                for future in wait(flying, settings.look_interval, FIRST_COMPLETED).done:
                    yield *flying.pop(future), self._result(future)
        finally:
            self.cancel[0] = 1
            if not self.broken:  # a failed executor would stumble over cancelled futures and leave processes behind
                for future in flying:
                    future.cancel()
                wait(flying, timeout=settings.block_timeout)

    def jobs(self, studies: Sequence[Study]) -> Iterator[tuple[Study, CellBlock]]:
        """Yield the blocks of studies: as large as memory allows, but enough for all workers."""
        for study in studies:
            largest = settings.largest_survey_block if study.cycles else settings.largest_memory_block
            shape = study.block_shape(max(1, min(largest, study.cells // self.shares)))
            yield from ((study, block) for block in study.blocks(shape))

    def _result(self, future: Future[Columns]) -> Columns:
        """Return a task's result. Raises the task's error, or RuntimeError if the executor failed."""
        with self._blamed():
            return future.result()

    @contextmanager
    def _blamed(self) -> Iterator[None]:
        try:
            yield
        except self.failures as error:
            self.broken = isinstance(error, BrokenExecutor)
            raise RuntimeError(f"the workers lost a block: {error or type(error).__name__}") from error

    def _submit(self, study: Study, block: CellBlock) -> Future[Columns]:
        arguments = (study.stage, study.links, study.block_columns(block), study.rtol, study.metrics)
        with self._blamed():
            return self.executor.submit(self.task, *arguments, **self.arguments)


class _Threads(ThreadPoolExecutor):
    """Executor threads that inherit the cancel flag and the priority of their caller."""

    def submit(self, fn: Callable[..., _T], /, *args: Any, **kwargs: Any) -> Future[_T]:
        """Submit a call, as any executor does."""
        return super().submit(partial(copy_context().run, fn, *args, **kwargs))


def local_crew(threads: int | None = None) -> Crew:
    """Return a crew of this process' threads, which compute one block at a time.

    `threads` is their number, by default one per processor. While they compute a block, another one is prepared, or the
    results of one are written.
    """
    stop = np.zeros(1, np.int64)
    arguments = {"threads": threads, "cancel": stop}
    return Crew(_Threads(2, thread_name_prefix="friso"), size=1, shares=1, arguments=arguments, cancel=stop)


def run_scattered(study: Study, cells: np.ndarray, crew: Crew) -> Columns:
    """Compute the metrics of single cells of a study, by the cells' indices in C order.

    Returns arrays of shape (cells,), in the order of the indices.
    """
    picked = study.at(cells)
    parts: dict[int, Columns] = {}
    for _, block, columns in crew.compute(crew.jobs([picked])):
        parts[block[0].start] = columns
    return {name: np.concatenate([parts[start][name] for start in sorted(parts)]) for name in study.metrics}
