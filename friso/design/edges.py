"""The edge of hunting over the corners of a specification: below which crossover a cycle attracts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.design.population import Population
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.edges import ABOVE, BELOW, UNKNOWN, find_edges

ROUNDS = 4
"""Bisections of the step that holds an edge: to 1 % of it on the grids here."""


@dataclass(frozen=True)
class Corners:
    """The corners of a specification with the highest crossover [Hz] at which a cycle attracts in each, shape (n,): 0
    where there is none from `searched[0]` on, infinite where it lies above `searched[1]`, NaN where it is not known."""

    population: Population
    edges: np.ndarray
    searched: tuple[float, float]

    @property
    def worst(self) -> int:
        """The number of the corner that hunts up to the highest crossover, or of one of which it is not known."""
        return int(np.where(np.isnan(self.edges), np.inf, self.edges).argmax())

    @property
    def highest(self) -> float:
        """The highest crossover [Hz] at which a cycle attracts in any of those that are known; at least where the
        search begins."""
        return float(np.nanmax([self.searched[0], *self.edges]))

    @property
    def hunts(self) -> bool:
        """Whether a cycle attracts anywhere in the range that was searched."""
        return bool(np.any(self.edges > 0))

    @property
    def unknown(self) -> int:
        """Corners of which it is not known."""
        return int(np.isnan(self.edges).sum())


def edges_over(flat: Mapping[str, Any], population: Population, low: float, high: float, steps: int) -> Corners:
    """The edges of the stage `flat` in all corners, searched from `low` to `high` [Hz], tuned by van Dijk's rules."""
    base = population.over({**flat, "controller.crossover": np.nan})
    whole = Ensemble.held(base, population.count)

    def stages(which: np.ndarray, crossover: np.ndarray) -> Ensemble:
        some = whole.take(which)
        return Ensemble.held({**some.flat, "controller.crossover": crossover}, len(which))

    grid = np.broadcast_to(np.geomspace(low, high, steps), (population.count, steps))
    found = find_edges(stages, grid, ROUNDS)
    special = {BELOW: 0.0, ABOVE: np.inf, UNKNOWN: np.nan}
    edges = [special.get(kind, edge) for kind, edge in zip(found.kind, found.crossover, strict=True)]
    return Corners(population, np.array(edges, float), (low, high))


def rigid(flat: Mapping[str, Any]) -> dict[str, Any]:
    """The stage without isolator: cart and stage as one mass, which a joint locked by its fixtures makes of them."""
    return {key: value for key, value in flat.items() if not key.startswith(("joint.", "flexure.", "parasitic."))}
