"""How far a stage is from the edge of hunting: the crossover at which its hunting cycle stops attracting."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import NOT_CLOSED, Cycles, hunting_cycles
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
    far = FARTHEST if attracting else 1 / FARTHEST
    low, high, points = 1.0, far, POINTS
    for _ in range(ROUNDS):
        factors = np.geomspace(low, high, points)
        cycles = hunting_cycles(Ensemble.held(faster(flat, factors), points))
        here = _attracting(cycles)
        changed = np.flatnonzero(here != attracting)
        if not changed.size or changed[0] == 0:
            return None
        low, high, points = factors[changed[0] - 1], factors[changed[0]], FINER
    factor = _interpolated(factors, np.abs(cycles.multiplier), int(changed[0]))
    crossover = flat["controller.crossover"] * factor if "controller.crossover" in flat else None
    return Margin(float(factor), crossover)


def _attracting(cycles: Cycles) -> np.ndarray:
    """Which cycles attract; of one that could not be closed it is not known, and taken to be so."""
    return cycles.attracting | (cycles.reasons == NOT_CLOSED)


def _interpolated(factors: np.ndarray, size: np.ndarray, k: int) -> float:
    """The factor between numbers k - 1 and k at which the multiplier passes 1, the middle where one is unknown."""
    weight = (1 - size[k - 1]) / (size[k] - size[k - 1])
    weight = weight if np.isfinite(weight) and 0 <= weight <= 1 else 0.5
    return float(factors[k - 1] * (factors[k] / factors[k - 1]) ** weight)
