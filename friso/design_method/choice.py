"""Find the Pareto front of leaf springs, and choose its softest that meet all requirements.

The front has soft leaf springs whose modes interfere with control at high frequency. Sizes are rounded so that the
leaves can be made, and the beam model confirms the choice.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.design_method.geometry import Geometry, Sheet, box, mechanisms, round_geometries, sheets, sizes_of
from friso.design_method.requirements import (
    PARASITIC,
    LeafTask,
    Requirement,
    buckling_share,
    evolved,
    load_stress,
    requirements,
)
from friso.design_method.settings import settings
from friso.leaf_springs import closed_forms
from friso.leaf_springs.beams import BeamFailure, beams
from friso.leaf_springs.closed_forms import first_interfering
from friso.leaf_springs.mechanism import Evaluation


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
    bounds = zip(low, high, strict=True)
    minimum = evolved(objective, bounds, settings.start_generations, settings.front_seed)
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


@dataclass(frozen=True)
class Confirmed:
    """Leaf springs of the front, by the beam model: drive stiffness [N/m] and frequency [Hz].

    The frequency is that of the first mode that interferes with control. Both numbers are NaN if the model could not be
    evaluated; `failure` gives the reason.
    """

    candidate: Candidate
    stiffness: float
    frequency: float
    failure: str = ""


@dataclass(frozen=True)
class ChosenLeaves:
    """The leaf springs chosen, evaluated by the beam model, with their requirements.

    `excess`, shape (requirements,), is the factor by which they use up each requirement by closed forms: 1 if they just
    meet it, never more. `passed_over` says why softer leaf springs were not taken.
    """

    geometry: Geometry
    beams: Evaluation
    requirements: tuple[Requirement, ...]
    excess: np.ndarray
    passed_over: tuple[str, ...]

    @property
    def frequency(self) -> float:
        """Return the frequency [Hz] of the first mode that interferes with control.

        The lower one of both models' frequencies is taken, since either model may miss a mode where two modes hide each
        other.
        """
        mode = self.beams.interfering
        return min(mode.frequency if mode else np.inf, float(first_interfering(self.beams.mechanism)))


def chosen(task: LeafTask, candidates: Sequence[Candidate]) -> ChosenLeaves | None:
    """Return the softest geometry that meets all requirements by closed forms and by beams.

    Returns None if there is none.
    """
    needs, passed = requirements(task), []
    for geometry, excess in _in_order(task, needs, candidates):
        try:
            evaluation = evaluated(task, geometry)
        except BeamFailure as failure:
            passed.append(str(failure))
            continue
        choice = ChosenLeaves(geometry, evaluation, tuple(needs), excess, tuple(passed))
        clear = choice.frequency >= task.spec.safety.parasitic * task.crossover
        if clear and stays(task, evaluation) and bears(task, evaluation):
            return choice
        passed.append(f"beams: {evaluation.drive[0]:.4g} N/m, {choice.frequency:.4g} Hz")
    return None


def stays(task: LeafTask, by_beams: Evaluation) -> bool:
    """Tell whether the beam model confirms that friction holds the cart over the whole stroke.

    The force of the leaves at the end of the stroke, with its safety factor and tolerance, is at most the friction.
    """
    safety = task.spec.safety
    return bool(safety.breakaway * (1 + safety.stiffness_tolerance) * by_beams.forces[-1] <= task.friction)


def bears(task: LeafTask, by_beams: Evaluation) -> bool:
    """Tell whether, by the beam model, the leaves withstand fatigue and buckling under load."""
    safety = task.spec.safety
    swing = 0.0 if np.isnan(by_beams.fatigue_margin) else 1 / by_beams.fatigue_margin
    lasts = safety.fatigue * (swing + load_stress(by_beams.mechanism, task) / by_beams.mechanism.yield_strength) <= 1
    return bool(lasts and safety.buckling * buckling_share(by_beams.mechanism, task, by_beams.buckling) <= 1)


def _in_order(
    task: LeafTask, needs: list[Requirement], candidates: Sequence[Candidate]
) -> Iterator[tuple[Geometry, np.ndarray]]:
    """Yield leaf springs in whole sizes that meet the requirements by closed forms.

    The softest come first. Each geometry comes with the factor by which it uses up every requirement, shape
    (requirements,), at most 1.
    """
    enough = task.spec.safety.parasitic * task.crossover
    near = [candidate.geometry for candidate in candidates if candidate.frequency >= 0.98 * enough]
    sizes = list(
        {geometry: None for start in near for geometry in round_geometries(task.spec, start, settings.size_step)}
    )
    if not sizes:
        return
    judgement = evaluate_geometries(task, needs, sizes_of(sizes), [geometry.sheet for geometry in sizes])
    for k in np.argsort(judgement.stiffness):
        if np.all(judgement.excess[k] <= 1):
            yield sizes[k], judgement.excess[k]


def evaluated(task: LeafTask, geometry: Geometry) -> Evaluation:
    """Evaluate a geometry by the beam model.

    Raises BeamFailure if the model finds no solution.
    """
    return beams(mechanisms(task.flat, sizes_of([geometry]), [geometry.sheet]).member(0), task.stroke)


def confirmed(task: LeafTask, candidates: Sequence[Candidate]) -> Iterable[Confirmed]:
    """Evaluate some leaf springs of the front, evenly picked, by the beam model.

    Where the model finds no solution, the result holds the reason.
    """
    for k in np.unique(np.linspace(0, len(candidates) - 1, settings.confirmed_candidates).astype(int)):
        candidate = candidates[k]
        try:
            evaluation = evaluated(task, candidate.geometry)
        except BeamFailure as failure:
            yield Confirmed(candidate, np.nan, np.nan, str(failure))
            continue
        mode = evaluation.interfering
        yield Confirmed(candidate, float(evaluation.drive[0]), mode.frequency if mode else np.nan)
