"""Compile plain Python loops over numbers and arrays.

The loops that run models, and the scan of turning points, have branches and a few hundred lines. A general compiler of
Python needs seconds for them, because it has to infer types. Here types follow from the arguments of a call.

The language has functions of whole numbers, float64 numbers, truth values, arrays, and named tuples of these. It has
assignments, arithmetic, comparisons, `if`, `while`, `for` over a `range` or a tuple, and `return` of a number. Imported
constants are evaluated in advance. A variable stays of one kind; arrays are indexed in full, or by their first index,
from 0 on and within their bounds, which is not checked.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from llvmlite import ir

from friso.engine.machine_code import FLOAT, INT, TRUTH, ArrayKind, CompiledKind, NumberKind, RecordKind, argument_kind
from friso.engine.vector_code import FASTMATH, syntax

_INT64, _DOUBLE, _BIT = ir.IntType(64), ir.DoubleType(), ir.IntType(1)
_NUMBERS = {INT: _INT64, FLOAT: _DOUBLE, TRUTH: _BIT}
_ELEMENTS = {"int64": _INT64, "float64": _DOUBLE, "bool": ir.IntType(8)}


def _types(kind: CompiledKind) -> Sequence[ir.Type]:
    """Return the LLVM types that represent a value.

    A number has one; an array has an address and a shape, a named tuple an address.
    """
    if isinstance(kind, NumberKind):
        return [_NUMBERS[kind]]
    if isinstance(kind, RecordKind):
        return [ir.PointerType(_INT64)]
    return [ir.PointerType(_ELEMENTS[kind.dtype])] + [_INT64] * kind.dimensions


def scalar_llvm(function: Callable[..., None], kinds: Sequence[CompiledKind]) -> ir.Module:
    """Translate a function into LLVM code, with a function `run` that calls it.

    `run` takes the address of the packed arguments (`friso.engine.machine_code.Packing`); `kinds` are their types.
    """
    module = ir.Module()
    entry = ir.Function(module, ir.FunctionType(ir.VoidType(), [ir.PointerType(_INT64)]), "run")
    builder: Any = ir.IRBuilder(entry.append_basic_block())
    arguments = _RecordValue(entry.args[0], RecordKind(tuple((str(i), kind) for i, kind in enumerate(kinds))))
    _Writer(module).call(builder, function, [arguments.field(builder, str(i)) for i in range(len(kinds))])
    builder.ret_void()
    return module


def take_next(queue: Any) -> Any:
    """Take the number at the head of a queue, and count it on; no other thread gets that number."""
    queue[0] += 1
    return queue[0] - 1


def call_at(address: Any, buffer: Any, *numbers: Any) -> Any:
    """Call a function at an `address`, compiled for several runs at once; return a bit for each.

    `friso.engine.vector_code` compiled it, such as the step. It takes the `buffer` of the runs and some numbers. A bit
    is set if the function returned true for that run. In Python that is not compiled, raises NotImplementedError.
    """
    raise NotImplementedError


@dataclass(frozen=True)
class _Value:
    """A number in the code being written, with its type."""

    value: Any
    kind: NumberKind

    @property
    def parts(self) -> list[ir.Value]:
        return [self.value]


@dataclass(frozen=True)
class _ArrayValue:
    """An array in the code being written: its address and shape."""

    data: ir.Value
    shape: tuple[ir.Value, ...]
    kind: ArrayKind

    @property
    def parts(self) -> list[ir.Value]:
        return [self.data, *self.shape]


@dataclass(frozen=True)
class _RecordValue:
    """A named tuple in the code being written, at an address and unchanged while the code runs."""

    words: ir.Value
    kind: RecordKind

    @property
    def parts(self) -> list[ir.Value]:
        return [self.words]

    def field(self, builder: Any, name: str) -> Any:
        place = 0
        for other, kind in self.kind.fields:
            if other == name:
                return self._field(builder, place, kind)
            place += len(kind.form)
        raise TypeError(f"not in the language of plain loops: no field {name}")

    def _field(self, builder: Any, place: int, kind: CompiledKind) -> Any:
        """Write the loading of a field of the named tuple, from a position among its words."""
        if isinstance(kind, RecordKind):
            return _RecordValue(builder.gep(self.words, [ir.Constant(_INT64, place)]), kind)
        parts = []
        for i, part in enumerate(_types(kind)):
            pointer = builder.gep(self.words, [ir.Constant(_INT64, place + i)])
            loaded = builder.load(builder.bitcast(pointer, ir.PointerType(part)))
            loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
            parts.append(loaded)
        return _value(parts, kind)


def _value(parts: Sequence[ir.Value], kind: CompiledKind) -> Any:
    if isinstance(kind, ArrayKind):
        return _ArrayValue(parts[0], tuple(parts[1:]), kind)
    return _Value(parts[0], kind) if isinstance(kind, NumberKind) else _RecordValue(parts[0], kind)


class _Writer:
    """Writer of LLVM code for Python functions, each once for given types of its arguments."""

    def __init__(self, module: ir.Module) -> None:
        self.module = module
        self._written: dict[tuple[Any, ...], tuple[ir.Function, NumberKind | None]] = {}

    def call(self, builder: Any, function: Callable[..., Any], arguments: list[Any]) -> Any:
        """Write the call of a function; return its result, None without one.

        All functions return a word, whatever the type of their result.
        """
        kinds = tuple(argument.kind for argument in arguments)
        if (function, kinds) not in self._written:
            self._written[function, kinds] = self._write(function, kinds)
        code, kind = self._written[function, kinds]
        word = builder.call(code, [part for argument in arguments for part in argument.parts])
        if kind is None:
            return None
        if kind == FLOAT:
            return _Value(builder.bitcast(word, _DOUBLE), FLOAT)
        return _Value(builder.trunc(word, _BIT) if kind == TRUTH else word, kind)

    def _write(
        self, function: Callable[..., Any], kinds: tuple[CompiledKind, ...]
    ) -> tuple[ir.Function, NumberKind | None]:
        """Write a function as LLVM code, for arguments of the given types.

        Returns the LLVM function, and the type of its result (None: it returns nothing).
        """
        tree = syntax(function)
        signature = ir.FunctionType(_INT64, [part for kind in kinds for part in _types(kind)])
        code = ir.Function(self.module, signature, self.module.get_unique_name(function.__name__))
        code.linkage = "internal"
        parts, scope = list(code.args), {}
        for name, kind in zip((argument.arg for argument in tree.args.args), kinds, strict=True):
            scope[name] = _value(parts[: len(_types(kind))], kind)
            del parts[: len(_types(kind))]
        frame = _Frame(self, code, scope, function.__globals__)
        frame.body(tree)
        return code, frame.result


_ARITHMETIC: dict[type[ast.AST], tuple[str, str]] = {
    ast.Add: ("add", "fadd"),
    ast.Sub: ("sub", "fsub"),
    ast.Mult: ("mul", "fmul"),
}
_BITWISE: dict[type[ast.AST], str] = {ast.BitAnd: "and_", ast.BitOr: "or_", ast.RShift: "ashr"}
_PYTHON: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
"""Operators between numbers that are known at compile time."""

_COMPARISONS: dict[type[ast.AST], str] = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}


class _Frame(ast.NodeVisitor):
    """Writer of LLVM code for the body of one function, given the types of its arguments.

    A variable with a number is a place in memory, which LLVM turns into registers. A variable with an array or a named
    tuple is another name for it. Compile-time values stay Python objects until they meet a number.
    """

    def __init__(self, writer: _Writer, code: ir.Function, scope: dict[str, Any], outside: dict[str, Any]) -> None:
        self.result: NumberKind | None = None
        self._writer, self._code, self._outside = writer, code, outside
        self._variables: Any = ir.IRBuilder(code.append_basic_block())
        self._builder: Any = ir.IRBuilder(code.append_basic_block())
        self._scope: dict[str, Any] = {}
        self._loops: list[tuple[ir.Block, ir.Block]] = []
        for name, value in scope.items():
            self._bind(name, value)
        self._first = self._code.blocks[1]

    def body(self, tree: ast.FunctionDef) -> None:
        """Write the whole body of the function from its syntax tree."""
        self._statements(tree.body)
        if not self._builder.block.is_terminated:
            self._builder.ret(ir.Constant(_INT64, 0))
        self._variables.branch(self._first)

    def generic_visit(self, node: ast.AST) -> Any:
        raise TypeError(f"not in the language of plain loops: {ast.unparse(node)}")

    def _statements(self, statements: Sequence[ast.stmt]) -> None:
        for statement in statements:
            if self._builder.block.is_terminated:
                return
            self.visit(statement)

    def visit_Expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            self.visit(node.value)

    def visit_Assign(self, node: ast.Assign) -> None:
        value = self.visit(node.value)
        for target in node.targets:
            self._assign(target, value)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self._assign(node.target, self._operate(node.op, self.visit(node.target), self.visit(node.value)))

    def _assign(self, target: ast.expr, value: Any) -> None:
        """Write the assignment of a value to a name, to several names, or to an element of an array."""
        if isinstance(target, ast.Tuple):
            for part, element in zip(target.elts, value, strict=True):
                self._assign(part, element)
        elif isinstance(target, ast.Name):
            self._bind(target.id, value)
        elif isinstance(target, ast.Subscript):
            array = self.visit(target.value)
            pointer, dtype = self._element(array, target.slice), array.kind.dtype
            if dtype == "bool":
                self._builder.store(self._builder.zext(self._truth(value), _ELEMENTS[dtype]), pointer)
            else:
                self._builder.store(self._number(value, INT if dtype == "int64" else FLOAT).value, pointer)
        else:
            self.generic_visit(target)

    def _bind(self, name: str, value: Any) -> None:
        """Write the assignment of a value to a variable; a number is copied into it."""
        if isinstance(value, _ArrayValue | _RecordValue):
            self._scope[name] = value
            return
        number = self._number(value)
        if name not in self._scope:
            room = self._variables.alloca(number.value.type)
            self._scope[name] = _Variable(room, number.kind)
        variable = self._scope[name]
        if not isinstance(variable, _Variable):
            raise TypeError(f"not in the language of plain loops: {name} is an array here, a number there")
        self._builder.store(self._number(number, variable.kind).value, variable.room)

    def visit_Return(self, node: ast.Return) -> None:
        """Write a return; a function without a value returns nothing."""
        if node.value is None:
            self._builder.ret(ir.Constant(_INT64, 0))
            return
        number = self._number(self.visit(node.value), self.result)
        self.result, value = number.kind, number.value
        if number.kind == FLOAT:
            value = self._builder.bitcast(value, _INT64)
        elif number.kind == TRUTH:
            value = self._builder.zext(value, _INT64)
        self._builder.ret(value)

    def visit_If(self, node: ast.If) -> None:
        """Write a branch with its two sides."""
        condition = self.visit(node.test)
        if not isinstance(condition, _Value):
            self._statements(node.body if condition else node.orelse)
            return
        chosen, otherwise, after = self._blocks(3)
        self._builder.cbranch(self._truth(condition), chosen, otherwise)
        for block, statements in ((chosen, node.body), (otherwise, node.orelse)):
            self._builder.position_at_end(block)
            self._statements(statements)
            self._go(after)
        self._builder.position_at_end(after)

    def visit_While(self, node: ast.While) -> None:
        test, body, after = self._blocks(3)
        self._go(test)
        self._builder.position_at_end(test)
        self._builder.cbranch(self._truth(self.visit(node.test)), body, after)
        self._loop(node, body, test, after)

    def visit_For(self, node: ast.For) -> None:
        """Write a loop over a range, or over the parts of a tuple."""
        if not (isinstance(node.iter, ast.Call) and self.visit(node.iter.func) is range):
            for part in self.visit(node.iter):
                self._assign(node.target, part)
                self._statements(node.body)
            return
        bounds = [self.visit(argument) for argument in node.iter.args]
        start, stop, step = (0, *bounds, 1) if len(bounds) == 1 else (*bounds, 1)[:3]
        if not isinstance(step, int):
            self.generic_visit(node.iter)
        end = self._number(stop, INT).value
        counter = self._variables.alloca(_INT64)
        self._builder.store(self._number(start, INT).value, counter)
        test, body, increment, after = self._blocks(4)
        self._go(test)
        self._builder.position_at_end(test)
        index = self._builder.load(counter)
        self._builder.cbranch(self._builder.icmp_signed("<" if step > 0 else ">", index, end), body, after)
        self._builder.position_at_end(increment)
        following = self._builder.add(self._builder.load(counter), ir.Constant(_INT64, step), flags=["nsw"])
        self._builder.store(following, counter)
        self._builder.branch(test)
        self._builder.position_at_end(body)
        self._assign(node.target, _Value(index, INT))
        self._loop(node, body, increment, after)

    def _loop(self, node: ast.For | ast.While, body: ir.Block, repeat: ir.Block, after: ir.Block) -> None:
        """Write the statements of a loop into the block `body`.

        In these, `continue` leads to the block `repeat`, and `break` to the block `after`, in which writing goes on.
        """
        if node.orelse:
            self.generic_visit(node)
        self._builder.position_at_end(body)
        self._loops.append((repeat, after))
        self._statements(node.body)
        self._loops.pop()
        self._go(repeat)
        self._builder.position_at_end(after)

    def visit_Break(self, node: ast.Break) -> None:
        self._builder.branch(self._loops[-1][1])

    def visit_Continue(self, node: ast.Continue) -> None:
        self._builder.branch(self._loops[-1][0])

    def _blocks(self, count: int) -> list[ir.Block]:
        return [self._code.append_basic_block() for _ in range(count)]

    def _go(self, block: ir.Block) -> None:
        if not self._builder.block.is_terminated:
            self._builder.branch(block)

    def visit_Constant(self, node: ast.Constant) -> Any:
        return node.value

    def visit_Tuple(self, node: ast.Tuple) -> tuple[Any, ...]:
        return tuple(map(self.visit, node.elts))

    def visit_Name(self, node: ast.Name) -> Any:
        if node.id in self._scope:
            value = self._scope[node.id]
            if isinstance(value, _Variable):
                return _Value(self._builder.load(value.room), value.kind)
            return value
        return self._outside[node.id] if node.id in self._outside else getattr(builtins, node.id)

    def visit_Attribute(self, node: ast.Attribute) -> Any:
        """Write access to an attribute: a module's constant, a record's field, an array's shape."""
        value = self.visit(node.value)
        if isinstance(value, _RecordValue):
            return value.field(self._builder, node.attr)
        if isinstance(value, _ArrayValue):
            lengths = tuple(_Value(length, INT) for length in value.shape)
            if node.attr == "shape":
                return lengths
            if node.attr == "size" and len(lengths) == 1:
                return lengths[0]
            self.generic_visit(node)
        return getattr(value, node.attr)

    def visit_Subscript(self, node: ast.Subscript) -> Any:
        """Write access to an element, or to a row, of an array."""
        array = self.visit(node.value)
        if not isinstance(array, _ArrayValue):
            return array[self.visit(node.slice)]
        if array.kind.dimensions > 1 and not isinstance(node.slice, ast.Tuple):
            kind = ArrayKind(array.kind.dtype, array.kind.dimensions - 1)
            return _ArrayValue(self._element(array, node.slice), array.shape[1:], kind)
        loaded = self._builder.load(self._element(array, node.slice))
        if array.kind.dtype == "bool":
            return _Value(self._builder.trunc(loaded, _BIT), TRUTH)
        return _Value(loaded, INT if array.kind.dtype == "int64" else FLOAT)

    def _element(self, array: _ArrayValue, node: ast.expr) -> ir.Value:
        """Write the address of an array's element at some indices.

        With the first index alone, it is the first element that has this index.
        """
        index = node.elts if isinstance(node, ast.Tuple) else [node]
        if len(index) not in (1, len(array.shape)):
            self.generic_visit(node)
        place = ir.Constant(_INT64, 0)
        for axis, length in enumerate(array.shape):
            place = self._builder.mul(place, length, flags=["nsw"])
            if axis < len(index):
                place = self._builder.add(place, self._number(self.visit(index[axis]), INT).value, flags=["nsw"])
        return self._builder.gep(array.data, [place], inbounds=True)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Any:
        """Write a negation of a number or of a truth value."""
        operand = self.visit(node.operand)
        if not isinstance(operand, _Value):
            return -operand if isinstance(node.op, ast.USub) else not operand
        if isinstance(node.op, ast.Not):
            return _Value(self._builder.not_(self._truth(operand)), TRUTH)
        if not isinstance(node.op, ast.USub):
            self.generic_visit(node)
        number = self._number(operand)
        negated = self._builder.fneg(number.value) if number.kind == FLOAT else self._builder.neg(number.value)
        return _Value(negated, number.kind)

    def visit_BinOp(self, node: ast.BinOp) -> Any:
        return self._operate(node.op, self.visit(node.left), self.visit(node.right))

    def _operate(self, sign: ast.operator, left: Any, right: Any) -> Any:
        """Write an arithmetic operation on two numbers."""
        if not isinstance(left, _Value) and not isinstance(right, _Value):
            return _PYTHON[type(sign)](left, right)
        if isinstance(sign, ast.Div):
            sides = (self._number(left, FLOAT).value, self._number(right, FLOAT).value)
            return _Value(self._builder.fdiv(*sides, flags=FASTMATH), FLOAT)
        first, second, kind = self._alike(left, right)
        if type(sign) in _ARITHMETIC:
            integer, real = _ARITHMETIC[type(sign)]
            flags = FASTMATH if kind == FLOAT else ["nsw"]
            return _Value(getattr(self._builder, real if kind == FLOAT else integer)(first, second, flags=flags), kind)
        if kind == FLOAT or type(sign) not in _BITWISE:
            raise TypeError(f"not in the language of plain loops: {type(sign).__name__} of {kind.name}")
        return _Value(getattr(self._builder, _BITWISE[type(sign)])(first, second), kind)

    def visit_Compare(self, node: ast.Compare) -> Any:
        if len(node.ops) > 1 or type(node.ops[0]) not in _COMPARISONS:
            self.generic_visit(node)
        left, right = self.visit(node.left), self.visit(node.comparators[0])
        if not isinstance(left, _Value) and not isinstance(right, _Value):
            return _PYTHON[type(node.ops[0])](left, right)
        return self._compare(_COMPARISONS[type(node.ops[0])], left, right)

    def _compare(self, sign: str, left: Any, right: Any) -> _Value:
        first, second, kind = self._alike(left, right)
        if kind != FLOAT:
            return _Value(self._builder.icmp_signed(sign, first, second), TRUTH)
        compare = self._builder.fcmp_unordered if sign == "!=" else self._builder.fcmp_ordered
        return _Value(compare(sign, first, second, flags=FASTMATH), TRUTH)

    def visit_BoolOp(self, node: ast.BoolOp) -> _Value:
        """Write `and` or `or`.

        As in Python, later operands are not evaluated if an earlier one decides.
        """
        after, ends = self._code.append_basic_block(), []
        decisive = ir.Constant(_BIT, int(isinstance(node.op, ast.Or)))
        for operand in node.values[:-1]:
            truth, further = self._truth(self.visit(operand)), self._code.append_basic_block()
            ends.append((decisive, self._builder.block))
            targets = (after, further) if isinstance(node.op, ast.Or) else (further, after)
            self._builder.cbranch(truth, *targets)
            self._builder.position_at_end(further)
        ends.append((self._truth(self.visit(node.values[-1])), self._builder.block))
        return _Value(self._meet(after, ends, _BIT), TRUTH)

    def visit_IfExp(self, node: ast.IfExp) -> Any:
        """Write a conditional expression; only the chosen side is computed."""
        condition = self.visit(node.test)
        if not isinstance(condition, _Value):
            return self.visit(node.body if condition else node.orelse)
        chosen, otherwise, after = self._blocks(3)
        self._builder.cbranch(self._truth(condition), chosen, otherwise)
        sides = []
        for block, side in ((chosen, node.body), (otherwise, node.orelse)):
            self._builder.position_at_end(block)
            sides.append((self._number(self.visit(side)), self._builder.block))
        kind = FLOAT if any(number.kind == FLOAT for number, _ in sides) else sides[0][0].kind
        ends: list[tuple[Any, Any]] = []
        for number, block in sides:
            self._builder.position_at_end(block)
            ends.append((self._number(number, kind).value, block))
        self._builder.position_at_end(ends[0][1])
        self._builder.branch(after)
        self._builder.position_at_end(ends[1][1])
        return _Value(self._meet(after, ends, ends[0][0].type), kind)

    def _meet(self, block: ir.Block, ends: Sequence[tuple[ir.Value, ir.Block]], type_: ir.Type) -> ir.Value:
        """Continue in a block to which several branches lead.

        Returns the value from the branch that was taken.
        """
        self._builder.branch(block)
        self._builder.position_at_end(block)
        value = self._builder.phi(type_)
        for incoming, origin in ends:
            value.add_incoming(incoming, origin)
        return value

    def visit_Call(self, node: ast.Call) -> Any:
        """Write a call of a built-in, a NumPy function, or a function that is compiled too."""
        function, arguments = self.visit(node.func), [self.visit(argument) for argument in node.args]
        if node.keywords:
            self.generic_visit(node)
        if function in _LIBRARY:
            return _LIBRARY[function](self, *arguments)
        if not any(hasattr(argument, "parts") for argument in arguments):
            return function(*arguments)
        if not inspect.isfunction(function):
            self.generic_visit(node)
        operands = [argument if hasattr(argument, "parts") else self._number(argument) for argument in arguments]
        return self._writer.call(self._builder, function, operands)

    def least(self, first: Any, second: Any) -> _Value:
        return self._choose("<", first, second)

    def greatest(self, first: Any, second: Any) -> _Value:
        return self._choose(">", first, second)

    def _choose(self, sign: str, left: Any, right: Any) -> _Value:
        first, second, kind = self._alike(left, right)
        condition = self._compare(sign, _Value(second, kind), _Value(first, kind)).value
        return _Value(self._builder.select(condition, second, first), kind)

    def magnitude(self, value: Any) -> _Value:
        signature = ir.FunctionType(_DOUBLE, [_DOUBLE])
        called = self._builder.module.declare_intrinsic("llvm.fabs.f64", (), signature)
        return _Value(self._builder.call(called, [self._number(value, FLOAT).value]), FLOAT)

    def integer(self, value: Any) -> _Value:
        number = self._number(value)
        if number.kind != FLOAT:
            return self._number(number, INT)
        return _Value(self._builder.fptosi(number.value, _INT64), INT)

    def real(self, value: Any) -> _Value:
        return self._number(value, FLOAT)

    def take_next(self, queue: _ArrayValue) -> _Value:
        ticket = self._builder.atomic_rmw("add", queue.data, ir.Constant(_INT64, 1), "monotonic")
        return _Value(ticket, INT)

    def call_at(self, address: _Value, buffer: _ArrayValue, *numbers: Any) -> _Value:
        signature = ir.FunctionType(_INT64, [*_types(buffer.kind)[:1]] + [_DOUBLE] * len(numbers))
        code = self._builder.inttoptr(address.value, ir.PointerType(signature))
        operands = [self._number(number, FLOAT).value for number in numbers]
        return _Value(self._builder.call(code, [buffer.data, *operands]), INT)

    def _alike(self, left: Any, right: Any) -> tuple[Any, Any, NumberKind]:
        """Convert two numbers to one type: float64 if either is, else whole numbers or truth values.

        They become truth values only if both are. Returns both, and the type.
        """
        first, second = self._number(left), self._number(right)
        kind = FLOAT if FLOAT in (first.kind, second.kind) else INT
        if first.kind == TRUTH and second.kind == TRUTH:
            kind = TRUTH
        return self._number(first, kind).value, self._number(second, kind).value, kind

    def _number(self, value: Any, kind: NumberKind | None = None) -> _Value:
        """Convert a number to a type, if one is given; whole numbers and truth values may widen.

        A whole number may become float64, and a truth value either. Raises TypeError for anything else.
        """
        if not isinstance(value, _Value):
            own_kind = argument_kind(value) if not isinstance(value, bool) else TRUTH
            if not isinstance(own_kind, NumberKind):
                raise TypeError(f"not in the language of plain loops: {value!r} where a number is expected")
            value = _Value(ir.Constant(_types(own_kind)[0], value), own_kind)
        if kind is None or value.kind == kind:
            return value
        if kind == FLOAT and value.kind == INT:
            return _Value(self._builder.sitofp(value.value, _DOUBLE), FLOAT)
        if value.kind == TRUTH:
            return self._number(_Value(self._builder.zext(value.value, _INT64), INT), kind)
        raise TypeError(f"not in the language of plain loops: {value.kind.name} where {kind.name} is expected")

    def _truth(self, value: Any) -> ir.Value:
        """Write the test whether a number is not 0."""
        number = self._number(value)
        return number.value if number.kind == TRUTH else self._compare("!=", number, 0).value


@dataclass(frozen=True)
class _Variable:
    """A variable with a number: where it is stored, and its type."""

    room: ir.Value
    kind: NumberKind


_LIBRARY: dict[Any, Callable[..., _Value]] = {
    min: _Frame.least,
    max: _Frame.greatest,
    abs: _Frame.magnitude,
    int: _Frame.integer,
    float: _Frame.real,
    take_next: _Frame.take_next,
    call_at: _Frame.call_at,
}
"""Functions that translate to single instructions."""
