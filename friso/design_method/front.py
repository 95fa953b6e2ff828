"""Find the Pareto front of leaf springs: soft ones whose modes interfere at high frequency.

All leaf springs on it meet the requirements. The frequency is that of the first mode that interferes with control.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import differential_evolution

from friso.design_method.geometry import Geometry, Sheet, box, mechanisms, sheets
from friso.design_method.requirements import PARASITIC, LeafTask, Requirement, requirements
from friso.design_method.settings import settings
from friso.leaf_springs import closed_forms
from friso.leaf_springs.joint import first_interfering


@dataclass(frozen=True)
class Candidate:
    """Leaf springs with their drive stiffness [N/m] and a frequency [Hz], by closed forms.

    The frequency is that of the first mode that interferes with control.
    """

    geometry: Geometry
    stiffness: float
    frequency: float


def front(task: LeafTask) -> list[Candidate]:
    """Return the Pareto front by rising stiffness (NSGA-II, doi:10.1109/4235.996017).

    The list is empty if no leaf springs meet the requirements. The requirement on the frequency of modes is left out,
    since the search raises this frequency.
    """
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.operators.crossover.sbx import SBX
    from pymoo.operators.mutation.pm import PM
    from pymoo.optimize import minimize

    needs = [requirement for requirement in requirements(task) if requirement.name != PARASITIC]
    start = closest(task, needs)
    if start is None:
        return []
    low, high = _ends(task)
    first = low + (high - low) * np.random.default_rng(settings.front_seed).random(
        (settings.front_population, len(low))
    )
    first[: len(first) // 4] = start  # from there the search reaches others, however little room there is
    variation = {"sampling": first, "crossover": SBX(prob=0.9, eta=10), "mutation": PM(eta=10)}
    algorithm = NSGA2(pop_size=settings.front_population, **variation)
    with np.errstate(invalid="ignore"):  # pymoo's distances within a front of a single geometry
        result = minimize(
            _problem(task, needs),
            algorithm,
            ("n_gen", settings.front_generations),
            seed=settings.front_seed,
            verbose=False,
        )
    if result.X is None or result.F is None:
        return []
    bought = sheets(task.spec)
    chosen, objectives = (np.atleast_2d(np.asarray(array, dtype=float)) for array in (result.X, result.F))
    candidates = [
        Candidate(Geometry.of(np.exp(x[:3]), bought[int(x[3])]), float(np.exp(f[0])), float(np.exp(-f[1])))
        for x, f in zip(chosen, objectives, strict=True)
    ]
    return sorted(candidates, key=lambda candidate: candidate.stiffness)


def _ends(task: LeafTask) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the largest variables of the search, each of shape (4,).

    The variables are logarithms of the sizes, and the index of the sheet.
    """
    low, high = box(task.spec)
    return np.append(np.log(low), 0.0), np.append(np.log(high), len(sheets(task.spec)) - 1e-9)


def _problem(task: LeafTask, needs: list[Requirement]) -> Any:
    """Return the search for the front in pymoo's form: two objectives, and the requirements.

    The objectives are low stiffness, and a high frequency of the first mode that interferes with control.
    """
    from pymoo.core.problem import Problem

    low, high = _ends(task)
    bought = sheets(task.spec)

    class Leaves(Problem):
        def _evaluate(self, x: np.ndarray, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
            judgement = evaluate_geometries(task, needs, np.exp(x[:, :3]), [bought[int(k)] for k in x[:, 3]])
            out["F"] = np.stack([np.log(judgement.stiffness), -np.log(judgement.frequency)], axis=1)
            out["G"] = np.log(judgement.excess)

    return Leaves(n_var=len(low), n_obj=2, n_ieq_constr=len(needs), xl=low, xu=high)


def closest(task: LeafTask, needs: list[Requirement]) -> np.ndarray | None:
    """Return the leaf springs that meet the requirements with the largest reserve, or None.

    The result has the logarithms of their sizes and the index of their sheet, shape (4,). Differential evolution
    searches for them.
    """
    bought = sheets(task.spec)

    def objective(x: np.ndarray) -> np.ndarray:
        judgement = evaluate_geometries(task, needs, np.exp(x[:3]).T, [bought[int(k)] for k in x[3]])
        return np.log(judgement.excess).max(axis=1)

    low, high = _ends(task)
    bounds = [*zip(low, high + 1e-12 * (high == low), strict=True)]
    minimum = differential_evolution(
        objective,
        bounds,
        vectorized=True,
        updating="deferred",
        maxiter=settings.start_generations,
        rng=settings.front_seed,
        polish=False,
    )
    return minimum.x if minimum.fun <= 0 else None


@dataclass(frozen=True)
class GeometryScores:
    """The stiffness [N/m] and a frequency [Hz] of many leaf springs, both of shape (count,).

    The frequency is that of the first mode that interferes with control. `excess` is the factor by which each
    requirement is broken, shape (count, requirements).
    """

    stiffness: np.ndarray
    frequency: np.ndarray
    excess: np.ndarray


def evaluate_geometries(
    task: LeafTask, needs: list[Requirement], sizes: np.ndarray, bought: list[Sheet]
) -> GeometryScores:
    """Evaluate leaf springs by closed forms.

    `sizes` [m], shape (count, 3), are lengths, widths and spacings, and `bought` their sheets.
    """
    many = mechanisms(task.flat, sizes, bought)
    excess = [np.broadcast_to(requirement.excess(many), (len(sizes),)) for requirement in needs]
    return GeometryScores(closed_forms.drive_stiffness(many), first_interfering(many), np.stack(excess, axis=1))
