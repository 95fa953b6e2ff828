"""Dahl friction: LuGre without Stribeck effect and bristle damping.

Dahl 1968 (Aerospace Corp. TOR-0158(3107-18)-1).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np

from friso.equations.conditions import friction_level, has_conditions
from friso.equations.friction.common import LEVEL_WORDS, Friction, direction
from friso.equations.friction.measured import Levels, MeasuredFriction, virgin_displacements
from friso.quantities import Quantity, Value, non_negative, positive
from friso.stage import FrictionSection, register_friction

if TYPE_CHECKING:
    import sympy as sp


@register_friction
class Dahl(FrictionSection):
    """A spring that slips: z' = v - sigma_0 abs(v)/F_c z, F = sigma_0 z + sigma_2 v."""

    model: Literal["dahl"]
    fitted: ClassVar[bool] = True
    words: ClassVar[Mapping[str, str]] = LEVEL_WORDS
    coulomb: Annotated[Value, Quantity("N", positive, "1 N")]
    bristle_stiffness: Annotated[Value, Quantity("N/m", positive, "1e5 N/m")]
    viscous: Annotated[Value, Quantity("N*s/m", non_negative, "0.5 N*s/m")]

    under_conditions: ClassVar[bool] = True

    @staticmethod
    def variant(flat: Mapping[str, Any]) -> Any:
        """Tell whether [conditions] multiply the law's level of sliding friction."""
        return has_conditions(flat)

    @staticmethod
    def declare(velocity: sp.Symbol, variant: bool) -> Friction:
        """Return the equations of friction on a body moving at `velocity` [m/s]."""
        from friso.equations.component import Component, Output, Role, State, key, state

        forward = direction(velocity)
        deflection, stiffness = state("bristle_deflection"), key("friction.bristle_stiffness")
        coulomb = friction_level("coulomb", variant)
        rate = velocity - stiffness * forward.sign * velocity / coulomb * deflection
        bristles = State(deflection, rate, "m", coulomb / stiffness, Role.BRISTLE)
        outputs = {"bristle_deflection": Output(deflection, "m", "bristle deflection z")}
        force = stiffness * deflection + key("friction.viscous") * velocity
        return Friction(force, coulomb, Component((bristles,), (forward,), outputs))

    @staticmethod
    def shown(flat: Mapping[str, Any]) -> MeasuredFriction:
        """Return what measurements would show of Dahl's law: one level of friction at all speeds.

        Friction does not fall with speed, and at rest there is no damping but the viscous one.
        """
        coulomb, stiffness = flat["friction.coulomb"], flat["friction.bristle_stiffness"]
        levels = Levels(coulomb, coulomb, NO_SPEED, 2.0, flat["friction.viscous"])
        displacement = virgin_displacements(coulomb, stiffness)
        return MeasuredFriction(
            levels, stiffness, 0.0, displacement, -coulomb * np.expm1(-displacement * stiffness / coulomb)
        )

    @staticmethod
    def keeping(measured: MeasuredFriction, elements: int) -> dict[str, Any]:
        """Return keys with the measured stiffness and sliding friction; the break-away peak is lost.

        `elements` has no effect on a law with one spring.
        """
        return {
            "friction.coulomb": measured.levels.coulomb,
            "friction.viscous": measured.levels.viscous,
            "friction.bristle_stiffness": measured.stiffness,
        }


NO_SPEED = 1e-3
"""Stribeck velocity [m/s] for a law whose friction does not depend on speed. Its value does not matter."""
