"""Compile friso's declared equations for solvers that take a right-hand side and a Jacobian.

The numbers of the rig are written into the code, common subexpressions are shared, and Numba compiles it with fast
arithmetic. More cannot be done for a solver that calls back. Kinks are evaluated at every call.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from numba import njit

from benchmarks.rigs import Rig
from friso.equations.component import TIME
from friso.equations.model import REFERENCE, assemble
from friso.equations.structure import structure

_LOOK_UP = [
    "i = 0",
    "while i + 1 < rows.shape[0] and t >= rows[i + 1, 0]:",
    "    i += 1",
    "since, r0, r1, r2 = t - rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3]",
]


@dataclass(frozen=True)
class Compiled:
    """Right-hand side and Jacobian of a rig, as functions of absolute time [s] and state.

    `rows` (pieces, 4) is the reference as in `Rig.pieces`: all of it, or the one piece at hand.
    `fill_rate(t, x, rows, out)`, `fill_jacobian(t, x, rows, out)` write into out; `rate`, `jacobian` return an array.
    """

    rate: Callable[..., np.ndarray]
    jacobian: Callable[..., np.ndarray]
    fill_rate: Callable[..., None]
    fill_jacobian: Callable[..., None]


def compile_equations(rig: Rig) -> Compiled:
    """Compile the equations of a rig."""
    model = assemble(structure(rig.flat))
    values = {sp.Symbol(name, real=True): sp.Float(value) for name, value in rig.parameters.items()}
    names = {symbol: sp.Symbol(f"x{i}", real=True) for i, symbol in enumerate(model.symbols)}
    names |= {kink.beyond: sp.Symbol(f"beyond{k}", real=True) for k, kink in enumerate(model.kinks)}
    names |= dict(zip((*REFERENCE, TIME), sp.symbols("r0 r1 r2 since", real=True), strict=True))

    def plain(expression: sp.Expr) -> sp.Expr:
        return sp.N(sp.sympify(expression).xreplace(values).xreplace(names), 20)

    surfaces = [plain(kink.surface) for kink in model.kinks]
    rates = {f"out[{i}]": plain(f) for i, f in enumerate(model.rhs)}
    entries = {
        f"out[{i}, {j}]": plain(sp.diff(f, x)) for i, f in enumerate(model.rhs) for j, x in enumerate(model.symbols)
    }
    n = len(model.symbols)
    fill_rate = _function("fill_rate", n, surfaces, rates)
    fill_jacobian = _function("fill_jacobian", n, surfaces, entries)

    @njit
    def rate(t: float, x: np.ndarray, rows: np.ndarray) -> np.ndarray:
        out = np.empty(n)
        fill_rate(t, x, rows, out)
        return out

    @njit
    def jacobian(t: float, x: np.ndarray, rows: np.ndarray) -> np.ndarray:
        out = np.empty((n, n))
        fill_jacobian(t, x, rows, out)
        return out

    return Compiled(rate, jacobian, fill_rate, fill_jacobian)


def _function(name: str, n: int, surfaces: Iterable[sp.Expr], targets: Mapping[str, sp.Expr]) -> Any:
    """Return a compiled function that fills `targets`."""
    lines = [*_LOOK_UP, *(f"x{i} = x[{i}]" for i in range(n))]
    lines += [f"beyond{k} = 1.0 if {sp.pycode(s)} > 0.0 else 0.0" for k, s in enumerate(surfaces)]
    shared, reduced = sp.cse(list(targets.values()), symbols=sp.numbered_symbols("w"), order="none")
    lines += [f"{symbol} = {sp.pycode(e)}" for symbol, e in shared]
    lines += [f"{target} = {sp.pycode(e)}" for target, e in zip(targets, reduced, strict=True)]
    source = f"def {name}(t, x, rows, out):\n" + "".join(f"    {line}\n" for line in lines)
    space: dict[str, Any] = {}
    exec("import math\n" + source, space)
    return njit(fastmath=True, error_model="numpy")(space[name])
