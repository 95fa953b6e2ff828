"""Compile straight-line Python, written for one run, for several runs at once.

The step of a model is a thousand lines without a branch. A general compiler would infer the type of every variable in
them, and find out that runs do not depend on each other. Here each operation becomes one instruction on a vector, which
has a number of each run in its lane. This takes a fraction of the time, and does not rely on a vectoriser.

The language has assignments, arithmetic, comparisons and tuples. It also has conditional expressions, both sides of
which are computed, and `for` over a known range. Functions written in it are inlined.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import math
import operator
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, reduce
from typing import Any

import numpy as np
from llvmlite import ir

from friso.engine.simd_math import bits_of, number_of

FASTMATH = ("arcp", "contract", "nsz")
"""Fast-math flags of LLVM that the kernels allow."""

CACHE_LINE = 64
"""Bytes of a cache line; a register that straddles two takes twice as long to load."""


def vector_llvm(functions: Mapping[str, Callable[..., Any]], lanes: int) -> ir.Module:
    """Compile functions to LLVM code under given names, for `lanes` runs at once.

    An original function, with the arguments `(B, *numbers)`, works on a column of numbers B[row]. The compiled function
    does so for every run in a flat float64 buffer. There the numbers of all runs, one in each lane, lie side by side in
    a row. The compiled function takes the buffer's address and the numbers, which are common to all runs. It returns a
    whole number, whose bit k is set if the original would return true for lane k.
    """
    module = ir.Module()
    for name, function in functions.items():
        _add(module, name, function, lanes)
    return module


def _add(module: ir.Module, name: str, function: Callable[..., Any], lanes: int) -> None:
    """Add a function to an LLVM module, as vector instructions for `lanes` runs at once."""
    numbers = [_FLOAT.element] * (len(syntax(function).args.args) - 1)
    signature = ir.FunctionType(_SIGNED.element, [ir.PointerType(_FLOAT.element), *numbers])
    code = ir.Function(module, signature, name)
    code.attributes.add("nounwind")  # LLVM writes the next attribute only after another one
    code.attributes.alignstack = CACHE_LINE
    builder: Any = ir.IRBuilder(code.append_basic_block())
    buffer, *scalars = code.args
    same = [_Vector(_splat(builder, scalar_value, lanes), _FLOAT) for scalar_value in scalars]
    writer = _Writer(builder, lanes)
    result = writer.inlined(function, [_Column(builder, buffer, lanes), *same])
    bits = builder.bitcast(writer.truth(result or False).value, ir.IntType(lanes))
    builder.ret(builder.zext(bits, _SIGNED.element))


@dataclass(frozen=True)
class _Kind:
    """Type of a vector's elements, with the names of the instructions for its operators."""

    element: ir.Type
    instructions: Mapping[type[ast.AST], str]


_BITWISE: dict[type[ast.AST], str] = {ast.BitAnd: "and_", ast.BitOr: "or_", ast.BitXor: "xor"}
_INTEGER = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.LShift: "shl", **_BITWISE}
_REAL: dict[type[ast.AST], str] = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}

_FLOAT = _Kind(ir.DoubleType(), {**_REAL, ast.USub: "fneg"})
_TRUTH = _Kind(ir.IntType(1), {**_BITWISE, ast.Not: "not_"})
_SIGNED = _Kind(ir.IntType(64), {**_INTEGER, ast.RShift: "ashr"})
_UNSIGNED = _Kind(ir.IntType(64), {**_INTEGER, ast.RShift: "lshr"})

_PYTHON: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.USub: operator.neg,
    ast.Not: operator.not_,
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
}
"""Operators between numbers that are known at compile time."""

_COMPARISONS: dict[type[ast.AST], str] = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}


@dataclass(frozen=True)
class _Vector:
    """A value in each lane of a register."""

    value: ir.Value
    kind: _Kind


@dataclass(frozen=True)
class _Column:
    """The rows of the buffer, which have a number of every run, side by side."""

    builder: Any
    data: ir.Value
    lanes: int

    def load(self, row: int) -> _Vector:
        return _Vector(self.builder.load(self._pointer(row), align=8), _FLOAT)

    def store(self, row: int, vector: _Vector) -> None:
        self.builder.store(vector.value, self._pointer(row), align=8)

    def _pointer(self, row: int) -> ir.Value:
        if row < 0:
            raise TypeError(f"not in the language of straight-line code: row {row}")
        pointer = self.builder.gep(self.data, [ir.Constant(ir.IntType(64), row * self.lanes)], inbounds=True)
        return self.builder.bitcast(pointer, ir.PointerType(ir.VectorType(_FLOAT.element, self.lanes)))


class _Writer:
    """Writer of the LLVM instructions of functions, for several runs at once."""

    def __init__(self, builder: Any, lanes: int) -> None:
        self.builder, self.lanes = builder, lanes

    def inlined(self, function: Callable[..., Any], arguments: list[Any]) -> Any:
        """Write a function's operations on its arguments; return the result."""
        tree = syntax(function)
        scope = dict(zip((argument.arg for argument in tree.args.args), arguments, strict=True))
        frame = _Frame(self, scope, function.__globals__)
        for statement in tree.body:
            if isinstance(statement, ast.Return) and statement.value is not None:
                return frame.visit(statement.value)
            frame.visit(statement)
        return None

    def vector(self, value: Any, kind: _Kind) -> _Vector:
        """Return a value as a vector; a number is copied to the lanes of all runs.

        Raises TypeError for a vector of another kind, and for a fraction where a whole number is expected.
        """
        if isinstance(value, _Vector):
            if value.kind is not kind:
                raise TypeError(f"{value.kind} where {kind} is expected")
            return value
        constant = float(value) if kind is _FLOAT else int(value)
        if constant != value:
            raise TypeError(f"not in the language of straight-line code: {value} where a whole number is expected")
        return _Vector(ir.Constant(self._type(kind), [ir.Constant(kind.element, constant)] * self.lanes), kind)

    def together(self, *operands: Any) -> tuple[list[ir.Value], _Kind]:
        """Convert vectors and numbers to one kind; return them and the kind.

        Numbers take the kind of the vectors.
        """
        kinds = [operand.kind for operand in operands if isinstance(operand, _Vector)]
        truths = all(isinstance(operand, bool) for operand in operands)
        kind = kinds[0] if kinds else (_TRUTH if truths else _FLOAT)
        return [self.vector(operand, kind).value for operand in operands], kind

    def operate(self, sign: ast.AST, *operands: Any) -> Any:
        """Return the result of an operator."""
        if not any(isinstance(operand, _Vector) for operand in operands):
            return _PYTHON[type(sign)](*operands)
        values, kind = self.together(*operands)
        instruction = kind.instructions[type(sign)]
        liberties = {"flags": FASTMATH} if instruction in _REAL.values() else {}
        return _Vector(getattr(self.builder, instruction)(*values, **liberties), kind)

    def compare(self, sign: str, left: Any, right: Any) -> _Vector:
        values, _ = self.together(left, right)
        return _Vector(self.builder.fcmp_ordered(sign, *values, flags=FASTMATH), _TRUTH)

    def select(self, condition: Any, chosen: Any, otherwise: Any) -> _Vector:
        """Return `chosen` where the condition is true, else `otherwise`, in each lane; no branch."""
        values, kind = self.together(chosen, otherwise)
        return _Vector(self.builder.select(self.truth(condition).value, *values), kind)

    def truth(self, value: Any) -> _Vector:
        """Return in each lane whether a number is not 0, as in Python."""
        if isinstance(value, _Vector) and value.kind is _FLOAT:
            zero = self.vector(0.0, _FLOAT).value
            return _Vector(self.builder.fcmp_unordered("!=", value.value, zero, flags=FASTMATH), _TRUTH)
        return value if isinstance(value, _Vector) else self.vector(bool(value), _TRUTH)

    def least(self, left: Any, right: Any) -> _Vector:
        return self.select(self.compare("<", right, left), right, left)

    def greatest(self, left: Any, right: Any) -> _Vector:
        return self.select(self.compare(">", right, left), right, left)

    def magnitude(self, value: Any) -> _Vector:
        return self._library("fabs", value)

    def root(self, value: Any) -> _Vector:
        return self._library("sqrt", value)

    def _library(self, name: str, value: Any) -> _Vector:
        """Return the result of LLVM's own function `name` of a number, in each lane."""
        vector = self._type(_FLOAT)
        signature = ir.FunctionType(vector, [vector])
        called = self.builder.module.declare_intrinsic(f"llvm.{name}.v{self.lanes}f64", (), signature)
        return _Vector(self.builder.call(called, [self.vector(value, _FLOAT).value]), _FLOAT)

    def bits_of(self, vector: Any) -> _Vector:
        return _Vector(self.builder.bitcast(vector.value, self._type(_SIGNED)), _SIGNED)

    def number_of(self, vector: Any) -> _Vector:
        return _Vector(self.builder.bitcast(vector.value, self._type(_FLOAT)), _FLOAT)

    def signed(self, vector: Any) -> _Vector:
        return self._same_bits(vector, _SIGNED)

    def unsigned(self, vector: Any) -> _Vector:
        return self._same_bits(vector, _UNSIGNED)

    def _same_bits(self, vector: _Vector, kind: _Kind) -> _Vector:
        if vector.kind.element != kind.element:
            raise TypeError(f"not in the language of straight-line code: a {vector.kind.element} as a whole number")
        return _Vector(vector.value, kind)

    def _type(self, kind: _Kind) -> ir.VectorType:
        return ir.VectorType(kind.element, self.lanes)


_LIBRARY: dict[Any, Callable[..., _Vector]] = {
    min: _Writer.least,
    max: _Writer.greatest,
    abs: _Writer.magnitude,
    math.sqrt: _Writer.root,
    bits_of: _Writer.bits_of,
    number_of: _Writer.number_of,
    np.int64: _Writer.signed,
    np.uint64: _Writer.unsigned,
}
"""Functions that are not inlined."""


class _Frame(ast.NodeVisitor):
    """Evaluation of the statements and expressions of one function, to vectors or to constants."""

    def __init__(self, writer: _Writer, scope: dict[str, Any], outside: Mapping[str, Any]) -> None:
        self._writer, self._scope, self._outside = writer, scope, outside

    def generic_visit(self, node: ast.AST) -> Any:
        raise TypeError(f"not in the language of straight-line code: {ast.unparse(node)}")

    def visit_Expr(self, node: ast.Expr) -> None:
        """Accept a docstring, and no other expression."""
        if not isinstance(node.value, ast.Constant):
            self.generic_visit(node)

    def visit_Pass(self, node: ast.Pass) -> None:
        pass

    def visit_Assign(self, node: ast.Assign) -> None:
        value = self.visit(node.value)
        for target in node.targets:
            self._assign(target, value)

    def visit_For(self, node: ast.For) -> None:
        if node.orelse:
            self.generic_visit(node)
        for item in self.visit(node.iter):
            self._assign(node.target, item)
            for statement in node.body:
                self.visit(statement)

    def _assign(self, target: ast.expr, value: Any) -> None:
        """Assign a value to a name, to several names, or to a row of the buffer."""
        if isinstance(target, ast.Tuple):
            for part, element in zip(target.elts, value, strict=True):
                self._assign(part, element)
        elif isinstance(target, ast.Subscript):
            self.visit(target.value).store(self.visit(target.slice), self._writer.vector(value, _FLOAT))
        elif isinstance(target, ast.Name):
            self._scope[target.id] = value
        else:
            self.generic_visit(target)

    def visit_Constant(self, node: ast.Constant) -> Any:
        return node.value

    def visit_Name(self, node: ast.Name) -> Any:
        if node.id in self._scope:
            return self._scope[node.id]
        return self._outside[node.id] if node.id in self._outside else getattr(builtins, node.id)

    def visit_Attribute(self, node: ast.Attribute) -> Any:
        return getattr(self.visit(node.value), node.attr)

    def visit_Tuple(self, node: ast.Tuple) -> tuple[Any, ...]:
        return tuple(map(self.visit, node.elts))

    def visit_Subscript(self, node: ast.Subscript) -> _Vector:
        return self.visit(node.value).load(self.visit(node.slice))

    def visit_BinOp(self, node: ast.BinOp) -> Any:
        return self._writer.operate(node.op, self.visit(node.left), self.visit(node.right))

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Any:
        operand = self.visit(node.operand)
        usable = not isinstance(operand, _Vector) or not isinstance(node.op, ast.Not)
        return self._writer.operate(node.op, operand if usable else self._writer.truth(operand))

    def visit_BoolOp(self, node: ast.BoolOp) -> Any:
        sign = ast.BitAnd() if isinstance(node.op, ast.And) else ast.BitOr()
        truths = (self._writer.truth(self.visit(operand)) for operand in node.values)
        return reduce(lambda left, right: self._writer.operate(sign, left, right), truths)

    def visit_Compare(self, node: ast.Compare) -> _Vector:
        if len(node.ops) > 1 or type(node.ops[0]) not in _COMPARISONS:
            self.generic_visit(node)
        left, right = self.visit(node.left), self.visit(node.comparators[0])
        return self._writer.compare(_COMPARISONS[type(node.ops[0])], left, right)

    def visit_IfExp(self, node: ast.IfExp) -> _Vector:
        return self._writer.select(*(self.visit(part) for part in (node.test, node.body, node.orelse)))

    def visit_Call(self, node: ast.Call) -> Any:
        """Write a call: of a mathematical function, or of a function that is inlined."""
        function, arguments = self.visit(node.func), [self.visit(argument) for argument in node.args]
        if not any(isinstance(argument, _Vector) for argument in arguments):
            return function(*arguments)
        if function in _LIBRARY and not node.keywords:
            return _LIBRARY[function](self._writer, *arguments)
        if not inspect.isfunction(function) or node.keywords:
            self.generic_visit(node)
        return self._writer.inlined(function, arguments)


@cache
def syntax(function: Callable[..., Any]) -> ast.FunctionDef:
    """Return the syntax of a function."""
    (tree,) = ast.parse(textwrap.dedent(inspect.getsource(function))).body
    assert isinstance(tree, ast.FunctionDef)
    return tree


def _splat(builder: Any, scalar: Any, lanes: int) -> ir.Value:
    """Return a register with one value in all lanes."""
    vector = ir.VectorType(scalar.type, lanes)
    first = builder.insert_element(ir.Constant(vector, ir.Undefined), scalar, ir.Constant(ir.IntType(32), 0))
    same = ir.Constant(ir.VectorType(ir.IntType(32), lanes), [0] * lanes)
    return builder.shuffle_vector(first, first, same)
