"""Compute the bifurcation diagram in one key: branches of cycles and their stability."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from friso.hunting.boundary.space import Space
from friso.hunting.continuation.branch import Branch, Point, Tracer
from friso.hunting.continuation.locate import SAME_CYCLE_LOG, LocatedPoint, special_points
from friso.hunting.cycle.find import CYCLE_RTOL, Cycles, families
from friso.hunting.cycle.hunting import surely_surveyed
from friso.hunting.loop import unstable_among
from friso.hunting.what_attracts import what_attracts
from friso.progress import Progress, Tally, silent

BRANCHES = "following branches of cycles"
"""Progress message for each cycle whose branch is followed."""


@dataclass(frozen=True)
class Diagram:
    """Bifurcation diagram over a range of one key: branches of cycles, and special points.

    The arrays belong to stages spaced evenly over the range, at `places` from 0 to 1. `cycles` are their hunting
    cycles. `attracts` is true for a stage with an attractor, and `decided` if that is known. `unstable` is true if the
    loop is unstable regardless of friction. Each has the shape (places,).
    """

    space: Space
    branches: tuple[Branch, ...]
    special: tuple[tuple[LocatedPoint, ...], ...]
    places: np.ndarray
    cycles: Cycles
    attracts: np.ndarray
    decided: np.ndarray
    unstable: np.ndarray

    def value(self, place: float) -> float:
        """Return the value of the key [SI] at a place from 0 to 1 in its range."""
        return float(self.space.ranges[0].at(np.array(place)))

    def error(self, special: LocatedPoint) -> float:
        """Return the error of the key's value [SI] at a special point."""
        return abs(self.value(special.point.place + special.error) - self.value(special.point.place))

    def in_doubt(self, places: np.ndarray) -> np.ndarray:
        """Return at which places (0 to 1 in the key's range) stability is unknown, shape (n,).

        It is unknown within the error of a special point.
        """
        return _in_doubt(self.special, places)


def _in_doubt(special: Sequence[Sequence[LocatedPoint]], places: np.ndarray) -> np.ndarray:
    """Return which places, shape (n,), lie within the error of a special point.

    Places run from 0 to 1 over the key's range.
    """
    near = [np.abs(spot.point.place - places) < spot.error for own in special for spot in own]
    return np.any([np.zeros(len(places), bool), *near], axis=0)


RANGE_STAGES = 33
"""Number of stages over the range from which branches start. Branches narrower than a step are missed; more stages
take longer."""

OTHER_BRANCHES = 6
"""Most further branches followed. Where periods double again and again, branches would never end."""


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def diagram(space: Space, rtol: float = CYCLE_RTOL, seeds: int | None = None, progress: Progress = silent) -> Diagram:
    """Follow every cycle that is found at `seeds` stages over the range of one key.

    The cycles are those that the return map suggests, and those in which simulations end, of any number of swings. Of
    the latter, at most `other_branches` (a setting) are followed. Orbits are closed to the relative tolerance `rtol`.
    """
    places = np.linspace(0, 1, RANGE_STAGES if seeds is None else seeds)
    places = places[space.allowed(places[:, None])]
    stages = space.stages(places[:, None])
    sought = families(stages, stages.searching_rtol(rtol))
    surveyed = what_attracts(stages, rtol)
    hundredth = space.hundredth(np.zeros(1), np.ones(1))
    branches: list[Branch] = []
    special: list[tuple[LocatedPoint, ...]] = []

    def follow(number: int, cycle: Cycles) -> bool:
        """Follow the branch through the cycle of a numbered stage; return whether it was followed.

        A branch that passes a cycle of an earlier branch is not followed.
        """
        start = Point.of(stages.take(np.array([number])), float(places[number]), cycle)
        if any(_passes(branch, start) for branch in branches):
            return False
        line = space.lines(np.zeros((1, 1)), np.ones((1, 1)))
        tracer = Tracer(line, cycle.sign, rtol, swings=cycle.swings, hundredth=hundredth)
        branches.append(tracer.branch(start))
        special.append(tuple(special_points(tracer, branches[-1])))
        return True

    suggested = [(k, cycles) for cycles in sought for k in np.flatnonzero(cycles.closed).tolist()]
    tally, skipped = Tally(progress, len(suggested) + len(surveyed.motions)), 0
    for k, cycles in suggested:
        tally.add(1, BRANCHES)
        follow(k, cycles.take(np.array([k])))
    for motion in surveyed.motions:
        tally.add(1, BRANCHES)
        if motion.cycles is not None and skipped < OTHER_BRANCHES:
            skipped += follow(motion.stage, motion.cycles.take(np.array([motion.number])))
    once = each_once(special, hundredth)
    attracting = sought[0].attracting & ~_in_doubt(once, places)
    decided = surely_surveyed(stages, surveyed) | attracting
    attracts = surveyed.attracts & decided | attracting
    unstable = np.any([*unstable_among(stages).values()], axis=0)
    return Diagram(space, tuple(branches), once, places, sought[0], attracts, decided, unstable)


SAME_POINT_HUNDREDTHS = 0.1  # [hundredths of the key]
"""Distance within which points of overlapping branches are one, where a limiter chatters."""


def each_once(
    special: Sequence[Sequence[LocatedPoint]], hundredth: Callable[[float], float]
) -> tuple[tuple[LocatedPoint, ...], ...]:
    """Merge special points that are equal within their errors, and keep the first of each group.

    Points of several branches also merge if they are close in terms of `hundredth`, the length over which the key
    changes by one per cent. Where a limiter chatters, multipliers scatter, and cycles are followed over short,
    overlapping stretches. The error of a merged point includes the difference between the points.
    """
    once: list[tuple[int, LocatedPoint]] = []
    for number, own in enumerate(special):
        for spot in own:
            close = SAME_POINT_HUNDREDTHS * hundredth(spot.point.place)
            twins = (k for k, (on, other) in enumerate(once) if _same(other, spot, close if on != number else 0.0))
            twin = next(twins, None)
            if twin is None:
                once.append((number, spot))
                continue
            branch, other = once[twin]
            off = abs(other.point.place - spot.point.place) + spot.error
            once[twin] = branch, replace(other, error=max(other.error, off))
    return tuple(tuple(spot for branch, spot in once if branch == number) for number in range(len(special)))


def _same(first: LocatedPoint, second: LocatedPoint, close: float) -> bool:
    """Tell whether two special points are the same point, computed twice.

    Kind, sign and swings of the cycle must be equal. The points must be no farther apart than `close` or their errors,
    and their cycles of almost equal size.
    """
    close = max([close, *(spot.error for spot in (first, second) if np.isfinite(spot.error))])
    apart = np.abs(first.point.vector - second.point.vector)
    kinds = [(spot.kind, spot.point.cycle.sign, spot.point.cycle.swings) for spot in (first, second)]
    return bool(kinds[0] == kinds[1] and apart[0] < close and apart[1:].max() < SAME_CYCLE_LOG)


def _passes(branch: Branch, point: Point) -> bool:
    """Tell whether a branch passes through a cycle or its mirror image."""
    if (branch.sign, branch.points[0].cycle.swings) != (point.cycle.sign, point.cycle.swings):
        return False
    path = np.array([passed.vector for passed in branch.points])
    for first, second in pairwise(path):
        low, high = sorted((first[0], second[0]))
        if low <= point.place <= high:
            share = (point.place - first[0]) / (second[0] - first[0]) if high > low else 0.0
            between = first + share * (second - first)
            if (
                np.abs(between - point.vector)[1:].max() < SAME_CYCLE_LOG
                or abs(between[2] - point.time) < SAME_CYCLE_LOG / 4
            ):
                return True
    return False
