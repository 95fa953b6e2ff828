"""Compute a study on a Dask cluster, one task for each block."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from typing import Any

import numpy as np

from friso.errors import InputError
from friso.stage import Stage
from friso.studies.cells import Columns, run_cells
from friso.studies.execute import Crew
from friso.studies.settings import settings
from friso.studies.study import equations_version

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
