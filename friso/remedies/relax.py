"""Find which parts of the goal to relax, at most three together, if no remedy meets it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from friso.design_method.requirements import Relaxation
from friso.engine.allowance import Exhausted
from friso.quantities import outwards
from friso.remedies.catalogue import Remedy
from friso.remedies.machines import Fleet, Goal
from friso.remedies.search import TriedPoints
from friso.remedies.settings import settings
from friso.remedies.trials import attraction, moves_of_points
from friso.remedies.verified import RemedyOutcome
from friso.stage import Stage


@dataclass(frozen=True)
class RelaxedGoal:
    """A goal relaxed in up to three parts, and a `remedy` that meets it.

    `stage` is that of the remedy, and `relaxations` are the parts. `factor` is the product of the factors by which they
    are relaxed.
    """

    remedy: Remedy
    stage: Stage
    relaxations: tuple[Relaxation, ...]
    factor: float


def relaxations(outcomes: Sequence[RemedyOutcome], goal: Goal, machines: Fleet) -> tuple[RelaxedGoal, ...]:
    """Return the cheapest relaxation for each set of parts of the goal, the smallest first.

    Only sets with the fewest parts are returned. The distance from hunting is never relaxed: surveyed machines do not
    hunt at the points considered. If an allowance of work is used up, the remaining remedies are left out.
    """
    best: dict[tuple[str, ...], RelaxedGoal] = {}
    with suppress(Exhausted):
        for outcome in outcomes:
            if outcome.points is None or not outcome.remedy.verifiable:
                continue
            for relaxed in _of_remedy(outcome.remedy, outcome.points, goal, machines):
                keys = tuple(sorted(relaxation.key for relaxation in relaxed.relaxations))
                if keys not in best or relaxed.factor < best[keys].factor:
                    best[keys] = relaxed
    fewest = min(map(len, best), default=0)
    listed = [relaxed for keys, relaxed in best.items() if len(keys) == fewest]
    return tuple(sorted(listed, key=lambda relaxed: relaxed.factor))


def _of_remedy(remedy: Remedy, points: TriedPoints, goal: Goal, machines: Fleet) -> Iterator[RelaxedGoal]:
    """Yield the cheapest relaxations for a remedy, of as few parts of the goal as possible.

    If possible, no part is relaxed by more than a reasonable factor. Otherwise, this is required of the bandwidth limit
    only.
    """
    needed = _needed(points, goal)
    far = [name for name, values in needed.items() if name != "within" and (values > settings.reasonable_factor).any()]
    listed = [*_within(remedy, points, goal, machines, needed, far)]
    yield from listed or _within(remedy, points, goal, machines, needed, [n for n in far if n == "bandwidth_limit"])


def _within(
    remedy: Remedy,
    points: TriedPoints,
    goal: Goal,
    machines: Fleet,
    needed: Mapping[str, np.ndarray],
    limited: Sequence[str],
) -> Iterator[RelaxedGoal]:
    """Yield the cheapest relaxations for a remedy, of as few parts of the goal as possible.

    `needed` has, by part, the factor by which each of the `points` must be relaxed. Parts in `limited` may not be
    relaxed by more than a reasonable factor. A few of the `machines` must not hunt at a point.
    """
    needed = {name: values.copy() for name, values in needed.items()}
    count = np.sum([values > 1 for values in needed.values()], axis=0)
    factor = np.prod([np.maximum(values, 1.0) for values in needed.values()], axis=0)
    possible = np.isfinite(factor) & np.isfinite(points.slower)
    for name in limited:
        possible &= needed[name] <= settings.reasonable_factor
    few = machines.take(np.arange(min(settings.relaxed_machines, machines.count)))
    for parts in (1, 2, 3):
        tried: dict[tuple[str, ...], int] = {}
        enough = False
        which = np.flatnonzero(possible & (count == parts))
        loose = which[needed["within"][which] > 1]
        loose = loose[np.argsort(points.looser[loose], kind="stable")]
        tolerance = _tolerances(remedy, points.shares[loose], goal, machines)
        factor[loose] *= tolerance / needed["within"][loose]
        needed["within"][loose] = tolerance
        for number in which[np.argsort(factor[which], kind="stable")]:
            names = tuple(name for name, values in needed.items() if values[number] > 1)
            tried[names] = tried.get(names, 0) + 1
            if tried[names] > settings.relaxed_points:
                continue
            if attraction(remedy, points.shares[[number]], few, goal).clear.all():
                tried[names], enough = settings.relaxed_points, True
                within = float(needed["within"][number])
                yield _relaxed_goal(remedy, points.take(np.array([number])), names, goal, within)
        if enough:
            return


def _relaxed_goal(remedy: Remedy, point: TriedPoints, names: tuple[str, ...], goal: Goal, within: float) -> RelaxedGoal:
    """Build the goal that a point meets: the parts `names` are relaxed as far as necessary.

    The tolerance is wider by the factor `within`.
    """
    values = {
        "margin": ("modulus margin", float(point.margin[0]), ""),
        "settle": ("settling time", float(_time(point)[0]), "s"),
        "force_limit": ("force of the actuator", float(point.force[0]), "N"),
        "within": ("deviation that counts as in position", within * goal.within, "m"),
        "bandwidth_limit": ("limit of the bandwidth", float(point.bandwidth[0]), "Hz"),
    }
    relaxed = []
    for name in names:
        requirement, needed, unit = values[name]
        present = getattr(goal, name)
        relaxed.append(Relaxation(requirement, name, present, outwards(needed, needed > present), unit))
    factor = np.prod([max(part.needed / part.value, part.value / part.needed) for part in relaxed])
    return RelaxedGoal(remedy, remedy.tuned(point.shares[0]), tuple(relaxed), float(factor))


def _tolerances(remedy: Remedy, shares: np.ndarray, goal: Goal, machines: Fleet) -> np.ndarray:
    """Return the factors by which the tolerance must be wider at points, shape (points,).

    A few factors are tried. The first with which the machines settle within the goal's time is taken. If there is none,
    it is the factor of the looser tolerance of the search.
    """
    factors = np.full(len(shares), settings.looser_tolerance)
    open_still = np.arange(min(len(shares), settings.most_relaxed))
    latest = np.inf if goal.settle is None else goal.settle
    for factor in settings.wider_tolerances:
        if not open_still.size:
            break
        moves = moves_of_points(remedy, shares[open_still], machines, replace(goal, within=factor * goal.within))
        time = moves.slowest(goal.share)
        settles = np.isfinite(time) & (time <= latest)
        factors[open_still[settles]] = factor
        open_still = open_still[~settles]
    return factors


def _needed(points: TriedPoints, goal: Goal) -> dict[str, np.ndarray]:
    """Return by which factor each part of the goal must be relaxed at each point, shape (n,).

    Factors are by the names of parts. A part that a point meets has a factor of at most 1.
    """
    none = np.zeros(len(points.margin))
    limit = goal.bandwidth_limit
    return {
        "margin": goal.margin / np.maximum(points.margin, 1e-9) * np.where(points.margin > 0, 1, np.inf),
        "within": np.where(
            np.isfinite(points.settling), 1.0, np.where(np.isfinite(points.looser), settings.looser_tolerance, np.inf)
        ),
        "settle": none if goal.settle is None else _time(points) / goal.settle,
        "force_limit": none if goal.force_limit is None else points.force / goal.force_limit,
        "bandwidth_limit": none if limit is None else np.nan_to_num(points.bandwidth / limit, nan=np.inf),
    }


def _time(points: TriedPoints) -> np.ndarray:
    """Return the settling time [s] of each point, shape (n,).

    It is the time to settle within the tolerance or, for points that do not, within the looser tolerance of the search.
    """
    return np.where(np.isfinite(points.settling), points.settling, points.looser)
