"""Cap the speed of the controller that is advised where nobody stated what the machine allows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from friso.frequency.bode import loop_bandwidth
from friso.remedies.machines import Goal
from friso.remedies.settings import settings
from friso.stage import Stage

CapReason = Literal["stated", "least", "sampling", "mode", "unknown"]
"""What caps the speed: the user's limit of the bandwidth, the least speed that works, the sampling of the drive, the
lowest mode, or that no mode is known."""


@dataclass(frozen=True)
class SpeedCap:
    """The largest `factor` by which a controller is made faster unasked, and the `reason` for it.

    No gain goes beyond that of the present controller made faster by the factor.
    """

    factor: float
    reason: CapReason

    def above(self, least: float) -> SpeedCap:
        """Return the cap once a controller that is `least` times as fast works, and nothing faster is needed."""
        if self.reason == "stated":
            return self
        return SpeedCap(min(self.factor, settings.faster_than_least * max(1.0, least)), "least")


def speed_cap(stage: Stage, goal: Goal) -> SpeedCap:
    """Return how much faster a controller may become.

    The bandwidth of the loop may reach a fraction of the sampling rate or of the lowest mode, whichever is less; where
    no mode is known, a multiple of the present bandwidth. A cap never asks for a slower controller.
    """
    if goal.bandwidth_limit is not None:
        return SpeedCap(settings.fastest_factor, "stated")
    flat, own = stage.flat(), loop_bandwidth(stage)
    caps, mode = [], flat.get("parasitic.frequency")
    if mode is not None and np.isfinite(own):
        caps.append(SpeedCap(settings.mode_share * mode / own, "mode"))
    else:
        caps.append(SpeedCap(settings.fastest_unasked, "unknown"))
    if (sample_time := flat.get("drive.sample_time")) and np.isfinite(own):
        caps.append(SpeedCap(settings.sampling_share / sample_time / own, "sampling"))
    least = min(caps, key=lambda cap: cap.factor)
    return SpeedCap(min(max(1.0, least.factor), settings.fastest_factor), least.reason)
