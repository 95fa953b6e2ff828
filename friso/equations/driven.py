"""Declare a stage that follows a log: reference and external force at every sample."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from friso.equations.structure import Structure

if TYPE_CHECKING:
    import sympy as sp

    from friso.equations.model import Control, Model

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
