"""Represent many linear systems with equal states at once: arrays with one system per row.

Linearise equations: derive the Jacobian in symbols, and evaluate it for many states.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy as sp

Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class System:
    """Linear systems x' = a x + b u, y = c x + d u, as many as there are members.

    a (members, n, n), b (members, n, m), c (members, p, n), d (members, p, m), with the names of states, inputs and
    outputs. For a sampled system x' is the next x.
    """

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray
    states: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()

    def take(self, inputs: Sequence[str], outputs: Sequence[str]) -> System:
        """Return the system with the given inputs and outputs only, in this order."""
        columns = [self.inputs.index(name) for name in inputs]
        rows = [self.outputs.index(name) for name in outputs]
        b, c, d = self.b[..., columns], self.c[..., rows, :], self.d[..., rows, :][..., columns]
        return System(self.a, b, c, d, self.states, tuple(inputs), tuple(outputs))

    def keep(self, numbers: Sequence[int]) -> System:
        """Return the system with some of its states only, the others being 0."""
        a, b, c = self.a[:, numbers][:, :, numbers], self.b[:, numbers], self.c[:, :, numbers]
        return replace(self, a=a, b=b, c=c, states=tuple(self.states[i] for i in numbers))

    def sees(self, name: str) -> bool:
        """Tell whether any state or output depends on the input with this name."""
        column = self.inputs.index(name)
        return bool(self.b[..., column].any() or self.d[..., column].any())

    def at(self, points: np.ndarray) -> Complex:
        """Return transfer matrices c (s - a)^-1 b + d at points s, (k,) or (members, k).

        The result has shape (members, k, p, m).
        """
        shifted = points[..., None, None] * np.eye(self.a.shape[-1]) - self.a[:, None]
        answers = np.linalg.solve(shifted, self.b[:, None])
        return (self.c[:, None] @ answers + self.d[:, None]).astype(complex)


@dataclass(frozen=True)
class Declared:
    """Equations to be linearised, in symbols.

    `states` have their `rates` of change. `inputs` are symbols, and `outputs` expressions, by name.
    """

    states: tuple[sp.Symbol, ...]
    rates: tuple[sp.Expr, ...]
    inputs: Mapping[str, sp.Symbol]
    outputs: Mapping[str, sp.Expr]

    @cached_property
    def _entries(self) -> tuple[list[tuple[int, int]], Any, list[str]]:
        """Return where the matrix [[a, b], [c, d]] is not zero, and a function for these entries.

        Also returns the names of the function's arguments.
        """
        rows = sp.Matrix([*self.rates, *self.outputs.values()])
        matrix = rows.jacobian([*self.states, *self.inputs.values()])
        entries = {place: entry for place, entry in matrix.todok().items() if entry != 0}
        symbols = sorted(set[Any]().union(*(entry.free_symbols for entry in entries.values())), key=str)
        function = sp.lambdify(symbols, list(entries.values()), [{"sine": sine}, "numpy"], cse=True)
        return list(entries), function, [str(symbol) for symbol in symbols]

    def at(self, values: Mapping[str, Any], members: int) -> System:
        """Return the linear systems for values of the symbols, by name.

        Values are numbers, or arrays of shape (members,) for as many systems.
        """
        places, function, names = self._entries
        n, m, p = len(self.states), len(self.inputs), len(self.outputs)
        matrices = np.zeros((members, n + p, n + m))
        for (i, j), entry in zip(places, function(*(values[name] for name in names)), strict=True):
            matrices[:, i, j] = entry
        parts = matrices[:, :n, :n], matrices[:, :n, n:], matrices[:, n:, :n], matrices[:, n:, n:]
        return System(*parts, tuple(map(str, self.states)), tuple(self.inputs), tuple(self.outputs))


def sine(turns: Any) -> Any:
    """Return sin(2 pi x) of a number of turns x, for `friso.equations.component.sine`."""
    return np.sin(2 * np.pi * turns)
