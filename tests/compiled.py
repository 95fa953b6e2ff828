"""Straight-line code compiled and run on its own."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numba import njit

from friso.engine.vector_code import OPTIONS, in_lanes


@cache
def compiled(function: Callable[..., None], lanes: int) -> Any:
    all_lanes = in_lanes(function, lanes)

    @njit(**OPTIONS)
    def run(buffer, *numbers):
        all_lanes(buffer, numbers)

    return run


def in_all(function: Callable[..., None], rows: np.ndarray, *numbers: float, lanes: int = 8) -> np.ndarray:
    """What straight-line code makes of the columns of an array of shape (rows, n), so many of them at a time."""
    count = rows.shape[1]
    result = np.pad(rows, ((0, 0), (0, -count % lanes)), mode="edge")
    for first in range(0, count, lanes):
        buffer = result[:, first : first + lanes].flatten()
        compiled(function, lanes)(buffer, *numbers)
        result[:, first : first + lanes] = buffer.reshape(-1, lanes)
    return result[:, :count]
