"""The masses, the joint between them, and the transmission that drives them.

Masses form a chain, cart, joint, stage, parasitic mass; or there is one rigid mass (thesis, Fig. 3 and 4).

The joint is compliant and has a limiter (thesis, Fig. 3). Table 1 of the thesis prints a series formula for the touched
limiter. A touching limiter acts in parallel with the leaf springs, so stiffness and damping are added here.

The transmission is a screw, belt or gear between motor and load: a spring and damper with backlash. Spring and damper
are idle while the backlash is crossed. The motor is a body of its own, its mass and motion taken at the load: one turn
of the motor moves the load by a lead. Friction at the motor is a friction law of its own, of the table
[motor_friction].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import sympy as sp

from friso.equations.component import STEADY, Component, Kink, Output, Piecewise, Role, State, key, state
from friso.equations.friction.common import Friction
from friso.equations.structure import JointForm
from friso.stage.tables import MOTOR_FRICTION, STATE_PREFIX


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


def joint_force(form: JointForm, deflection: sp.Expr, rate: sp.Expr, limiter_pulls: bool) -> tuple[sp.Expr, Component]:
    """Return the force of the joint on the cart [N], and its kinks, for a deflection [m].

    Kinks are where derivatives jump. "locked": cart and stage are coupled by the limiter alone. "touching": the stroke
    is zero, so that the limiter always touches. "free": the limiter touches where abs(deflection) exceeds the stroke. A
    limiter that cannot pull lets go where its damping would outweigh its stiffness. `rate` [m/s] is that of the
    deflection.
    """
    contact = key("joint.limiter_stiffness") * deflection + key("joint.limiter_damping") * rate
    leaves = key("joint.stiffness") * deflection + key("joint.damping") * rate
    kinks: tuple[Kink, ...] = ()
    if form == "locked":
        force = contact
    elif form == "touching":
        force = leaves + contact
    else:
        stroke = key("joint.stroke")
        kinks = touching(deflection)
        reached = key("joint.limiter_stiffness") * stroke
        ahead, behind = (kink.beyond for kink in kinks)
        if not limiter_pulls:
            pushing = stops(contact, reached, "contact")
            ahead, behind = ahead * pushing[0].beyond, behind * pushing[1].beyond
            kinks = (*kinks, *pushing)
        force = leaves + beyond_stops(ahead, behind, contact, reached)
    outputs = {
        "joint_deflection": Output(deflection, "m", "joint deflection"),
        "joint_force": Output(force, "N", "joint force"),
    }
    return force, Component(kinks=kinks, outputs=outputs)


def joint_deflection(form: JointForm, force: sp.Expr) -> sp.Expr:
    """Return the deflection of the joint [m] under a constant force [N], as in `joint_force`."""
    if form == "rigid":
        return sp.S.Zero
    limiter = key("joint.limiter_stiffness")
    if form == "locked":
        return force / limiter
    if form == "touching":
        return force / (key("joint.stiffness") + limiter)
    return deflection_under(force, key("joint.stiffness"), limiter, key("joint.stroke"))


def touching(deflection: sp.Expr) -> tuple[Kink, Kink]:
    """Return the kinks at which the limiter of a free joint touches, ahead and behind.

    At a kink derivatives jump. `deflection` [m] is that of the joint.
    """
    return stops(deflection, key("joint.stroke"), "stroke")


BACKLASH = key("transmission.backlash")
"""Total backlash [m], from flank to flank."""


def transmission(backlash: bool, motor: Body, load: Body) -> tuple[sp.Expr, Component]:
    """Return the force of the transmission on the load [N], and its kinks.

    At a kink derivatives jump. The force is 0 within the backlash. On a flank the spring acts on the deflection beyond
    half the backlash, in parallel with the damper.
    """
    deflection, rate = motor.position - load.position, motor.velocity - load.velocity
    stiffness = key("transmission.stiffness")
    contact = stiffness * deflection + key("transmission.damping") * rate
    force, kinks = contact, ()
    if backlash:
        kinks = ahead, behind = flanks(deflection)
        force = beyond_stops(ahead.beyond, behind.beyond, contact, stiffness * BACKLASH / 2)
    outputs = {
        "transmission_deflection": Output(deflection, "m", "motor minus load"),
        "transmission_force": Output(force, "N", "transmission force"),
    }
    return force, Component(kinks=kinks, outputs=outputs)


def transmission_deflection(backlash: bool, force: sp.Expr) -> sp.Expr:
    """Return how far the motor is ahead of the load [m] under a constant force on the load [N].

    With a backlash the transmission lies on a flank.
    """
    return deflection_under(force, sp.S.Zero, key("transmission.stiffness"), BACKLASH / 2 if backlash else sp.S.Zero)


def flanks(deflection: sp.Expr) -> tuple[Kink, Kink]:
    """Return the kinks at which the transmission touches its flanks, ahead and behind.

    At a kink derivatives jump. `deflection` [m] is the position of the motor relative to the load.
    """
    return stops(deflection, BACKLASH / 2, "flank")


def at_motor(friction: Friction, velocity: sp.Symbol, motor_velocity: sp.Symbol) -> Friction:
    """Return a friction law moved from the guide to the motor, with names and keys of its own.

    `velocity` is that of the body for which the law was declared.
    """
    component = friction.component
    names = {x: _renamed(str(x)) for x in (part.symbol for part in component.states)}
    names |= {kink.beyond: _renamed(kink.name, "beyond_") for kink in component.kinks}
    symbols: dict[Any, Any] = {old: sp.Symbol(new, real=True) for old, new in names.items()}
    symbols[velocity] = motor_velocity
    for expression in _expressions(friction):
        for symbol in expression.free_symbols:
            name = str(symbol)
            if name.startswith("friction."):
                symbols[symbol] = key(f"{MOTOR_FRICTION}.{name.removeprefix('friction.')}")

    def put(expression: sp.Expr) -> sp.Expr:
        return cast(sp.Expr, expression.xreplace(symbols))

    states = tuple(
        State(put(x.symbol), put(x.derivative), x.unit, put(x.scale), x.role, put(x.settled), x.controlled)  # type: ignore[arg-type]
        for x in component.states
    )
    kinks = tuple(kink.with_values(symbols).called(f"{STATE_PREFIX}{kink.name}") for kink in component.kinks)
    outputs = {
        f"{STATE_PREFIX}{name}": Output(put(output.expression), output.unit, f"motor: {output.label}")
        for name, output in component.outputs.items()
    }
    outputs["motor_friction_force"] = Output(put(friction.force), "N", "friction force at the motor")
    sliding: Any = friction.sliding and {put(x): put(expression) for x, expression in friction.sliding.items()}
    alone = None if friction.alone is None else put(friction.alone)
    return Friction(put(friction.force), put(friction.breakaway), Component(states, kinks, outputs), sliding, alone)


def _renamed(name: str, before: str = "") -> str:
    return f"{before}{STATE_PREFIX}{name}"


def _expressions(friction: Friction) -> list[sp.Expr]:
    """Return all expressions that a law declares."""
    component = friction.component
    expressions = [friction.force, friction.breakaway, *([] if friction.alone is None else [friction.alone])]
    expressions += [e for part in component.states for e in (part.derivative, part.scale, part.settled)]
    expressions += [output.expression for output in component.outputs.values()]
    expressions += map(sp.sympify, (friction.sliding or {}).values())
    for kink in component.kinks:
        expressions += [kink.surface, kink.narrow, kink.at_start, *getattr(kink, "becomes", {}).values()]
    return expressions
