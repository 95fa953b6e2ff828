"""LuGre friction: Canudas de Wit, Olsson, Astrom, Lischinsky 1995, doi:10.1109/9.376053 (thesis, Eq. 3 to 5)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np

from friso.equations.friction.common import (
    Friction,
    StribeckCurve,
    StribeckSection,
    direction,
    stribeck_level,
    viscous_force,
)
from friso.equations.friction.measured import MeasuredFriction, displacements, levels_of, on_bristles
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
    decided_by: ClassVar[Mapping[str, str]] = {"": "the drift under a load that oscillates below break-away"}

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

    @staticmethod
    def shown(flat: Mapping[str, Any]) -> MeasuredFriction:
        """From rest F = F_s (1 - exp(-sigma_0 x/F_s))."""
        static, stiffness = flat["friction.static"], flat["friction.bristle_stiffness"]
        way = displacements(static, stiffness) * stiffness / static
        return on_bristles(flat, -static * np.expm1(-way))

    @staticmethod
    def keeping(measured: MeasuredFriction, elements: int) -> dict[str, Any]:
        """Bristles as stiff and damped as measured; the shape of the virgin curve is LuGre's own."""
        return {
            **measured.levels.keys,
            "friction.bristle_stiffness": measured.stiffness,
            "friction.bristle_damping": measured.damping,
        }

    @staticmethod
    def active(flat: Mapping[str, Any]) -> str:
        """Passive where sigma_2 >= sigma_1 (F_s - F_c)/F_c (Barabanov, Ortega 2000, doi:10.1109/9.839944)."""
        return bristles_active(flat)


def bristles_active(flat: Mapping[str, Any], softer: float = 1.0, power: str = "") -> str:
    """The condition under which damped bristles on a Stribeck curve are passive, where it is not met. Those bent most
    give way `softer` times as fast as LuGre's; `power` writes that in the condition."""
    levels, damping = levels_of(flat), flat["friction.bristle_damping"]
    least = damping * (levels.static / levels.coulomb - 1) * softer
    viscous = levels.viscous * (1 - abs(levels.viscous_asymmetry))  # in the direction in which it damps less
    if viscous >= least:
        return ""
    return (
        f"viscous >= bristle_damping ((static - coulomb)/coulomb){power} = {least:.4g} N*s/m; "
        f"it is {viscous:.4g} N*s/m{' in one direction' if levels.viscous_asymmetry else ''}"
    )
