"""Define map axes that multiply several keys: controller speed and friction level."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.equations.bandwidth import faster
from friso.equations.scaled_friction import with_friction
from friso.errors import InputError
from friso.stage.controllers import KIND
from friso.studies.links import names


@dataclass(frozen=True)
class Scaling:
    """Axis of factors on several keys, such as the speed of the controller.

    Fields are `words` for figures and the function that multiplies the keys. `needs` is a key that a stage must have
    for this axis.
    """

    words: str
    scaled: Callable[[Mapping[str, Any], Any], dict[str, Any]]
    needs: str


SCALINGS = {
    "speed": Scaling("Controller speed (times yours)", faster, KIND),
    "friction": Scaling("Friction (times yours)", with_friction, "friction.model"),
}
"""All axes of factors, by name.

Factors apply to all poles and zeros of the controller, or to every friction force.
"""


def scaled(flat: Mapping[str, Any], columns: Mapping[str, np.ndarray], links: Mapping[str, str]) -> dict[str, Any]:
    """Return keys of stages, multiplied by the scaling factors among the columns.

    `flat` has SI numbers or arrays (cells,) by key. A name that links use is a free variable, not a scaling. Raises
    InputError if a stage has nothing to scale.
    """
    for name, scaling in SCALINGS.items():
        if name in columns and name not in names(links):
            if flat.get(scaling.needs, "none") == "none":
                table = scaling.needs.partition(".")[0]
                raise InputError(name, f"a stage without [{table}]", "one that has it, or a key of the stage", "--help")
            flat = scaling.scaled(flat, columns[name])
    return dict(flat)
