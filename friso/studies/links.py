"""Evaluate links: expressions such as "0.7 * mass" for keys that follow a study's axes.

Numbers without a unit are in SI.
"""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from friso.errors import InputError
from friso.quantities import quoted, si_value
from friso.stage import Stage

EXAMPLE = 'masses.stage = "0.3 * mass" or friction.static = "max(friction.static, friction.coulomb)"'

_OPERATORS: dict[type, Any] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_FUNCTIONS: dict[str, Any] = {"min": np.minimum, "max": np.maximum, "sqrt": np.sqrt, "abs": np.abs}
_KEY, _ELEMENT = re.compile(r"\b[A-Za-z_]\w*(?:\.\w+)+"), re.compile(r"\.([0-9]+)\b")
"""Patterns of a key, and of the number of an array element in a key, as in controller.filters.2.frequency. Python
itself would write [2]."""

_QUANTITY = re.compile(r"(?<![\w.])[0-9.]+(?:[eE][+-]?[0-9]+)?\s+[^\W\d_][\w/*^²³]*(?:/\([\w*^]+\))?")
"""Pattern of a number with a unit, which has no blanks: "2 um", "0.5 N*s/m", "3 N/(m*s)"."""

_ARGUMENTS = {"min": 2, "max": 2, "sqrt": 1, "abs": 1}


def names(links: Mapping[str, str]) -> frozenset[str]:
    """Return every name of a key or an axis in the expressions of links.

    Raises InputError for an expression that is not allowed.
    """
    trees = [_parsed(key, text) for key, text in links.items()]
    called = {id(node.func) for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Call)}
    keys = set()
    for tree in trees:
        inner = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Attribute | ast.Subscript)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Name | ast.Attribute | ast.Subscript) and id(node) not in called | inner:
                keys.add(_name(node))
    return frozenset(keys)


def check_links(stage: Stage, links: Mapping[str, str], axes: frozenset[str]) -> None:
    """Check that links lead to keys, and that their expressions use only keys or `axes`.

    Raises InputError otherwise.
    """
    numeric = stage.numeric_keys()
    for key in links:
        if key not in numeric:
            stage.flat({key: 0.0})  # raises an error that names the nearest key
        if key in axes and key not in names({key: links[key]}):
            text = f"{key} = {links[key]}, which does not follow the axis {key}"
            raise InputError("link", text, "an axis or a link, or a link in which the axis occurs", EXAMPLE)
    for name in sorted(names(links) - axes):
        if name not in numeric or name not in stage.flat():
            raise InputError("link", f"the name {name}", "axes and numeric keys that the stage has", EXAMPLE)


def linked(links: Mapping[str, str], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the SI values of linked keys, from `values` of keys and axes (numbers or arrays).

    A link can use the links before it.
    """
    numbers = dict(values)
    for key, text in links.items():
        with np.errstate(all="ignore"):  # a result that is no number makes the cell invalid
            numbers[key] = _value(_parsed(key, text), numbers)
    return {key: numbers[key] for key in links}


def _parsed(key: str, text: str) -> ast.expr:
    try:
        plain = _QUANTITY.sub(lambda quantity: repr(si_value(quantity[0])), text.strip())
        tree = ast.parse(_KEY.sub(lambda key: _ELEMENT.sub(r"[\1]", key[0]), plain), mode="eval").body
        _check(tree)
    except InputError as error:
        raise error.under(key) from None
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise InputError(
            key, quoted(text), "numbers, with units or in SI, names, + - * / **, min, max, sqrt, abs", EXAMPLE
        ) from error
    return tree


def _check(node: ast.expr) -> None:
    """Raise ValueError for anything but arithmetic in an expression."""
    match node:
        case ast.BinOp(left, op, right) if type(op) in _OPERATORS:
            _check(left)
            _check(right)
        case ast.UnaryOp(op, operand) if type(op) in _OPERATORS:
            _check(operand)
        case ast.Call(ast.Name(name), arguments, []) if _ARGUMENTS.get(name) == len(arguments):
            for argument in arguments:
                _check(argument)
        case ast.Name():
            pass
        case ast.Attribute(ast.Name() | ast.Attribute() | ast.Subscript() as owner, _):
            _check(owner)
        case ast.Subscript(ast.Attribute() as owner, ast.Constant()):
            _check(owner)
        case ast.Constant(value) if type(value) in (int, float):
            pass
        case _:
            raise ValueError(ast.unparse(node))


def _value(node: ast.expr, numbers: Mapping[str, Any]) -> Any:
    match node:
        case ast.BinOp(left, op, right):
            return _OPERATORS[type(op)](_value(left, numbers), _value(right, numbers))
        case ast.UnaryOp(op, operand):
            return _OPERATORS[type(op)](_value(operand, numbers))
        case ast.Call(ast.Name(name), arguments):
            return _FUNCTIONS[name](*(_value(argument, numbers) for argument in arguments))
        case ast.Constant(value):
            return np.float64(str(value))
        case _:
            return np.asarray(numbers[_name(node)], dtype=float)[()]


def _name(node: ast.expr) -> str:
    """Return the name of a key or an axis as in a stage file."""
    match node:
        case ast.Subscript(owner, part):
            return f"{_name(owner)}.{ast.unparse(part)}"
        case ast.Attribute(owner, part):
            return f"{_name(owner)}.{part}"
        case _:
            return ast.unparse(node)
