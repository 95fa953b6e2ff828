"""Declare what friction laws with one damped bristle have in common.

The laws differ in how fast the bristle deflects; the rest is as in LuGre.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from friso.equations.conditions import friction_level
from friso.equations.friction.common import Friction, StribeckCurve, viscous_force
from friso.equations.friction.measured import MeasuredFriction, levels_under_conditions

if TYPE_CHECKING:
    import sympy as sp

    from friso.equations.component import Kink


def bristle_friction(
    velocity: sp.Symbol,
    variant: StribeckCurve,
    rate: sp.Expr,
    kinks: Sequence[Kink],
    sliding: Mapping[sp.Symbol, sp.Expr] | None = None,
) -> Friction:
    """Return friction of a bristle z that deflects at `rate` [m/s]: F = s0 z + s1 z' + s2 v.

    s0, s1, s2 are stiffness, damping and viscous friction. `variant` has the choices of the law's Stribeck curve. The
    `kinks` are where derivatives jump; the first one is the reversal of the velocity. `sliding` holds states and modes
    in steady sliding, where the equations do not determine them.
    """
    from friso.equations.component import Component, Output, Role, State, key, state

    deflection, stiffness = state("bristle_deflection"), key("friction.bristle_stiffness")
    force = (
        stiffness * deflection
        + key("friction.bristle_damping") * rate
        + viscous_force(velocity, kinks[0].sign, variant)
    )
    static = friction_level("static", variant.conditions)
    bristle = State(deflection, rate, "m", static / stiffness, Role.BRISTLE)
    outputs = {"bristle_deflection": Output(deflection, "m", "bristle deflection z")}
    return Friction(force, static, Component((bristle,), tuple(kinks), outputs), sliding)


def keeping_bristle(measured: MeasuredFriction, **shape: float) -> dict[str, Any]:
    """Return the keys of a law with measured friction levels, bristle stiffness and damping.

    `shape` has further keys, which shape the virgin curve.
    """
    return {
        **measured.levels.keys,
        "friction.bristle_stiffness": measured.stiffness,
        "friction.bristle_damping": measured.damping,
        **{f"friction.{name}": value for name, value in shape.items()},
    }


def bristles_active(flat: Mapping[str, Any], softer: float = 1.0, power: str = "") -> str:
    """Return the condition of passivity that a damped bristle violates; "" if it is passive.

    A fully bent bristle yields `softer` times as fast as in LuGre. `power` is the exponent that the condition then
    shows, such as "^2".
    """
    levels, damping = levels_under_conditions(flat), flat["friction.bristle_damping"]
    least = damping * (levels.static / levels.coulomb - 1) * softer
    viscous = levels.viscous * (1 - abs(levels.viscous_asymmetry))  # in the direction with less damping
    if viscous >= least:
        return ""
    return (
        f"viscous >= bristle_damping ((static - coulomb)/coulomb){power} = {least:.4g} N*s/m; "
        f"it is {viscous:.4g} N*s/m{' in one direction' if levels.viscous_asymmetry else ''}"
    )
