"""Declare a friction law on a body that follows a measured motion, sample by sample.

The friction force does not act back on the motion. The impulse of the friction force is integrated as well. Differences
of the impulse give the mean force between samples, for any law.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from friso.equations.imposed import Imposed

if TYPE_CHECKING:
    from friso.equations.model import Model

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
