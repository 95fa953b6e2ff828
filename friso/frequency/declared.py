"""Linearise equations: derive the Jacobian in symbols, and evaluate it for many states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import sympy as sp

from friso.frequency.system import System


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
