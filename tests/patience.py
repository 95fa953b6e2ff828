"""Wait for what another thread or process does, however busy the machine is."""

import time
from collections.abc import Callable

LIMIT = 300.0
"""Seconds after which something is taken to have hung: no test depends on how quick a machine is."""


def wait_until(happened: Callable[[], object]) -> None:
    """Wait until a condition holds. Raises TimeoutError if it does not within `LIMIT`."""
    end = time.monotonic() + LIMIT
    while not happened():
        if time.monotonic() > end:
            raise TimeoutError(f"not within {LIMIT:g} s")
        time.sleep(0.01)
