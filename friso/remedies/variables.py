"""What an optimiser may change of a stage: numbers on logarithmic scales, and the keys that follow from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.equations.bandwidth import bandwidth, sped_up
from friso.frequency.margins import margins
from friso.frequency.members import limit_cases
from friso.stage import Stage
from friso.stage.controllers import controller_of

Change = Callable[[Mapping[str, Any], np.ndarray], dict[str, Any]]
"""From the flat keys so far and the values of a variable to the keys that change."""

BANDWIDTH = "bandwidth"
"""Name of the variable that makes a controller faster as a whole."""

WIDE = 4.0
"""Factor by which a gain may change against the others."""

FASTEST, SLOWEST = 10.0, 0.3
"""Factors up to and down to which the bandwidth is changed."""

FORCE_SHARE = (0.2, 0.8)
"""Force of the joint at its stroke, as a share of the least static friction: above it the cart moves before the joint
touches its limiter on the weakest machines."""

STROKES = (1e-5, 3e-3)
"""Strokes of a joint that are tried [m]."""

DAMPING_RATIOS = (0.01, 0.3)
"""Damping ratios of the stage on its joint that are tried."""


@dataclass(frozen=True)
class Variable:
    """A number between `low` and `high` (SI), tried evenly in its logarithm."""

    name: str
    low: float
    high: float
    change: Change

    def at(self, share: np.ndarray) -> np.ndarray:
        """Its values at shares of the range."""
        return np.asarray(self.low * (self.high / self.low) ** share)


def of_key(key: str, low: float, high: float) -> Variable:
    """A key of the stage file itself."""
    return Variable(key, low, high, lambda flat, value: {key: value})


def bandwidth_factor(stage: Stage, limit: float | None) -> Variable:
    """How fast the controller is as a whole, as a factor of what it is, up to a limit of the bandwidth [Hz]."""
    present = loop_bandwidth(stage)
    high = FASTEST if limit is None or not present > 0 else min(FASTEST, limit / present)
    return Variable(BANDWIDTH, min(SLOWEST, high / 2), high, sped_up)


def loop_bandwidth(stage: Stage) -> float:
    """The bandwidth [Hz] that the controller states; else the last frequency at which the loop's gain is 1 while the
    stage slides (NaN: there is none): stuck, its bearing holds it, and the loop hardly moves it."""
    flat = stage.flat()
    stated = bandwidth(flat)
    if stated is not None:
        return float(stated)
    sliding = next(case for name, case in limit_cases(flat).items() if not name.startswith("stuck"))
    crossings = margins(flat, sliding).crossovers
    return float(crossings[-1]) if crossings else float("nan")


def gains(stage: Stage, bandwidth: Variable) -> tuple[Variable, ...]:
    """The gains of a controller against each other, then its bandwidth."""
    flat, controller = stage.flat(), controller_of(stage.flat())
    shape = [of_key(controller.key(name), low, high) for name, (low, high) in controller.shaped_by.items()]
    keys = [controller.key(name) for name in controller.speeds_up if flat.get(controller.key(name))]
    against = [of_key(key, flat[key] / WIDE, flat[key] * WIDE) for key in keys[1:]]
    return (*shape, *against, bandwidth)


def joint_variables(friction: float) -> tuple[Variable, ...]:
    """Stroke, stiffness and damping of an isolator for the least static friction [N]."""

    def stiffness(flat: Mapping[str, Any], share: np.ndarray) -> dict[str, Any]:
        return {"joint.stiffness": share * friction / flat["joint.stroke"]}

    def damping(flat: Mapping[str, Any], ratio: np.ndarray) -> dict[str, Any]:
        return {"joint.damping": 2 * ratio * np.sqrt(flat["joint.stiffness"] * flat["masses.stage"])}

    return (
        of_key("joint.stroke", *STROKES),
        Variable("force of the joint at its stroke", *FORCE_SHARE, stiffness),
        Variable("damping ratio of the joint", *DAMPING_RATIOS, damping),
    )
