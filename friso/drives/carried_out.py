"""Carry out a controller's program in Python, in double or single precision."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import exp, floor, sqrt
from typing import Any

import numpy as np

from friso.drives.languages import PYTHON
from friso.drives.program import Program, identifier

Real = Callable[[Any], Any]
"""Type of the numbers of a sample: float or numpy.float32."""


def carried_out(
    program: Program, start: Mapping[str, float], inputs: Mapping[str, np.ndarray], real: Real = float
) -> np.ndarray:
    """Return the outputs of a program over samples, shape (n,).

    The run begins with the inputs and the output of `start`; `inputs` have the shape (n,). Constants and the beginning
    are computed in double precision, and the samples with numbers of the type `real`.
    """
    begins = (*program.prepared, *program.begins)
    values = {identifier(str(key)): value for key, value in program.parameters.items()} | dict(start)
    scope: dict[str, Any] = {"abs": abs, "exp": exp, "floor": floor, "sqrt": sqrt}
    exec("\n".join(PYTHON.lines(begins, identifier)), scope, values)
    kept = [identifier(str(one)) for one in program.memories]
    begun = [eval(PYTHON.expression(value, identifier), scope, values) for value in program.started]
    numbers = {identifier(str(one)): real(values[identifier(str(one))]) for one in program.sampled_constants}
    following = ", ".join(PYTHON.expression(value, identifier) for value in (*program.updates, program.command))
    names = [*map(identifier, map(str, program.inputs))]
    body = [*PYTHON.lines(program.steps, identifier), f"return ({following},)"]
    scope |= numbers
    exec(f"def sample({', '.join([*kept, *names])}):\n" + "\n".join(f"    {line}" for line in body), scope)
    memories, outputs = [*map(real, begun)], []
    for row in zip(*(inputs[name].tolist() for name in names), strict=True):
        *memories, output = scope["sample"](*memories, *map(real, row))
        outputs.append(float(output))
    return np.array(outputs)


def single_difference(program: Program, start: Mapping[str, float], inputs: Mapping[str, np.ndarray]) -> float:
    """Return by how much outputs in single precision differ at most from those in double precision."""
    with np.errstate(over="ignore"):
        single = carried_out(program, start, inputs, np.float32)
    return float(np.abs(single - carried_out(program, start, inputs)).max())
