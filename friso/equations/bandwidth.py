"""Scale the bandwidth of a controller and the friction of stages, and compute the forces at which a stage breaks away.

A controller becomes faster or slower as a whole. Friction grows or shrinks as a whole too, or static friction alone.

Guide and motor each have a force at which they break away, and one at which they slide.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.equations.friction.common import friction_alone
from friso.stage import numeric_keys
from friso.stage.controllers import KIND, controller_of
from friso.stage.tables import MOTOR_FRICTION, as_friction, friction_law

if TYPE_CHECKING:
    import sympy as sp


def bandwidth(flat: Mapping[str, Any]) -> Any:
    """Return the bandwidth [Hz] that a controller's keys state, such as its crossover.

    The result is None if they state none, as for a controller by gains, or without a controller.
    """
    key = controller_of(flat).bandwidth_key if KIND in flat else None
    return None if key is None else flat[key]


def at_bandwidth(flat: Mapping[str, Any], bandwidth: Any) -> dict[str, Any]:
    """Return stages whose controllers are scaled to the given bandwidths [Hz].

    For a controller that states no bandwidth, `bandwidth` is a factor on its present speed.
    """
    key = controller_of(flat).bandwidth_key
    return faster(flat, bandwidth) if key is None else {**faster(flat, bandwidth / flat[key]), key: bandwidth}


def faster(flat: Mapping[str, Any], factor: Any) -> dict[str, Any]:
    """Return stages whose whole controller is faster by a factor, bandwidth included.

    All poles and zeros of the controller are multiplied by the factor. `flat` has the stages' keys in SI.
    """
    return {**flat, **sped_up(flat, factor)}


def sped_up(flat: Mapping[str, Any], factor: Any) -> dict[str, Any]:
    """Return the keys that change, with new values, when a controller is faster by a factor."""
    controller = controller_of(flat)
    powers = {controller.key(name): power for name, power in controller.speeds_up.items()}
    return {key: flat[key] * factor**power for key, power in powers.items() if key in flat}


def range_example(flat: Mapping[str, Any]) -> str:
    """Return a range of a typical key, as an example in a message.

    The key is the bandwidth if there is one, else the first gain, else a mass.
    """
    controller = controller_of(flat) if KIND in flat else None
    gains = [controller.bandwidth_key, *map(controller.key, controller.speeds_up)] if controller else []
    key = next(key for key in [*gains, "masses.stage", "masses.cart"] if key and flat.get(key))
    low, high, unit = flat[key] / 8, flat[key] * 5, getattr(numeric_keys(flat)[key], "unit", "")
    return f'{key}="{low:.3g} {unit}..{high:.3g} {unit}"' if unit else f'{key}="{low:.3g}..{high:.3g}"'


@dataclass(frozen=True)
class _Numbers:
    """A controller's keys as numbers, for `ControllerSection.stiffness`.

    That function usually gets symbols.
    """

    flat: Mapping[str, Any]

    def key(self, name: str) -> Any:
        return self.flat[controller_of(self.flat).key(name)]


def proportional_stiffness(flat: Mapping[str, Any]) -> float:
    """Return the proportional stiffness of a stage's loop [N/m]; `flat` has its keys in SI."""
    controller = controller_of(flat)
    return float(controller.stiffness(_Numbers(flat), controller.variant(flat)))


TABLES = ("friction", MOTOR_FRICTION)
"""Tables of a stage file that hold a friction law."""


def static_frictions(flat: Mapping[str, Any]) -> dict[str, str]:
    """Return the keys of static friction, each with its key of Coulomb friction.

    The result is empty for a law without static or Coulomb friction.
    """
    pairs = {f"{table}.static": f"{table}.coulomb" for table in TABLES}
    return {static: coulomb for static, coulomb in pairs.items() if static in flat and coulomb in flat}


def least_static_factor(flat: Mapping[str, Any]) -> float:
    """Return the smallest factor on static friction for which it is at least Coulomb friction.

    The stages, given by keys in SI, must have a law with static and Coulomb friction.
    """
    return max(float(np.max(flat[coulomb] / flat[static])) for static, coulomb in static_frictions(flat).items())


def with_static_friction(flat: Mapping[str, Any], factor: Any) -> dict[str, Any]:
    """Return stages with static friction times a factor, Coulomb friction unchanged.

    `flat` has the stages' keys in SI. A law without static or Coulomb friction stays as it is.
    """
    return {**flat, **{key: flat[key] * factor for key in static_frictions(flat)}}


def with_friction(flat: Mapping[str, Any], factor: Any) -> dict[str, Any]:
    """Return stages with all their friction times a factor; `flat` has their keys in SI.

    Every force, stiffness and damping of a law is multiplied, so that its deflections and speeds do not change.
    """
    forces = [key for key, kind in numeric_keys(flat).items() if key.partition(".")[0] in TABLES and _is_force(kind)]
    return {**flat, **{key: flat[key] * factor for key in forces if key in flat}}


def _is_force(kind: Any) -> bool:
    """Tell whether a quantity is a force, or a force per speed or distance."""
    return str(kind.unit).startswith("N")


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
