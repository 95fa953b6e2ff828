"""Linearise the friction law of a stage, and compute its steady force and range of speeds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy as sp

from friso.equations.component import Switch, state
from friso.equations.friction.common import direction, solve_linear
from friso.equations.structure import shared_structure
from friso.frequency.settings import settings
from friso.frequency.system import Declared, sine
from friso.stage.stage import declared_keys
from friso.stage.tables import friction_law
from friso.stage.transmission import STATE_PREFIX, leading_friction

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
    friction = friction_law(name).declare(VELOCITY, variant)
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
