"""LuGre friction that grows with the force of the drive, as in joints with strain-wave and cycloid gears.

Carvalho Bittencourt, Gunnarsson 2012, doi:10.1115/1.4006589: friction of a robot's joint rises in proportion to the
torque that it transmits.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np

from friso.equations.conditions import friction_level
from friso.equations.friction.bristles import bristle_friction, bristles_active, keeping_bristle
from friso.equations.friction.common import (
    Friction,
    StribeckCurve,
    StribeckSection,
    direction,
    stribeck_level,
    transmitted_force,
    viscous_force,
)
from friso.equations.friction.measured import MeasuredFriction, on_bristles, virgin_displacements
from friso.quantities import Bound, Number, Quantity, Value, non_negative, positive
from friso.stage import register_friction

if TYPE_CHECKING:
    import sympy as sp

from_0_below_1 = Bound("at least 0 and less than 1", lambda value: (value >= 0) & (value < 1))


@register_friction
class LoadDependent(StribeckSection):
    """LuGre bristles below a level of which a part is proportional to the force P of the drive.

    z' = v - sigma_0 abs(v)/((1 - mu) g(v) + mu abs(P)) z, F = sigma_0 z + sigma_1 z' + (1 - mu) sigma_2 v, with mu =
    `load_coefficient`. Levels and viscous friction are those that a drive measures which moves nothing else: P is then
    friction itself. Without mu the law is LuGre.
    """

    model: Literal["load_dependent"]
    follows_drive: ClassVar[bool] = True
    bristle_stiffness: Annotated[Value, Quantity("N/m", positive, "1e5 N/m")]
    bristle_damping: Annotated[Value, Quantity("N*s/m", non_negative, "316 N*s/m")]
    load_coefficient: Annotated[float, Number(from_0_below_1, "0.1")]
    rounded: ClassVar[float] = 1e-7
    """Force of the drive, relative to static friction, below which its size is rounded."""
    usual_coefficients: ClassVar[tuple[float, float]] = (0.02, 0.3)
    """Coefficients of the load that joints with strain-wave and cycloid gears show."""
    decided_by: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("", "friction.load_coefficient"), "the drive's force in slow motion to and fro under several loads"
    )

    @staticmethod
    def declare(velocity: sp.Symbol, variant: StribeckCurve) -> Friction:
        """Return the equations of friction on a body moving at `velocity` [m/s]."""
        from sympy import sqrt

        from friso.equations.component import key, state

        forward = direction(velocity, key("friction.stribeck_velocity"))
        deflection, stiffness = state("bristle_deflection"), key("friction.bristle_stiffness")
        share, corner = (
            key("friction.load_coefficient"),
            LoadDependent.rounded * friction_level("static", variant.conditions),
        )
        level = stribeck_level(velocity, forward.sign, variant)
        load = sqrt(transmitted_force() ** 2 + corner**2) - corner
        rate = velocity - stiffness * forward.sign * velocity / ((1 - share) * level + share * load) * deflection
        viscous = viscous_force(velocity, forward.sign, variant)
        rounded = forward.sign * corner * share / (1 - share)
        sliding = {deflection: (forward.sign * level + share * viscous - rounded) / stiffness}
        law = bristle_friction(velocity, variant, rate, (forward,), sliding)
        alone = stiffness * deflection + (1 - share) * viscous
        return Friction(law.force - share * viscous, law.breakaway, law.component, sliding, alone)

    @staticmethod
    def shown(flat: Mapping[str, Any]) -> MeasuredFriction:
        """Return what measurements without another load would show."""
        share, static, stiffness = (
            float(flat[f"friction.{name}"]) for name in ("load_coefficient", "static", "bristle_stiffness")
        )
        displacement = virgin_displacements(static, stiffness)
        lacking = np.append(np.linspace(1.0, 0.01, 800, endpoint=False), np.geomspace(0.01, 1e-12, 401))
        places = -static / stiffness / (1 - share) * (np.log(lacking) + share * (1 - lacking))
        force = static * (1 - np.exp(np.interp(displacement, places, np.log(lacking))))
        return on_bristles(flat, displacement, force)

    @staticmethod
    def keeping(measured: MeasuredFriction, elements: int) -> dict[str, Any]:
        """Return the law's keys for measured friction, with a coefficient in the middle of what may be."""
        return keeping_bristle(measured, load_coefficient=sum(LoadDependent.usual_coefficients) / 2)

    @staticmethod
    def left_open(measured: MeasuredFriction) -> dict[str, tuple[float, float]]:
        """Return the range of coefficients, of which friction without a load does not tell."""
        return {"friction.load_coefficient": LoadDependent.usual_coefficients}

    @staticmethod
    def active(flat: Mapping[str, Any]) -> str:
        """Return the condition of passivity that the law violates without a load; "" if it is passive."""
        return bristles_active(flat)
