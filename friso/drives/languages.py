"""Print the arithmetic of a controller in languages, which differ in spelling alone, and carry it out in Python."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import exp, floor, sqrt
from typing import Any

import numpy as np
import sympy as sp

from friso.drives.program import Assignment, Program, floored, identifier

_RELATIONS = {
    sp.StrictGreaterThan: ">",
    sp.StrictLessThan: "<",
    sp.GreaterThan: ">=",
    sp.LessThan: "<=",
}
_SUM, _PRODUCT, _FACTOR = range(3)
"""How tightly an expression binds: as a sum, as a product, or as a factor."""


@dataclass(frozen=True)
class Language:
    """How a language spells expressions and assignments.

    `functions` maps the class of a function to its name. `if_`, `elif_` and `else_` begin a branch (the first two with
    {} for the condition), and `end` ends a distinction. `assign` has {name} and {value}, and `power` is the name of the
    function for powers that are not whole. `number` writes a number.
    """

    both: str
    either: str
    negation: str
    functions: Mapping[type, str]
    if_: str
    elif_: str
    else_: str
    end: str
    assign: str
    power: str
    number: Callable[[float], str] = repr
    indent: str = "    "

    def expression(self, value: Any, name: Callable[[str], str], binding: int = _SUM) -> str:
        """Write an expression; `name` gives the name of a symbol, and `binding` says where the expression stands."""
        text, own = self._bound(value, name)
        return text if own >= binding else f"({text})"

    def _bound(self, value: Any, name: Callable[[str], str]) -> tuple[str, int]:
        """Write an expression, and tell how tightly it binds."""
        if value.is_Symbol:
            return name(str(value)), _FACTOR
        if value.is_number and not value.args:
            number = float(value)
            return self.number(number), _FACTOR if number >= 0 else _SUM
        if value.is_Add:
            return self._sum(value, name), _SUM
        if value.is_Mul or value.is_Pow:
            root = value.is_Pow and value.exp.is_positive and not value.exp.is_Integer
            return self._product(value, name), _FACTOR if root else _PRODUCT
        function = self.functions[type(value)]
        return f"{function}({', '.join(self.expression(part, name) for part in value.args)})", _FACTOR

    def _sum(self, value: Any, name: Callable[[str], str]) -> str:
        """Write a sum, with what is positive first."""
        parts = sorted(value.args, key=lambda part: part.could_extract_minus_sign())
        text = self.expression(parts[0], name)
        for part in parts[1:]:
            minus = part.could_extract_minus_sign()
            text += f" - {self.expression(-part, name, _PRODUCT)}" if minus else f" + {self.expression(part, name)}"
        return text

    def _product(self, value: Any, name: Callable[[str], str]) -> str:
        """Write a product or a power: whole powers as products, negative ones below a fraction bar."""
        above: list[str] = []
        below: list[str] = []
        sign = ""
        for factor in sp.Mul.make_args(value):
            base, exponent = factor.as_base_exp() if factor.is_Pow else (factor, sp.S.One)
            if factor == -1:
                sign = "-"
                continue
            place = below if exponent.could_extract_minus_sign() else above
            size: Any = abs(exponent)
            if size.is_Integer:
                place += [self.expression(base, name, _FACTOR)] * int(size)
            elif size == sp.S.Half:
                place.append(f"{self.functions[sp.sqrt]}({self.expression(base, name)})")  # type: ignore[index]
            else:
                place.append(f"{self.power}({self.expression(base, name)}, {self.expression(size, name)})")
        text = sign + (" * ".join(above) or self.number(1.0))
        divisor = below[0] if len(below) == 1 else f"({' * '.join(below)})"
        return f"{text} / {divisor}" if below else text

    def condition(self, value: Any, name: Callable[[str], str], inner: bool = False) -> str:
        """Write a condition, in parentheses where it stands within another (`inner`)."""
        if isinstance(value, sp.And | sp.Or):
            word = self.both if isinstance(value, sp.And) else self.either
            text = f" {word} ".join(self.condition(part, name, True) for part in value.args)
            return f"({text})" if inner else text
        if isinstance(value, sp.Not):
            return f"{self.negation}({self.condition(value.args[0], name)})"
        left, right = (self.expression(part, name) for part in value.args)
        text = f"{left} {_RELATIONS[type(value)]} {right}"
        return f"({text})" if inner else text

    def lines(self, assignments: Iterable[Assignment], name: Callable[[str], str]) -> list[str]:
        """Write assignments, each with a case distinction as branches."""
        written: list[str] = []
        for symbol, value in assignments:
            target = name(str(symbol))
            if not isinstance(value, sp.Piecewise):
                written.append(self.assign.format(name=target, value=self.expression(value, name)))
                continue
            branch = self.if_
            for result, condition in (case.args for case in value.args):
                always = condition == sp.true
                written.append(self.else_ if always else branch.format(self.condition(condition, name)))
                value_text = self.expression(result, name)
                written.append(self.indent + self.assign.format(name=target, value=value_text))
                branch = self.elif_
            written.append(self.end)
        return [line for line in written if line]


def functions(absolute: str, root: str, floor: str, exp: str, tanh: str = "tanh") -> Mapping[Any, str]:
    """Return the names of functions by what they stand for, in the form of `Language.functions`."""
    return {sp.Abs: absolute, sp.sqrt: root, floored: floor, sp.exp: exp, sp.tanh: tanh}


PYTHON = Language(
    both="and",
    either="or",
    negation="not ",
    functions=functions("abs", "sqrt", "floor", "exp"),
    if_="if {}:",
    elif_="elif {}:",
    else_="else:",
    end="",
    assign="{name} = {value}",
    power="pow",
)


def c_language(real: str = "double") -> Language:
    """Return C with numbers of the type `real`."""
    number: Callable[[float], str] = repr if real == "double" else lambda value: f"({real}){value!r}"
    return Language(
        both="&&",
        either="||",
        negation="!",
        functions=functions("fabs", "sqrt", "floor", "exp"),
        if_="if ({}) {{",
        elif_="}} else if ({}) {{",
        else_="} else {",
        end="}",
        assign="{name} = {value};",
        power="pow",
        number=number,
    )


def commented(text: str, begin: str = "/*", before: str = " * ", end: str = " */") -> str:
    """Return lines of text as a comment, in C unless its marks are given; what would end it is broken up."""
    marks = (begin.strip(), end.strip())
    for mark in marks:
        text = text.replace(mark, " ".join(mark))
    return "\n".join([begin, *(f"{before}{line}".rstrip() for line in text.splitlines()), end, ""])


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
