"""Define the building blocks of the model in SymPy symbols: states, kinks, outputs, and expressions by cases.

Kinks are where derivatives jump.

A parameter is a symbol named after its stage-file key. So its value is looked up among the stage's keys, and a
derivative with respect to it is a sensitivity to that key.

Expressions by cases keep their conditions as written. SymPy's own class simplifies conditions in which other piecewise
expressions occur, whenever one is made or changed. Conditions of a sampled controller with settings against friction
depend on each other. For such conditions SymPy takes minutes and finds nothing shorter.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self, cast

import sympy as sp
from sympy.functions.elementary.piecewise import ExprCondPair

from friso.equations.roles import Role, Steady


class _Case(ExprCondPair):
    """An expression and its condition, kept as written."""

    def __new__(cls, expression: Any, condition: Any) -> _Case:
        return sp.Tuple.__new__(cls, sp.sympify(expression), sp.sympify(condition))


class Piecewise(sp.Piecewise):
    """The first of some expressions whose condition holds.

    An example is ``Piecewise((1, x > 0), (-1, x < 0), (0, True))``. Cases whose condition is never true are left out,
    and so is everything after a condition that is always true. If the cases just before that last one have its
    expression, as in a derivative, they are left out too. Raises TypeError where no condition can be true.
    """

    def __new__(cls, *cases: Any, **options: Any) -> Any:
        kept: list[_Case] = []
        for case in cases:
            kept.append(_Case(*getattr(case, "args", case)))
            if kept[-1].cond == sp.false:
                kept.pop()
            elif kept[-1].cond == sp.true:
                while len(kept) > 1 and kept[-2].expr == kept[-1].expr:
                    del kept[-2]
                break
        if not kept:
            raise TypeError("cases given: none that may hold, expected: at least one")
        return kept[0].expr if kept[0].cond == sp.true else sp.Basic.__new__(cls, *kept)


def key(name: str) -> sp.Symbol:
    """Return the parameter with the stage-file key `name`, such as ``masses.cart`` [SI]."""
    return sp.Symbol(name, real=True)


def state(name: str) -> sp.Symbol:
    """Return the state called `name` [SI]."""
    return sp.Symbol(name, real=True)


TIME = sp.Symbol("time", real=True)
"""Time since the last corner of the reference [s]."""


STEADY = Steady(*(sp.Symbol(f"steady_{name}", real=True) for name in Steady._fields))
"""Symbols of the steady motion with which a run begins."""


@dataclass(frozen=True)
class State:
    """A state: its derivative, unit, role, and the magnitude below which it does not matter.

    `settled` is its value in a steady motion that has lasted, in terms of `STEADY`. A state that is not `controlled`
    has no influence on the size of the steps.
    """

    symbol: sp.Symbol
    derivative: sp.Expr
    unit: str
    scale: sp.Expr
    role: Role
    settled: sp.Expr = sp.S.Zero
    controlled: bool = True


@dataclass(frozen=True)
class Held:
    """A number that a drive holds between samples.

    `update` is its next value, in terms of the held values just before. `settled` is its value in a steady motion that
    has lasted, in terms of `STEADY`.
    """

    symbol: sp.Symbol
    update: sp.Expr
    settled: sp.Expr = sp.S.Zero
    role: Role = Role.FILTER


TICK = sp.Symbol("tick", real=True)
"""Index of a sample, counted from 0."""


@dataclass(frozen=True)
class Clock:
    """The instants at which a drive samples, every `period` [s], and what it looks up there.

    Results of a sample take effect `late` [s] after it, less than a period; then the held numbers change. `seen` are
    states measured at the sample itself, under separate names. `places` maps symbols of looked-up values to the
    position at which their table is read. `times` are symbols of values read from tables over time. Looked-up values
    are held between samples too.
    """

    period: sp.Expr
    late: sp.Expr
    seen: Mapping[sp.Symbol, sp.Symbol]
    places: Mapping[sp.Symbol, sp.Symbol]
    times: tuple[sp.Symbol, ...]

    @property
    def tabled(self) -> tuple[sp.Symbol, ...]:
        """Return the symbols of all values that are looked up in tables."""
        return (*self.places, *self.times)


class gaussian(sp.Function):
    """A normally distributed number, determined by a seed and the index of a sample.

    It does not depend on which runs are computed together, or on how many threads (`friso.engine`).
    """

    nargs = 2


class sine(sp.Function):
    """The function sin(2 pi x) of a number of turns x, which the engine computes itself."""

    nargs = 1

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        """Return the derivative by the number of turns x: 2 pi cos(2 pi x)."""
        return 2 * sp.pi * sine(self.args[0] + sp.Rational(1, 4))


class clipped(sp.Function):
    """A number limited to plus and minus the second argument.

    SymPy's own minimum and maximum take minutes to compare long expressions.
    """

    nargs = 2


class quantised(sp.Function):
    """A number rounded to multiples of the second argument; unchanged if that argument is 0."""

    nargs = 2


@dataclass(frozen=True)
class Kink:
    """A surface in state space on which a derivative of the right-hand side jumps.

    `beyond` is a symbol that is 1 where `surface` > 0, and 0 where `surface` < 0. The right-hand side contains it
    instead of an absolute value or a condition, and so is smooth while `beyond` is held. Within about `narrow` of the
    surface (in the unit of `surface`) the right-hand side may have a peak, which a long step across would miss.
    `starts` is the surface with conditions in place of the `beyond` symbols of other kinks.
    """

    name: str
    surface: sp.Expr
    narrow: sp.Expr = field(default=sp.S.Zero, kw_only=True, compare=False)
    starts: sp.Expr | None = field(default=None, kw_only=True, compare=False)

    @property
    def beyond(self) -> sp.Symbol:
        return sp.Symbol(f"beyond_{self.name}", real=True)

    @property
    def sign(self) -> sp.Expr:
        """Return +1 beyond the surface, -1 before it."""
        return 2 * self.beyond - 1

    @property
    def at_start(self) -> sp.Expr:
        """Return an expression that is positive in states where a run begins beyond the surface."""
        return self.surface if self.starts is None else self.starts

    def beginning(self, sides: Mapping[Any, Any]) -> Kink:
        """Return the kink with conditions in place of other kinks' `beyond`, for the start of a run.

        `sides` has these conditions by symbol.
        """
        return Kink(self.name, self.surface, narrow=self.narrow, starts=cast(sp.Expr, self.surface.xreplace(sides)))

    def called(self, name: str) -> Self:
        """Return the kink (where derivatives jump) under another name.

        Expressions that contain the old `beyond` must be given the new one.
        """
        return replace(self, name=name)

    def with_values(self, values: Mapping[Any, Any]) -> Kink:
        """Return the kink (where derivatives jump) with expressions replaced by others.

        `values` maps old to new ones.
        """
        surface, narrow = (cast(sp.Expr, expression.xreplace(values)) for expression in (self.surface, self.narrow))
        starts = None if self.starts is None else cast(sp.Expr, self.starts.xreplace(values))
        return Kink(self.name, surface, narrow=narrow, starts=starts)


@dataclass(frozen=True)
class Switch(Kink):
    """A mode with memory, such as slipping: the history of the motion decides whether it holds.

    The mode is entered where `enter` rises through 0, and left where `leave` does. `beyond` is 1 in the mode. `begins`
    is positive in states where a run begins in the mode, if nothing else decides; it contains no mode. `entered` and
    `left` are the new values of states on entering and on leaving, in terms of the old ones. Other states do not
    change.
    """

    surface: sp.Expr = field(init=False, compare=False)
    enter: sp.Expr
    leave: sp.Expr
    begins: sp.Expr
    entered: Mapping[sp.Symbol, sp.Expr] = field(default_factory=dict, compare=False)
    left: Mapping[sp.Symbol, sp.Expr] = field(default_factory=dict, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "surface", (1 - self.beyond) * self.enter - self.beyond * self.leave)

    @property
    def at_start(self) -> sp.Expr:
        return self.begins

    @property
    def becomes(self) -> dict[sp.Symbol, sp.Expr]:
        """Return the new values of states at a change of the mode, in terms of the old `beyond`."""
        changed = dict.fromkeys((*self.entered, *self.left))
        return {x: (1 - self.beyond) * self.entered.get(x, x) + self.beyond * self.left.get(x, x) for x in changed}

    def with_values(self, values: Mapping[Any, Any]) -> Switch:
        """Return the switch with expressions replaced by others: `values` maps old to new ones."""
        enter, leave, begins = (
            cast(sp.Expr, expression.xreplace(values)) for expression in (self.enter, self.leave, self.begins)
        )
        entered, left = (
            {x: cast(sp.Expr, e.xreplace(values)) for x, e in assignments.items()}
            for assignments in (self.entered, self.left)
        )
        return Switch(self.name, enter, leave, begins, entered, left)


@dataclass(frozen=True)
class Output:
    """A quantity to be plotted or listed: its expression, unit and name."""

    expression: sp.Expr
    unit: str
    label: str


@dataclass(frozen=True)
class Component:
    """A part of the model, such as a joint, with its states, kinks and outputs.

    Kinks are where derivatives jump.
    """

    states: tuple[State, ...] = ()
    kinks: tuple[Kink, ...] = ()
    outputs: Mapping[str, Output] = field(default_factory=dict)
