"""Masses in a chain: cart, joint, stage, parasitic mass; or one rigid mass.

See Fig. 3 and 4 of the thesis.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from friso.equations.cases import Piecewise
from friso.equations.component import STEADY, Component, Kink, Output, Role, State, key, state


@dataclass(frozen=True)
class Body:
    """A moving mass: its mass [kg], position [m] and velocity [m/s].

    In a steady motion it is `ahead` [m] of the measured position, because of the forces that joint and transmission
    carry.
    """

    mass: sp.Expr
    position: sp.Symbol
    velocity: sp.Symbol
    ahead: sp.Expr = sp.S.Zero

    @classmethod
    def named(cls, prefix: str, mass: sp.Expr, ahead: sp.Expr = sp.S.Zero) -> Body:
        """Make a body of this mass [kg]; a prefix names the symbols of its position and velocity.

        `ahead` [m] is how far it is from the measured position in a steady motion.
        """
        return cls(mass, state(f"{prefix}position"), state(f"{prefix}velocity"), ahead)

    def under(self, force: sp.Expr, length: sp.Expr, rate: sp.Expr) -> tuple[State, State]:
        """Return the body's position and velocity as states under a force [N], by Newton's law.

        `length` [m] and `rate` [1/s] scale them.
        """
        return (
            State(self.position, self.velocity, "m", length, Role.POSITION, STEADY.position + self.ahead),
            State(self.velocity, force / self.mass, "m/s", length * rate, Role.VELOCITY, STEADY.velocity),
        )


def parasitic_force(parasitic: Body, stage: Body) -> sp.Expr:
    """Return the force of the stage on the parasitic mass [N], by a spring and a damper.

    Spring and damper represent the joint's first internal mode. `parasitic.frequency` is the frequency at which the two
    parts of the stage oscillate against each other (design.md, section 1).
    """
    reduced = parasitic.mass * stage.mass / (parasitic.mass + stage.mass)
    omega = 2 * sp.pi * key("parasitic.frequency")
    damping = 2 * key("parasitic.damping_ratio") * omega * reduced
    return omega**2 * reduced * (stage.position - parasitic.position) + damping * (stage.velocity - parasitic.velocity)


def position_outputs(prefix: str, name: str, body: Body) -> Component:
    """Return position and velocity of a body as outputs."""
    return Component(
        outputs={
            f"{prefix}position": Output(body.position, "m", f"{name} position"),
            f"{prefix}velocity": Output(body.velocity, "m/s", f"{name} velocity"),
        }
    )


def stops(deflection: sp.Expr, reach: sp.Expr, name: str) -> tuple[Kink, Kink]:
    """Return the two kinks, ahead and behind, at which bodies touch and derivatives jump.

    The bodies have a clearance `reach` [m] to either side; `name` names the kinks.
    """
    return Kink(f"{name}_ahead", deflection - reach), Kink(f"{name}_behind", -deflection - reach)


def deflection_under(force: sp.Expr, stiffness: sp.Expr, contact_stiffness: sp.Expr, reach: sp.Expr) -> sp.Expr:
    """Return the deflection [m] of a spring with stops under a constant `force` [N].

    The spring alone has a `stiffness` [N/m]. From the deflection `reach` [m] on, the stops add `contact_stiffness`
    [N/m]. A spring of no stiffness lies at a stop; without a force there is no deflection.
    """
    beyond = (sp.Abs(force) + contact_stiffness * reach) / (stiffness + contact_stiffness)
    side = Piecewise((1, force > 0), (-1, force < 0), (0, True))
    if stiffness == 0:
        return side * beyond
    return Piecewise((force / stiffness, sp.Abs(force) <= stiffness * reach), (side * beyond, True))


def beyond_stops(ahead: sp.Expr, behind: sp.Expr, contact: sp.Expr, reached: sp.Expr) -> sp.Expr:
    """Return the force [N] between two bodies at stops; zero between the stops.

    `ahead` and `behind` are 1 where the respective stop acts, else 0. `contact` is the force [N] of a permanent
    contact, and `reached` its value [N] at the stops, which is subtracted.
    """
    return (ahead + behind) * contact + (behind - ahead) * reached
