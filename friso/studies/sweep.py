"""Run parameter studies into an xarray Dataset, or into a store that can be resumed.

Blocks of cells run in threads, in processes, or on a Dask cluster, where each block is a task. Processes on this
machine talk over private pipes, so no port is opened.
"""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from contextvars import copy_context
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import connection, get_context, parent_process
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeVar

import numpy as np

from friso.engine.cache import FOLDER_VARIABLE, cache_folder, remove_if_passing
from friso.engine.side_by_side import go_on
from friso.errors import InputError
from friso.platform.system import interrupts_held
from friso.progress import Progress, Tally, silent
from friso.stage import Stage
from friso.studies.axes import AxisValues, Samples
from friso.studies.cells import Columns, run_cells, unfilled
from friso.studies.metric import attributes_of
from friso.studies.settings import settings
from friso.studies.store import Store
from friso.studies.study import CellBlock, Request, Study, cells_of, equations_version

if TYPE_CHECKING:
    import xarray as xr


_T = TypeVar("_T")


LOOK_INTERVAL = 0.05  # [s]
"""Interval between checks for cancellation. Longer ones are felt after Ctrl-C."""

BLOCK_TIMEOUT = 10.0  # [s]
"""Time within which cancelled blocks end."""

LARGEST_SURVEY_BLOCK = 256
"""Largest block of a survey [cells], which needs a hundred runs for each cell. Larger ones report progress too
rarely."""

LARGEST_MEMORY_BLOCK = 2048
"""Largest block in memory [cells]. It fills the processor's registers nearly to its end."""


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
                for future in wait(flying, LOOK_INTERVAL, FIRST_COMPLETED).done:
                    yield *flying.pop(future), self._result(future)
        finally:
            self.cancel[0] = 1
            if not self.broken:  # a failed executor would stumble over cancelled futures and leave processes behind
                for future in flying:
                    future.cancel()
                wait(flying, timeout=BLOCK_TIMEOUT)

    def jobs(self, studies: Sequence[Study]) -> Iterator[tuple[Study, CellBlock]]:
        """Yield the blocks of studies: as large as memory allows, but enough for all workers."""
        for study in studies:
            largest = LARGEST_SURVEY_BLOCK if study.cycles else LARGEST_MEMORY_BLOCK
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


logger = logging.getLogger("friso")


@contextmanager
def connected(scheduler: str) -> Iterator[Crew]:
    """Yield a crew of workers: the worker threads of a Dask scheduler.

    `scheduler` is an address such as "tls://10.0.0.1:8786". Every thread computes one block at a time, in that thread
    alone. Certificates come from Dask's configuration (distributed.comm.tls). Without TLS, anyone who can reach the
    address can run code; this is logged. Raises InputError if the scheduler does not answer, has no workers, or one
    with another version of friso.
    """
    from distributed import Client, KilledWorker
    from distributed.comm.core import CommClosedError

    try:
        asyncio.run(_answers(scheduler))
        client: Any = Client(scheduler, timeout=settings.scheduler_timeout, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:  # TypeError: TLS without a certificate
        expected = f"the address of a Dask scheduler that answers ({error})"
        raise InputError("--scheduler", scheduler, expected, "--scheduler tls://10.0.0.1:8786") from None
    if not scheduler.startswith("tls://"):
        logger.warning("anyone who reaches %s can run code on its workers and here; tls:// keeps others out", scheduler)
    with client:
        _refuse_strangers(client)
        threads = sum(client.nthreads().values())
        arguments = {"expected": equations_version(), "pure": False}
        failures = (CancelledError, KilledWorker, CommClosedError, TimeoutError)
        yield Crew(client.get_executor(), threads, 4 * threads, run_checked, arguments, failures=failures)


async def _answers(scheduler: str) -> None:
    """Raise OSError or ValueError if nothing answers at the scheduler's address.

    The address is tried first because Dask's client, if it fails, lingers for long.
    """
    from distributed.comm.core import connect
    from distributed.security import Security

    comm = await connect(scheduler, timeout=settings.scheduler_timeout, **Security().get_connection_args("client"))
    await comm.close()


def run_checked(
    stage: Stage,
    links: Mapping[str, str],
    columns: Mapping[str, np.ndarray],
    rtol: float,
    metrics: Sequence[str],
    expected: str,
) -> Columns:
    """Run cells on a worker, after checking that its friso has the `expected` equations.

    This is checked again for each block, because workers may join after the study began. Raises InputError for another
    version.
    """
    if equations_version() != expected:
        raise _stranger("a worker", equations_version())
    return run_cells(stage, links, columns, rtol, metrics)


def _refuse_strangers(client: Any) -> None:
    """Raise InputError unless every worker has the same friso as this process."""
    if not client.nthreads():
        raise InputError("--scheduler", "a scheduler without workers", "workers: dask worker tcp://...")

    def version() -> str:  # sent as code, not by name: an older friso, or none, has no such function
        try:
            from friso.studies.study import equations_version
        except ImportError as error:
            return f"that runs no studies ({error})"
        return equations_version()

    for address, version_there in client.run(version).items():
        if version_there != equations_version():
            raise _stranger(f"the worker {address}", version_there)


def _stranger(place: str, version: str) -> InputError:
    text = f"{place} has friso {version}"
    return InputError("--scheduler", text, f"friso {equations_version()}, as here, on every worker")


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
    connection.wait([parent.sentinel])
    remove_if_passing(cache)  # the parent was killed before it could remove it
    os._exit(1)


CELLS = "cells of the map"
"""Progress message of a sweep."""


def sweep(
    stage: Stage,
    axes: Mapping[str, AxisValues],
    samples: Samples | None = None,
    links: Mapping[str, str] | None = None,
    metrics: Sequence[str] | None = None,
    rtol: float = 1e-6,
    store: str | os.PathLike[str] | None = None,
    threads: int | None = None,
) -> xr.Dataset:
    """Run every combination of the axes' values.

    An axis is a stage-file key with its values, which are one of these:

    - an array with a unit, ``(np.linspace(1, 40, 41), "Hz")``;
    - a range, ``"1 Hz..40 Hz:41"``, with ``":log"`` behind it if it is logarithmic;
    - a list of texts with units;
    - bare numbers, words or booleans, if the key takes these.

    `samples` adds a dimension "sample" along which several keys vary at once (see `Samples`). `links` are SI
    expressions for keys that follow. With ``{"mass": (masses, "kg")}`` as axis, they may be
    ``{"masses.cart": "0.7 * mass", "masses.stage": "0.3 * mass"}``.

    The result has one dimension per axis, with SI coordinates. Its variables, or the `metrics` among them, are:

    - outcome: what the run did at its end, "swings", "creeps", "rests" or "failed";
    - peaks (the thesis's count), and distinct_peaks;
    - peak_to_peak [m] and period [s] at the end of the run;
    - settling_time [s] into 1 um, and settling_time_10um [s];
    - largest_force [N];
    - steps and rejected, the solver's attempted and rejected steps, and status.

    A cell that no stage may have is "invalid", with the reason in its status. If named in `metrics`, there are also
    those of what attracts the stage, whatever its motion does:

    - attractor: "cycle", "swing" where no orbit could be closed, "nothing", or "unknown" where it is not certain;
    - amplitude [m], cycle_period [s] and multiplier, of the largest swing that was found. They are NaN where nothing
      attracts, and the multiplier also where no orbit could be closed;
    - verdict on the stage: "hunts", "bistable", "transient", "settles", "undecided" or "failed".

    The attribute `criterion` of a variable names its criterion of hunting (`friso.hunting.criteria`).

    With `store`, a folder, results are written there in Zarr as they come, and a study that was interrupted resumes.
    Raises InputError for a wrong axis, link or store, ValueError for a tolerance that is not usable.
    """
    study = Request(stage, axes, samples, links or {}).study(metrics, rtol)
    with local_crew(threads) as crew:
        if store is None:
            return run_in_memory([study], crew)[0]
        return run_in_store(study, Path(store), crew)


def run_in_memory(studies: Sequence[Study], crew: Crew, progress: Progress = silent) -> list[xr.Dataset]:
    """Run studies side by side, and return them as datasets."""
    tally = Tally(progress, sum(study.cells for study in studies))
    columns = [{name: unfilled(name, study.shape) for name in study.metrics} for study in studies]
    number = {id(study): k for k, study in enumerate(studies)}
    for study, block, columns_of_block in crew.compute(crew.jobs(studies)):
        for name in study.metrics:
            target = columns[number[id(study)]][name][block]
            target[...] = columns_of_block[name].reshape(target.shape)
        tally.add(len(columns_of_block["outcome"]), CELLS)
    return [dataset(study, columns_of_study) for study, columns_of_study in zip(studies, columns, strict=True)]


def run_in_store(study: Study, path: Path, crew: Crew, progress: Progress = silent) -> xr.Dataset:
    """Run the missing blocks of a study's store, and return the study as read from the store.

    The store at `path` is created if necessary. Raises InputError for a folder that cannot be this store.
    """
    with Store.opened(path, study) as store:
        return fill(store, crew, progress)


def fill(store: Store, crew: Crew, progress: Progress = silent) -> xr.Dataset:
    """Run the missing blocks of an opened store, and return the study as read from it."""
    study, missing = store.study, list(store.missing())
    tally = Tally(progress, study.cells)
    tally.add(study.cells - sum(map(cells_of, missing)), CELLS)
    for _, block, measures in crew.compute((study, block) for block in missing):
        store.write(block, measures)
        tally.add(len(measures["outcome"]), CELLS)
    return store.read()


def dataset(study: Study, columns: Columns) -> xr.Dataset:
    """Return the dataset of a study from its metrics, each of the study's shape."""
    import xarray as xr

    variables = {
        name: (study.names, columns[name], attributes_of(name, study.stage.axis_kind)) for name in study.metrics
    }
    return xr.Dataset(variables, coords=study.coordinates(), attrs=study.attributes())
