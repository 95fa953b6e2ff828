"""What a tuned machine has to do, and what may be changed for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.frequency.crossover import WANTED
from friso.hunting import SEARCH_LIMITS

SHARE = 0.95
"""Share of the machines, each with a move of its own, that have to meet the goal."""


@dataclass(frozen=True)
class Goal:
    """In position is `within` [m]; the slowest twentieth of machines and moves has to be there `settle` [s] after the
    reference stands (None: before the run ends) with at most `force_limit` [N] of the actuator (None: any); the
    bandwidth does not exceed `bandwidth_limit` [Hz] (None: only what the stage file tells limits it). Modulus
    `margin` and `distance` from hunting hold for all settled states. `controller` and `joint` may be changed."""

    within: float = 1e-6
    settle: float | None = None
    force_limit: float | None = None
    bandwidth_limit: float | None = None
    margin: float = WANTED
    distance: float = SEARCH_LIMITS.edge_distance
    share: float = SHARE
    controller: bool = True
    joint: bool = True

    def surely(self, machines: int) -> float:
        """The share of so many machines that has to meet the goal for it to be taken that its share of all does: one
        standard error more. Settings at the edge of what works would else be taken for ones that do half the time."""
        return min(1.0, self.share + float(np.sqrt(self.share * (1 - self.share) / machines)))
