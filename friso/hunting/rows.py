"""Base for results of many stages or runs: arrays with one row each, to select from."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, Self

import numpy as np


class ArrayRows:
    """Base of dataclasses with one row for every stage or run.

    All arrays have these rows, and so have parts with arrays of their own. Numbers and words that all rows share stay
    unchanged.
    """

    def take(self, numbers: Any) -> Self:
        """Select the rows with these numbers; a number may occur several times."""
        parts = {part.name: _rows_of(getattr(self, part.name), numbers) for part in fields(self)}  # type: ignore[arg-type]
        return replace(self, **parts)  # type: ignore[type-var]


def spans(flags: np.ndarray) -> list[tuple[int, int]]:
    """Return the first and last numbers of each group of neighbouring flags, shape (count,), that are true."""
    ends = np.flatnonzero(np.diff(flags.astype(int), prepend=0, append=0))
    return [(int(first), int(after) - 1) for first, after in zip(ends[::2], ends[1::2], strict=True)]


def _rows_of(part: Any, numbers: Any) -> Any:
    """Select rows by number from an array, or all arrays in a `part`; return others unchanged."""
    if isinstance(part, np.ndarray):
        return part[numbers]
    if isinstance(part, tuple):
        return tuple(_rows_of(one, numbers) for one in part)
    return part.take(numbers) if hasattr(part, "take") and not isinstance(part, np.generic) else part
