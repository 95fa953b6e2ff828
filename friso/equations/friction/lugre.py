"""LuGre friction: Canudas de Wit et al. 1995, doi:10.1109/9.376053 (thesis, Eq. 3 to 5)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np

from friso.equations.friction.bristles import bristle_friction, bristles_active, keeping_bristle
from friso.equations.friction.common import (
    Friction,
    StribeckCurve,
    StribeckSection,
    direction,
    stribeck_level,
)
from friso.equations.friction.measured import MeasuredFriction, on_bristles, virgin_displacements
from friso.quantities import Quantity, Value, non_negative, positive
from friso.stage import register_friction

if TYPE_CHECKING:
    import sympy as sp


@register_friction
class LuGre(StribeckSection):
    """Bristles that deflect by z.

    z' = v - sigma_0 abs(v)/g(v) z, F = sigma_0 z + sigma_1 z' + sigma_2 v.
    """

    model: Literal["lugre"]
    fitted: ClassVar[bool] = True
    bristle_stiffness: Annotated[Value, Quantity("N/m", positive, "1e5 N/m")]
    bristle_damping: Annotated[Value, Quantity("N*s/m", non_negative, "316 N*s/m")]

    @staticmethod
    def declare(velocity: sp.Symbol, variant: StribeckCurve) -> Friction:
        """Return the equations of friction on a body moving at `velocity` [m/s]."""
        from friso.equations.component import key, state

        forward = direction(velocity, key("friction.stribeck_velocity"))
        deflection, stiffness = state("bristle_deflection"), key("friction.bristle_stiffness")
        level = stribeck_level(velocity, forward.sign, variant)
        rate = velocity - stiffness * forward.sign * velocity / level * deflection
        return bristle_friction(velocity, variant, rate, (forward,))

    @staticmethod
    def shown(flat: Mapping[str, Any]) -> MeasuredFriction:
        """Return what measurements would show; from rest, F = F_s (1 - exp(-sigma_0 x/F_s))."""
        static, stiffness = flat["friction.static"], flat["friction.bristle_stiffness"]
        displacement = virgin_displacements(static, stiffness)
        return on_bristles(flat, displacement, -static * np.expm1(-displacement * stiffness / static))

    @staticmethod
    def keeping(measured: MeasuredFriction, elements: int) -> dict[str, Any]:
        """Return the law's keys for measured friction; the virgin curve keeps LuGre's shape."""
        return keeping_bristle(measured)

    @staticmethod
    def active(flat: Mapping[str, Any]) -> str:
        """Return the condition of passivity if it is violated: sigma_2 >= sigma_1 (F_s - F_c)/F_c.

        The result is "" if the law is passive. The condition is due to Barabanov, Ortega 2000, doi:10.1109/9.839944.
        """
        return bristles_active(flat)
