"""Motions and forces that are imposed on a stage instead of its controller.

Sinusoidal motion, for the describing function of a friction law: time counts in periods, so that all runs have equal
length. The first harmonic of the friction force is integrated as well, to the solver's tolerance, however abruptly the
force changes.

Measured motion of a body, sample by sample: the friction force does not act back on it. The impulse of the friction
force is integrated as well. Differences of the impulse give the mean force between samples, for any law.

Log: a stage follows its reference and external force at every sample.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from friso.equations.structure import Structure
from friso.errors import InputError
from friso.stage.tables import FrictionSection, friction_law

if TYPE_CHECKING:
    import sympy as sp

    from friso.equations.component import State
    from friso.equations.model import Control, Model


FREQUENCY = "imposed.frequency"
"""Key of the frequency of the motion [Hz]. The amplitude of the motion is the displacement at the start."""

HARMONIC = ("in_phase", "in_quadrature")
"""States that integrate the real and the imaginary part of the first harmonic of friction [N] over a period.

With the harmonic, force = Re(harmonic exp(2 pi i time)) and position = amplitude cos(2 pi time)."""


@dataclass(frozen=True)
class Imposed:
    """Structure of a friction law on a body with an imposed motion.

    `friction_variant` is any further choice of the law (see `Structure`).
    """

    friction: str
    friction_variant: Hashable


def imposed_form(flat: Mapping[str, Any]) -> Imposed:
    """Return the structure of a stage's friction law under imposed motion; `flat` has its keys.

    Raises InputError for a law without a force.
    """
    name = flat["friction.model"]
    law = friction_law(name)
    if law.declare is FrictionSection.declare:
        raise InputError("friction.model", f'"{name}", without a force', "a friction law", 'model = "lugre"')
    return Imposed(name, law.variant(flat))


def imposed(form: Imposed) -> Model:
    """Return the equations of a friction law under an imposed sinusoidal motion.

    Time counts in periods of the motion.
    """
    import sympy as sp

    from friso.equations.component import Output, Role, State, key, state
    from friso.equations.friction.common import friction_alone
    from friso.equations.masses import Body
    from friso.equations.model import MOTION_SIZE, Model, resets

    body, period = Body.named("", sp.oo), 1 / key(FREQUENCY)  # no force acts back on the imposed motion
    position, velocity = body.position, body.velocity
    friction = friction_alone(form.friction, velocity, form.friction_variant)
    omega, size = 2 * sp.pi / period, friction.breakaway
    shares = (2 * friction.force * position / MOTION_SIZE, 2 * friction.force * velocity / (omega * MOTION_SIZE))
    states = (
        State(position, velocity * period, "m", MOTION_SIZE, Role.POSITION),
        State(velocity, -(omega**2) * position * period, "m/s", MOTION_SIZE * omega, Role.VELOCITY),
        *(_per_period(part, period) for part in friction.component.states),
        *(State(state(name), share, "N", size, Role.SUM) for name, share in zip(HARMONIC, shares, strict=True)),
    )
    return Model(
        states=states,
        stage=body,
        cart=body,
        kinks=friction.component.kinks,
        outputs={"friction_force": Output(friction.force, "N", "friction force")},
        deviation=position,
        deviation_rate=velocity * period,
        length=MOTION_SIZE,
        rate=2 * sp.pi,
        breakaway=friction.breakaway,
        stiffness=sp.S.Zero,
        jumps=resets(friction.component.kinks),
    )


def _per_period(inner: State, period: sp.Expr) -> State:
    """Return a state of the law, `inner`, with its derivative per period instead of per second.

    States that are lengths get the size of the motion as their scale, if it is smaller.
    """
    import sympy as sp

    from friso.equations.model import MOTION_SIZE

    scale = sp.Min(inner.scale, MOTION_SIZE) if inner.unit == "m" else inner.scale
    return replace(inner, derivative=inner.derivative * period, scale=scale)


IMPULSE = "impulse"
"""Name of the state that integrates the friction force [N s]."""


@dataclass(frozen=True)
class Dragged(Imposed):
    """Structure of a friction law on a body that follows a reference."""


def dragged(form: Dragged) -> Model:
    """Return the equations of a friction law on a body that follows a reference.

    The reference gives position [m], velocity [m/s] and acceleration [m/s^2] at every sample, as in
    `friso.engine.batch.run_driven`.
    """
    import sympy as sp

    from friso.equations.component import Output, Role, State, key, state
    from friso.equations.friction.common import friction_alone
    from friso.equations.masses import Body
    from friso.equations.model import MOTION_SIZE, REFERENCE, Model, resets

    body, rate = Body.named("", sp.oo), 1 / key("motion.duration")
    friction = friction_alone(form.friction, body.velocity, form.friction_variant)
    component, size = friction.component, friction.breakaway
    states = (
        State(body.position, body.velocity, "m", MOTION_SIZE, Role.POSITION),
        State(body.velocity, REFERENCE[2], "m/s", MOTION_SIZE * rate, Role.VELOCITY),
        *component.states,
        State(state(IMPULSE), friction.force, "N*s", size / rate, Role.SUM),
    )
    return Model(
        states=states,
        stage=body,
        cart=body,
        kinks=component.kinks,
        outputs={"friction_force": Output(friction.force, "N", "friction force")},
        deviation=body.position,
        deviation_rate=body.velocity,
        length=MOTION_SIZE,
        rate=rate,
        breakaway=size,
        stiffness=sp.S.Zero,
        jumps=resets(component.kinks),
        inputs=(*REFERENCE, key("external.force"), key("external.rate")),
    )


HELD_FORCE = "held_force"
"""Name of the force [N] that a sampled drive holds until the next sample."""


@dataclass(frozen=True)
class Driven:
    """Structure of a stage that follows a logged position or reference, with an external force.

    `velocity_samples` is the number of samples over which the drive differentiates the position; 0 means a controller
    in continuous time.
    """

    structure: Structure
    velocity_samples: int = 0


def driven(form: Driven) -> Model:
    """Return the equations of a stage with reference and external force at every sample.

    The reference has position [m], velocity [m/s] and acceleration [m/s^2]. The external force [N] acts in addition to
    the controller's, and has a rate [N/s].
    """
    from dataclasses import replace

    from friso.equations.component import TIME, key
    from friso.equations.model import REFERENCE, assemble

    force, rate = key("external.force"), key("external.rate")
    model = assemble(
        form.structure.standing, lambda _: force + rate * TIME, _sampled(form) if form.velocity_samples else None
    )
    return replace(model, inputs=(*REFERENCE, force, rate))


def _sampled(form: Driven) -> Control:
    """Return the controller as a drive computes it, sampled at the corners of the reference.

    At these corners the log has its samples.
    """
    from dataclasses import replace

    from friso.equations.blocks import Controller, Loop
    from friso.equations.component import TIME, Component, Held, Output, state
    from friso.equations.sampled import sampled_controller

    def control(loop: Loop, length: sp.Expr, rate: sp.Expr) -> Controller:
        assert form.structure.controller is not None
        held_force = state(HELD_FORCE)
        at_corner = replace(
            loop, error=loop.error.subs(TIME, 0), reference_velocity=loop.reference_velocity.subs(TIME, 0)
        )
        force, held = sampled_controller(form.structure.controller, at_corner, form.velocity_samples)
        component = Component(outputs={"force": Output(held_force, "N", "actuator force")})
        return Controller(held_force, component, (*held, Held(held_force, force)))

    return control
