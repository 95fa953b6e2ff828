"""Compute studies in separate processes on this machine.

They talk over private pipes, so no port is opened.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

import numpy as np

from friso.engine.cache import FOLDER_VARIABLE, cache_folder, remove_if_passing
from friso.platform.system import interrupts_held
from friso.studies.cells import Columns, run_cells
from friso.studies.execute import Crew

_cancel = np.zeros(1, np.int64)
"""Flag, (1,), that ends this process' block early; a worker shares it with its parent."""


@contextmanager
def processes(workers: int) -> Iterator[Crew]:
    """Yield a crew of `workers`: separate processes on this machine.

    A worker computes one block at a time, in one thread. The workers end with this process, however it ends.
    """
    context = get_context("spawn")
    with interrupts_held(), _modules_of_this_folder_ignored():
        shared: Any = context.RawArray("q", 1)
        pool = ProcessPoolExecutor(workers, context, _prepare, (shared, cache_folder()))
        for _ in range(workers):  # each task starts one worker
            pool.submit(os.getpid)
    cancel = np.frombuffer(shared, np.int64)
    with Crew(pool, workers, 4 * workers, run_block, cancel=cancel, failures=(BrokenProcessPool,)) as crew:
        yield crew


@contextmanager
def _modules_of_this_folder_ignored() -> Iterator[None]:
    """Start Python processes within the block that import nothing from the current folder.

    The folder may belong to someone else, and contain a file with the name of a module.
    """
    before = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    try:
        yield
    finally:
        del os.environ[_SAFE_PATH]
        if before is not None:
            os.environ[_SAFE_PATH] = before


_SAFE_PATH = "PYTHONSAFEPATH"


def run_block(*arguments: Any) -> Columns:
    """Compute a block's metrics with `run_cells` in a worker, until done or cancelled."""
    return run_cells(*arguments, cancel=_cancel)


def _prepare(shared: Any, cache: Path) -> None:
    """Make this process a worker of its parent.

    Ctrl-C is left to the parent process, and the worker ends with its parent. The worker uses the parent's cache of
    kernels, even a temporary one.
    """
    global _cancel
    _cancel = np.frombuffer(shared, np.int64)
    os.environ[FOLDER_VARIABLE] = str(cache.parent)
    sys.stdout = sys.stderr  # output of plug-ins must not mix with answers
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, args=(cache,), daemon=True).start()


def _end_with_parent(cache: Path) -> None:
    parent = parent_process()
    assert parent is not None
    wait([parent.sentinel])
    remove_if_passing(cache)  # the parent was killed before it could remove it
    os._exit(1)
