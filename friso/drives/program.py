"""Turn the controller of a drive into arithmetic that any language of controllers can express.

The controller is that of `friso.equations.as_built`, the one that simulations run. Here its equations at a sample
become a list of assignments, without cases inside expressions.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from typing import Any

import numpy as np
import sympy as sp
from sympy.logic.boolalg import Boolean

from friso.engine.printing import Constants
from friso.engine.simd_math import quarter_sine
from friso.equations.as_built import NEUTRAL, AsBuilt, controller_as_built
from friso.equations.blocks import Loop
from friso.equations.component import STEADY, Held, Piecewise, clipped, key, sine, state
from friso.equations.sampled import Sampled
from friso.errors import InputError

Assignment = tuple[sp.Symbol, sp.Expr]
"""A symbol and its value. The value is free of cases, or consists of cases that are free of further ones."""

OUTPUT, PER_NEWTON = state("output"), key("output.per_newton")
"""Symbols of the output, and of the output per newton of the commanded force."""

REFERENCE, VELOCITY, ACCELERATION, POSITION = INPUTS = tuple(
    map(state, ("reference_position", "reference_velocity", "reference_acceleration", "position"))
)
MOTOR_POSITION, JERK, DIRECTION = EXTRA_INPUTS = tuple(
    map(state, ("motor_position", "reference_jerk", "reference_direction"))
)
"""Inputs that only some controllers have."""

MEANINGS: Mapping[sp.Symbol, tuple[str, str]] = {
    REFERENCE: ("m", "position of the reference"),
    VELOCITY: ("m/s", "velocity of the reference"),
    ACCELERATION: ("m/s^2", "acceleration of the reference"),
    POSITION: ("m", "measured position"),
    MOTOR_POSITION: ("m", "position at the encoder of the velocity"),
    JERK: ("m/s^3", "jerk of the reference"),
    DIRECTION: ("1", "direction of the motion of the reference: 1 ahead, -1 back, 0 at rest"),
}
"""Unit and meaning of each input, on a linear axis."""


def identifier(name: Any) -> str:
    """Return a symbol of an equation, or its name, as an identifier: dots and dashes become single underscores."""
    return re.sub(r"[\W_]+", "_", str(name))


class floored(sp.Function):
    """The largest whole number that is not above a number of 0 or more."""

    nargs = 1


@dataclass(frozen=True, kw_only=True)
class Program:
    """The controller of a drive at a sample, as assignments that follow one another.

    - `inputs`: what it reads at each sample; a drive without second encoder has no motor position.
    - `parameters`: keys of the stage file by symbol, in SI.
    - `prepared`: constants that follow from the parameters.
    - `memories`: numbers kept from one sample to the next.
    - `begins`: assignments that lead from inputs and the output so far to the memories with which a run begins.
    - `started`: what the memories begin with.
    - `steps`: assignments of a sample; `updates` are then the next values of the memories, and `command` the output.
    """

    inputs: tuple[sp.Symbol, ...]
    parameters: Mapping[sp.Symbol, float]
    prepared: tuple[Assignment, ...]
    memories: tuple[sp.Symbol, ...]
    begins: tuple[Assignment, ...]
    started: tuple[sp.Expr, ...]
    steps: tuple[Assignment, ...]
    updates: tuple[sp.Expr, ...]
    command: sp.Expr
    period: float
    constants: tuple[sp.Symbol, ...] = field(default=())

    @property
    def names(self) -> list[str]:
        """Return the names of everything in the program, each once."""
        symbols = [*self.inputs, *self.parameters, *self.memories, *(s for s, _ in self._assigned)]
        return [*dict.fromkeys(str(symbol) for symbol in symbols)]

    @property
    def _assigned(self) -> tuple[Assignment, ...]:
        return (*self.prepared, *self.begins, *self.steps)

    @cached_property
    def read(self) -> frozenset[str]:
        """Return the names of all symbols that the equations of a sample read."""
        values = (*(e for _, e in self.steps), *self.updates, self.command)
        return frozenset(str(symbol) for e in values for symbol in e.free_symbols)

    @property
    def sampled_constants(self) -> tuple[sp.Symbol, ...]:
        """Return the constants that samples read; others only begin a run."""
        return tuple(one for one in self.constants if str(one) in self.read)

    @cached_property
    def operations(self) -> int:
        """Return the number of operations of a sample: additions, multiplications, comparisons."""
        return int(sum(sp.count_ops(e) for e in (*(e for _, e in self.steps), *self.updates, self.command)))


@dataclass(frozen=True)
class LinearController:
    """The controller without limits and settings against friction, at each sample of a period of its loops.

    x' = a x + b u and y = c x + d u, with the inputs u in the order of `inputs` and the output y. There is one set of
    matrices for each sample of the period: a (n, n), b (n, inputs), c (1, n), d (1, inputs).
    """

    inputs: tuple[str, ...]
    states: tuple[str, ...]
    samples: tuple[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray], ...]
    period: float

    def response(self, name: str, turns: np.ndarray) -> np.ndarray:
        """Return the response from an input to the output of loops at one rate, shape (k,).

        A signal turns by `turns` [rad], shape (k,), in a sample.
        """
        ((a, b, c, d),) = self.samples
        column = self.inputs.index(name)
        z = np.exp(1j * turns)[:, None, None]
        inside = np.linalg.solve(
            z * np.eye(len(a)) - a, np.broadcast_to(b[:, column : column + 1], (len(turns), len(a), 1))
        )
        return (c @ inside)[:, 0, 0] + d[0, column]

    def as_system(self) -> Any:
        """Return the controller as a system of python-control with its sample time, dt [s].

        Loops at several rates are lifted to their common period, which is then dt: its inputs and outputs are those of
        the samples in it, one after another, such as position_0 and position_1.
        """
        control: Any = import_module("control")  # its own annotations mislead the type checker about NumPy elsewhere
        n, count, width = len(self.states), len(self.samples), len(self.inputs)
        along, pushed = np.eye(n), np.zeros((n, count * width))
        c, d = np.zeros((count, n)), np.zeros((count, count * width))
        for k, (a, b, answer, direct) in enumerate(self.samples):
            own = slice(k * width, (k + 1) * width)
            c[k], d[k] = (answer @ along)[0], (answer @ pushed)[0]
            d[k, own] += direct[0]
            along, pushed = a @ along, a @ pushed
            pushed[:, own] += b
        suffixes = [f"_{k}" for k in range(count)] if count > 1 else [""]
        names = [f"{name}{suffix}" for suffix in suffixes for name in self.inputs]
        outputs = [f"output{suffix}" for suffix in suffixes]
        dt = self.period * count
        return control.ss(along, pushed, c, d, dt, inputs=names, outputs=outputs, states=[*self.states])


def _declared(form: AsBuilt, flat: Mapping[str, Any]) -> tuple[list[sp.Symbol], sp.Expr, list[Held]]:
    """Return inputs, output and memories of a controller with its drive, without those that have no effect.

    Properties of the drive that are neutral in `flat`, flat keys in SI, drop out of the equations.
    """
    transmission = form.structure.transmission
    rated = MOTOR_POSITION if transmission and transmission.position != transmission.velocity else None
    loop = Loop(
        REFERENCE - POSITION,
        POSITION,
        sp.S.Zero,
        VELOCITY,
        ACCELERATION,
        DIRECTION,
        rated,
        JERK,
        sp.S.Zero if rated is None else rated - POSITION,
    )
    command, held = controller_as_built(form, loop)
    plain = neutral(flat)
    output = with_values(command, plain) * (PER_NEWTON if flat[str(PER_NEWTON)] != 1 else 1)
    kept = {
        one.symbol: Held(one.symbol, with_values(one.update, plain), with_values(one.settled, plain)) for one in held
    }
    needed: set[Any] = set()
    wanted: set[Any] = output.free_symbols & kept.keys()
    while wanted:
        needed |= wanted
        wanted = {s for one in wanted for s in kept[one].update.free_symbols} & kept.keys() - needed
    memories = [one for one in kept.values() if one.symbol in needed]
    used = output.free_symbols.union(*(one.update.free_symbols for one in memories))
    return [*INPUTS, *(one for one in EXTRA_INPUTS if one in used)], output, memories


def neutral(flat: Mapping[str, Any]) -> dict[sp.Symbol, sp.Expr]:
    """Return the properties of a drive that are neutral in `flat`, flat keys in SI, with their values."""
    return {key(name): sp.sympify(value) for name, value in NEUTRAL.items() if flat[name] == value}


def with_values(expression: Any, values: Mapping[Any, Any]) -> Any:
    """Return an expression with symbols replaced, and the cases that then never hold left out."""
    return sp.sympify(expression).xreplace(values)


def program_of(flat: Mapping[str, Any]) -> Program:
    """Return the controller of a stage with a complete drive as a program; `flat` has its keys in SI.

    Raises InputError for a stage without a controller, and for a controller whose blocks have no discrete form.
    """
    form = AsBuilt.of(flat)
    inputs, output, memories = _discrete(form, flat)
    symbols = [one.symbol for one in memories]
    begin = {
        STEADY.error: REFERENCE - POSITION,
        STEADY.position: POSITION,
        STEADY.velocity: VELOCITY,
        STEADY.reference_velocity: VELOCITY,
        STEADY.force: OUTPUT / PER_NEWTON if flat[str(PER_NEWTON)] != 1 else OUTPUT,
        STEADY.deflected: sp.S.One,
    }
    started = [with_values(one.settled, begin) for one in memories]
    values = [output, *(one.update for one in memories)]
    free: set[Any] = set().union(*(e.free_symbols for e in (*values, *started)))
    keys = sorted(free - {*inputs, *symbols, OUTPUT}, key=str)
    if missing := [str(one) for one in keys if str(one) not in flat]:
        raise InputError("controller", ", ".join(missing), "equations in keys of the stage and what a drive measures")
    constants = Constants(keys)
    hoisted = [constants.hoist(in_arithmetic(value)) for value in (*values, *started)]
    prepared, names, hoisted = constants_as_numbers(constants, hoisted)
    steps, (command, *updates) = straight(hoisted[: len(values)], "w")
    begins, starts = straight(hoisted[len(values) :], "b")
    return Program(
        inputs=tuple(inputs),
        parameters={one: float(flat[str(one)]) for one in keys},
        prepared=tuple(prepared),
        memories=tuple(symbols),
        begins=tuple(begins),
        started=tuple(starts),
        steps=tuple(steps),
        updates=tuple(updates),
        command=command,
        period=float(flat["drive.sample_time"]),
        constants=tuple(names),
    )


def _discrete(form: AsBuilt, flat: Mapping[str, Any]) -> tuple[list[sp.Symbol], sp.Expr, list[Held]]:
    """Return what `_declared` does. Raises InputError for a controller that has no such form."""
    if form.structure.controller is None:
        raise InputError("controller", "a stage without a controller", "a [controller]", 'kind = "pid"')
    try:
        return _declared(form, flat)
    except (NotImplementedError, AttributeError) as error:
        if isinstance(error, AttributeError) and not isinstance(error.obj, Sampled):
            raise
        kind = form.structure.controller.kind
        expected = "a controller of which every block has a discrete form"
        raise InputError("controller.kind", f'"{kind}", of which friso cannot sample: {error}', expected) from None


def _is_condition(value: Any) -> bool:
    """Tell whether a value is true or false; a symbol, which SymPy takes for either, is a number."""
    return isinstance(value, Boolean) and not isinstance(value, sp.Expr)


def constants_as_numbers(
    constants: Constants, values: list[Any]
) -> tuple[list[Assignment], list[sp.Symbol], list[Any]]:
    """Return assignments of constants, their symbols, and the values that contain them.

    A condition on parameters alone is a constant, too; it becomes 1 or 0, and is compared where it stands.
    """
    names = [*constants.index]
    truths = [_is_condition(value) for value in constants.expressions]
    numbers = [
        Piecewise((1, value), (0, True)) if truth else in_arithmetic(value)
        for value, truth in zip(constants.expressions, truths, strict=True)
    ]
    compared: dict[Any, Any] = {one: one > sp.S.Half for one, truth in zip(names, truths, strict=True) if truth}
    prepared, ready = straight(numbers, "p")
    return [*prepared, *zip(names, ready, strict=True)], names, [with_values(value, compared) for value in values]


def in_arithmetic(expression: Any) -> Any:
    """Return an expression in which limits are cases, and the sine of a number of turns is the series of the engine."""

    def turned(turn: Any) -> Any:
        later = turn + sp.Rational(1, 4)
        return quarter_sine(sp.Rational(1, 4) - sp.Abs(later - floored(later) - sp.S.Half))

    return expression.replace(sine, turned)


def straight(values: Iterable[Any], letter: str) -> tuple[list[Assignment], list[Any]]:
    """Write expressions as assignments to symbols that begin with a `letter`, and what then remains of them.

    Subexpressions that occur several times are computed once, and every case distinction is an assignment of its own.
    """
    shared, reduced = sp.cse([*values], symbols=sp.numbered_symbols(f"{letter}_", real=True))
    writer = _Straight(letter)
    conditions: dict[Any, Any] = {}  # languages differ in how they keep a truth value, so none is kept
    for symbol, value in shared:
        whole = value.xreplace(conditions)
        if _is_condition(whole):
            conditions[symbol] = whole
        else:
            writer.assign(symbol, whole)
    return writer.steps, [writer.plain(with_values(value, conditions)) for value in reduced]


class _Straight:
    """Writer of assignments in which case distinctions stand alone."""

    def __init__(self, letter: str) -> None:
        self.steps: list[Assignment] = []
        self._symbols = sp.numbered_symbols(f"{letter}c_", real=True)
        self._done: dict[Any, sp.Symbol] = {}

    def assign(self, symbol: Any, value: Any) -> None:
        """Add the assignment of a value to a symbol."""
        self.steps.append((symbol, self._simple(value)))

    def plain(self, value: Any) -> Any:
        """Return an expression without case distinctions, which are assigned first."""
        simple = self._simple(value)
        if not isinstance(simple, sp.Piecewise):
            return simple
        if simple not in self._done:
            self._done[simple] = next(self._symbols)
            self.assign(self._done[simple], simple)
        return self._done[simple]

    def _simple(self, value: Any) -> Any:
        """Return an expression whose arguments are free of case distinctions."""
        if not value.args:
            return value
        if isinstance(value, clipped):
            inner, limit = map(self._named, value.args)
            return Piecewise((limit, inner > limit), (-limit, inner < -limit), (inner, True))
        if isinstance(value, sp.Piecewise):
            cases = [(self.plain(case.args[0]), self.plain(case.args[1])) for case in value.args]
            return Piecewise(*cases)
        return value.func(*map(self.plain, value.args))

    def _named(self, value: Any) -> Any:
        """Return a symbol or a number for an expression."""
        plain = self.plain(value)
        if plain.is_Atom:
            return plain
        symbol = next(self._symbols)
        self.assign(symbol, plain)
        return symbol


def linear_controller(flat: Mapping[str, Any], samples: int = 1) -> LinearController:
    """Return the controller of a stage for small motions, at each of the `samples` of a period of its loops.

    Limits, and settings against friction other than a leak, are left out, as for Bode plots (`friso.frequency.loops`).
    """
    from dataclasses import replace

    from friso.equations.sampled import counter
    from friso.stage.rig import LOOPS

    form = AsBuilt.of(flat)
    control = form.structure.controller
    assert control is not None
    bare = replace(control, anti_windup=None, settings=control.settings.only("integral_leak"))
    plain = {**flat, "drive.feedforward_coulomb": 0.0, "drive.integrator_deadband": 0.0, "drive.integrator_reset": 0.0}
    inputs, output, memories = _discrete(replace(form, structure=replace(form.structure, controller=bare)), plain)
    inputs = [one for one in inputs if one != DIRECTION]
    counters = {counter(name): f"drive.{name}_sample_time" for name in LOOPS if name in control.loops}
    states = [one for one in memories if one.symbol not in counters]
    values = {key(name): value for name, value in plain.items() if isinstance(value, int | float)}
    sets = []
    for k in range(samples):
        passed: Any = {c: sp.Integer(k % round(flat[name] / flat["drive.sample_time"])) for c, name in counters.items()}
        rows: Any = [with_values(e, passed).doit(deep=False) for e in (*(one.update for one in states), output)]
        along: Sequence[Any] = [*(one.symbol for one in states), *inputs]
        rows = [in_arithmetic(sp.sympify(row)).replace(floored, sp.floor) for row in rows]
        jacobian = sp.Matrix(rows).jacobian(along).xreplace({DIRECTION: sp.S.Zero, **values})
        whole = np.asarray(jacobian.evalf(subs={}).tolist(), dtype=float)
        n = len(states)
        sets.append((whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:]))
    return LinearController(
        tuple(map(str, inputs)), tuple(str(one.symbol) for one in states), tuple(sets), float(flat["drive.sample_time"])
    )
