"""Print SymPy expressions as straight-line Python for the kernels, and as NumPy elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import sympy as sp
from sympy.printing.numpy import NumPyPrinter
from sympy.printing.pycode import PythonCodePrinter

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
