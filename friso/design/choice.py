"""The leaf springs chosen from the front: softest that do, in sizes that can be made, confirmed by the beam model."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from friso.design.front import Candidate, judged
from friso.design.geometry import Geometry, mechanisms, rounded, sizes_of
from friso.design.requirements import Requirement, Task, buckling_share, load_stress, requirements
from friso.flexure.beams import BeamFailure, beams
from friso.flexure.evaluation import Evaluation
from friso.flexure.joint import first_interfering

STEP = 1e-4
"""Sizes are whole multiples of this [m]."""

SHOWN = 24
"""Candidates of the front that the beam model confirms, at most."""


@dataclass(frozen=True)
class Confirmed:
    """A candidate by the beam model: its drive stiffness [N/m] and first interfering frequency [Hz], NaN with the
    reason in `failure` where that could not be evaluated."""

    candidate: Candidate
    stiffness: float
    frequency: float
    failure: str = ""


@dataclass(frozen=True)
class Choice:
    """The geometry chosen, by the beam model; its requirements, and by what factor it breaks each by closed forms (at
    most 1); and of the geometries that were passed over, what beams found or why they failed."""

    geometry: Geometry
    beams: Evaluation
    requirements: tuple[Requirement, ...]
    excess: np.ndarray
    passed_over: tuple[str, ...]

    @property
    def frequency(self) -> float:
        """First interfering frequency [Hz], the lower one of both models: in one two modes may hide each other."""
        mode = self.beams.interfering
        return min(mode.frequency if mode else np.inf, float(first_interfering(self.beams.mechanism)))


def chosen(task: Task, candidates: Sequence[Candidate]) -> Choice | None:
    """The softest geometry that meets all requirements, by closed forms and by beams; None if there is none."""
    wanted, passed = requirements(task), []
    for geometry, excess in _in_order(task, wanted, candidates):
        try:
            found = evaluated(task, geometry)
        except BeamFailure as failure:
            passed.append(str(failure))
            continue
        choice = Choice(geometry, found, tuple(wanted), excess, tuple(passed))
        if choice.frequency >= task.spec.safety.parasitic * task.crossover and _bears(task, found):
            return choice
        passed.append(f"beams: {found.drive[0]:.4g} N/m, {choice.frequency:.4g} Hz")
    return None


def _bears(task: Task, found: Evaluation) -> bool:
    """Whether by beams, too, the cart does not break away inside the stroke and the leaves bear bending and load."""
    safety = task.spec.safety
    stays = safety.breakaway * (1 + safety.stiffness_tolerance) * found.forces[-1] <= task.friction
    swing = 0.0 if np.isnan(found.fatigue_margin) else 1 / found.fatigue_margin
    lasts = safety.fatigue * (swing + load_stress(found.mechanism, task) / found.mechanism.yield_strength) <= 1
    return bool(stays and lasts and safety.buckling * buckling_share(found.mechanism, task, found.buckling) <= 1)


def _in_order(
    task: Task, wanted: list[Requirement], candidates: Sequence[Candidate]
) -> Iterator[tuple[Geometry, np.ndarray]]:
    """Geometries in whole sizes that meet the requirements by closed forms, the softest first."""
    enough = task.spec.safety.parasitic * task.crossover
    near = [each.geometry for each in candidates if each.frequency >= 0.98 * enough]
    whole = list({geometry: None for each in near for geometry in rounded(task.spec, each, STEP)})
    if not whole:
        return
    found = judged(task, wanted, sizes_of(whole), [each.sheet for each in whole])
    for k in np.argsort(found.stiffness):
        if np.all(found.excess[k] <= 1):
            yield whole[k], found.excess[k]


def evaluated(task: Task, geometry: Geometry) -> Evaluation:
    """A geometry by the beam model. Raises BeamFailure."""
    return beams(mechanisms(task.flat, sizes_of([geometry]), [geometry.sheet]).member(0), task.stroke)


def confirmed(task: Task, candidates: Sequence[Candidate]) -> Iterable[Confirmed]:
    """Some of the front, evenly, by the beam model; where that fails, why."""
    for k in np.unique(np.linspace(0, len(candidates) - 1, SHOWN).astype(int)):
        each = candidates[k]
        try:
            found = evaluated(task, each.geometry)
        except BeamFailure as failure:
            yield Confirmed(each, np.nan, np.nan, str(failure))
            continue
        mode = found.interfering
        yield Confirmed(each, float(found.drive[0]), mode.frequency if mode else np.nan)
