"""Run structured text (IEC 61131-3), as far as friso writes it; anything else is refused.

A declaration names its variables, and an expression may use no other. Text is turned into Python of its own, by a
parser that knows the grammar of expressions, IF, assignments and calls of function blocks.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import sqrt, trunc
from typing import Any

_TOKEN = re.compile(
    r"\s+|\(\*.*?\*\)|(?P<number>\d+\.\d+(?:E[+-]?\d+)?|\d+)|(?P<name>[A-Za-z_]\w*)"
    r"|(?P<mark>:=|<=|>=|<>|\.\.|[-+*/()<>=;:,.\[\]])",
    re.DOTALL,
)
_FUNCTIONS = {"abs": abs, "sqrt": sqrt, "trunc": trunc}
_TYPES = {"lreal": 0.0, "bool": False, "udint": 0, "dint": 0}


def _tokens(text: str) -> Iterator[str]:
    """Yield the tokens of a text, names in lower case; comments are left out."""
    place = 0
    while place < len(text):
        match = _TOKEN.match(text, place)
        assert match, f"not structured text: {text[place : place + 40]!r}"
        place = match.end()
        if match.lastgroup:
            token = match[0]
            assert "__" not in token
            yield token.lower() if match.lastgroup == "name" else token


@dataclass
class Unit:
    """A function block or a program: its variables with their initial values, and its body as Python."""

    name: str
    variables: dict[str, Any]
    inputs: list[str]
    code: Any
    others: dict[str, Unit] = field(default_factory=dict)

    def instance(self) -> dict[str, Any]:
        """Return the variables of a new instance."""
        own = {name: list(value) if isinstance(value, list) else value for name, value in self.variables.items()}
        return {name: self.others[value].instance() if isinstance(value, str) else value for name, value in own.items()}

    def run(self, own: dict[str, Any], **values: Any) -> dict[str, Any]:
        """Run the body once with inputs, and return the variables."""
        lowered = {name.lower(): value for name, value in values.items()}
        assert lowered.keys() <= {*self.inputs}
        own.update(lowered)
        exec(self.code, {"CALL": self._call, **_FUNCTIONS}, own)
        return own

    def _call(self, own: dict[str, Any], name: str, **values: Any) -> None:
        self.others[self.variables[name]].run(own, **values)


class _Parser:
    """Parser of a unit, which writes Python."""

    def __init__(self, text: str, others: dict[str, Unit]) -> None:
        self.tokens, self.place, self.others = [*_tokens(text), "end"], 0, others
        self.variables: dict[str, Any] = {}
        self.inputs: list[str] = []
        self.lines: list[str] = []

    @property
    def next(self) -> str:
        return self.tokens[self.place]

    def take(self, *expected: str) -> str:
        token = self.next
        assert not expected or token in expected, f"{token!r} where {expected} is expected"
        self.place += 1
        return token

    def unit(self) -> Unit:
        kind = self.take("function_block", "program")
        name = self.take()
        while self.next in ("var", "var_input", "var_output"):
            self.declarations(self.take())
        self.block(0, f"end_{kind}")
        self.take(f"end_{kind}")
        self.take("end")
        return Unit(name, self.variables, self.inputs, compile("\n".join(self.lines), name, "exec"), self.others)

    def declarations(self, kind: str) -> None:
        while self.next != "end_var":
            name = self.take()
            assert re.fullmatch(r"[a-z_]\w*", name), name
            assert name not in self.variables, f"{name} declared twice"
            self.take(":")
            value = self.initial()
            self.variables[name] = value
            self.inputs += [name] if kind == "var_input" else []
            self.take(";")
        self.take("end_var")

    def initial(self) -> Any:
        kind = self.take()
        if kind == "array":
            for token in ("[", "0", ".."):
                self.take(token)
            last = int(self.take())
            for token in ("]", "of", "lreal", ":=", "["):
                self.take(token)
            values = [self.literal()]
            while self.next == ",":
                self.take()
                values.append(self.literal())
            self.take("]")
            assert len(values) == last + 1
            return values
        if kind in self.others:
            return kind
        if self.next != ":=":
            return _TYPES[kind]
        self.take()
        return self.literal()

    def literal(self) -> float:
        sign = -1.0 if self.next == "-" and self.take() else 1.0
        return sign * float(self.take())

    def block(self, depth: int, *ends: str) -> None:
        count = len(self.lines)
        while self.next not in ends:
            self.statement(depth)
        if len(self.lines) == count:
            self.lines.append("    " * depth + "pass")

    def statement(self, depth: int) -> None:
        indent = "    " * depth
        if self.next == "if":
            word = "if"
            while self.next in ("if", "elsif"):
                self.take()
                condition = self.expression()
                self.take("then")
                self.lines.append(f"{indent}{word} {condition}:")
                self.block(depth + 1, "elsif", "else", "end_if")
                word = "elif"
            if self.next == "else":
                self.take()
                self.lines.append(f"{indent}else:")
                self.block(depth + 1, "end_if")
            self.take("end_if")
            if self.next == ";":
                self.take()
            return
        name = self.take()
        assert name in self.variables, f"{name} is not declared"
        if self.take(":=", "(") == ":=":
            self.lines.append(f"{indent}{name} = {self.expression()}")
        else:
            arguments = []
            while True:
                argument = self.take()
                self.take(":=")
                arguments.append(f"{argument}={self.expression()}")
                if self.take(",", ")") == ")":
                    break
            self.lines.append(f"{indent}CALL({name}, {name!r}, {', '.join(arguments)})")
        self.take(";")

    def expression(self, level: int = 0) -> str:
        """Parse an expression by precedence: OR, AND, comparison, sum, product, sign."""
        levels = [("or",), ("and",), ("=", "<>", "<", ">", "<=", ">="), ("+", "-"), ("*", "/")]
        if level == len(levels):
            return self.sign()
        text = self.expression(level + 1)
        while self.next in levels[level]:
            mark = self.take()
            text += f" { {'=': '==', '<>': '!='}.get(mark, mark) } {self.expression(level + 1)}"
        return f"({text})"

    def sign(self) -> str:
        if self.next in ("-", "not"):
            return f"({self.take()} {self.sign()})"
        return self.primary()

    def primary(self) -> str:
        token = self.take()
        if token == "(":
            text = self.expression()
            self.take(")")
            return text
        if token[0].isdigit():
            return token
        if token in ("true", "false"):
            return token.capitalize()
        if token in _FUNCTIONS:
            self.take("(")
            text = self.expression()
            self.take(")")
            return f"{token}({text})"
        assert token in self.variables, f"{token} is not declared"
        if self.next == "[":
            self.take()
            text = self.expression()
            self.take("]")
            return f"{token}[{text}]"
        if self.next == ".":
            self.take()
            return f"{token}[{self.take()!r}]"
        return token


def parsed(text: str, **others: Unit) -> Unit:
    """Return the unit of a text, which may use other units by their names."""
    return _Parser(text, {name.lower(): unit for name, unit in others.items()}).unit()
