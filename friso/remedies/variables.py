"""Define the variables of an optimiser, on logarithmic scales: gains, bandwidth, and joint."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.equations.bandwidth import sped_up
from friso.remedies.settings import settings
from friso.stage import Stage
from friso.stage.controllers import controller_of

KeyChanges = Callable[[Mapping[str, Any], np.ndarray], dict[str, Any]]
"""Function that takes the keys so far, in SI, and values of a variable, and returns the keys that change."""

BANDWIDTH = "bandwidth"
"""Name of the variable that makes the whole controller faster."""


DAMPING_RATIOS = (0.01, 0.3)
"""Range of damping ratios of the stage on its joint."""


@dataclass(frozen=True)
class Variable:
    """A number between `low` and `high` (SI) on a logarithmic scale.

    Close to the `present` value, the number takes exactly that value; NaN means that there is none.
    """

    name: str
    low: float
    high: float
    change: KeyChanges
    present: float = float("nan")

    def at(self, share: np.ndarray) -> np.ndarray:
        """Return the values at coordinates from 0 to 1 over the range."""
        value = np.asarray(self.low * (self.high / self.low) ** share)
        return np.where(np.abs(share - self.share(self.present)) < settings.snap_share, self.present, value)

    def share(self, value: float) -> float:
        """Return the coordinate, from 0 to 1 over the range, of a value."""
        return float(np.log(value / self.low) / np.log(self.high / self.low))


def of_key(key: str, low: float, high: float, present: float = float("nan")) -> Variable:
    """Return a key of the stage file as a variable between `low` and `high`.

    Close to the `present` value, the variable takes exactly that value; NaN means that there is none.
    """
    return Variable(key, low, high, lambda flat, value: {key: value}, present)


def bandwidth_factor(present: float = float("nan")) -> Variable:
    """Return the bandwidth of the whole controller as a variable: a factor on the present one."""
    return Variable(BANDWIDTH, settings.slowest_factor, settings.fastest_factor, sped_up, present)


def gains(stage: Stage) -> tuple[Variable, ...]:
    """Return as variables the numbers that shape the controller, then its bandwidth."""
    flat, controller = stage.flat(), controller_of(stage.flat())
    shape = [of_key(controller.key(name), low, high) for name, (low, high) in controller.shaped_by.items()]
    keys = [controller.key(name) for name in controller.speeds_up if flat.get(controller.key(name))]
    against = [of_key(key, flat[key] / settings.gain_factor, flat[key] * settings.gain_factor) for key in keys[1:]]
    return (*shape, *against, bandwidth_factor())


def joint_variables(friction: float) -> tuple[Variable, ...]:
    """Return stroke, stiffness and damping of an isolator as variables.

    The ranges of the variables follow from the least static `friction` [N].
    """

    def stiffness(flat: Mapping[str, Any], share: np.ndarray) -> dict[str, Any]:
        return {"joint.stiffness": share * friction / flat["joint.stroke"]}

    def damping(flat: Mapping[str, Any], ratio: np.ndarray) -> dict[str, Any]:
        return {"joint.damping": 2 * ratio * np.sqrt(flat["joint.stiffness"] * flat["masses.stage"])}

    return (
        of_key("joint.stroke", *settings.joint_strokes),
        Variable("force of the joint at its stroke", *settings.joint_force_share, stiffness),
        Variable("damping ratio of the joint", *DAMPING_RATIOS, damping),
    )
