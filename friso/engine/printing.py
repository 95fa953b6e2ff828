"""Print SymPy expressions and eliminations as code: straight-line Python for the kernels, NumPy elsewhere.

Gaussian elimination of a matrix with many zeros becomes code without loops, because it is known which entries are zero.
Pivots stay on the diagonal, which 1/(gamma h) makes large enough. Their order decides how many operations there are,
and how long an operation waits for others. It is searched, starting from Markowitz's rule.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import sympy as sp
from sympy.printing.numpy import NumPyPrinter
from sympy.printing.pycode import PythonCodePrinter

MatrixEntry = tuple[int, int]

MULTIPLY_LATENCY, DIVIDE_LATENCY = 4, 13
"""Latency of a fused multiply-add and of a division, in cycles, on current x86-64 processors."""

OPERATION_CLOCKS = 0.5
"""Processor clocks of a vector operation that nothing waits for; two work side by side."""


@dataclass(frozen=True)
class Elimination:
    """A symbolic elimination: pivot order, entries of both factors, and the factorising code.

    Entries of the lower factor are in the order of use, those of the upper one by row.
    """

    order: tuple[int, ...]
    lower: tuple[MatrixEntry, ...]
    upper: dict[int, tuple[int, ...]]
    code: tuple[str, ...]

    def solve(self, name: str) -> list[str]:
        """Return code that solves the system for a right-hand side, which the solution replaces.

        The entries of the right-hand side are called `name` followed by the row.
        """
        forward = [f"{name}{i} = {name}{i} - L_{i}_{k} * {name}{k}" for i, k in self.lower]
        backward = [
            f"{name}{k} = {name}{k} * D_{k}" + "".join(f" - U_{k}_{j} * {name}{j}" for j in self.upper[k])
            for k in reversed(self.order)
        ]
        return forward + backward


def eliminate(size: int, nonzero: set[MatrixEntry], diagonal: set[int], solves: int) -> Elimination:
    """Write the elimination of a matrix with entries ``A_i_j`` at `nonzero` and on the diagonal.

    The matrix has `size` rows. Rows not in `diagonal` have the variable ``diagonal``, 1/(gamma h), on the diagonal; the
    variable ``inverse`` is its inverse. The pivot order is improved by exchanging two pivots until no exchange makes
    one factorisation and `solves` solutions cheaper.
    """
    pattern = nonzero | {(i, i) for i in range(size)}
    order = _markowitz(size, pattern)
    best = _cost(order, pattern, diagonal, solves)
    improved = True
    while improved:
        improved = False
        for a, b in combinations(range(size), 2):
            trial = list(order)
            trial[a], trial[b] = trial[b], trial[a]
            cost = _cost(trial, pattern, diagonal, solves)
            if cost < best:
                order, best, improved = trial, cost, True
    return _write(order, pattern, diagonal)


def _markowitz(size: int, nonzero: set[MatrixEntry]) -> list[int]:
    """Return the order of the pivots: always next the one that causes the fewest products.

    The matrix has `size` rows and is not zero at `nonzero`.
    """
    pattern, left, order = set(nonzero), set(range(size)), []
    while left:
        rows = {k: [i for i in left if i != k and (i, k) in pattern] for k in left}
        columns = {k: [j for j in left if j != k and (k, j) in pattern] for k in left}
        pivot = min(left, key=lambda k: (len(rows[k]) * len(columns[k]), k))
        left.remove(pivot)
        order.append(pivot)
        pattern |= {(i, j) for i in rows[pivot] for j in columns[pivot]}
    return order


def _cost(order: Sequence[int], nonzero: set[MatrixEntry], diagonal: set[int], solves: int) -> float:
    """Estimate the processor clocks of one factorisation and `solves` solutions.

    Pivots are taken in this `order`. The matrix is not zero at `nonzero`; rows not in `diagonal` have a common number
    on the diagonal. The estimate is the longest chain of operations that wait for each other, plus some time for every
    operation.
    """
    ready = dict.fromkeys(nonzero, 0)
    inverse, operations = dict.fromkeys(order, 0), 0
    forward, backward = dict.fromkeys(order, 0), dict.fromkeys(order, 0)
    untouched = set(order) - diagonal
    for step, k in enumerate(order):
        inverse[k] = 0 if k in untouched else ready[k, k] + DIVIDE_LATENCY
        later = order[step + 1 :]
        for i in (i for i in later if (i, k) in ready):
            factor = max(ready[i, k], inverse[k]) + MULTIPLY_LATENCY
            forward[i] = max(forward[i], forward[k]) + MULTIPLY_LATENCY
            operations += 1 + solves
            for j in (j for j in later if (k, j) in ready):
                ready[i, j] = max(ready.get((i, j), 0), factor, ready[k, j]) + MULTIPLY_LATENCY
                untouched -= {i} if i == j else set()
                operations += 1
    for step in range(len(order) - 1, -1, -1):
        k = order[step]
        backward[k] = forward[k] + MULTIPLY_LATENCY
        for j in (j for j in reversed(order[step + 1 :]) if (k, j) in ready):
            backward[k] = max(backward[k], backward[j]) + MULTIPLY_LATENCY
            operations += 1 + solves
    return max(inverse.values()) + solves * max(backward.values()) + OPERATION_CLOCKS * operations


def _write(order: Sequence[int], nonzero: set[MatrixEntry], diagonal: set[int]) -> Elimination:
    """Write the elimination with its pivots in the given order."""
    pattern, untouched = set(nonzero), set(order) - diagonal
    code: list[str] = []
    lower: list[MatrixEntry] = []
    upper: dict[int, tuple[int, ...]] = {}
    for step, k in enumerate(order):
        later = order[step + 1 :]
        code.append(f"D_{k} = inverse" if k in untouched else f"D_{k} = 1.0 / A_{k}_{k}")
        columns = [j for j in later if (k, j) in pattern]
        upper[k] = tuple(reversed(columns))
        code += [f"U_{k}_{j} = A_{k}_{j} * D_{k}" for j in columns]
        for i in later:
            if (i, k) not in pattern:
                continue
            lower.append((i, k))
            code.append(f"L_{i}_{k} = A_{i}_{k} * D_{k}")
            for j in columns:
                present = f"A_{i}_{j}" if (i, j) in pattern else ""
                code.append(f"A_{i}_{j} = {present} - L_{i}_{k} * A_{k}_{j}")
                pattern.add((i, j))
                untouched -= {i} if i == j else set()
    return Elimination(tuple(order), tuple(lower), upper, tuple(code))


Rename = Callable[[sp.Symbol], str]


class reciprocal(sp.Function):
    """Reciprocal 1/x, kept apart from powers so that x^-1 and x^-2 share one division."""


def reciprocals(expr: Any) -> Any:
    """Return an expression with every negative whole power written as a power of a reciprocal."""

    def negative_power(e: Any) -> bool:
        return e.is_Pow and e.exp.is_Integer and e.exp < 0

    return expr.replace(negative_power, lambda e: reciprocal(e.base) ** -e.exp)


class _KernelPrinter(PythonCodePrinter):
    """Printer of expressions as scalar code that calls only `friso.engine.simd_math`."""

    def __init__(self, rename: Rename) -> None:
        super().__init__({"fully_qualified_modules": False})
        self._rename = rename

    def _print_Symbol(self, expr: sp.Symbol) -> str:
        return self._rename(expr)

    def _print_Rational(self, expr: sp.Rational) -> str:
        return repr(float(expr))

    _print_Integer = _print_Rational
    _print_NumberSymbol = _print_Rational
    _print_Pi = _print_Rational

    def _print_exp(self, expr: sp.exp) -> str:
        return f"exp({self._print(expr.args[0])})"

    def _print_tanh(self, expr: sp.tanh) -> str:
        return f"tanh({self._print(expr.args[0])})"

    def _print_call(self, expr: sp.Expr) -> str:
        return f"{type(expr).__name__}({', '.join(self._print(argument) for argument in expr.args)})"

    _print_gaussian = _print_quantised = _print_clipped = _print_sine = _print_call

    def _print_reciprocal(self, expr: sp.Expr) -> str:
        return f"(1.0 / ({self._print(expr.args[0])}))"

    def _print_Pow(self, expr: sp.Pow, rational: bool = False, sqrt: str = "") -> str:
        base, exponent = expr.base, expr.exp
        text = f"({self._print(base)})"
        if exponent.is_Integer:
            product = "(" + " * ".join([text] * abs(int(exponent))) + ")"
            return product if exponent > 0 else f"(1.0 / {product})"
        if abs(exponent) == sp.S.Half:
            return f"sqrt({text})" if exponent > 0 else f"(1.0 / sqrt({text}))"
        return f"power({text}, {self._print(exponent)})"

    def _print_re(self, expr: sp.re) -> str:
        # all symbols are real, which SymPy does not know: its abs(exp(x)) is exp(re(x))
        return self._print(expr.args[0])

    def _print_Mul(self, expr: sp.Mul) -> str:
        return "(" + " * ".join(f"({self._print(factor)})" for factor in expr.args) + ")"


def print_scalar(expr: Any, rename: Rename) -> str:
    """Return an expression as kernel code."""
    return str(_KernelPrinter(rename).doprint(expr))


class _Renamed(NumPyPrinter):
    """Printer of expressions as NumPy code, with symbols renamed to places in arrays."""

    def __init__(self, rename: Rename) -> None:
        super().__init__({"fully_qualified_modules": False})
        self._rename = rename

    def _print_Symbol(self, expr: sp.Symbol) -> str:
        return self._rename(expr)

    def _print_sine(self, expr: sp.Expr) -> str:
        return f"sine({self._print(expr.args[0])})"

    def _print_clipped(self, expr: sp.Expr) -> str:
        value, limit = map(self._print, expr.args)
        return f"np.clip({value}, -({limit}), {limit})"

    def _print_Piecewise(self, expr: sp.Piecewise) -> str:
        """Print cases as nested `where`, which is faster than the `select` that SymPy prints."""
        text = "np.nan"
        for case in reversed(expr.args):
            result, condition = case.args
            value = self._print(result)
            text = value if condition == sp.true else f"np.where({self._print(condition)}, {value}, {text})"
        return text

    def _module_format(self, fqn: str, register: bool = True) -> str:
        return fqn.replace("numpy.", "np.")


def print_numpy(expr: sp.Expr, rename: Rename) -> str:
    """Return an expression as NumPy code that broadcasts."""
    return str(_Renamed(rename).doprint(expr))


class Constants:
    """Subexpressions that are constant over a run, collected to be computed once."""

    def __init__(self, parameters: Iterable[sp.Symbol]) -> None:
        self._parameters = frozenset(parameters)
        self._symbols: dict[sp.Expr, sp.Symbol] = {}

    @property
    def expressions(self) -> Sequence[sp.Expr]:
        return list(self._symbols)

    @property
    def index(self) -> Mapping[sp.Symbol, int]:
        return {symbol: i for i, symbol in enumerate(self._symbols.values())}

    def hoist(self, expr: Any) -> Any:
        """Replace every largest subexpression in parameters alone by the symbol of a constant."""
        if expr.is_number or not expr.free_symbols & self._parameters:
            return expr
        if expr.free_symbols <= self._parameters and not isinstance(expr, sp.Tuple):  # a case is no number
            return self._symbols.setdefault(expr, sp.Symbol(f"c{len(self._symbols)}", real=True))
        if isinstance(expr, sp.Add | sp.Mul):
            shared = [a for a in expr.args if a.free_symbols <= self._parameters]
            if any(a.free_symbols for a in shared):
                rest = [self.hoist(a) for a in expr.args if a not in shared]
                return expr.func(self.hoist(expr.func(*shared)), *rest)
        return expr.func(*(self.hoist(a) for a in expr.args))
