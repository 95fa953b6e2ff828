"""Represent plant and controller of a stage as linear systems, for many states at once.

The friction law has a steady state: stuck under a bias force, or sliding at a speed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from friso.equations.blocks import Controller, Loop
from friso.equations.component import Component, Kink
from friso.equations.continuous import continuous_controller
from friso.equations.joint import touching
from friso.equations.model import REFERENCE as REFERENCE_COURSE
from friso.equations.model import assemble
from friso.equations.roles import Role
from friso.equations.structure import ControllerForm, Structure, shared_structure
from friso.equations.transmission import flanks
from friso.errors import InputError
from friso.frequency.members import FORWARD, Members, law_of, motor_law_of
from friso.frequency.system import Declared, System
from friso.stage.tables import MOTOR_STATES, STATE_PREFIX, of_motor


def operating_point(flat: Mapping[str, Any], members: Members) -> dict[str, Any]:
    """Return the steady values of a stage's friction law in each state of `members`, by name.

    Each has the shape (members,). They are the values of its internal states, of its modes with memory, of the sides of
    its kinks (where derivatives jump), and of its direction. The result is empty without friction.
    """
    law, forward = law_of(flat), members.forward.astype(float)
    if law is None:
        return {}
    sign = 2 * forward - 1
    at = {**flat, "velocity": sign * np.maximum(members.speed, np.finfo(float).tiny), FORWARD: forward}
    sliding, stuck = law.sliding(at), law.stuck({**at, "bias": sign * members.bias})
    internal = {
        name: np.where(members.stuck, rest, moving)
        for name, rest, moving in zip((*law.states, *law.modes), stuck, sliding, strict=True)
    }
    return {FORWARD: forward, **internal}


def operating_point_of_motor(flat: Mapping[str, Any], members: Members) -> dict[str, Any]:
    """Return the steady values of the friction law at the motor in each state, by name.

    The motor moves with the load and bears no bias force.
    """
    unbiased = replace(members, bias=np.zeros(len(members)))
    point = operating_point(of_motor(flat), unbiased)
    beyond = "beyond_"
    return {
        f"{beyond}{STATE_PREFIX}{name.removeprefix(beyond)}" if name.startswith(beyond) else f"{STATE_PREFIX}{name}": at
        for name, at in point.items()
    }


FORCE, DISTURBANCE, REFERENCE, NOISE = "force", "disturbance on cart", "reference", "sensor noise"
FEEDFORWARD = "reference velocity", "reference acceleration", "reference jerk"
STAGE, CART, DEFLECTION, VELOCITY = "stage", "cart", "joint deflection", "stage velocity"
RATED = "velocity's encoder"
"""Name of the position signal that the drive differentiates to a velocity: the velocity encoder's, if separate."""

_REFERENCE, _POSITION, _VELOCITY, *_DERIVATIVES = (
    sp.Symbol(f"measured_{name}", real=True) for name in ("r", "y", "v", "r_rate", "r_bend", "r_jerk")
)
_CONTROLLER_INPUTS = {
    REFERENCE: _REFERENCE,
    STAGE: _POSITION,
    VELOCITY: _VELOCITY,
    **dict(zip(FEEDFORWARD, _DERIVATIVES, strict=True)),
}


def plant(flat: Mapping[str, Any], members: Members) -> System:
    """Return the plant in each state of `members`, which are all stuck or all sliding.

    Inputs are the forces on stage and cart [N]. Outputs are the positions of stage and cart, the joint deflection, the
    position at the velocity's encoder [m], and the velocity of the stage [m/s]. `flat` has the keys in SI, which may be
    arrays of shape (members,).
    """
    form = _plant(shared_structure(flat).standing)
    velocity = np.where(members.forward, members.speed, -members.speed)
    values = {**flat, **operating_point(flat, members)}
    values |= dict.fromkeys(form.velocities, velocity)
    values |= {**_ahead(touching, members.touched.astype(float)), **_ahead(flanks, 1.0)}
    values |= {str(symbol): 0.0 for symbol in REFERENCE_COURSE}  # the reference rests
    bodies = {form.cart: law_of(flat)}
    if form.motor:
        bodies[form.motor] = motor_law_of(flat)
        values |= operating_point_of_motor(flat, members)
    system = form.declared.at(values, len(members))
    for body, law in bodies.items():
        if law is not None:
            stuck = members.stuck.all()
            system = _following(system, body, law.states) if stuck else _without_constants(system, law.states)
    return system


def mechanics(flat: Mapping[str, Any], touched: np.ndarray) -> System:
    """Return the masses without friction as systems, from forces on stage and cart to positions.

    There is one system for each entry of `touched`, with the limiter touched or not. Raises InputError for a
    transmission with another nonlinearity than the friction of the guide.
    """
    drive = shared_structure(flat).transmission
    if drive is not None and (drive.backlash or drive.friction != "none"):
        actual = "a backlash" if drive.backlash else "friction at the motor"
        raise InputError("transmission", actual, "the friction of the guide alone", "friso check, which simulates")
    declared = _plant(replace(shared_structure(flat).standing, friction="none", friction_variant=None)).declared
    masses = declared.at({**flat, **_ahead(touching, touched.astype(float))}, len(touched))
    return masses.take((FORCE, DISTURBANCE), (STAGE, CART))


def _ahead(kinks: Callable[[sp.Expr], tuple[Kink, Kink]], values: Any) -> dict[str, Any]:
    """Return the symbols of the stops ahead and behind, by name: `values` say where the one ahead is touched.

    With the limiter, members that touch it do so ahead. With a backlash, the motor stands on the flank ahead, on which
    it pushes the load forward.
    """
    ahead, behind = (str(kink.beyond) for kink in kinks(sp.S.Zero))
    return {ahead: values, behind: 0.0}


def compensator(flat: Mapping[str, Any], members: int) -> System:
    """Return the controller, from reference and measurements to the force [N].

    Inputs are the reference, position [m] and velocity [m/s] of the stage, and velocity [m/s], acceleration [m/s^2] and
    jerk [m/s^3] of the reference. There are `members` equal ones, unless keys are arrays. Raises InputError for a
    controller that exerts no force.
    """
    form = shared_structure(flat).controller
    assert form is not None  # a stage file has a controller
    bare = replace(form, anti_windup=None, settings=form.settings.only("integral_leak"))
    system = _compensator(bare).at(flat, members)
    if not (system.c.any() or system.d.any()):
        raise InputError("controller", "gains that are all 0", "a controller that acts", 'kp = "3 N/m"')
    return system


def reference_derivatives(control: System) -> tuple[str, ...]:
    """Return names of the derivatives of the reference that a controller takes."""
    return tuple(name for name in FEEDFORWARD if control.sees(name))


@dataclass(frozen=True)
class _Plant:
    """The model's own equations in symbols, with a force in place of the controller.

    It has the names of all velocities, and of position and velocity of the cart and of the motor (None without a
    transmission).
    """

    declared: Declared
    velocities: tuple[str, ...]
    cart: tuple[str, str]
    motor: tuple[str, str] | None


@cache
def _plant(form: Structure) -> _Plant:
    push = sp.Symbol("actuator_force", real=True)
    seen: list[Loop] = []

    def control(loop: Loop, length: sp.Expr, rate: sp.Expr) -> Controller:
        seen.append(loop)
        return Controller(push, Component())

    at_rest = replace(form, controller=None, biased=("cart",), limiter_pulls=True)  # a touched limiter stays touched
    model = assemble(at_rest, control=control, alone=True)
    (loop,) = seen
    expressions = {name: output.expression for name, output in model.outputs.items()}
    rated = loop.position if loop.rated is None else loop.rated
    outputs = {STAGE: loop.position, CART: expressions["cart_position"], VELOCITY: loop.velocity, RATED: rated}
    if "joint_deflection" in expressions:
        outputs[DEFLECTION] = expressions["joint_deflection"]
    inputs = {FORCE: push, DISTURBANCE: sp.Symbol("bias.cart", real=True)}
    velocities = tuple(str(state.symbol) for state in model.states if state.role == Role.VELOCITY)
    cart = (str(model.cart.position), str(model.cart.velocity))
    motor = MOTOR_STATES if form.transmission else None
    return _Plant(Declared(model.symbols, model.rhs, inputs, outputs), velocities, cart, motor)


def cart_states(flat: Mapping[str, Any]) -> tuple[str, str]:
    """Return the names of the states that are position and velocity of the body with friction."""
    return _plant(shared_structure(flat).standing).cart


@cache
def _compensator(form: ControllerForm) -> Declared:
    speed, acceleration, jerk = _DERIVATIVES
    loop = Loop(_REFERENCE - _POSITION, _POSITION, _VELOCITY, speed, acceleration, reference_jerk=jerk)
    control = continuous_controller(form, loop, sp.S.One, sp.S.One)
    states = control.component.states
    # within all limits of the controller
    within: dict[Any, Any] = {kink.beyond: sp.S.Zero for kink in control.component.kinks}
    symbols = tuple(state.symbol for state in states)
    force, *rates = (sp.sympify(e).subs(within) for e in (control.force, *(state.derivative for state in states)))
    return Declared(symbols, tuple(rates), _CONTROLLER_INPUTS, {FORCE: force})


def _following(system: System, cart: tuple[str, str], internal: tuple[str, ...]) -> System:
    """Return the system with the friction law's internal states tied to the stuck cart.

    At rest the rate of these states is proportional to the velocity of the cart alone. So they differ from a multiple
    of its position by a constant, which depends on where on the rail the cart got stuck. Nothing controls that
    constant, and it does not matter; it would be a pole at 0.
    """
    position, velocity = map(system.states.index, cart)
    a, c = system.a.copy(), system.c.copy()
    for z in map(system.states.index, internal):
        share = system.a[:, z, velocity]
        for matrix in (a, c):
            matrix[:, :, position] += share[:, None] * matrix[:, :, z]
    return replace(system, a=a, c=c).keep([i for i, name in enumerate(system.states) if name not in internal])


def _without_constants(system: System, internal: tuple[str, ...]) -> System:
    """Return the system without internal states of the friction law that stay constant.

    An example is the force of an element that slips. Such a state would be a pole at 0.
    """
    unmoved = [z for z in map(system.states.index, internal) if not (system.a[:, z].any() or system.b[:, z].any())]
    return system.keep([i for i in range(len(system.states)) if i not in unmoved])
