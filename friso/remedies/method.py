"""The method of `friso tune`: every remedy optimised by itself, its best points verified, the least change first."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from friso.engine.kernel import KernelRequest, kernels
from friso.equations.motion import last_corner
from friso.equations.structure import structure
from friso.errors import InputError
from friso.frequency.crossover import Limits, limits
from friso.hunting.check import Case
from friso.progress import Progress, silent
from friso.remedies.catalogue import Remedy, remedies
from friso.remedies.goal import Goal
from friso.remedies.machines import TRAVEL, Fleet, draw_fleet
from friso.remedies.relax import RelaxedGoal, relaxations
from friso.remedies.search import Budget, Search
from friso.remedies.sensitivities import Sensitivities, edge_sensitivities
from friso.remedies.verified import Performance, RemedyOutcome, performance_of, unmet_goals, verified
from friso.remedies.window import windows
from friso.stage import Stage
from friso.stage.correlations import Correlations
from friso.stage.rig import AS_BUILT
from friso.studies.compare.options import linear_flat

TRIES = 3
"""Points of a remedy that are verified at most: the next best ones where the best are not sure to work."""

FRESH = 1000
"""What is added to the seed for the machines that the optimiser does not see."""


@dataclass(frozen=True)
class Advice:
    """The outcomes of all remedies, those that change least first, for a stage that was checked and measured itself
    (`present`); the bandwidths with which it keeps its margin; what its edge of hunting depends on; what to relax where
    nothing works; whether it was interrupted."""

    stage: Stage
    goal: Goal
    case: Case
    present: Performance
    limits: Limits
    outcomes: tuple[RemedyOutcome, ...]
    relaxed: tuple[RelaxedGoal, ...]
    machines: Fleet
    seed: int
    interrupted: bool = False
    sensitivities: Sensitivities | None = None

    @property
    def needed(self) -> bool:
        """Whether the stage as it is does not meet the goal."""
        return bool(unmet_goals(self.case, self.present, self.goal))

    @property
    def working(self) -> tuple[RemedyOutcome, ...]:
        """The remedies that work."""
        return tuple(outcome for outcome in self.outcomes if outcome.certainty == "works")

    @property
    def fastest(self) -> RemedyOutcome | None:
        """The remedy that works and settles soonest."""
        return min(self.working, key=lambda outcome: _slowest(outcome, self.goal), default=None)


def _slowest(outcome: RemedyOutcome, goal: Goal) -> float:
    return np.inf if outcome.measured is None else outcome.measured.slowest(goal)


def tune(
    stage: Stage,
    goal: Goal | None = None,
    seed: int = 1,
    correlations: Correlations | None = None,
    budget: Budget | None = None,
    chosen: Collection[str] | None = None,
    progress: Progress = silent,
) -> Advice:
    """The best points of every remedy that the goal allows, or of those with the names `chosen`. Raises InputError for
    a motion after which nothing has to settle."""
    goal, budget, correlations = goal or Goal(), budget or Budget(), correlations or Correlations()
    _moves(stage)
    ideal = _ideal(stage)
    listed = [remedy for remedy in remedies(ideal, goal) if chosen is None or remedy.name in chosen]
    report = _Report(progress, sum(_steps(remedy, budget) for remedy in listed) + 2)
    report("compiling")
    kernels({KernelRequest(structure(remedy.stage.flat())) for remedy in [Remedy.settled_on("", ideal), *listed]})
    fresh = draw_fleet(ideal, correlations, budget.fresh, seed + FRESH)
    machines = draw_fleet(ideal, correlations, budget.machines, seed)
    report("the stage as it is")
    case, present = verified(ideal), performance_of(ideal, fresh, goal, stage)
    outcomes: list[RemedyOutcome] = []
    relaxed: tuple[RelaxedGoal, ...] = ()
    interrupted, searches = False, list[Search]()
    try:
        for remedy in listed:
            search = Search(remedy, goal, machines, stage, budget, report)
            searches = [search]
            outcomes.append(RemedyOutcome(remedy, None, None, None, (), interrupted=True))  # as long as it is not there
            outcomes[-1] = _outcome_of(search, fresh, stage, outcomes)
            report.after(_steps(remedy, budget))
        if not any(outcome.certainty == "works" for outcome in outcomes):
            report("what to relax")
            relaxed = relaxations(outcomes, goal, machines)
    except KeyboardInterrupt:
        interrupted = True
        outcomes[-1:] = [_so_far(search, outcome) for search, outcome in zip(searches, outcomes[-1:], strict=True)]
    return Advice(
        ideal,
        goal,
        case,
        present,
        limits(linear_flat(stage, stage.flat())),
        tuple(outcomes),
        relaxed,
        fresh,
        seed,
        interrupted,
        None if interrupted else edge_sensitivities(ideal, case.judgement.margin),
    )


def _outcome_of(search: Search, fresh: Fleet, drive: Stage, outcomes: list[RemedyOutcome]) -> RemedyOutcome:
    """The best points of a remedy that are verified, or else the best that are not sure to work; `outcomes` ends with
    what is known of it so far."""
    remedy, goal = search.remedy, search.goal
    search.optimise()
    unsure: RemedyOutcome | None = None
    for number, shares in enumerate(search.surveyed()):
        tuned = remedy.tuned(shares)
        search.report(f"{remedy.name}: cycles")
        measured = performance_of(tuned, fresh, goal, drive)
        case = verified(tuned)
        around = windows(search, shares)
        outcome = RemedyOutcome(
            remedy,
            tuned,
            measured,
            case,
            unmet_goals(case, measured, goal),
            around,
            search.points,
            search.attracted,
            shares=shares,
        )
        if outcome.certainty == "works":
            return outcome
        unsure = unsure or outcome
        outcomes[-1] = unsure
        if number + 1 == TRIES:
            break
    return unsure or RemedyOutcome(remedy, None, None, None, (), (), search.points, search.attracted)


def _so_far(search: Search, outcome: RemedyOutcome) -> RemedyOutcome:
    """What is known of a remedy whose search was interrupted: its best point so far, not verified."""
    if not outcome.interrupted or not search.tried:
        return outcome
    points = search.points
    best = int(points.cost(search.goal).argmin())
    if any(broken[best] for broken in points.broken(search.goal).values()):
        return outcome
    shares = points.shares[best]
    return replace(outcome, stage=search.remedy.tuned(shares), points=points, shares=shares)


def _moves(stage: Stage) -> None:
    """Raises InputError for a motion after which nothing has to settle."""
    flat = stage.flat()
    kind = flat["motion.kind"]
    corner, duration = float(last_corner(flat)), flat["motion.duration"]
    if kind not in TRAVEL or not flat[TRAVEL[kind][0]] or corner >= duration:
        example = '[motion] kind = "step", size = "1 mm", duration = "20 s"'
        raise InputError("motion.kind", f'"{kind}"', "a move whose reference stands in the end", example)


def _ideal(stage: Stage) -> Stage:
    """The stage without what cycles leave out: rail, cable, floor, sampling and delay."""
    return stage.replace({table: None for table in AS_BUILT if getattr(stage, table)})


def _steps(remedy: Remedy, budget: Budget) -> int:
    """How many reports a remedy makes, about."""
    return (2 if len(remedy.variables) == 1 else budget.generations) + 4


class _Report:
    """Counts the steps of all remedies."""

    def __init__(self, progress: Progress, total: int) -> None:
        self.progress, self.total, self.done, self.base = progress, total, 0, 2

    def __call__(self, label: str) -> None:
        self.done = min(self.done + 1, self.total)
        self.progress(self.done, self.total, label)

    def after(self, steps: int) -> None:
        """A remedy of so many steps has ended."""
        self.base += steps
        self.done = self.base
