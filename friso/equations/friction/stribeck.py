"""Static Stribeck friction with a viscous term, regularised: Armstrong-Helouvry, Dupont, Canudas de Wit 1994,
doi:10.1016/0005-1098(94)90209-7."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from friso.equations.friction.common import COULOMB_BELOW_STATIC, Friction, stribeck_level, whole_exponent
from friso.quantities import Number, Quantity, Value, non_negative, positive
from friso.stage import FrictionSection, Rule, register_friction

if TYPE_CHECKING:
    import sympy as sp


@register_friction
class Stribeck(FrictionSection):
    """A curve of force against velocity: F = g(v) tanh(v/v_r) + sigma_2 v; at rest it creeps instead of sticking."""

    model: Literal["stribeck"]
    static: Annotated[Value, Quantity("N", positive, "3 N")]
    coulomb: Annotated[Value, Quantity("N", positive, "1 N")]
    stribeck_velocity: Annotated[Value, Quantity("m/s", positive, "1.6 mm/s")]
    stribeck_exponent: Annotated[float, Number(positive, "2")]
    viscous: Annotated[Value, Quantity("N*s/m", non_negative, "0.5 N*s/m")]
    regularisation_velocity: Annotated[Value, Quantity("m/s", positive, "10 um/s")]
    rules: ClassVar[tuple[Rule, ...]] = (COULOMB_BELOW_STATIC,)

    @staticmethod
    def variant(flat: Mapping[str, Any]) -> int | None:
        return whole_exponent(flat)

    @staticmethod
    def declare(velocity: sp.Symbol, variant: int | None) -> Friction:
        """Friction on a body moving at `velocity` [m/s]."""
        from sympy import tanh

        from friso.equations.component import Component, Kink, key

        forward = Kink("forward", velocity)
        level = stribeck_level(velocity, forward.sign, variant)
        force = level * tanh(velocity / key("friction.regularisation_velocity"))
        even = variant is None or variant % 2 == 0  # then the curve is smooth at rest
        component = Component(kinks=() if even else (forward,))
        return Friction(force + key("friction.viscous") * velocity, key("friction.static"), component)
