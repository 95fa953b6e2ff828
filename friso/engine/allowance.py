"""Limit how far a computation goes: its work, and its relative tolerance.

Work is counted rather than time, so that the answer to a question is equal on every machine.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from friso.errors import InputError


class Exhausted(Exception):
    """Error: the allowed work does not suffice for the requested runs."""


COUNTED_LANES = 8
"""Runs that count as computed side by side, whatever the processor. A processor with fewer lanes takes longer, but
stops at equal work."""

FAIR_SHARE_FACTOR = 2.0  # [of an equal part]
"""Largest part of the remaining work for each of several runs. With less, the longest run stops early."""

BATCH_WORK = 1e5
"""Work to prepare a batch of runs, which Python does."""


@dataclass
class Allowance:
    """Work that runs may take together, and how much of it is `used`.

    `work` counts steps times the work of a step (`Kernel.work`; a unit is about 12 ns on a core of 2024). `exhausted`
    is true if runs were dropped because this allowance, or one `around` it, did not suffice.
    """

    work: float
    around: Allowance | None = None
    used: float = 0.0
    exhausted: bool = False

    @property
    def left(self) -> float:
        """Return the work that may still be used, by this allowance and those around it."""
        own = self.work - self.used
        return own if self.around is None else min(own, self.around.left)

    def most_steps(self, runs: int, step: float) -> float:
        """Return how many steps each of several runs may take; a step takes the work `step`.

        Raises Exhausted if nothing is left.
        """
        left = self.left
        if left <= 0:
            self.exhaust()
        return left / step * min(1 / COUNTED_LANES, FAIR_SHARE_FACTOR / runs)

    def exhaust(self) -> NoReturn:
        """Raise Exhausted, because the allowance, or one around it, does not suffice."""
        left, at = self.left, self
        at.exhausted = True
        while at.work - at.used > left and at.around is not None:
            at = at.around
            at.exhausted = True
        raise Exhausted

    def charge(self, steps: np.ndarray, step: float) -> None:
        """Add the work of runs, from their numbers of steps, (runs,), and the work of one `step`.

        A single run counts as much as eight, because eight are computed side by side.
        """
        longest = COUNTED_LANES * float(np.max(steps, initial=0.0))
        work = BATCH_WORK + step * max(float(np.sum(steps)), longest)
        at: Allowance | None = self
        while at is not None:
            at.used += work
            at = at.around


_CURRENT: ContextVar[Allowance | None] = ContextVar("allowance", default=None)


def current_allowance() -> Allowance | None:
    """Return the allowance of the current runs, or None."""
    return _CURRENT.get()


@contextmanager
def allowance(work: float = np.inf) -> Iterator[Allowance]:
    """Limit the work of all runs within the block; a run that needs more raises Exhausted."""
    some = Allowance(work, _CURRENT.get())
    token = _CURRENT.set(some)
    try:
        yield some
    finally:
        _CURRENT.reset(token)


TIGHTEST_RTOL, LOOSEST_RTOL = 1e-12, 1e-2


def checked_rtol(rtol: float) -> float:
    """Return `rtol` if the solver can meet it. Raises InputError otherwise."""
    if not TIGHTEST_RTOL <= rtol <= LOOSEST_RTOL:
        raise InputError("rtol", f"{rtol:g}", "a number from 1e-12 to 1e-2", "rtol=1e-6")
    return rtol
