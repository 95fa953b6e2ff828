"""What to relax where no remedy meets the goal: the points that break one constraint alone, or two."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from friso.design_method.relax import Relaxation
from friso.remedies.catalogue import Remedy
from friso.remedies.goal import Goal
from friso.remedies.machines import Fleet
from friso.remedies.search import TriedPoints
from friso.remedies.trials import LOOSER, attraction
from friso.remedies.verified import RemedyOutcome
from friso.stage import Stage

TRIED, SURVEYED = 3, 4
"""Points whose machines are surveyed, at most, for one relaxation, and how many machines."""


@dataclass(frozen=True)
class RelaxedGoal:
    """A goal relaxed in one part or two, with which a `remedy` meets it: its stage, the parts, and the factor by which
    they are relaxed, all together."""

    remedy: Remedy
    stage: Stage
    relaxations: tuple[Relaxation, ...]
    factor: float


def relaxations(outcomes: Sequence[RemedyOutcome], goal: Goal, machines: Fleet) -> tuple[RelaxedGoal, ...]:
    """The cheapest relaxation of each kind, the one that relaxes least first. Nothing is relaxed of the distance from
    hunting: machines that are surveyed at the points named have nothing that attracts."""
    best: dict[tuple[str, ...], RelaxedGoal] = {}
    for outcome in outcomes:
        if outcome.points is None:
            continue
        for relaxed in _of_remedy(outcome.remedy, outcome.points, goal, machines):
            keys = tuple(sorted(relaxation.key for relaxation in relaxed.relaxations))
            if keys not in best or relaxed.factor < best[keys].factor:
                best[keys] = relaxed
    single = [relaxed for keys, relaxed in best.items() if len(keys) == 1]
    listed = single or [*best.values()]
    return tuple(sorted(listed, key=lambda relaxed: relaxed.factor))


def _of_remedy(remedy: Remedy, points: TriedPoints, goal: Goal, machines: Fleet) -> Iterator[RelaxedGoal]:
    """The cheapest relaxations of a remedy: those of one part each, or else of two."""
    needed = _needed(points, goal)
    count = np.sum([values > 1 for values in needed.values()], axis=0)
    factor = np.prod([np.maximum(values, 1.0) for values in needed.values()], axis=0)
    possible = np.isfinite(factor) & np.isfinite(points.slower)
    few = machines.take(np.arange(min(SURVEYED, machines.count)))
    for parts in (1, 2):
        kinds: dict[tuple[str, ...], int] = {}
        which = np.flatnonzero(possible & (count == parts))
        for number in which[np.argsort(factor[which], kind="stable")]:
            names = tuple(name for name, values in needed.items() if values[number] > 1)
            kinds[names] = kinds.get(names, 0) + 1
            if kinds[names] > TRIED:
                continue
            if attraction(remedy, points.shares[[number]], few, goal).clear.all():
                kinds[names] = TRIED
                relaxed = tuple(_relaxation(name, points, int(number), goal) for name in names)
                yield RelaxedGoal(remedy, remedy.tuned(points.shares[number]), relaxed, float(factor[number]))
        if kinds:
            return


def _needed(points: TriedPoints, goal: Goal) -> dict[str, np.ndarray]:
    """The factors by which parts of the goal would have to be relaxed for each point."""
    time = np.where(np.isfinite(points.settling), points.settling, points.looser)
    none = np.zeros(len(time))
    return {
        "margin": goal.margin / np.maximum(points.margin, 1e-9) * np.where(points.margin > 0, 1, np.inf),
        "within": np.where(np.isfinite(points.settling), 1.0, np.where(np.isfinite(points.looser), LOOSER, np.inf)),
        "settle": none if goal.settle is None else time / goal.settle,
        "force_limit": none if goal.force_limit is None else points.force / goal.force_limit,
    }


def _relaxation(part: str, points: TriedPoints, number: int, goal: Goal) -> Relaxation:
    """What a part of the goal would have to be for a point."""
    time = points.settling[number] if np.isfinite(points.settling[number]) else points.looser[number]
    name, needed, unit = {
        "margin": ("modulus margin", points.margin[number], ""),
        "settle": ("settling time", time, "s"),
        "force_limit": ("force of the actuator", points.force[number], "N"),
        "within": ("deviation that counts as in position", LOOSER * goal.within, "m"),
    }[part]
    return Relaxation(name, part, getattr(goal, part), float(needed), unit)
