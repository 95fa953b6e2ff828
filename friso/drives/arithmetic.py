"""Read numbers in drive scripts, written as digits or as arithmetic."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from math import inf, pi
from operator import add, mul, neg, pos, pow, sub, truediv

LONGEST_EXPRESSION = 200
"""Longest arithmetic expression in characters."""

_NAMED: Mapping[str, float] = {
    "float('inf')": inf,
    **{f"{module}{name}": value for name, value in (("pi", pi), ("inf", inf)) for module in ("", "math.", "np.")},
}
_PAIRS = {ast.Add: add, ast.Sub: sub, ast.Mult: mul, ast.Div: truediv, ast.Pow: pow}
_SIGNS = {ast.USub: neg, ast.UAdd: pos}

_OTHER = re.compile(r"\d(?!e[+-]?\d)[a-z_]|\\", re.IGNORECASE)
"""Pattern of texts that are not arithmetic and would make Python's parser warn, such as letters after a digit in
0x10."""


def number_in(text: str) -> float | None:
    """Return the number that a text stands for, or None if it is no number.

    Arithmetic with +, -, *, /, **, brackets, pi and inf is evaluated. Python code is never executed.
    """
    if len(text) > LONGEST_EXPRESSION or _OTHER.search(text):
        return None
    try:
        return _worked_out(ast.parse(text.strip(), mode="eval").body)
    except (SyntaxError, ValueError, ArithmeticError, RecursionError, MemoryError):
        return None


def _worked_out(node: ast.expr) -> float:
    """Return the value of an arithmetic expression.

    Raises ValueError for anything but arithmetic of numbers, and for a root of a negative number.
    """
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return float(value)
        case ast.BinOp(left, sign, right) if type(sign) in _PAIRS:
            value = _PAIRS[type(sign)](_worked_out(left), _worked_out(right))
            if isinstance(value, complex):
                raise ValueError(value)
            return value
        case ast.UnaryOp(sign, operand) if type(sign) in _SIGNS:
            return _SIGNS[type(sign)](_worked_out(operand))
    name = ast.unparse(node)
    if name not in _NAMED:
        raise ValueError(name)
    return _NAMED[name]
