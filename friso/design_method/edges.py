"""Find the edge of hunting over the corners of a specification, the ends of all its ranges.

The edge is the highest crossover at which a stage hunts. In the corner where it is highest it is located to 1 or 2 %;
only this one decides, and a design simulates all its moves afterwards.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from friso.design_method.population import Population
from friso.design_method.settings import settings
from friso.equations.controllers.van_dijk import CROSSOVER
from friso.hunting import find_attractors
from friso.progress import Progress, silent


@dataclass(frozen=True)
class Corners:
    """Extremes of friction and masses (corners), and the edge of hunting at each.

    `edges` [Hz], shape (n,), is the highest crossover at which the stage hunts: to 1 or 2 % in the worst corner, in the
    others to half a step of the search. It is 0 if the stage does not hunt from `searched[0]` on, and infinite if it
    still hunts at `searched[1]`. `unknown` counts the corners whose edge is not certain. Either simulations below it
    failed or did not settle, which counts as hunting. Or something above it may attract that no simulation reached.
    """

    population: Population
    edges: np.ndarray
    searched: tuple[float, float]
    unknown: int = 0

    @property
    def worst(self) -> int:
        """Return the index of the corner that hunts up to the highest crossover."""
        return int(self.edges.argmax())

    @property
    def highest(self) -> float:
        """Return the highest crossover [Hz] at which any corner hunts.

        If none hunts, the result is the lowest crossover searched.
        """
        return float(max(self.searched[0], self.edges.max()))

    @property
    def hunts(self) -> bool:
        """Tell whether any corner hunts in the range searched."""
        return bool(np.any(self.edges > 0))


def edges_over(
    flat: Mapping[str, Any],
    population: Population,
    low: float,
    high: float,
    steps: int,
    progress: Progress = silent,
    label: str = "",
) -> Corners:
    """Find the edge of hunting of a stage by van Dijk's rules, for each machine of a population.

    The search goes down from `high` to `low` [Hz] on a grid of `steps`, until the stage hunts. It then halves the step
    above that point, for the machines that may have the highest edge of all. `label` names the search to the progress.
    """
    corners = population.over({**flat, CROSSOVER: np.nan, "motion.kind": "release"})  # whatever the stage's motion
    grid, count = np.log(np.geomspace(low, high, steps)), population.count
    inside, outside, unsure = np.full(count, -np.inf), np.full(count, np.inf), np.zeros((2, count), bool)

    def survey(which: np.ndarray, crossover: np.ndarray) -> None:
        attract, certain = _attract(corners, which, crossover)
        outside[which[~attract]], inside[which[attract]] = crossover[~attract], crossover[attract]
        unsure[attract.astype(int), which] = ~certain

    for k, point in enumerate(grid[::-1]):
        progress(k, steps + settings.edge_bisections, label)
        if (left := np.flatnonzero(np.isneginf(inside))).size:
            survey(left, np.full(left.size, point))
    for k in range(settings.edge_bisections):
        progress(steps + k, steps + settings.edge_bisections, label)
        highest = np.flatnonzero(np.isfinite(inside) & np.isfinite(outside) & (outside > inside.max()))
        if highest.size:
            survey(highest, (inside[highest] + outside[highest]) / 2)
    edges = np.where(np.isneginf(inside), 0.0, np.exp((inside + outside) / 2))
    return Corners(population, edges, (low, high), int(unsure.any(axis=0).sum()))


def worst_edges(by_law: Mapping[str, Corners]) -> Corners:
    """Return at each corner of friction and masses the highest edge of hunting of all laws.

    All friction laws must have been searched over the same corners and range.
    """
    several = [*by_law.values()]
    edges = np.max([corners.edges for corners in several], axis=0)
    return replace(several[0], edges=edges, unknown=sum(corners.unknown for corners in several))


@dataclass(frozen=True)
class OtherLaws:
    """The friction of some stages under other laws: keys [SI] by the name of the law.

    Keys that differ between stages are arrays of shape (stages,). `lost` names the laws that cannot match the measured
    friction of some stages, each with their indices.
    """

    frictions: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    lost: Mapping[str, Sequence[int]] = field(default_factory=dict)


def under_law(flat: Mapping[str, Any], friction: Mapping[str, Any]) -> dict[str, Any]:
    """Return the stage's keys with all friction keys replaced by those of another law."""
    return {**{key: value for key, value in flat.items() if not key.startswith("friction.")}, **friction}


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def _attract(corners: Mapping[str, Any], which: np.ndarray, crossover: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tell which corners hunt or may hunt at certain crossovers, and whether that is certain.

    `which` are indices of corners, and `crossover` the logarithm of a crossover for each.
    """
    some = {key: value[which] if np.ndim(value) else value for key, value in corners.items()}
    attracted = find_attractors({**some, CROSSOVER: np.exp(crossover)}, len(which), settings.orbit_rtol)
    return attracted.attracts | ~attracted.decided, attracted.certain


def rigid(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return the stage without isolator: cart and stage become one mass, as if locked."""
    return {key: value for key, value in flat.items() if not key.startswith(("joint.", "flexure.", "parasitic."))}
