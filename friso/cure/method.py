"""The method of `friso tune`: every way optimised by itself, its best settings verified, the least change first."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from friso.cure.answers import Cure, Performance, doubts, measure, verified
from friso.cure.goal import Goal
from friso.cure.machines import TRAVEL, Fleet, drawn
from friso.cure.relax import Relaxed, relaxations
from friso.cure.search import Budget, Search
from friso.cure.sensitivities import Sensitivities, edge_sensitivities
from friso.cure.ways import WayOut, ways
from friso.cure.window import windows
from friso.engine.kernel import KernelRequest, kernels
from friso.equations.motion import last_corner
from friso.equations.structure import structure
from friso.errors import InputError
from friso.frequency.crossover import Limits, limits
from friso.hunting.check import Case
from friso.progress import Progress, silent
from friso.stage import Stage
from friso.stage.correlations import Correlations
from friso.studies.compare.options import linear_flat

TRIES = 3
"""Settings of a way that are verified at most: the next best ones where the best are not sure to work."""

FRESH = 1000
"""What is added to the seed for the machines that the optimiser does not see."""


@dataclass(frozen=True)
class Advice:
    """The answers, those that change least first, for a stage that was checked and measured itself (`present`); the
    bandwidths with which it keeps its margin; what its edge of hunting depends on; what to relax where nothing works;
    whether it was interrupted."""

    stage: Stage
    goal: Goal
    case: Case
    present: Performance
    limits: Limits
    answers: tuple[Cure, ...]
    relaxed: tuple[Relaxed, ...]
    machines: Fleet
    seed: int
    interrupted: bool = False
    sensitivities: Sensitivities | None = None

    @property
    def needed(self) -> bool:
        """Whether the stage as it is does not meet the goal."""
        return bool(doubts(self.case, self.present, self.goal))

    @property
    def working(self) -> tuple[Cure, ...]:
        """The ways that work."""
        return tuple(answer for answer in self.answers if answer.sure == "works")

    @property
    def fastest(self) -> Cure | None:
        """The way that works and settles soonest."""
        return min(self.working, key=lambda answer: _slowest(answer, self.goal), default=None)


def _slowest(answer: Cure, goal: Goal) -> float:
    return np.inf if answer.measured is None else answer.measured.slowest(goal)


def tune(
    stage: Stage,
    goal: Goal | None = None,
    seed: int = 1,
    correlations: Correlations | None = None,
    budget: Budget | None = None,
    chosen: Collection[str] | None = None,
    progress: Progress = silent,
) -> Advice:
    """The best settings of every way that the goal allows, or of those with the names `chosen`. Raises InputError for a
    motion after which nothing has to settle."""
    goal, budget, correlations = goal or Goal(), budget or Budget(), correlations or Correlations()
    _moves(stage)
    ideal = _ideal(stage)
    listed = [way for way in ways(ideal, goal) if chosen is None or way.name in chosen]
    report = _Report(progress, sum(_steps(way, budget) for way in listed) + 2)
    report("compiling")
    kernels({KernelRequest(structure(way.stage.flat())) for way in [WayOut.settled_on("", ideal), *listed]})
    fresh = drawn(ideal, correlations, budget.fresh, seed + FRESH)
    machines = drawn(ideal, correlations, budget.machines, seed)
    report("the stage as it is")
    case, present = verified(ideal), measure(ideal, fresh, goal, stage)
    answers: list[Cure] = []
    relaxed: tuple[Relaxed, ...] = ()
    interrupted, searches = False, list[Search]()
    try:
        for way in listed:
            search = Search(way, goal, machines, stage, budget, report)
            searches = [search]
            answers.append(Cure(way, None, None, None, (), interrupted=True))  # as long as it is not there
            answers[-1] = _answer(search, fresh, stage, answers)
            report.after(_steps(way, budget))
        if not any(answer.sure == "works" for answer in answers):
            report("what to relax")
            relaxed = relaxations(answers, goal, machines)
    except KeyboardInterrupt:
        interrupted = True
        answers[-1:] = [_so_far(search, cure) for search, cure in zip(searches, answers[-1:], strict=True)]
    return Advice(
        ideal,
        goal,
        case,
        present,
        limits(linear_flat(stage, stage.flat())),
        tuple(answers),
        relaxed,
        fresh,
        seed,
        interrupted,
        None if interrupted else edge_sensitivities(ideal, case.judgement.margin),
    )


def _answer(search: Search, fresh: Fleet, drive: Stage, answers: list[Cure]) -> Cure:
    """The best settings of a way that are verified, or else the best that are not sure to work; `answers` ends with
    what is known of it so far."""
    way, goal = search.way, search.goal
    search.optimise()
    unsure: Cure | None = None
    for number, shares in enumerate(search.surveyed()):
        tuned = way.tuned(shares)
        search.report(f"{way.name}: cycles")
        measured = measure(tuned, fresh, goal, drive)
        case = verified(tuned)
        around = windows(search, shares)
        answer = Cure(
            way,
            tuned,
            measured,
            case,
            doubts(case, measured, goal),
            around,
            search.settings,
            search.attracted,
            shares=shares,
        )
        if answer.sure == "works":
            return answer
        unsure = unsure or answer
        answers[-1] = unsure
        if number + 1 == TRIES:
            break
    return unsure or Cure(way, None, None, None, (), (), search.settings, search.attracted)


def _so_far(search: Search, cure: Cure) -> Cure:
    """What is known of a way whose search was interrupted: its best settings so far, not verified."""
    if not cure.interrupted or not search.tried:
        return cure
    settings = search.settings
    best = int(settings.cost(search.goal).argmin())
    if any(broken[best] for broken in settings.broken(search.goal).values()):
        return cure
    shares = settings.shares[best]
    return replace(cure, stage=search.way.tuned(shares), settings=settings, shares=shares)


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
    return stage.replace({table: None for table in ("drive", "rail", "cable", "floor") if getattr(stage, table)})


def _steps(way: WayOut, budget: Budget) -> int:
    """How many reports a way makes, about."""
    return (2 if len(way.variables) == 1 else budget.generations) + 4


class _Report:
    """Counts the steps of all ways."""

    def __init__(self, progress: Progress, total: int) -> None:
        self.progress, self.total, self.done, self.base = progress, total, 0, 2

    def __call__(self, label: str) -> None:
        self.done = min(self.done + 1, self.total)
        self.progress(self.done, self.total, label)

    def after(self, steps: int) -> None:
        """A way of so many steps has ended."""
        self.base += steps
        self.done = self.base
