"""Static Stribeck friction with a viscous term, regularised.

Armstrong-Helouvry, Dupont, Canudas de Wit 1994, doi:10.1016/0005-1098(94)90209-7.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np

from friso.equations.conditions import friction_level
from friso.equations.friction.common import (
    Friction,
    StribeckCurve,
    StribeckSection,
    direction,
    stribeck_level,
    viscous_force,
)
from friso.equations.friction.measured import MeasuredFriction, levels_of
from friso.quantities import Quantity, Value, positive
from friso.stage import register_friction

if TYPE_CHECKING:
    import sympy as sp


@register_friction
class Stribeck(StribeckSection):
    """A curve of force against velocity: F = g(v) tanh(v/v_r) + sigma_2 v.

    At rest it creeps instead of sticking.
    """

    model: Literal["stribeck"]
    fitted: ClassVar[bool] = True
    regularisation_velocity: Annotated[Value, Quantity("m/s", positive, "10 um/s")]

    @staticmethod
    def declare(velocity: sp.Symbol, variant: StribeckCurve) -> Friction:
        """Return the equations of friction on a body moving at `velocity` [m/s]."""
        from sympy import tanh

        from friso.equations.component import Component, key

        forward = direction(velocity, key("friction.stribeck_velocity"))
        level = stribeck_level(velocity, forward.sign, variant)
        force = level * tanh(velocity / key("friction.regularisation_velocity"))
        even = variant.exponent is None or variant.exponent % 2 == 0
        smooth = even and not (variant.asymmetric or variant.viscous_asymmetric)  # smooth at rest
        static = friction_level("static", variant.conditions)
        component = Component(kinks=() if smooth else (forward,))
        return Friction(force + viscous_force(velocity, forward.sign, variant), static, component)

    @staticmethod
    def shown(flat: Mapping[str, Any]) -> MeasuredFriction:
        """Return what measurements would show: friction over speed, and none before sliding."""
        return MeasuredFriction(levels_of(flat), 0.0, 0.0, np.zeros(1), np.zeros(1))

    @staticmethod
    def keeping(measured: MeasuredFriction, elements: int) -> dict[str, Any]:
        """Return the law's keys for measured friction over speed.

        The curve is kept down to a hundredth of the Stribeck velocity.
        """
        return {
            **measured.levels.keys,
            "friction.regularisation_velocity": RISE_SHARE * measured.levels.stribeck_velocity,
        }


RISE_SHARE = 0.01
"""Velocity over which the curve rises from 0, as a fraction of the Stribeck velocity."""
