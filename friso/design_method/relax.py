"""Find which single requirement to relax if no leaf springs meet all of them.

For each requirement the least sufficient change is computed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import differential_evolution

from friso.design_method.geometry import SIZES, Geometry, Sheet, box, mechanisms
from friso.design_method.requirements import LeafTask, Requirement, less, more, requirements
from friso.design_method.settings import settings
from friso.leaf_springs.mechanism import Mechanism


@dataclass(frozen=True)
class Relaxation:
    """A `key` of the specification that must change from `value` to `needed` [unit].

    Changed alone, it lets the `requirement` be met, by leaf springs of a `geometry`. The geometry is None for
    requirements on other parts.
    """

    requirement: str
    key: str
    value: float
    needed: float
    unit: str
    geometry: Geometry | None = None


def relaxed_requirements(task: LeafTask) -> tuple[Relaxation, ...]:
    """Return by how much each requirement must be relaxed if all others stand, the least first.

    The result is empty if no single relaxation is enough.
    """
    needs = [*requirements(task), *_space(task)]
    all_relaxations = [relaxation for k in range(len(needs)) for relaxation in _alone(task, needs, k)]
    return tuple(sorted(all_relaxations, key=_change))


def _change(relaxation: Relaxation) -> float:
    """Return how far a requirement is relaxed, as the logarithm of the factor on its value.

    The result is infinite if the value has to become 0.
    """
    return float(abs(np.log(relaxation.needed / relaxation.value))) if relaxation.needed > 0 else np.inf


def _space(task: LeafTask) -> list[Requirement]:
    """Return the limits of the leaves' sizes and of the sheets' thickness as requirements."""
    low, high = box(task.spec)
    gauges = sorted(map(float, task.spec.leaves.thickness))
    limits = []
    for name, least, most in zip((*SIZES, "thickness"), [*low, gauges[0]], [*high, gauges[-1]], strict=True):
        words, key = "sheets" if name == "thickness" else f"{name} of the leaves", f"leaves.{name}"
        limits += [
            Requirement(f"{words}, at least", (less(key, float(least), "m"),), _over(name, least, low=True)),
            Requirement(f"{words}, at most", (more(key, float(most), "m"),), _over(name, most, low=False)),
        ]
    return limits


def _over(name: str, limit: float, low: bool) -> Callable[[Mechanism], Any]:
    """Return a function that computes by which factor leaf springs break a limit of a size.

    `name` is the size, and `low` is true for a lower limit.
    """

    def excess(mechanism: Mechanism) -> Any:
        return limit / getattr(mechanism, name) if low else getattr(mechanism, name) / limit

    return excess


@dataclass(frozen=True)
class _Trials:
    """Leaf springs in more space than allowed, given by variables of a search.

    The variables are logarithms of length, width, spacing and thickness, and the index of the kind: number of leaves
    and material. The thickness is `free`, or is rounded to the next available sheet.
    """

    task: LeafTask
    free: bool

    @property
    def kinds(self) -> list[tuple[float, str]]:
        """Return the allowed combinations of number of leaves and material."""
        section = self.task.spec.leaves
        return [(count, material) for count in section.leaves for material in section.materials]

    @property
    def gauges(self) -> np.ndarray:
        """Return the available thicknesses [m], ascending."""
        return np.sort(np.array(self.task.spec.leaves.thickness, dtype=float))

    @property
    def bounds(self) -> list[tuple[float, float]]:
        """Return the bounds of each variable, somewhat beyond the space allowed."""
        low, high = box(self.task.spec)
        ends = np.log([[*low, self.gauges[0]], [*high, self.gauges[-1]]]).T + np.log(
            settings.relaxed_beyond
        ) * np.array([-1, 1])
        return [*map(tuple, ends), (0, len(self.kinds) - 1e-9)]

    def built(self, x: np.ndarray) -> tuple[np.ndarray, list[Sheet]]:
        """Return sizes (count, 3) and sheets for variables of shape (5, count)."""
        sizes, gauges, kinds = np.exp(x[:4]).T, self.gauges, self.kinds
        nearest = gauges[np.abs(np.log(gauges) - x[3][:, None]).argmin(axis=1)]
        thickness = sizes[:, 3] if self.free else nearest
        chosen = (kinds[int(n)] for n in x[4])
        return sizes[:, :3], [Sheet(count, float(t), of) for t, (count, of) in zip(thickness, chosen, strict=True)]


def _alone(task: LeafTask, needs: list[Requirement], k: int) -> Iterator[Relaxation]:
    """Yield the least changes of keys that relax requirement `k` so that all others can be met."""
    of_sheets = np.array([requirement.keys[0].key == "leaves.thickness" for requirement in needs])
    trials = _Trials(task, free=bool(of_sheets[k]))
    spare = np.where(of_sheets, 0.0, settings.relaxed_reserve)  # sizes of sheets are met exactly

    def objective(x: np.ndarray) -> np.ndarray:
        many = mechanisms(task.flat, *trials.built(x))
        excess = np.log([np.broadcast_to(requirement.excess(many), x.shape[1]) for requirement in needs])
        others = np.delete(excess + spare[:, None], k, axis=0).max(axis=0)
        return np.where(others <= 1e-9, excess[k], settings.unmet_penalty + others)

    search = {
        "popsize": settings.relaxed_population,
        "maxiter": settings.relaxed_generations,
        "rng": settings.relaxed_seed,
        "polish": False,
    }
    with np.errstate(divide="ignore"):  # a requirement of nothing divides by 0
        minimum = differential_evolution(objective, trials.bounds, vectorized=True, updating="deferred", **search)
    if minimum.fun >= settings.unmet_penalty:
        return
    (sizes,), (sheet,) = trials.built(minimum.x[:, None])
    for relaxable in needs[k].keys:
        needed = relaxable.needed(settings.relaxed_more * float(np.exp(max(minimum.fun, 0.0))))
        if needed is not None and not np.isclose(needed, relaxable.value, rtol=1e-6):
            yield Relaxation(
                needs[k].name, relaxable.key, relaxable.value, needed, relaxable.unit, Geometry.of(sizes, sheet)
            )
