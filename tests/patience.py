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


LONG = 30_000
"""Characters of a text that is long, but not so long that it is refused unread."""


def grows_with_the_square(read: Callable[[int], object], long: int = LONG) -> bool:
    """Tell whether reading takes much more than four times as long, on the processor, where a text is so."""

    def seconds(length: int) -> float:
        begin = time.process_time()
        read(length)
        return time.process_time() - begin

    return min(seconds(4 * long) for _ in range(2)) > 10 * max(0.01, *(seconds(long) for _ in range(3)))
