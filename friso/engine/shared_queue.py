"""The queue from which threads take their runs, one by one, so that all of them are busy to the end."""

from __future__ import annotations

from typing import Any

import llvmlite.ir as ir
import numpy as np
from numba import types
from numba.extending import intrinsic


def new_queue() -> np.ndarray:
    """A queue whose next run is number 0, shape (1,)."""
    return np.zeros(1, np.int64)


@intrinsic
def take_next(typing_context: Any, queue: Any) -> Any:
    """The number at the head of the queue, which no other thread gets too."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        return builder.atomic_rmw("add", array.data, ir.Constant(ir.IntType(64), 1), "monotonic")

    return types.int64(queue), code
