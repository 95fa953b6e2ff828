"""Linear systems of a stage, many at once, and the states that they belong to: at rest, in sliding, and between.

Systems have equal states; arrays hold one system per row. Equations are linearised by their Jacobian, derived in
symbols and evaluated for many states. The drive between controller and plant is modelled by its hold, delay and current
loop.

The states are the thesis's limit cases (Table 1), and those between. The friction law is linearised in each: a spring
before it slides, a steady force and a range of speeds afterwards. Springs in series, joint and bearing (Eq. 1), and the
touched limiter (Table 1) are those of the thesis.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from math import comb, factorial
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy as sp

from friso.engine.arrays import ArrayColumns
from friso.equations.component import Switch, state
from friso.equations.friction.common import direction, friction_alone, solve_linear
from friso.equations.structure import shared_structure, structure
from friso.errors import InputError
from friso.stage.arguments import check_arguments
from friso.stage.rig import LOOPS
from friso.stage.stage import declared_keys
from friso.stage.tables import STATE_PREFIX, leading_friction

Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class System:
    """Linear systems x' = a x + b u, y = c x + d u, as many as there are members.

    a (members, n, n), b (members, n, m), c (members, p, n), d (members, p, m), with the names of states, inputs and
    outputs. For a sampled system x' is the next x.
    """

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray
    states: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()

    def take(self, inputs: Sequence[str], outputs: Sequence[str]) -> System:
        """Return the system with the given inputs and outputs only, in this order."""
        columns = [self.inputs.index(name) for name in inputs]
        rows = [self.outputs.index(name) for name in outputs]
        b, c, d = self.b[..., columns], self.c[..., rows, :], self.d[..., rows, :][..., columns]
        return System(self.a, b, c, d, self.states, tuple(inputs), tuple(outputs))

    def keep(self, numbers: Sequence[int]) -> System:
        """Return the system with some of its states only, the others being 0."""
        a, b, c = self.a[:, numbers][:, :, numbers], self.b[:, numbers], self.c[:, :, numbers]
        return replace(self, a=a, b=b, c=c, states=tuple(self.states[i] for i in numbers))

    def sees(self, name: str) -> bool:
        """Tell whether any state or output depends on the input with this name."""
        column = self.inputs.index(name)
        return bool(self.b[..., column].any() or self.d[..., column].any())

    def at(self, points: np.ndarray) -> Complex:
        """Return transfer matrices c (s - a)^-1 b + d at points s, (k,) or (members, k).

        The result has shape (members, k, p, m).
        """
        shifted = points[..., None, None] * np.eye(self.a.shape[-1]) - self.a[:, None]
        answers = np.linalg.solve(shifted, self.b[:, None])
        return (self.c[:, None] @ answers + self.d[:, None]).astype(complex)


@dataclass(frozen=True)
class Declared:
    """Equations to be linearised, in symbols.

    `states` have their `rates` of change. `inputs` are symbols, and `outputs` expressions, by name.
    """

    states: tuple[sp.Symbol, ...]
    rates: tuple[sp.Expr, ...]
    inputs: Mapping[str, sp.Symbol]
    outputs: Mapping[str, sp.Expr]

    @cached_property
    def _entries(self) -> tuple[list[tuple[int, int]], Any, list[str]]:
        """Return where the matrix [[a, b], [c, d]] is not zero, and a function for these entries.

        Also returns the names of the function's arguments.
        """
        rows = sp.Matrix([*self.rates, *self.outputs.values()])
        matrix = rows.jacobian([*self.states, *self.inputs.values()])
        entries = {place: entry for place, entry in matrix.todok().items() if entry != 0}
        symbols = sorted(set[Any]().union(*(entry.free_symbols for entry in entries.values())), key=str)
        function = sp.lambdify(symbols, list(entries.values()), [{"sine": sine}, "numpy"], cse=True)
        return list(entries), function, [str(symbol) for symbol in symbols]

    def at(self, values: Mapping[str, Any], members: int) -> System:
        """Return the linear systems for values of the symbols, by name.

        Values are numbers, or arrays of shape (members,) for as many systems.
        """
        places, function, names = self._entries
        n, m, p = len(self.states), len(self.inputs), len(self.outputs)
        matrices = np.zeros((members, n + p, n + m))
        for (i, j), entry in zip(places, function(*(values[name] for name in names)), strict=True):
            matrices[:, i, j] = entry
        parts = matrices[:, :n, :n], matrices[:, :n, n:], matrices[:, n:, :n], matrices[:, n:, n:]
        return System(*parts, tuple(map(str, self.states)), tuple(self.inputs), tuple(self.outputs))


def sine(turns: Any) -> Any:
    """Return sin(2 pi x) of a number of turns x, for `friso.equations.component.sine`."""
    return np.sin(2 * np.pi * turns)


SLOW_LOOPS = tuple(f"drive.{name}_sample_time" for name in LOOPS)
"""Keys of the sample times of slower loops."""

PADE_6 = tuple(comb(6, k) / (comb(12, k) * factorial(k)) for k in range(7))
"""Coefficients of the numerator of Pade's approximation of order 6 to the exponential."""

SCALED_NORM = 0.5
"""Norm to which matrices are scaled for the exponential, whose relative error is then below 1e-16."""


MOST_DELAY_SAMPLES = 64
"""Most samples of a delay. More make the state of a sampled drive too large for eigenvalues."""


@dataclass(frozen=True)
class DriveTiming:
    """Timing of a drive.

    `sample_time` [s] is 0 for a controller in continuous time; `delay` [s] lies between measurement and force. `period`
    is the number of samples after which all loops are due again. `lag` [s] is the time constant of the current loop, 0
    without one.
    """

    sample_time: float
    delay: float
    period: int = 1
    lag: float = 0.0

    @classmethod
    def of(cls, flat: Mapping[str, Any]) -> DriveTiming:
        """Return the timing of a stage's drive; `flat` has the stage's keys in SI.

        Raises InputError for a delay of too many samples, and for a loop that is due too rarely.
        """
        sample_time = flat.get("drive.sample_time", 0.0)
        slow = {key: flat[key] for key in SLOW_LOOPS if key in flat}
        key = max(slow, key=lambda key: slow[key], default="")
        period = round(slow[key] / sample_time) if slow else 1
        if period > MOST_DELAY_SAMPLES:
            text = f"{slow[key]:g} s, {period} samples of {sample_time:g} s"
            raise InputError(key, text, f"at most {MOST_DELAY_SAMPLES} samples", 'position_sample_time = "1 ms"')
        lag = 1 / (2 * np.pi * flat["drive.current_bandwidth"]) if "drive.current_bandwidth" in flat else 0.0
        drive = cls(sample_time, flat.get("drive.delay", 0.0), period, lag)
        if drive.sample_time and drive.delay > MOST_DELAY_SAMPLES * drive.sample_time * (1 + 1e-9):
            text = f"{drive.delay:g} s, {drive.delay / drive.sample_time:.3g} samples of {drive.sample_time:g} s"
            raise InputError("drive.delay", text, f"at most {MOST_DELAY_SAMPLES} samples", 'delay = "100 us"')
        return drive

    @property
    def highest(self) -> float:
        """Return half the sampling frequency [rad/s], the highest that the drive can represent.

        It is infinite for a controller in continuous time.
        """
        return np.pi / self.sample_time if self.sample_time else np.inf

    @property
    def samples_late(self) -> tuple[int, float]:
        """Return the delay as whole samples, and the remaining time [s]."""
        samples = int(self.delay / self.sample_time + 1e-9)
        return samples, max(0.0, self.delay - samples * self.sample_time)

    def transfer(self, omega: np.ndarray) -> np.ndarray:
        """Return the frequency response of hold, delay and current loop, in the shape of `omega`.

        Frequencies are in [rad/s]. Aliases are left out.
        """
        half = omega * self.sample_time / 2
        return np.sinc(half / np.pi) * np.exp(-1j * (half + omega * self.delay)) / (1 + 1j * omega * self.lag)

    def to_s(self, poles: Complex) -> Complex:
        """Return the poles of the loop as s [rad/s].

        For a sampled loop each is the slowest s whose exponential over the period is the pole; a pole at 0 becomes
        minus infinity.
        """
        if not self.sample_time:
            return poles
        time = self.sample_time * self.period
        with np.errstate(divide="ignore"):
            return (np.log(np.abs(poles)) / time + 1j * (np.angle(poles) / time)).astype(complex)


LIGHT_DAMPING = 0.3
"""Damping ratio below which a pole has a peak that a frequency grid could miss."""


def resonances(poles: Complex) -> Complex:
    """Return those of the poles [rad/s] that are lightly damped."""
    return poles[np.abs(poles.real) < LIGHT_DAMPING * np.abs(poles.imag)]


def behind_current_loop(machine: System, lag: float) -> System:
    """Return a plant with one input whose force follows by a first-order `lag` [s]; 0 for none."""
    if not lag:
        return machine
    pole = np.full((1, 1), 1 / lag)
    return _behind(machine, (-pole, pole, np.eye(1), np.zeros((1, 1))), "motor_force")


def zero_order_hold(machine: System, sample_time: float, late: float) -> System:
    """Return a plant with one input in discrete time, behind a hold and a delay, exactly.

    The delay `late` [s] is less than a sample. The force that is still acting becomes a further state.
    """
    members, n, waiting = len(machine.a), len(machine.states), int(late > 0)
    rest, before = _transition(machine, late)
    ahead, after = _transition(machine, sample_time - late)
    following = np.zeros((members, n + waiting, n + 1 + waiting))  # from states, the new force, and the previous one
    following[:, :n, :n], following[:, :n, [n]] = ahead @ rest, after
    if waiting:
        following[:, :n, [n + 1]], following[:, n, n] = ahead @ before, 1.0
    a, b = np.delete(following, n, axis=2), following[:, :, [n]]
    c = np.concatenate([machine.c, np.zeros((members, machine.c.shape[1], waiting))], axis=2)
    return replace(machine, a=a, b=b, c=c, states=machine.states + ("force_before",) * waiting)


def waited(machine: System, samples: int) -> System:
    """Return a plant in discrete time whose force, the one input, is delayed by some samples."""
    if not samples:
        return machine
    register = np.eye(samples, k=-1)
    return _behind(
        machine, (register, np.eye(samples, 1), np.eye(1, samples, samples - 1), np.zeros((1, 1))), "waiting"
    )


LEAST_DELAY_PHASE = 5.0  # [rad]
"""Least phase covered by the rational functions. With less, their poles lie too near the loop's poles."""

MOST_DELAY_PHASE = 20.0  # [rad]
"""Largest phase of a resonance within the delay. A loop with more is unstable in any case."""

PADE_PHASE = 2.5  # [rad]
"""Phase that one rational function of `PADE_ORDER` covers."""

MOST_DELAY_SECTIONS = 24
"""Most rational functions of a delay. More make the eigenvalues inaccurate."""

PADE_ORDER = 4
"""Order of the rational function of a delay. With the phase `PADE_PHASE`, its error stays under 1e-6; a higher
order is ill-conditioned."""


def delayed(machine: System, delay: float, loop: float) -> System:
    """Return a plant with one input behind a delay [s], made of rational functions (Pade).

    A long delay is split into several such functions. `loop` [rad/s] is the fastest resonance of the closed loop
    without delay. Raises InputError if the phase of the plant's own resonances turns too far within the delay.
    """
    turn = fastest(np.linalg.eigvals(machine.a).astype(complex)) * delay
    sections = int(np.ceil(max(LEAST_DELAY_PHASE, turn, min(loop * delay, MOST_DELAY_PHASE)) / PADE_PHASE))
    if sections > MOST_DELAY_SECTIONS:
        most = MOST_DELAY_SECTIONS * PADE_PHASE / (2 * np.pi)
        expected = f"at most {most:.3g} periods, or a drive.sample_time"
        text = f"{delay:g} s, {turn / (2 * np.pi):.3g} periods of the fastest mode"
        raise InputError("drive.delay", text, expected, 'delay = "100 us"')
    from control import pade
    from scipy.signal import tf2ss  # 0.8 s to import

    for k in range(sections):
        machine = _behind(machine, tf2ss(*pade(delay / sections, PADE_ORDER)), f"delay_{k}")
    return machine


def fastest(poles: Complex) -> float:
    """Return the largest magnitude [rad/s] of the resonances among poles; 0 if there are none."""
    return float(np.abs(resonances(poles.ravel())).max(initial=0.0))


def _behind(machine: System, first: tuple[np.ndarray, ...], name: str) -> System:
    """Return a plant with one input behind the system `first`, its matrices a, b, c, d.

    `name` names that system's states.
    """
    la, lb, lc, ld = first
    members, n, k = len(machine.a), len(machine.states), len(la)
    a = np.zeros((members, n + k, n + k))
    a[:, n:, n:] = la
    a[:, :n, :n], a[:, :n, n:] = machine.a, machine.b @ lc
    b = np.concatenate([machine.b @ ld, np.tile(np.asarray(lb), (members, 1, 1))], axis=1)
    c = np.concatenate([machine.c, machine.d @ lc], axis=2)
    return replace(machine, a=a, b=b, c=c, d=machine.d @ ld, states=machine.states + (name,) * k)


def _transition(machine: System, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the effect of states and of a constant force on the states after a time [s].

    The shapes are (members, n, n) and (members, n, 1).
    """
    n = len(machine.states)
    matrices = np.zeros((len(machine.a), n + 1, n + 1))
    matrices[:, :n, :n], matrices[:, :n, n:] = machine.a * time, machine.b * time
    moved = exponentials(matrices)
    return moved[:, :n, :n], moved[:, :n, n:]


def exponentials(matrices: np.ndarray) -> np.ndarray:
    """Return the exponentials of square matrices, shape (members, n, n), all at once.

    The method is Pade's of order 6 with scaling and squaring (Higham 2005, doi:10.1137/04061101X); `scipy.linalg.expm`
    takes them one by one.
    """
    norm = np.abs(matrices).sum(axis=-2).max()
    squarings = max(0, int(np.ceil(np.log2(norm / SCALED_NORM)))) if norm > 0 else 0
    scaled, identity = matrices / 2.0**squarings, np.eye(matrices.shape[-1])
    power, even, odd = identity, identity * 0.0, identity * 0.0
    for k, weight in enumerate(PADE_6):
        term = weight * power
        even, odd = (even + term, odd) if k % 2 == 0 else (even, odd + term)
        power = power @ scaled
    moved = np.linalg.solve(even - odd, even + odd)
    for _ in range(squarings):
        moved = moved @ moved
    return moved


VELOCITY, BIAS = state("velocity"), sp.Symbol("bias", real=True)
FORWARD = str(direction(VELOCITY).beyond)
"""Name of the symbol that is 1 for motion ahead, and 0 for motion back."""


@dataclass(frozen=True)
class LinearFriction:
    """A friction law as a linear system from the velocity of the cart to its force.

    Four fields are functions of the keys [SI] and of what a steady state needs. `sliding` returns the steady state at a
    velocity, `stuck` the one that bears a bias force at rest. Both list the law's internal states, then the values of
    `modes`: its modes with memory, and the sides of its kinks, where derivatives jump. `force` returns the friction
    force [N] of steady sliding. `lengths` returns the typical sizes [m] of internal states measured in metres.
    """

    declared: Declared
    modes: tuple[str, ...]
    sliding: Callable[[Mapping[str, Any]], list[Any]]
    stuck: Callable[[Mapping[str, Any]], list[Any]]
    force: Callable[[Mapping[str, Any]], list[Any]]
    lengths: Callable[[Mapping[str, Any]], list[Any]]

    @property
    def states(self) -> tuple[str, ...]:
        """Return the names of the internal states of the law."""
        return tuple(map(str, self.declared.states))


def law_of(flat: Mapping[str, Any]) -> LinearFriction | None:
    """Return the friction law of a stage, linearised; None without friction."""
    form = shared_structure(flat)
    return _law(form.friction, form.friction_variant)


def motor_law_of(flat: Mapping[str, Any]) -> LinearFriction | None:
    """Return the law of friction at the motor, linearised and with the motor's names of states.

    The result is None without such friction.
    """
    form = shared_structure(flat).transmission
    law = _law(form.friction, form.friction_variant) if form else None
    if law is None:
        return None
    states = tuple(state(f"{STATE_PREFIX}{name}") for name in law.states)
    return replace(law, declared=replace(law.declared, states=states))


@cache
def _law(name: str, variant: Hashable) -> LinearFriction | None:
    friction = friction_alone(name, VELOCITY, variant)
    if friction is None:
        return None
    component = friction.component
    states = tuple(state.symbol for state in component.states)
    rates = tuple(state.derivative for state in component.states)
    modes = tuple(kink.beyond for kink in component.kinks if isinstance(kink, Switch))
    left: dict[Any, Any] = dict.fromkeys(modes, sp.S.Zero)
    slid: dict[Any, Any] = friction.slid()
    stuck = _stuck(states, [rate.subs(left) for rate in rates], friction.force.subs(left)) | left
    stuck |= friction.sides(stuck)
    lengths = [state.scale for state in component.states if state.unit == "m"]
    return LinearFriction(
        Declared(states, rates, {"velocity": VELOCITY}, {"force": friction.force}),
        tuple(map(str, slid))[len(states) :],
        _compiled([*slid.values()]),
        _compiled([stuck[symbol] for symbol in slid]),
        _compiled([friction.force.subs(slid)]),
        _compiled(lengths),
    )


def _stuck(states: Sequence[sp.Symbol], rates: Sequence[sp.Expr], force: sp.Expr) -> dict[sp.Symbol, sp.Expr]:
    """Return the friction law's internal states that bear the bias force at rest, by symbol.

    `rates` are the states' rates of change, and `force` is the law's force. All states are deflected by one
    displacement of the cart from the unloaded state.
    """
    pulled = sp.Symbol("pulled", real=True)
    relaxed: dict[Any, Any] = {VELOCITY: 0, **dict.fromkeys(states, 0)}
    ways: dict[Any, Any] = {
        x: sp.diff(rate, VELOCITY).subs(relaxed) * pulled for x, rate in zip(states, rates, strict=True)
    }
    if not ways:
        return {}
    (far,) = solve_linear([force.subs(VELOCITY, 0).subs(ways) - BIAS], [pulled])
    return {x: limit.subs(pulled, far) for x, limit in ways.items()}


def _compiled(expressions: list[sp.Expr]) -> Callable[[Mapping[str, Any]], list[Any]]:
    """Compile expressions into a function of a mapping: their symbols' names to values.

    Overflow gives infinity or NaN.
    """
    symbols = sorted(set[Any]().union(*(expression.free_symbols for expression in expressions)), key=str)
    function = sp.lambdify(symbols, expressions, [{"sine": sine}, "numpy"])

    def values_of(values: Mapping[str, Any]) -> list[Any]:
        with np.errstate(all="ignore"):
            return function(*(values[str(symbol)] for symbol in symbols))

    return values_of


def level(flat: Mapping[str, Any], forward: bool) -> float:
    """Return the friction force [N] at which a stuck cart breaks away; 0 for a law that creeps.

    `forward` is the direction, and `flat` has the stage's keys in SI.
    """
    law = law_of(leading_friction(flat))
    return float(steady_force(flat, np.zeros(1), forward)[0]) if law is not None and law.states else 0.0


def steady_force(flat: Mapping[str, Any], speeds: np.ndarray, forward: bool) -> np.ndarray:
    """Return the friction force [N] against steady motion at speeds [m/s], both (count,).

    `forward` is true for motion ahead. `flat` has the stage's keys in SI.
    """
    flat = leading_friction(flat)
    law, sign = law_of(flat), 1.0 if forward else -1.0
    (force,) = law.force({**flat, "velocity": sign * speeds, FORWARD: float(forward)}) if law else (np.zeros(1),)
    return np.broadcast_to(sign * np.asarray(force), speeds.shape)


SLOWEST_SPEED_SHARE = 1e-3
"""Slowest speed over the slowest velocity of the law. A slower cart is as if stuck."""

FASTEST_SPEED_FACTOR = 1e3
"""Fastest speed over the fastest velocity of the law. Beyond it only viscous friction is left."""

BRISTLE_LENGTH = 1e-6  # [m]
"""Length scale of a law without bristles, whose force does not depend on speed."""

SLOWEST_BRISTLE_RATE = 0.1  # [1/s]
"""Slowest rate at which bristles give way. Slower ones are springs to any loop."""

FASTEST_BRISTLE_RATE = 1e5  # [1/s]
"""Fastest rate at which bristles give way. Faster ones leave only viscous friction."""


def speeds(flat: Mapping[str, Any], count: int) -> np.ndarray:
    """Return speeds [m/s] from creeping to where friction hardly depends on speed, (count,)."""
    flat = leading_friction(flat)
    units = {key: quantity.unit for key, quantity in declared_keys(flat).items() if key.startswith("friction.")}
    named = [flat[key] for key, unit in units.items() if unit == "m/s" and key in flat]
    if named:
        return np.geomspace(SLOWEST_SPEED_SHARE * min(named), FASTEST_SPEED_FACTOR * max(named), count)
    law = law_of(flat)
    bristles = (law.lengths(flat) if law else []) or [BRISTLE_LENGTH]
    return np.geomspace(SLOWEST_BRISTLE_RATE * min(bristles), FASTEST_BRISTLE_RATE * max(bristles), count)


def in_series(first: Any, second: Any) -> Any:
    """Return the stiffness [N/m] of two springs, or damping [N s/m] of two dampers, in series.

    See Eq. 1 of the thesis.
    """
    return first * second / (first + second)


def limiter_in_series(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return a stage's keys with joint and limiter in series as its joint, as Table 1 prints.

    Stiffness and damping are k1 k2 / (k1 + k2), and the limiter never touches.
    """
    pairs = {"stiffness": "limiter_stiffness", "damping": "limiter_damping"}
    free = {"joint.stroke": 1.0}  # so long that the limiter does not touch
    return {**flat, **free, **{f"joint.{a}": _printed(flat, a, b) for a, b in pairs.items() if f"joint.{a}" in flat}}


def _printed(flat: Mapping[str, Any], joint: str, limiter: str) -> Any:
    joint_value, limiter_value = flat[f"joint.{joint}"], flat[f"joint.{limiter}"]
    return in_series(joint_value, limiter_value) if joint_value + limiter_value else joint_value


BIAS_COUNT, SPEED_COUNT = 65, 257
"""Bias forces and speeds in a family, for each state of the limiter."""


@dataclass(frozen=True)
class Members(ArrayColumns):
    """States of a stage, one per row, each array of shape (members,).

    `speed` [m/s] is that of the cart, 0 where it is stuck. `bias` [N] is the friction force of a stuck cart, positive
    where it opposes the motion. `touched` is true if the limiter is touched, and `forward` for motion ahead.

    Examples
    --------
    >>> import friso
    >>> sliding = friso.member(speed=1e-3)
    >>> len(sliding), sliding.stuck.item(), sliding.touched.item()
    (1, False, False)
    """

    speed: np.ndarray
    bias: np.ndarray
    touched: np.ndarray
    forward: np.ndarray

    def __len__(self) -> int:
        return len(self.speed)

    def __getitem__(self, which: Any) -> Members:
        """Select states by numbers or by a boolean array."""
        return self.mapped(lambda column: np.atleast_1d(column[which]))

    @property
    def kinds(self) -> list[Members]:
        """Return the stuck states and the sliding ones as two groups; empty groups are left out.

        The equations of both have different states.
        """
        return [self[mask] for mask in (self.stuck, ~self.stuck) if mask.any()]

    @property
    def stuck(self) -> np.ndarray:
        """Return in which states the cart is stuck, shape (members,)."""
        return self.speed == 0

    @property
    def settled(self) -> np.ndarray:
        """Return which states of a family are stuck, or slide the fastest, shape (members,)."""
        return self.stuck | (self.speed == self.speed.max())

    def with_limiter(self, touched: bool) -> Members:
        """Return the states with the limiter touched or not."""
        return replace(self, touched=np.full(len(self), touched))

    def repeated(self, times: int) -> Members:
        """Return all states in order, and this list `times` times."""
        return self.mapped(lambda column: np.tile(column, times))


@check_arguments
def member(speed: float = 0.0, bias: float = 0.0, touched: bool = False, forward: bool = True) -> Members:
    """Return one state of a stage: sliding at a speed [m/s], or stuck under a bias force [N].

    It slides `forward` or back; a speed of 0 means stuck. The limiter may be `touched`. Raises InputError for a
    negative speed and for a bias of a cart that slides.

    Examples
    --------
    >>> import friso
    >>> friso.member(speed=1e-3).stuck
    array([False])
    """
    if not 0 <= speed < np.inf:
        raise InputError("speed", f"{speed} m/s", "0 or greater; forward=False for the other direction", "speed=1e-3")
    if bias and speed:
        raise InputError("bias", f"{bias} N at {speed} m/s", "a bias of a cart that is stuck", "member(bias=1.0)")
    return Members(np.array([speed]), np.array([bias]), np.array([touched]), np.array([forward]))


def limit_cases(flat: Mapping[str, Any]) -> dict[str, Members]:
    """Return the limit cases of a stage by name: "stuck" and "sliding" (fast).

    Both have "-touched" appended where the limiter is touched (Table 1). A stage with just one case calls it "given".
    `flat` has the stage's keys in SI.
    """
    flat = leading_friction(flat)
    moves = ["sliding"] if flat["friction.model"] == "none" else ["stuck", "sliding"]
    limits = limiter_states(flat)
    if len(moves) == len(limits) == 1:
        return {"given": member(_fast(flat), touched=limits[0])}
    named = structure(flat).joint in ("free", "touching")
    return {
        f"{move}-touched" if touched and named else move: member(0.0 if move == "stuck" else _fast(flat), 0.0, touched)
        for touched in limits
        for move in moves
    }


GREATEST_BIAS_SHARE = 0.999
"""Largest bias force over the break-away force. A stage nearer to break-away has no stiffness."""


def family(flat: Mapping[str, Any], biases: int = BIAS_COUNT, speeds_: int = SPEED_COUNT) -> Members:
    """Return states near and between all limit cases of a stage, stuck and sliding.

    Stuck ones bear `biases` different bias forces up to nearly break-away, for and against the motion. Sliding ones
    cover all speeds by `speeds_` of them, in both directions if friction differs between them. Without friction they
    are the limit cases alone.
    """
    flat = leading_friction(flat)
    if flat["friction.model"] == "none":
        return Members.joined(limit_cases(flat).values())
    parts = []
    differs = any(flat.get(f"friction.{name}", 0.0) != 0 for name in ("asymmetry", "viscous_asymmetry"))
    for touched in limiter_states(flat):
        for forward in (True, False) if differs else (True,):
            least, most = (
                -GREATEST_BIAS_SHARE * level(flat, not forward),
                GREATEST_BIAS_SHARE * level(flat, forward),
            )
            bias = np.unique(np.linspace(least, most, biases))  # a law that creeps instead of sticking bears no bias
            speed = np.concatenate([np.zeros(len(bias)), speeds(flat, speeds_)])
            bias = np.concatenate([bias, np.zeros(speeds_)])
            parts.append(Members(speed, bias, np.full(len(speed), touched), np.full(len(speed), forward)))
    return Members.joined(parts)


def _fast(flat: Mapping[str, Any]) -> float:
    return 0.0 if flat["friction.model"] == "none" else float(speeds(flat, 2)[-1])


def limiter_states(flat: Mapping[str, Any]) -> tuple[bool, ...]:
    """Return whether the limiter of a stage may be free (False), touched (True), or both."""
    return {"free": (False, True), "touching": (True,)}.get(structure(flat).joint, (False,))
