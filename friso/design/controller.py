"""The controller of a design: how fast it may be, with which margins, and what joint damping would add."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.design.population import Population
from friso.frequency.crossover import Limits, settled_members
from friso.frequency.family import scan
from friso.frequency.tuning import Tuning, tuning
from friso.stage import Stage

RATIOS = np.geomspace(0.02, 0.7, 9)
"""Joint damping that is tried, as a damping ratio of the stage on the joint."""

ENOUGH = 0.95
"""Share of the best modulus margin that damping reaches, from which more is not worth its trouble."""


@dataclass(frozen=True)
class Damping:
    """Joint dampings [N s/m] tried, the stage's own first, and the least modulus margin with each (0: not stable)."""

    tried: np.ndarray
    margins: np.ndarray

    @property
    def worth(self) -> int:
        """The number of the least damping that does nearly all that damping can do; 0 where the stage's own does."""
        return int(np.flatnonzero(self.margins >= ENOUGH * self.margins.max())[0])


@dataclass(frozen=True)
class Controller:
    """Gains by van Dijk's rules at the `crossover` [Hz] chosen; the ranges of crossovers that are stable and
    comfortable; the least modulus margin of the settled states, in the stage of the design and in each corner (n,); and
    what joint damping adds."""

    crossover: float
    gains: Tuning
    limits: Limits
    margin: float
    corners: np.ndarray
    damping: Damping


def comfortable_below(found: Limits, highest: float) -> float | None:
    """The highest crossover [Hz], not above `highest`, with a modulus margin of 0.5 in all settled states."""
    below = [min(high, highest) for low, high in found.comfortable if low < highest]
    return max(below) if below else None


def controller(stage: Stage, found: Limits, population: Population) -> Controller:
    """The controller of a stage whose crossover is chosen."""
    flat = stage.flat()
    gains = tuning(*(flat[f"controller.{name}"] for name in ("crossover", "alpha", "beta", "tuned_mass")))
    corners = np.array([settled_margin({**flat, **population.of(k)}) for k in range(population.count)])
    return Controller(flat["controller.crossover"], gains, found, settled_margin(flat), corners, _damping(flat))


def settled_margin(flat: Mapping[str, Any]) -> float:
    """The least modulus margin of the settled states of a stage; 0 if one of them is not stable."""
    seen = scan(flat, settled_members(flat))
    return float(seen.distance.min()) if seen.stable.all() else 0.0


def dampings(flat: Mapping[str, Any]) -> np.ndarray:
    """Dampings of the joint [N s/m] to be tried: the stage's own and larger ones."""
    critical = 2 * np.sqrt(flat["joint.stiffness"] * flat["masses.stage"])
    own = flat["joint.damping"]
    return np.array([own, *(each for each in RATIOS * critical if each > own)])


def _damping(flat: Mapping[str, Any]) -> Damping:
    tried = dampings(flat)
    return Damping(tried, np.array([settled_margin({**flat, "joint.damping": each}) for each in tried]))
