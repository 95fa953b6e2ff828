"""Screw, belt or gear between motor and load: a spring and damper with backlash.

Spring and damper are idle while the backlash is crossed. The motor is a body of its own, its mass and motion taken at
the load: one turn of the motor moves the load by a lead. Friction at the motor is a friction law of its own, of the
table [motor_friction].
"""

from __future__ import annotations

from typing import Any, cast

import sympy as sp

from friso.equations.component import Component, Kink, Output, State, key
from friso.equations.friction.common import Friction
from friso.equations.masses import Body, beyond_stops, deflection_under, stops
from friso.stage.tables import MOTOR_FRICTION, STATE_PREFIX

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
