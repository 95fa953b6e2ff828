"""Choose a design's controller, and whether more joint damping would help."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.design_method.modal import Modal
from friso.design_method.population import Population
from friso.design_method.settings import settings
from friso.equations.controllers.van_dijk import ALPHA, BETA, CROSSOVER, TUNED_MASS
from friso.frequency.ranges import Range, shared
from friso.frequency.tuning import Tuning, tuning
from friso.leaf_springs.evaluation import Evaluation
from friso.stage import Stage

RATIOS = np.geomspace(0.02, 0.7, 9)
"""Joint dampings that are tried, as damping ratios of the stage on the joint."""


@dataclass(frozen=True)
class Damping:
    """Joint dampings that were tried [N s/m], and each one's least modulus margin.

    The margin is 0 for an unstable loop. The stage's own damping comes first.
    """

    tried: np.ndarray
    margins: np.ndarray

    @property
    def worth(self) -> int:
        """Return the index of the smallest damping that gives nearly all of the possible margin.

        Index 0 is the stage's own damping.
        """
        return int(np.flatnonzero(self.margins >= settings.enough_margin * self.margins.max())[0])


@dataclass(frozen=True)
class DesignedController:
    """Gains by van Dijk's rules at the chosen `crossover` [Hz].

    `margin` is the least modulus margin as designed, over the limit cases and all states stuck under a bias force.
    `corners` has the least margin at each corner of friction and masses, shape (n,). `damping` shows what more damping
    of the joint would add.
    """

    crossover: float
    gains: Tuning
    margin: float
    corners: np.ndarray
    damping: Damping


def comfortable_below(ranges: Sequence[Range], highest: float) -> float | None:
    """Return the highest crossover [Hz] in the `ranges` up to `highest`; None if all lie above."""
    below = [min(high, highest) for low, high in ranges if low < highest]
    return max(below) if below else None


def comfortable(stage: Stage, leaves: Evaluation, population: Population) -> tuple[Range, ...]:
    """Return the ranges of crossovers [Hz] in which the least modulus margin is at least 0.5.

    The margin counts in the limit cases and all states stuck under a bias force, for the stage's own masses and all
    masses in the population.
    """
    flat = stage.flat()
    ranges = Modal.of(flat, leaves).comfortable
    masses = {
        tuple((key, value) for key, value in population.of(k).items() if key.startswith("masses."))
        for k in range(population.count)
    }
    for group in sorted(masses):
        if group:
            ranges = shared(ranges, Modal.of({**flat, **dict(group)}, leaves).comfortable)
    return ranges


def choose_controller(stage: Stage, leaves: Evaluation, population: Population) -> DesignedController:
    """Return the gains and margins of a stage with leaf springs, at its chosen crossover."""
    flat = stage.flat()
    gains = tuning(*(flat[key] for key in (CROSSOVER, ALPHA, BETA, TUNED_MASS)))
    corners = np.array([_margin({**flat, **population.of(k)}, leaves) for k in range(population.count)])
    tried = dampings(flat)
    damping = Damping(tried, np.array([_margin({**flat, "joint.damping": trial}, leaves) for trial in tried]))
    return DesignedController(flat[CROSSOVER], gains, _margin(flat, leaves), corners, damping)


def _margin(flat: Mapping[str, Any], leaves: Evaluation) -> float:
    return float(Modal.of(flat, leaves).margin(flat[CROSSOVER])[0])


def dampings(flat: Mapping[str, Any]) -> np.ndarray:
    """Return the joint dampings to try [N s/m]: the stage's own, then larger ones, ascending."""
    critical = 2 * np.sqrt(flat["joint.stiffness"] * flat["masses.stage"])
    given_damping = flat["joint.damping"]
    return np.array([given_damping, *(damping for damping in RATIOS * critical if damping > given_damping)])
