"""Compute the forces at which guide and motor break away and slide."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.equations.friction.common import friction_alone
from friso.stage.tables import MOTOR_FRICTION, as_friction, friction_law

if TYPE_CHECKING:
    import sympy as sp

SLOWEST_SLIDING = 1e-12
"""Speed [m/s] that stands for the slowest possible sliding."""

Force = Callable[[Mapping[str, Any]], Any]


def breakaway(flat: Mapping[str, Any]) -> Any:
    """Return the largest friction force at rest [N] of guide and motor together.

    The result is an array if keys are arrays. A friction law without such a force counts as 0.
    """
    return sum(_breakaway(keys) for keys in _tables(flat))


def sliding(flat: Mapping[str, Any]) -> Any:
    """Return the level of sliding friction [N] of guide and motor together.

    It is Coulomb friction if the law has that key, otherwise its friction in the slowest motion.
    """
    named = "friction.coulomb"
    return sum(keys[named] if named in keys else np.maximum(*_slow(keys)) for keys in _tables(flat))


def least_breakaway(flat: Mapping[str, Any]) -> Any:
    """Return the force [N] at which the guide breaks away in its weaker direction.

    Friction laws give the mean break-away force of both directions. A bias force on the cart is subtracted.
    """
    forward, back = _slow(flat)
    total = forward + back
    weaker = np.divide(2 * np.minimum(forward, back), total, out=np.ones_like(total), where=total > 0)
    return _breakaway(flat) * weaker - np.abs(flat.get("bias.cart", 0.0))


def _tables(flat: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the keys for the guide's friction law, and for the motor's under the guide's names.

    The list has one entry if there is no friction at the motor.
    """
    at_motor = [as_friction(flat)] if f"{MOTOR_FRICTION}.model" in flat else []
    return [flat, *at_motor]


def _variant(flat: Mapping[str, Any]) -> Hashable:
    one = {key: value[0] if np.ndim(value) else value for key, value in flat.items()}
    return friction_law(flat["friction.model"]).variant(one)


def _breakaway(flat: Mapping[str, Any]) -> Any:
    """Return the break-away force of one friction law [N]; 0 without friction."""
    force = _breakaway_of(flat["friction.model"], _variant(flat))
    return 0.0 if force is None else force(flat)


def _slow(flat: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return the friction forces [N] of one law in the slowest motion, forward and back.

    They are positive, and 0 if the law has no steady friction.
    """
    force = _steady_of(flat["friction.model"], _variant(flat))
    if force is None:
        return np.zeros(()), np.zeros(())
    forward, back = (np.abs(force({**flat, "velocity": sign * SLOWEST_SLIDING})) for sign in (1.0, -1.0))
    return forward, back


@cache
def _breakaway_of(name: str, variant: Hashable) -> Force | None:
    from friso.equations.component import state

    friction = friction_alone(name, state("velocity"), variant)
    return friction and _compiled(friction.breakaway)


@cache
def _steady_of(name: str, variant: Hashable) -> Force | None:
    from friso.equations.component import state

    velocity = state("velocity")
    friction = friction_alone(name, velocity, variant)
    steady = friction and friction.steady(velocity)
    return None if steady is None else _compiled(steady)


def _compiled(expression: sp.Expr) -> Force:
    """Compile an expression into a function of a mapping: its symbols' names to their values."""
    import sympy as sp

    expression = sp.sympify(expression)
    symbols = sorted(expression.free_symbols, key=str)
    function = sp.lambdify(symbols, expression, [{"sine": lambda turns: np.sin(2 * np.pi * turns)}, "numpy"])
    return lambda flat: function(*np.broadcast_arrays(*(np.asarray(flat[str(x)], float) for x in symbols)))
