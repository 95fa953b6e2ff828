"""A stage that follows a log: its reference, and a force besides the controller's, come sample by sample."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from friso.equations.structure import Structure

if TYPE_CHECKING:
    from friso.equations.model import Model


@dataclass(frozen=True)
class Driven:
    """The stage's structure, and over how many samples the drive takes the velocity; 0: a controller in continuous
    time."""

    structure: Structure
    velocity_samples: int = 0


def driven(form: Driven) -> Model:
    """The equations of the stage with what it is given at every sample: position [m], velocity [m/s] and acceleration
    [m/s^2] of the reference, and the force [N] besides the controller's with its rate [N/s]."""
    from dataclasses import replace

    from friso.equations.component import TIME, key
    from friso.equations.model import REFERENCE, assemble

    force, rate = key("external.force"), key("external.rate")
    model = assemble(form.structure, force + rate * TIME, form.velocity_samples)
    return replace(model, inputs=(*REFERENCE, force, rate))
