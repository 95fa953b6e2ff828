"""How far a stage is from the edge of hunting: the crossover at which its hunting cycle stops attracting."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import NOT_CLOSED, hunting_cycles
from friso.stage import Stage

FARTHEST, POINTS = 10.0, 25
"""Factor up to which the bandwidth is changed, and steps on the way."""

FINER, ROUNDS = 9, 3
"""Steps between the two that enclose the edge, and how often they are taken."""


@dataclass(frozen=True)
class Margin:
    """The edge of hunting nearest in bandwidth: hunting is possible below it.

    `factor` is the bandwidth there over that of the stage, `crossover` [Hz] the crossover there (None for a controller
    given by its gains, all of whose poles and zeros the factor scales).
    """

    factor: float
    crossover: float | None


def faster(flat: Mapping[str, Any], factor: np.ndarray) -> dict[str, Any]:
    """Stages whose controller is faster by a factor, all its poles and zeros and the crossover being scaled."""
    if "controller.crossover" in flat:
        return {**flat, "controller.crossover": flat["controller.crossover"] * factor}
    powers = {"kp": 2, "ki": 3, "kd": 1, "tau": -1}
    return {**flat, **{f"controller.{name}": flat[f"controller.{name}"] * factor**n for name, n in powers.items()}}


def margin(stage: Stage, attracting: bool) -> Margin | None:
    """The edge above the bandwidth of a stage whose cycle attracts, or below that of one whose cycle does not; None
    within a factor of ten."""
    flat = stage.flat()
    low, high, points = 1.0, FARTHEST if attracting else 1 / FARTHEST, POINTS
    for _ in range(ROUNDS):
        factors = np.geomspace(low, high, points)
        cycles = hunting_cycles(Ensemble.held(faster(flat, factors), points))
        unknown = cycles.reasons == NOT_CLOSED  # taken to be as it is on this side
        changed = np.flatnonzero((cycles.attracting != attracting) & ~unknown)
        if not changed.size or changed[0] == 0:
            return None
        k = int(changed[0])
        low, high, points = factors[k - 1], factors[k], FINER
    factor = _interpolated(factors, np.abs(cycles.multiplier), k)
    crossover = flat["controller.crossover"] * factor if "controller.crossover" in flat else None
    return Margin(factor, crossover)


def _interpolated(factors: np.ndarray, size: np.ndarray, k: int) -> float:
    """The factor between numbers k - 1 and k at which the multiplier passes 1, the middle where one is unknown."""
    weight = (1 - size[k - 1]) / (size[k] - size[k - 1])
    weight = weight if np.isfinite(weight) and 0 <= weight <= 1 else 0.5
    return float(factors[k - 1] * (factors[k] / factors[k - 1]) ** weight)
