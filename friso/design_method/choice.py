"""Choose from the front the softest leaf springs that meet all requirements.

Sizes are rounded so that the leaves can be made, and the beam model confirms the choice.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from friso.design_method.front import Candidate, evaluate_geometries
from friso.design_method.geometry import Geometry, mechanisms, round_geometries, sizes_of
from friso.design_method.requirements import LeafTask, Requirement, buckling_share, load_stress, requirements
from friso.design_method.settings import settings
from friso.leaf_springs.beams import BeamFailure, beams
from friso.leaf_springs.evaluation import Evaluation
from friso.leaf_springs.joint import first_interfering


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
