"""Limit how much may be computed to answer one question, counted in work.

Work is counted rather than time, so that the answer is equal on every machine.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import NoReturn

import numpy as np

PER_BATCH = 1e5
"""Work to prepare a batch of runs."""

COUNTED_LANES = 8
"""Runs that are counted as done side by side on every processor: one with fewer lanes takes longer, and gives up where
others do."""

FAIR = 2.0
"""Share of what is left that each of several runs may take, in units of an equal share."""


class Exhausted(Exception):
    """The work allowed does not suffice for the runs that were to be done."""


@dataclass
class Allowance:
    """Work that runs may take together, and how much of it is `used`.

    `work` counts steps times the work of a step of their kernel (`Kernel.work`; a unit is about 12 ns on a core of
    2024). `exhausted` tells whether runs were given up for want of work, of this allowance or of one `around` it,
    which limits it as well.
    """

    work: float
    around: Allowance | None = None
    used: float = 0.0
    exhausted: bool = False

    @property
    def left(self) -> float:
        """Return the work that may still be used."""
        own = self.work - self.used
        return own if self.around is None else min(own, self.around.left)

    def most_steps(self, runs: int, step: float) -> float:
        """Return how many steps each of some runs may take, a step being so much work.

        Raises Exhausted if nothing is left.
        """
        left = self.left
        if left <= 0:
            self.exhaust()
        return left / step * min(1 / COUNTED_LANES, FAIR / runs)

    def exhaust(self) -> NoReturn:
        """Tell that the allowance, or one around it, does not suffice: raises Exhausted."""
        left, at = self.left, self
        at.exhausted = True
        while at.work - at.used > left and at.around is not None:
            at = at.around
            at.exhausted = True
        raise Exhausted

    def charge(self, steps: np.ndarray, step: float) -> None:
        """Count the work of a batch of runs by their steps, shape (runs,).

        `step` is the work of a step. A run alone takes as long as eight.
        """
        work = PER_BATCH + step * max(float(np.sum(steps)), COUNTED_LANES * float(np.max(steps, initial=0.0)))
        at: Allowance | None = self
        while at is not None:
            at.used += work
            at = at.around


_CURRENT: ContextVar[Allowance | None] = ContextVar("allowance", default=None)


def current_allowance() -> Allowance | None:
    """Return the allowance under which runs are done now, if any."""
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
