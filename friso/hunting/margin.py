"""How far a stage is from the edge of hunting: the crossover at which its hunting cycle stops attracting."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import NOT_CLOSED, hunting_cycles
from friso.stage import Stage

FARTHEST = 10.0
"""Factor up to which the bandwidth is changed."""

STRIDES, STEPS = 4, 7
"""Parts of the way there, gone one after the other, and steps in each of them."""

FINER, ROUNDS = 9, 2
"""Steps between the two that enclose the edge, and how often they are taken."""


@dataclass(frozen=True)
class Margin:
    """The edge of hunting nearest in bandwidth: hunting is possible below it.

    `factor` is the bandwidth there over that of the stage, `crossover` [Hz] the crossover there (None for a controller
    given by its gains, all of whose poles and zeros the factor scales). It is `certain` unless the cycle of the stage
    before it could not be computed.
    """

    factor: float
    crossover: float | None
    certain: bool


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
    ends = np.geomspace(1.0, far, STRIDES + 1)
    found = None
    for low, high in pairwise(ends):
        found = _between(flat, float(low), float(high), STEPS, attracting)
        if found is not None:
            break
    if found is None:
        return None
    for _ in range(ROUNDS):
        found = _between(flat, found.low, found.high, FINER, attracting) or found
    factor = found.low * (found.high / found.low) ** found.share
    crossover = flat["controller.crossover"] * factor if "controller.crossover" in flat else None
    return Margin(factor, crossover, found.certain)


@dataclass(frozen=True)
class _Edge:
    """Two factors that enclose the edge, where between them the multiplier passes 1, as a share of the way in their
    logarithms, and whether the cycle at the first of them is known."""

    low: float
    high: float
    share: float
    certain: bool


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def _between(flat: Mapping[str, Any], low: float, high: float, points: int, attracting: bool) -> _Edge | None:
    """The edge between two factors, if it is there."""
    factors = np.geomspace(low, high, points)
    cycles = hunting_cycles(Ensemble.held(faster(flat, factors), points))
    unknown = cycles.reasons == NOT_CLOSED  # taken to be as it is on this side
    changed = np.flatnonzero((cycles.attracting != attracting) & ~unknown)
    if not changed.size or changed[0] == 0:
        return None
    k, size = int(changed[0]), np.abs(cycles.multiplier)
    share = (1 - size[k - 1]) / (size[k] - size[k - 1])
    share = float(share) if np.isfinite(share) and 0 <= share <= 1 else 0.5  # the middle where one is unknown
    return _Edge(float(factors[k - 1]), float(factors[k]), share, not unknown[k - 1])
