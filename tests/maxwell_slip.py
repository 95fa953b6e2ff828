"""A friction law of several elements side by side, each a spring that slips at its strength: Maxwell-slip, after
Iwan 1966, doi:10.1115/1.3625199. An element sticks, F_i' = k_i v, until its force reaches its strength; it then slips,
its force staying there, until the velocity passes 0. With a `kinetic_share` the force drops to that share of the
strength as the element breaks loose, so that stages hunt.

All that friso knows of it stands here, as in any file of a user: importing this module registers the law.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from friso.equations.friction.common import Friction, direction
from friso.quantities import Number, Quantity, Value, inside_0_1, non_negative, positive
from friso.stage import FrictionSection, Rule, Several, Values, element_keys, register_friction

if TYPE_CHECKING:
    import sympy as sp

AT = 1 - 1e-9
"""Share of the squared limit from which on an element that is pulled further is taken to slip."""

STIFFNESS, STRENGTH = "friction.element_stiffness", "friction.element_strength"


@register_friction
class MaxwellSlip(FrictionSection):
    """Elements that stick or slip, F = sum of F_i + sigma_2 v."""

    model: Literal["maxwell_slip"]
    element_stiffness: Annotated[Values, Several(Quantity("N/m", positive, "40 N/um"), ("40 N/um", "30 N/um"), 1, 12)]
    element_strength: Annotated[Values, Several(Quantity("N", positive, "1 N"), ("0.5 N", "1 N"), 1, 12)]
    viscous: Annotated[Value, Quantity("N*s/m", non_negative, "0.5 N*s/m")]
    kinetic_share: Annotated[float | None, Number(inside_0_1, "0.5")] = None

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            (STIFFNESS, STRENGTH),
            lambda flat: len(element_keys(flat, STIFFNESS)) == len(element_keys(flat, STRENGTH)),
            "one strength for each stiffness",
            'element_stiffness = ["40 N/um", "30 N/um"], element_strength = ["0.5 N", "1 N"]',
        ),
    )

    @staticmethod
    def variant(flat: Mapping[str, Any]) -> tuple[int, bool]:
        """The number of elements, and whether their force drops."""
        return len(element_keys(flat, STIFFNESS)), "friction.kinetic_share" in flat

    @staticmethod
    def declare(velocity: sp.Symbol, variant: tuple[int, bool]) -> Friction:
        """Friction on a body moving at `velocity` [m/s]."""
        from sympy import And, Integer, Piecewise

        from friso.equations.component import Component, Output, Role, State, Switch, key, state

        elements, drops = variant
        share = key("friction.kinetic_share") if drops else Integer(1)
        force, breakaway = key("friction.viscous") * velocity, Integer(0)
        states, switches, outputs, sliding = [], [], {}, {}
        for number in range(1, elements + 1):
            deflection = state(f"deflection_{number}")
            stiffness, strength = key(f"{STIFFNESS}.{number}"), key(f"{STRENGTH}.{number}")
            limit = strength / stiffness
            pulled_on = Piecewise((1, And(deflection * velocity > 0, deflection**2 >= AT * limit**2)), (-1, True))
            slip = Switch(
                f"slip_{number}",
                enter=(deflection**2 - limit**2) / limit,
                leave=-deflection * velocity / limit,
                begins=Integer(-1) if drops else pulled_on,
                # the limit to either side, but for the square of what rounding leaves
                entered={deflection: share * (deflection + limit**2 / deflection) / 2},
            )
            states.append(State(deflection, velocity * (1 - slip.beyond), "m", limit, Role.BRISTLE))
            switches.append(slip)
            outputs[f"deflection_{number}"] = Output(deflection, "m", f"deflection of element {number}")
            outputs[f"slip_{number}"] = Output(slip.beyond, "1", f"element {number} slips")
            sliding |= {deflection: direction(velocity).sign * share * limit, slip.beyond: Integer(1)}
            force, breakaway = force + stiffness * deflection, breakaway + strength
        return Friction(force, breakaway, Component(tuple(states), tuple(switches), outputs), sliding)
