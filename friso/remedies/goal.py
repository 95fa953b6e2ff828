"""Define the goal of tuning, and which parts may change to reach it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.frequency.crossover import WANTED
from friso.hunting import SEARCH_LIMITS
from friso.remedies.machines import MoveRange
from friso.stage import Stage

SHARE = 0.95
"""Fraction of the machines, each with its own move, that must meet the goal."""


@dataclass(frozen=True)
class Goal:
    """The goal that a tuned machine must meet, and the parts that may change.

    A machine is in position `within` [m] of its reference. A fraction `share` (95 %) of machines and moves must be
    there `settle` [s] after the reference stands still; None means before the run ends. The actuator may use at most
    `force_limit` [N]; None means any force. The bandwidth must not exceed `bandwidth_limit` [Hz]; None means that only
    the stage file limits it.

    `moves` is the range of moves; None means those of the stage. The limit cases, and all states stuck under a bias
    force, must keep the modulus `margin`. The machine must not hunt at its bandwidth, nor at bandwidths up to the
    factor `distance` away. `controller` and `joint` are true if these parts may change.
    """

    within: float = 1e-6
    settle: float | None = None
    force_limit: float | None = None
    bandwidth_limit: float | None = None
    margin: float = WANTED
    distance: float = SEARCH_LIMITS.edge_distance
    share: float = SHARE
    controller: bool = True
    joint: bool = True
    moves: MoveRange | None = None

    def moves_of(self, stage: Stage) -> MoveRange:
        """Return the moves that machines must make: the goal's, or else the stage's."""
        return self.moves or MoveRange.of_stage(stage, self.within)

    def surely(self, machines: int) -> float:
        """Return the fraction of a sample of machines that must meet the goal.

        This fraction is one standard error above the one required of all machines. Otherwise, half of the settings at
        the limit would pass.
        """
        return min(1.0, self.share + float(np.sqrt(self.share * (1 - self.share) / machines)))
