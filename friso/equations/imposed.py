"""Declare a friction law under an imposed sinusoidal motion, for its describing function.

Time counts in periods, so that all runs have equal length. The first harmonic of the friction force is integrated as
well, to the solver's tolerance, however abruptly the force changes.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from friso.errors import InputError
from friso.stage.tables import FrictionSection, friction_law

if TYPE_CHECKING:
    import sympy as sp

    from friso.equations.component import State
    from friso.equations.model import Model

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
