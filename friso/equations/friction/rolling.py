"""Rolling friction: stiffness before gross rolling falls with a power of the force.

The law is due to Dahl 1976, doi:10.2514/3.61511, here with the Stribeck level, bristle damping and viscous friction of
LuGre. Dahl's exponent i shapes the virgin curve: d(sigma_0 z)/dx = sigma_0 (1 - sigma_0 z/g)^i. From rest, 1 - F/F_s =
(1 + (i - 1) sigma_0 x/F_s)^(-1/(i - 1)); with i = 1 the law is LuGre. It has a single state, so that a reversal from
rolling leaves the stiffness 2^i sigma_0. Masing's rule, which ball guideways obey (Al-Bender, Symens 2005,
doi:10.1016/j.wear.2004.11.018), needs elements in parallel (`gms`).
"""

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
from friso.equations.friction.measured import (
    MeasuredFriction,
    as_good,
    best,
    levels_under_conditions,
    on_bristles,
    power_law,
    virgin_displacements,
)
from friso.quantities import Bound, Number, Quantity, Value, non_negative, positive
from friso.stage import register_friction

if TYPE_CHECKING:
    import sympy as sp

from_1_to_4 = Bound("from 1 to 4", lambda value: (value >= 1) & (value <= 4))


@register_friction
class Rolling(StribeckSection):
    """Bristles that give way by a power of what they lack.

    z' = v r abs(r)^(i - 1), r = 1 - sigma_0 z sgn(v)/g(v), F = sigma_0 z + sigma_1 z' + sigma_2 v, the power rounded
    at r = 0 (`softening`).
    """

    model: Literal["rolling"]
    fitted: ClassVar[bool] = True
    bristle_stiffness: Annotated[Value, Quantity("N/m", positive, "1e5 N/m")]
    bristle_damping: Annotated[Value, Quantity("N*s/m", non_negative, "316 N*s/m")]
    rolling_exponent: Annotated[float, Number(from_1_to_4, "1.5")]
    decided_by: ClassVar[Mapping[str, str]] = {
        "": "force over displacement from rest up to break-away",
        "friction.rolling_exponent": "force over displacement from rest up to break-away",
    }

    @staticmethod
    def declare(velocity: sp.Symbol, variant: StribeckCurve) -> Friction:
        """Return the equations of friction on a body moving at `velocity` [m/s]."""
        from friso.equations.component import key, state

        forward = direction(velocity, key("friction.stribeck_velocity"))
        deflection, stiffness = state("bristle_deflection"), key("friction.bristle_stiffness")
        level = stribeck_level(velocity, forward.sign, variant)
        lacking = 1 - stiffness * forward.sign * deflection / level
        rate = velocity * lacking * softening(lacking, key("friction.rolling_exponent"))
        sliding = {deflection: forward.sign * level / stiffness}
        return bristle_friction(velocity, variant, rate, (forward,), sliding)

    @staticmethod
    def shown(flat: Mapping[str, Any]) -> MeasuredFriction:
        """Return what measurements would show of the law; Dahl's exponent shapes the virgin curve."""
        static, stiffness, i = (
            flat[f"friction.{name}"] for name in ("static", "bristle_stiffness", "rolling_exponent")
        )
        far = static / stiffness * (MISSING_AT_END ** (1 - i) - 1) / (i - 1) if i > 1 else 0.0
        displacement = virgin_displacements(static, stiffness, [far])
        return on_bristles(flat, displacement, power_law(static, stiffness, i, displacement))

    @staticmethod
    def keeping(measured: MeasuredFriction, elements: int) -> dict[str, Any]:
        """Return the law's keys for measured friction, its exponent fitted to the virgin curve."""
        return keeping_bristle(measured, rolling_exponent=best(*_exponent_candidates(measured)))

    @staticmethod
    def left_open(measured: MeasuredFriction) -> dict[str, tuple[float, float]]:
        """Return the range of exponents with almost the same virgin curve."""
        return {"friction.rolling_exponent": as_good(*_exponent_candidates(measured))}

    @staticmethod
    def active(flat: Mapping[str, Any]) -> str:
        """Return the condition of passivity if violated: sigma_2 >= sigma_1 ((F_s - F_c)/F_c)^i.

        The result is "" if the law is passive. The condition follows from z' v >= -v^2 ((F_s - F_c)/F_c)^i, with the
        power rounded.
        """
        levels, exponent = levels_under_conditions(flat), flat["friction.rolling_exponent"]
        softer = softening(levels.static / levels.coulomb - 1, exponent)
        return bristles_active(flat, softer, "" if exponent == 1 else f"^{exponent:g}")


MISSING_AT_END = 0.01
"""Force, as a fraction of static friction, that may be missing at the last point of a virgin curve."""

ROUNDED_SHARE = 1e-4
"""Missing force, as a fraction of the level, below which the bristle yields in proportion to the missing force."""


def softening(lacking: Any, exponent: Any) -> Any:
    """Return abs(r)^(i - 1), rounded at r = 0 and still 1 at rest, where r = `lacking` is 1.

    It is ((r^2 + d^2)/(1 + d^2))^((i - 1)/2) with the `exponent` i and d = ROUNDED_SHARE. A bare power is 0 at r = 0.
    Bristles of a body that rolls steadily would then not follow a small change of the level. The linearised law would
    also change abruptly as i leaves 1. Rounding changes the force by less than d F_s.
    """
    return ((lacking**2 + ROUNDED_SHARE**2) / (1 + ROUNDED_SHARE**2)) ** ((exponent - 1) / 2)


def _exponent_candidates(measured: MeasuredFriction) -> tuple[np.ndarray, np.ndarray]:
    """Return trial exponents, and the misfit of the virgin curve for each."""
    tried = np.linspace(1.0, 4.0, 301)
    curves = (power_law(measured.levels.static, measured.stiffness, i, measured.displacement) for i in tried)
    return tried, np.array([measured.misfit(curve) for curve in curves])
