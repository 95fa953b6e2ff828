"""LuGre friction whose static friction grows with the time at rest.

Friction approaches its curve over speed with a delay, as in laws of rate and state (Ruina 1983,
doi:10.1029/JB088iB12p10359), at rest exponentially in time, which is Kato's law with the exponent 1 (Armstrong-
Helouvry, Dupont, Canudas de Wit 1994, doi:10.1016/0005-1098(94)90209-7). Sliding renews the contacts over a distance.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np

from friso.equations.conditions import friction_level
from friso.equations.friction.bristles import bristle_friction, keeping_bristle
from friso.equations.friction.common import (
    Friction,
    StribeckCurve,
    StribeckSection,
    direction,
    stribeck_level,
    stribeck_level_from_speed,
)
from friso.equations.friction.lugre import LuGre
from friso.equations.friction.measured import MeasuredFriction
from friso.quantities import Quantity, Value, non_negative, positive
from friso.stage import register_friction

if TYPE_CHECKING:
    import sympy as sp


@register_friction
class DwellFriction(StribeckSection):
    """LuGre bristles below a level that follows its Stribeck curve with a delay.

    z' = v - sigma_0 abs(v)/(F_s - w) z, w' = (1 + abs(v)/v_s) (F_s - g(v) - w)/T, F = sigma_0 z + sigma_1 z' +
    sigma_2 v.

    w is the friction that a contact lacks which has not rested for long: after sliding it is F_s - g(v), and at rest it
    decays with the time constant T, `dwell_time`. Sliding renews the contacts over the distance v_s T. With a short
    dwell time the law is LuGre.
    """

    model: Literal["dwell"]
    bristle_stiffness: Annotated[Value, Quantity("N/m", positive, "1e5 N/m")]
    bristle_damping: Annotated[Value, Quantity("N*s/m", non_negative, "316 N*s/m")]
    dwell_time: Annotated[Value, Quantity("s", positive, "0.5 s")]
    usual_times: ClassVar[tuple[float, float]] = (0.01, 10.0)
    """Dwell times [s] that metal on metal with grease shows."""
    decided_by: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("", "friction.dwell_time"), "static friction after rests of different length"
    )

    @staticmethod
    def declare(velocity: sp.Symbol, variant: StribeckCurve) -> Friction:
        """Return the equations of friction on a body moving at `velocity` [m/s]."""
        from friso.equations.component import STEADY, Output, Role, State, key, state

        forward = direction(velocity, key("friction.stribeck_velocity"))
        deflection, stiffness, lack = state("bristle_deflection"), key("friction.bristle_stiffness"), state("lack")
        static = friction_level("static", variant.conditions)
        tilt = 1 + key("friction.asymmetry") * forward.sign if variant.asymmetric else 1
        even = variant._replace(asymmetric=False)
        steady = static - stribeck_level(velocity, forward.sign, even)
        slid = static - stribeck_level_from_speed(STEADY.velocity, even)
        level, speed = tilt * (static - lack), forward.sign * velocity
        rate = velocity - stiffness * speed / level * deflection
        ages = (1 + speed / key("friction.stribeck_velocity")) / key("friction.dwell_time")
        sliding = {deflection: forward.sign * tilt * (static - steady) / stiffness, lack: steady}
        law = bristle_friction(velocity, variant, rate, (forward,), sliding)
        scale = friction_level("coulomb", variant.conditions) / 2
        ageing = State(lack, ages * (steady - lack), "N", scale, Role.BRISTLE, slid)
        outputs = {"lack": Output(lack, "N", "friction that more rest would add")}
        return law.joined((ageing,), outputs)

    shown = staticmethod(LuGre.shown)  # of measurements after a long rest
    active = staticmethod(LuGre.active)  # the level stays between Coulomb and static friction

    @staticmethod
    def keeping(measured: MeasuredFriction, elements: int) -> dict[str, Any]:
        """Return the law's keys for measured friction, with a dwell time in the middle of what may be."""
        return keeping_bristle(measured, dwell_time=float(np.sqrt(np.prod(DwellFriction.usual_times))))

    @staticmethod
    def left_open(measured: MeasuredFriction) -> dict[str, tuple[float, float]]:
        """Return the range of dwell times, of which neither friction over speed nor the virgin curve tells."""
        return {"friction.dwell_time": DwellFriction.usual_times}
