"""Straight-line code compiled and run on its own."""

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from friso.engine.kernel import Kernel
from friso.engine.machine_code import load_object, object_code
from friso.engine.vector_code import vector_llvm


@cache
def function(original: Callable[..., Any], lanes: int, numbers: int) -> Any:
    """Return a compiled function of a buffer's address and `numbers` numbers."""
    return at_address(load_object(object_code(vector_llvm({"run": original}, lanes)), ["run"])["run"], numbers)


def at_address(address: int, numbers: int) -> Any:
    return ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p, *[ctypes.c_double] * numbers)(address)


def aligned(values: np.ndarray) -> np.ndarray:
    """A copy as a flat buffer that begins on a boundary of 64 bytes."""
    room = np.empty(values.size + 8)
    first = -room.ctypes.data % 64 // 8
    room[first : first + values.size] = values.ravel()
    return room[first : first + values.size]


def step(kernel: Kernel, buffer: np.ndarray, *numbers: float) -> int:
    """Take a step in all lanes of a kernel's buffer; the bits of those that want attention."""
    return at_address(kernel.layout.step, len(numbers))(buffer.ctypes.data, *numbers)


def in_all(original: Callable[..., Any], rows: np.ndarray, *numbers: float, lanes: int = 8) -> np.ndarray:
    """Apply straight-line code to the columns of an array (rows, n), `lanes` columns at a time."""
    count = rows.shape[1]
    result = np.pad(rows, ((0, 0), (0, -count % lanes)), mode="edge")
    for first in range(0, result.shape[1], lanes):
        buffer = aligned(result[:, first : first + lanes])
        function(original, lanes, len(numbers))(buffer.ctypes.data, *numbers)
        result[:, first : first + lanes] = buffer.reshape(-1, lanes)
    return result[:, :count]
