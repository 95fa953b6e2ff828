"""The edge of hunting over the corners of a specification: below which crossover a cycle attracts.

Coarser than `friso.hunting.edges`, which distinguishes kinds of edges and simulates for minutes where a cycle cannot be
closed: a design asks for 1 or 2 % in seconds, and simulates all its moves afterwards.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.design.population import Population
from friso.equations.controllers.van_dijk import CROSSOVER
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import hunting_cycles
from friso.hunting.persistence import DISTANCES, hunts_somehow
from friso.progress import Progress, silent

ROUNDS = 4
"""Bisections of the step that holds an edge: to 1 or 2 % of it on the grids here."""

RTOL = 1e-7
"""Relative tolerance to which cycles are followed: their multipliers are needed to a percent."""

PERIODS, TRIED = 60.0, DISTANCES[::4]
"""How long, and from where, is simulated where a cycle may be that could not be closed; verification goes further."""


@dataclass(frozen=True)
class Corners:
    """The corners of a specification with the highest crossover [Hz] at which a cycle attracts in each, shape (n,): 0
    where there is none from `searched[0]` on, infinite where it lies above `searched[1]`. In `unknown` of them a run
    that had to decide failed somewhere: there it counts as hunting."""

    population: Population
    edges: np.ndarray
    searched: tuple[float, float]
    unknown: int = 0

    @property
    def worst(self) -> int:
        """The number of the corner that hunts up to the highest crossover."""
        return int(self.edges.argmax())

    @property
    def highest(self) -> float:
        """The highest crossover [Hz] at which a cycle attracts in any of them; at least where the search begins."""
        return float(max(self.searched[0], self.edges.max()))

    @property
    def hunts(self) -> bool:
        """Whether a cycle attracts anywhere in the range that was searched."""
        return bool(np.any(self.edges > 0))


def edges_over(
    flat: Mapping[str, Any],
    population: Population,
    low: float,
    high: float,
    steps: int,
    progress: Progress = silent,
    what: str = "",
) -> Corners:
    """The edges of the stage `flat` in all corners, searched from `low` to `high` [Hz], tuned by van Dijk's rules: on a
    grid, and between the last point at which a cycle attracts and the next. `what` names the search to the progress."""
    ensemble = Ensemble.held(population.over({**flat, CROSSOVER: np.nan}), population.count)
    grid, every = np.log(np.geomspace(low, high, steps)), np.arange(population.count)
    attracts, decided = _attracts(ensemble, np.repeat(every, steps), np.tile(grid, population.count))
    attracts, decided = attracts.reshape(-1, steps), decided.reshape(-1, steps)
    last = steps - 1 - attracts[:, ::-1].argmax(axis=1)
    inside, outside = grid[last], grid[np.minimum(last + 1, steps - 1)]
    open_ = np.flatnonzero(attracts.any(axis=1) & (last < steps - 1))
    for k in range(ROUNDS if open_.size else 0):
        progress(k + 1, ROUNDS + 1, what)
        middle = (inside[open_] + outside[open_]) / 2
        within, _ = _attracts(ensemble, open_, middle)
        inside[open_], outside[open_] = (
            np.where(within, middle, inside[open_]),
            np.where(within, outside[open_], middle),
        )
    edges = np.exp((inside + outside) / 2)
    edges[last == steps - 1] = np.inf
    edges[~attracts.any(axis=1)] = 0.0
    return Corners(population, edges, (low, high), int((~decided).any(axis=1).sum()))


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def _attracts(ensemble: Ensemble, which: np.ndarray, crossover: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether a cycle attracts, or may for all that is known, in corners at logarithms of crossovers; whether it is."""
    some = ensemble.take(which)
    stages = Ensemble.held({**some.flat, CROSSOVER: np.exp(crossover)}, len(which))
    cycles = hunting_cycles(stages, RTOL)
    attracts, decided = cycles.attracting.copy(), np.ones(len(which), bool)
    unsure = np.flatnonzero(cycles.uncertain)
    if unsure.size:
        attracts[unsure], decided[unsure] = hunts_somehow(stages.take(unsure), PERIODS, TRIED)
    return attracts | ~decided, decided


def rigid(flat: Mapping[str, Any]) -> dict[str, Any]:
    """The stage without isolator: cart and stage as one mass, which a joint locked by its fixtures makes of them."""
    return {key: value for key, value in flat.items() if not key.startswith(("joint.", "flexure.", "parasitic."))}
