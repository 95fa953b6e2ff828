"""Where the blocks of a study are computed: in the threads of this process, or wherever an executor sends them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from friso.studies.cells import Columns, run_cells
from friso.studies.study import Block, Study

LARGEST_BLOCK, LEAST_BLOCK = 1024, 64
"""Cells of a block: enough that its lanes are busy nearly to the end, few enough that little is lost with it."""

Progress = Callable[[int], None]
"""Called with the number of cells just done."""


@dataclass
class Crew:
    """An executor, how many blocks are computed side by side, and how to have those in flight end early."""

    executor: Executor
    size: int
    task: Callable[..., Columns] = run_cells
    arguments: dict[str, Any] = field(default_factory=dict)
    cancel: Callable[[], None] = lambda: None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *reason: object) -> None:
        self.executor.shutdown(wait=True, cancel_futures=True)

    def compute(self, jobs: Iterable[tuple[Study, Block]]) -> Iterator[tuple[Study, Block, Columns]]:
        """The measures of blocks of studies, in the order in which they are done.

        No more blocks are in flight than keep the crew busy, so that a study of any length streams. Whatever ends
        this early (Ctrl-C among it) cancels the blocks in flight.
        """
        upcoming = iter(jobs)
        flying: dict[Future[Columns], tuple[Study, Block]] = {}
        try:
            while True:
                while len(flying) < 2 * self.size and (job := next(upcoming, None)):
                    flying[self._submit(*job)] = job
                if not flying:
                    return
                for future in wait(flying, return_when=FIRST_COMPLETED).done:
                    yield *flying.pop(future), future.result()
        finally:
            for future in flying:
                future.cancel()
            if flying:
                self.cancel()
                wait(flying)

    def block_shape(self, study: Study) -> tuple[int, ...]:
        """The shape of blocks small enough that a small study keeps the whole crew busy."""
        return study.block_shape(max(LEAST_BLOCK, min(LARGEST_BLOCK, study.cells // (4 * self.size))))

    def _submit(self, study: Study, block: Block) -> Future[Columns]:
        columns = study.block_columns(block)
        return self.executor.submit(self.task, study.stage, study.links, columns, study.rtol, **self.arguments)


def local_crew(threads: int | None = None) -> Crew:
    """The threads of this process, as many as it has processors unless told: one block each."""
    size = threads or len(os.sched_getaffinity(0))
    stop = np.zeros(1, np.int64)
    return Crew(
        ThreadPoolExecutor(size, thread_name_prefix="friso"),
        size,
        arguments={"cancel": stop},
        cancel=lambda: stop.fill(1),
    )


def run_scattered(study: Study, cells: np.ndarray, crew: Crew) -> Columns:
    """The measures of single cells, by their numbers in C order."""
    picked = study.at(cells)
    parts: dict[int, Columns] = {}
    for _, block, found in crew.compute((picked, block) for block in picked.blocks(crew.block_shape(picked))):
        parts[block[0].start] = found
    return {name: np.concatenate([parts[start][name] for start in sorted(parts)]) for name in study.metrics}
