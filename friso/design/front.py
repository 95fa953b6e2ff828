"""The Pareto front of leaf springs: drive stiffness against first interfering frequency, within all requirements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.design.geometry import Geometry, Sheet, box, mechanisms, sheets
from friso.design.requirements import PARASITIC, Requirement, Task, requirements
from friso.flexure import closed_forms
from friso.flexure.joint import first_interfering

POPULATION, GENERATIONS = 160, 120
"""Geometries of the genetic algorithm, and how often they are renewed."""

SEED = 34
"""Of its random numbers: the same front for the same specification."""


@dataclass(frozen=True)
class Candidate:
    """Leaf springs with their drive stiffness [N/m] and first interfering frequency [Hz] by closed forms."""

    geometry: Geometry
    stiffness: float
    frequency: float


def front(task: Task) -> list[Candidate]:
    """The front, by rising stiffness (NSGA-II, doi:10.1109/4235.996017); empty where no geometry meets the requirements
    but for that on the frequency, which is an objective here."""
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.core.problem import Problem
    from pymoo.operators.crossover.sbx import SBX
    from pymoo.operators.mutation.pm import PM
    from pymoo.optimize import minimize

    bought, (low, high) = sheets(task.spec), box(task.spec)
    wanted = [each for each in requirements(task) if each.name != PARASITIC]

    class Leaves(Problem):
        def __init__(self) -> None:
            ends = np.log([low, high])
            super().__init__(
                n_var=4, n_obj=2, n_ieq_constr=len(wanted), xl=[*ends[0], 0], xu=[*ends[1], len(bought) - 1e-9]
            )

        def _evaluate(self, x: np.ndarray, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
            found = judged(task, wanted, np.exp(x[:, :3]), [bought[int(k)] for k in x[:, 3]])
            out["F"] = np.stack([np.log(found.stiffness), -np.log(found.frequency)], axis=1)
            out["G"] = np.log(found.excess)

    crossover, mutation = SBX(prob=0.9, eta=10), PM(eta=10)
    result = minimize(
        Leaves(),
        NSGA2(pop_size=POPULATION, crossover=crossover, mutation=mutation),
        ("n_gen", GENERATIONS),
        seed=SEED,
        verbose=False,
    )
    if result.X is None or result.F is None:
        return []
    found = [
        Candidate(Geometry.of(np.exp(x[:3]), bought[int(x[3])]), float(np.exp(f[0])), float(np.exp(-f[1])))
        for x, f in zip(np.atleast_2d(result.X), np.atleast_2d(result.F), strict=True)
    ]
    return sorted(found, key=lambda each: each.stiffness)


@dataclass(frozen=True)
class Judged:
    """Of geometries: drive stiffness [N/m] and first interfering frequency [Hz], shape (count,), and by what factor
    each requirement is broken, (count, requirements)."""

    stiffness: np.ndarray
    frequency: np.ndarray
    excess: np.ndarray


def judged(task: Task, wanted: list[Requirement], sizes: np.ndarray, bought: list[Sheet]) -> Judged:
    """Geometries by closed forms."""
    many = mechanisms(task.flat, sizes, bought)
    excess = [np.broadcast_to(each.excess(many), (len(sizes),)) for each in wanted]
    return Judged(closed_forms.drive_stiffness(many), first_interfering(many), np.stack(excess, axis=1))
