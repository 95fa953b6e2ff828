"""Define the states of a stage: the thesis's limit cases (Table 1), and those between.

The friction law is linearised in each: a spring before it slides, a steady force and a range of speeds afterwards.
Springs in series, joint and bearing (Eq. 1) and the touched limiter (Table 1), are those of the thesis.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy as sp

from friso.engine.arrays import ArrayColumns
from friso.equations.component import Switch, state
from friso.equations.friction.common import direction, friction_alone, solve_linear
from friso.equations.structure import shared_structure, structure
from friso.errors import InputError
from friso.frequency.settings import settings
from friso.frequency.system import Declared, sine
from friso.stage.arguments import check_arguments
from friso.stage.stage import declared_keys
from friso.stage.tables import STATE_PREFIX, leading_friction

if TYPE_CHECKING:
    from collections.abc import Hashable

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


def speeds(flat: Mapping[str, Any], count: int) -> np.ndarray:
    """Return speeds [m/s] from creeping to where friction hardly depends on speed, (count,)."""
    flat = leading_friction(flat)
    units = {key: quantity.unit for key, quantity in declared_keys(flat).items() if key.startswith("friction.")}
    named = [flat[key] for key, unit in units.items() if unit == "m/s" and key in flat]
    if named:
        return np.geomspace(
            settings.slowest_speed_share * min(named), settings.fastest_speed_factor * max(named), count
        )
    law = law_of(flat)
    bristles = (law.lengths(flat) if law else []) or [settings.bristle_length]
    return np.geomspace(
        settings.slowest_bristle_rate * min(bristles), settings.fastest_bristle_rate * max(bristles), count
    )


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
                -settings.greatest_bias_share * level(flat, not forward),
                settings.greatest_bias_share * level(flat, forward),
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
