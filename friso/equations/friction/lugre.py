"""LuGre friction: Canudas de Wit, Olsson, Astrom, Lischinsky 1995, doi:10.1109/9.376053 (thesis, Eq. 3 to 5)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from friso.equations.friction.common import (
    Friction,
    StribeckCurve,
    StribeckSection,
    direction,
    stribeck_level,
    viscous_force,
)
from friso.quantities import Quantity, Value, non_negative, positive
from friso.stage import register_friction

if TYPE_CHECKING:
    import sympy as sp


@register_friction
class LuGre(StribeckSection):
    """Bristles that deflect by z: z' = v - sigma_0 abs(v)/g(v) z, F = sigma_0 z + sigma_1 z' + sigma_2 v."""

    model: Literal["lugre"]
    bristle_stiffness: Annotated[Value, Quantity("N/m", positive, "1e5 N/m")]
    bristle_damping: Annotated[Value, Quantity("N*s/m", non_negative, "316 N*s/m")]

    @staticmethod
    def declare(velocity: sp.Symbol, variant: StribeckCurve) -> Friction:
        """Friction on a body moving at `velocity` [m/s]."""
        from friso.equations.component import Component, Output, Role, State, key, state

        forward = direction(velocity, key("friction.stribeck_velocity"))
        deflection, stiffness = state("bristle_deflection"), key("friction.bristle_stiffness")
        level = stribeck_level(velocity, forward.sign, variant)
        rate = velocity - stiffness * forward.sign * velocity / level * deflection
        force = (
            stiffness * deflection
            + key("friction.bristle_damping") * rate
            + viscous_force(velocity, forward.sign, variant)
        )
        static = key("friction.static")
        bristles = State(deflection, rate, "m", static / stiffness, Role.BRISTLE)
        outputs = {"bristle_deflection": Output(deflection, "m", "bristle deflection z")}
        return Friction(force, static, Component((bristles,), (forward,), outputs))
