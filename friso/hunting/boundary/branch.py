"""A hunting cycle followed along a line through the keys, round its folds: pseudo-arclength continuation.

Keller 1977, in Applications of Bifurcation Theory (Academic Press); Kuznetsov 2004, doi:10.1007/978-1-4757-3978-7,
chapter 10. The line is measured by a place (0 to 1) and the cycle by the distance at which the stage sticks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from friso.hunting.boundary.settings import ContinuationSettings
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import RTOL, Cycles, described
from friso.hunting.cycle.shooting import Border, Family, close_along

END_OF_RANGE = "end of the range"
"""How a branch ends that has been followed to the end."""

REACHED = "it reached the end of the requested range"
"""How a branch ends that was followed until something happened."""

NO_FARTHER = "it could not be followed farther"
"""How the reason begins where the next cycle of a branch was not found."""


HUNDREDTH = float(np.log(1.01))
"""Length of a line over which what is varied changes by a hundredth, where places are logarithms of it."""


@dataclass(frozen=True)
class Point:
    """A cycle on a branch, its place on the line, and the logarithms of its distance [m] and its time of return [s];
    with the Jacobian that it was closed with (see `Followed`), if it was followed."""

    place: float
    distance: float
    time: float
    cycle: Cycles
    jacobians: np.ndarray | None = None

    @classmethod
    def of(cls, stages: Ensemble, place: float, cycle: Cycles, jacobians: np.ndarray | None = None) -> Point:
        """The point of one cycle."""
        distance = abs(float(cycle.states[0, stages.sticking]))
        return cls(place, float(np.log(distance)), float(np.log(cycle.orbits.times[0])), cycle, jacobians)

    @property
    def multiplier(self) -> float:
        """The multiplier that decides whether the cycle attracts."""
        return float(self.cycle.multiplier[0])

    @property
    def vector(self) -> np.ndarray:
        """Where it is in the space of place, log distance and log time."""
        return np.array([self.place, self.distance, self.time])


@dataclass(frozen=True)
class Branch:
    """Cycles in order along a branch, of half a period (sign -1) or a whole one, and how it ends on either side."""

    sign: float
    points: tuple[Point, ...]
    ends: tuple[str, str]


class Tracer:
    """Follows one cycle along a line of stages (a family of one), from place 0 to the farthest; `sign` and `swings` are
    those of the cycle (the latter only if they are not as few as there may be); `pace` times as fast as a curve is
    drawn, in steps not shorter than `shortest`, the `first` one as long as is asked, as long as its multiplier is below
    the `steepest`. At a place, what is varied changes by a hundredth over a length of the line, `hundredth`."""

    def __init__(
        self,
        family: Family,
        sign: float,
        rtol: float = RTOL,
        farthest: float = 1.0,
        swings: int | None = None,
        pace: float = 1.0,
        shortest: float | None = None,
        hundredth: Callable[[float], float] = lambda _: HUNDREDTH,
        steepest: float | None = None,
        first: float | None = None,
    ) -> None:
        settings = ContinuationSettings.current()
        self.family, self.sign, self.rtol, self.farthest, self.swings = family, sign, rtol, farthest, swings
        self.first, self.longest, self.smooth = (
            first or pace * settings.first_branch_step,
            pace * settings.longest_branch_step,
            pace * settings.multiplier_change_per_step,
        )
        self.hundredth = hundredth
        self.shortest = settings.shortest_branch_step if shortest is None else shortest
        self.steepest = settings.steepest_multiplier if steepest is None else steepest

    def solve(
        self, near: Point, target: np.ndarray, normal: np.ndarray, states: np.ndarray | None = None
    ) -> Point | None:
        """The cycle on the plane through a target (place, log distance, log time) with this normal, found from a cycle
        near it, or from about its own states (1, states); None if none is found, with the Jacobian of the one near it
        or with one of its own."""
        point = self._solved(near, target, normal, states)
        if point is None and near.jacobians is not None:
            return self._solved(replace(near, jacobians=None), target, normal, states)
        return point

    def _solved(
        self, near: Point, target: np.ndarray, normal: np.ndarray, states: np.ndarray | None = None
    ) -> Point | None:
        """Solve for the cycle as `solve` does, but with the Jacobian of the nearby cycle alone, if it has one."""
        border = Border(normal[None, :], np.array([normal @ target]))
        begin, times, place = near.cycle.states, near.cycle.orbits.times, np.array([near.place])
        if states is not None or near.jacobians is None:
            begin = begin * np.exp(target[1] - near.distance) if states is None else states
            times, place = times * np.exp(target[2] - near.time), target[:1]
        orbits, places, jacobians = close_along(
            self.family, begin, times, place, border, self.sign, self.rtol, self.swings, near.jacobians
        )
        if not orbits.closed[0]:
            return None
        stages = self.family(np.zeros(1, np.int64), places)
        cycle = described(stages, orbits, self.rtol)
        if not np.isfinite(cycle.multiplier[0]) or not np.isfinite(cycle.amplitude[0]):
            return None
        return Point.of(stages, float(places[0]), cycle, jacobians if np.isfinite(jacobians).all() else None)

    def walk(
        self, start: Point, ahead: float, until: Callable[[Point, Point], bool] | None = None
    ) -> tuple[list[Point], str]:
        """The points that follow the start on one side, and how they end; `ahead` is 1 or -1. The first point of which,
        with the one before it, `until` holds is the last, and asymmetric cycles are then followed on where they meet
        the symmetric one."""
        settings = ContinuationSettings.current()
        points, direction, step = [start], np.array([ahead, 0.0, 0.0]), self.first
        while len(points) <= settings.most_branch_steps:
            last = points[-1]
            target, states = continued(points[-3:], step, direction)
            point = self.solve(last, target, direction, states)
            moved = np.zeros(3) if point is None else point.vector - last.vector
            length = float(np.linalg.norm(moved))
            near = point is not None and 0 < length < (2 * step if len(points) > 1 else self.longest)
            ahead = float(moved @ direction) / length if near else 0.0
            if near and (ahead > 0 or len(points) == 1):
                direction = moved / length
            if point is None or not near or (ahead < np.cos(settings.branch_turn_per_step) and len(points) > 1):
                step /= 3  # and along the direction that the branch turned out to have
                points[-1] = replace(last, jacobians=None)  # which may have led astray
                if step < self.shortest:
                    return points[1:], f"{NO_FARTHER} (multiplier {last.multiplier:.3g})"
                continue
            coarse = (
                abs(point.multiplier - last.multiplier) > self.smooth
                and abs(last.multiplier) < settings.steep_multiplier
            )
            if coarse and step > self.first:
                step /= 2
                continue
            if not 0 <= point.place <= self.farthest:
                return [*points[1:], *self._at_the_end(last, point)], END_OF_RANGE
            if until is None and self._is_mirrored(start, point):
                return points[1:], "it meets the symmetric cycle"
            points.append(point)
            if until is not None and until(last, point):
                return points[1:], REACHED
            step = min(1.5 * step, self.longest)
            if reason := self._stop(point):
                return points[1:], reason
        return points[1:], "it was followed for as many steps as there may be"

    def reaches(self, points: Sequence[Point], reason: str) -> bool:
        """Whether a walk with these points that ended for a reason came to the farthest place, and not back to the
        first, on a branch that turns."""
        return reason == END_OF_RANGE and bool(points) and points[-1].place > self.farthest * (1 - 1e-6)

    def _at_the_end(self, last: Point, beyond: Point) -> list[Point]:
        """The point at the end of the range that lies between two."""
        end = 0.0 if beyond.place < 0 else self.farthest
        share = (end - last.place) / (beyond.place - last.place)
        terminal = self.solve(last, last.vector + share * (beyond.vector - last.vector), np.array([1.0, 0.0, 0.0]))
        return [terminal] if terminal else []

    def _is_mirrored(self, start: Point, point: Point) -> bool:
        """Whether a cycle of a symmetric stage leans to the other side than the start: beyond the symmetric cycle the
        branch is its own mirror image."""
        stages = self.family(np.zeros(1, np.int64), np.array([point.place]))
        leans = float(point.cycle.middle[0] * start.cycle.middle[0])
        return bool(self.sign > 0 and stages.symmetric[0] and leans < 0)

    def _stop(self, point: Point) -> str:
        """Why a branch is not followed beyond a point; "" if it is."""
        stages = self.family(np.zeros(1, np.int64), np.array([point.place]))
        if point.cycle.amplitude[0] < ContinuationSettings.current().vanished_amplitude * stages.length[0]:
            return "the cycle shrinks into the rest at the reference"
        if abs(point.multiplier) > self.steepest:
            return f"the cycle repels {self.steepest:g}-fold and more per return"
        return ""

    def branch(self, start: Point) -> Branch:
        """The whole branch through a point."""
        (after, last), (before, first) = self.walk(start, 1.0), self.walk(start, -1.0)
        return Branch(self.sign, (*before[::-1], start, *after), (first, last))


def continued(points: Sequence[Point], step: float, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Where the cycle a step beyond the last of up to three points is, in the space of place, log distance and log
    time, a step ahead along a direction there; and its states (1, states), None if there is one point alone: on the
    straight line through two, on the parabola through three, over the lengths between them."""
    last = points[-1]
    if len(points) == 1:
        return last.vector + step * direction, None
    chords = [float(np.linalg.norm(b.vector - a.vector)) for a, b in pairwise(points)]
    lengths = [sum(chords[k:]) for k in range(len(points))]
    weights = [np.prod([(step + b) / (b - a) for k, b in enumerate(lengths) if k != j]) for j, a in enumerate(lengths)]
    vector = np.tensordot(weights, [point.vector for point in points], 1)
    states = np.tensordot(weights, [point.cycle.states for point in points], 1)
    return vector + (step - (vector - last.vector) @ direction) * direction, states
