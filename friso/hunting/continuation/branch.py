"""Follow a hunting cycle along a line through the keys, around its folds.

The method is pseudo-arclength continuation: Keller 1977, in Applications of Bifurcation Theory (Academic Press);
Kuznetsov 2004, doi:10.1007/978-1-4757-3978-7, chapter 10. A stage's position on the line is its "place", from 0 to 1
over the range of the keys. The cycle is measured by how far off the reference it sticks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from friso.engine.side_by_side import side_by_side
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import CYCLE_RTOL, Cycles, described
from friso.hunting.cycle.shooting import Border, Condition, ConditionSearch, Family, Followed, close_along

END_OF_RANGE = "end of the range"
"""Reason for the end of a branch: it reached the end of the range."""

NO_FARTHER = "it could not be followed farther"
"""First words of the reason why a branch ends, if no cycle was found one step farther."""


HUNDREDTH = float(np.log(1.01))
"""Change of place over which the key changes by 1 %, if the place is the key's logarithm."""


@dataclass(frozen=True)
class Point:
    """A cycle on a branch, at a `place` (mostly 0 to 1) on the line through the keys.

    `distance` and `time` are logarithms of its sticking distance [m] and its time of return [s]. `jacobians` is the
    Jacobian with which it was closed (see `Followed`), if it was followed from another cycle.
    """

    place: float
    distance: float
    time: float
    cycle: Cycles
    jacobians: np.ndarray | None = None

    @classmethod
    def of(cls, stages: Ensemble, place: float, cycle: Cycles, jacobians: np.ndarray | None = None) -> Point:
        """Make the point of one cycle, from the stage that it belongs to and its place on the line.

        `jacobians` is the Jacobian with which the cycle was closed, if it is known.
        """
        distance = abs(float(cycle.states[0, stages.sticking]))
        return cls(place, float(np.log(distance)), float(np.log(cycle.orbits.times[0])), cycle, jacobians)

    @property
    def multiplier(self) -> float:
        """Return the multiplier that decides whether the cycle is stable."""
        return float(self.cycle.multiplier[0])

    @property
    def vector(self) -> np.ndarray:
        """Return place, logarithm of distance and logarithm of time of the point, shape (3,)."""
        return np.array([self.place, self.distance, self.time])


@dataclass(frozen=True)
class Branch:
    """A branch of cycles: its `points` in order, and why it `ends` on either side, in words.

    `sign` is -1 for cycles closed over half a period, 1 for cycles closed over a whole one.
    """

    sign: float
    points: tuple[Point, ...]
    ends: tuple[str, str]


FARTHEST_MOVE = 3.0  # [steps]
"""Distance from a cycle beyond which the search for its neighbour is given up: it leads to another branch."""

FIRST_BRANCH_STEP = 0.002
"""First step along a branch. A longer one may lead to another branch."""

MOST_BRANCH_STEPS = 300
"""Most steps along a branch, each of which is an orbit. A branch with more winds without end."""

LONGEST_BRANCH_STEP = 0.1
"""Longest step along a branch. Longer steps draw corners; shorter ones take more orbits."""

BRANCH_TURN_PER_STEP = 0.3  # [rad]
"""Largest turn of a branch per step. A sharper turn is a jump to another branch."""

SHORTEST_BRANCH_STEP = 1e-6
"""Shortest step along a branch, below which its cycle cannot be closed and the branch ends."""

MULTIPLIER_CHANGE_PER_STEP = 0.25
"""Largest change of the multiplier per step. A larger one may step over two special points at once."""

STEEP_MULTIPLIER = 3.0
"""Multiplier beyond which its changes do not limit the steps."""

VANISHED_AMPLITUDE = 1e-3  # [deflections at break-away]
"""Amplitude below which a cycle cannot be told from rest, and its branch ends."""

STEEPEST_MULTIPLIER = 30.0
"""Multiplier beyond which a branch is left: no motion comes near so unstable a cycle, and its orbits are hard to
close."""

CHECK_RTOL_FACTOR = 0.01
"""Factor of the tighter tolerance at which results are repeated to estimate their error."""


class Tracer:
    """Tracer of one cycle along a line of stages, from place 0 to 1.

    `family` gives the stages by place. `sign` is -1 for a cycle closed over half a period, 1 for a whole one; `swings`
    counts its swings in that time (None: the fewest possible).
    `hundredth` gives, at a place, the length of line over which the key changes by one per cent. Cycles are closed to
    the relative tolerance `rtol`, or a wider one if they may chatter.
    """

    def __init__(
        self,
        family: Family,
        sign: float,
        rtol: float = CYCLE_RTOL,
        swings: int | None = None,
        hundredth: Callable[[float], float] = lambda _: HUNDREDTH,
    ) -> None:
        self.family, self.sign, self.swings = family, sign, swings
        beginning = family(np.zeros(1, np.int64), np.zeros(1))
        self.rtol, self.chatters = beginning.searching_rtol(rtol), beginning.chatters
        self.hundredth = hundredth

    def solve(
        self, near: Point, target: np.ndarray, normal: np.ndarray, states: np.ndarray | None = None
    ) -> Point | None:
        """Find the cycle on a plane in the space of place, log distance and log time.

        The plane passes through `target` with the normal `normal`. The search starts from the cycle `near` the plane,
        or from approximate `states` (1, states) of the cycle sought. It uses the Jacobian of the nearby cycle first,
        then a new one. Returns None if no cycle is found.
        """
        point = self._solved(near, target[None], normal, states)[0]
        if point is None and near.jacobians is not None:
            return self._solved(replace(near, jacobians=None), target[None], normal, states)[0]
        return point

    def solve_all(self, near: Point, targets: np.ndarray, normal: np.ndarray) -> list[Point]:
        """Find cycles on parallel planes at once, from a cycle `near` them all.

        The planes pass through `targets`, (planes, 3), with the `normal`, (3,), in the space of place, log distance and
        log time. Cycles that are not found are left out.
        """
        return [point for point in self._solved(replace(near, jacobians=None), targets, normal) if point]

    def _solved(
        self, near: Point, targets: np.ndarray, normal: np.ndarray, states: np.ndarray | None = None
    ) -> list[Point | None]:
        """Make one attempt to find a cycle on each of several parallel planes; None where none is found.

        The planes pass through `targets`, (planes, 3), with the `normal`, (3,). The search starts from the cycle `near`
        the planes, or from approximate `states` (planes, states). If that cycle has a Jacobian, there may be one plane.
        """
        begin, times, places = near.cycle.states, near.cycle.orbits.times, np.array([near.place])
        if states is not None or near.jacobians is None:
            begin = begin * np.exp(targets[:, 1:2] - near.distance) if states is None else states
            times, places = times * np.exp(targets[:, 2] - near.time), targets[:, 0]
        reach = FARTHEST_MOVE * float(np.abs(targets - near.vector).max())
        border = Border(np.broadcast_to(normal, targets.shape), targets @ normal)
        return self._points(
            close_along(
                self._on_line, begin, times, places, border, self.sign, self.rtol, self.swings, near.jacobians, reach
            )
        )

    def _on_line(self, _: np.ndarray, places: np.ndarray) -> Ensemble:
        """Return the stages at `places`, all on the line that is followed."""
        return self.family(np.zeros(len(places), np.int64), places)

    def _points(self, followed: Followed) -> list[Point | None]:
        """Return the cycles of orbits that were followed; None for an orbit that is not closed."""
        orbits, places, jacobians = followed
        stages = self._on_line(places, places)
        cycles = described(stages, orbits, self.rtol)
        usable = orbits.closed & np.isfinite(cycles.multiplier) & np.isfinite(cycles.amplitude)
        certain = np.all(np.isfinite(jacobians), axis=(1, 2))
        points: list[Point | None] = [None] * len(places)
        for k in np.flatnonzero(usable):
            one = np.array([k])
            jacobian = jacobians[one] if certain[k] else None
            points[k] = Point.of(stages.take(one), float(places[k]), cycles.take(one), jacobian)
        return points

    def shift(self, condition: Condition, point: Point) -> float:
        """Return how far the place of a cycle that meets a condition moves at a hundredth of the tolerance."""
        tight, place = self.rtol * CHECK_RTOL_FACTOR, np.array([point.place])
        again = ConditionSearch(condition, self._on_line, point.cycle.orbits, place, tight)
        return abs(float(again.moved()[0]))

    def walk(self, start: Point, ahead: float) -> tuple[list[Point], str]:
        """Follow the branch from a point to one side, 1 or -1; return its further points, and why it ends.

        A branch of asymmetric cycles also ends where it meets the symmetric cycle.
        """
        points, direction, step = [start], np.array([ahead, 0.0, 0.0]), FIRST_BRANCH_STEP
        while len(points) <= MOST_BRANCH_STEPS:
            last = points[-1]
            target, states = continued(points[-3:], step, direction)
            point = self.solve(last, target, direction, states)
            moved = np.zeros(3) if point is None else point.vector - last.vector
            length = float(np.linalg.norm(moved))
            near = point is not None and 0 < length < (2 * step if len(points) > 1 else LONGEST_BRANCH_STEP)
            ahead = float(moved @ direction) / length if near else 0.0
            if near and (ahead > 0 or len(points) == 1):
                direction = moved / length
            if point is None or not near or (ahead < np.cos(BRANCH_TURN_PER_STEP) and len(points) > 1):
                step /= 3  # and along the direction estimated from the points
                points[-1] = replace(last, jacobians=None)  # the old Jacobian may have misled the search
                if step < SHORTEST_BRANCH_STEP:
                    return points[1:], f"{NO_FARTHER} (multiplier {last.multiplier:.3g})"
                continue
            coarse = (
                abs(point.multiplier - last.multiplier) > MULTIPLIER_CHANGE_PER_STEP
                and abs(last.multiplier) < STEEP_MULTIPLIER
            )
            if coarse and step > FIRST_BRANCH_STEP:
                step /= 2
                continue
            if not 0 <= point.place <= 1:
                return [*points[1:], *self._at_the_end(last, point)], END_OF_RANGE
            if self._is_mirrored(start, point):
                return points[1:], "it meets the symmetric cycle"
            points.append(point)
            step = min(1.5 * step, LONGEST_BRANCH_STEP)
            if reason := self._stop(point):
                return points[1:], reason
        return points[1:], "it was followed for as many steps as there may be"

    def _at_the_end(self, last: Point, beyond: Point) -> list[Point]:
        """Return the cycle at the end of the range of places, as a list of one; empty if it fails.

        `last` is the last point inside the range, and `beyond` the first point outside.
        """
        end = 0.0 if beyond.place < 0 else 1.0
        share = (end - last.place) / (beyond.place - last.place)
        terminal = self.solve(last, last.vector + share * (beyond.vector - last.vector), np.array([1.0, 0.0, 0.0]))
        return [terminal] if terminal else []

    def _is_mirrored(self, start: Point, point: Point) -> bool:
        """Tell whether the middle of an asymmetric cycle has passed to the reference's other side.

        The cycles are those at `point` and at the `start` of the branch. Beyond the symmetric cycle a branch of
        asymmetric cycles continues as its own mirror image. The result is false for stages without mirror-image
        motions.
        """
        stages = self.family(np.zeros(1, np.int64), np.array([point.place]))
        leans = float(point.cycle.middle[0] * start.cycle.middle[0])
        return bool(self.sign > 0 and stages.symmetric[0] and leans < 0)

    def _stop(self, point: Point) -> str:
        """Return the reason why a branch is not followed beyond a point; "" if it is followed on."""
        stages = self.family(np.zeros(1, np.int64), np.array([point.place]))
        if point.cycle.amplitude[0] < VANISHED_AMPLITUDE * stages.length[0]:
            return "the cycle shrinks into the rest at the reference"
        if abs(point.multiplier) > (steepest := STEEPEST_MULTIPLIER):
            return f"the cycle repels {steepest:g}-fold and more per return"
        return ""

    def branch(self, start: Point) -> Branch:
        """Follow the branch through the cycle `start`, in both directions."""
        (after, last), (before, first) = side_by_side([partial(self.walk, start, ahead) for ahead in (1.0, -1.0)])
        return Branch(self.sign, (*before[::-1], start, *after), (first, last))


def continued(points: Sequence[Point], step: float, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Extrapolate a branch one step beyond the last of up to three points.

    Returns the point in the space of place, log distance and log time, and the cycle's states (1, states). Two points
    give a straight line, three a parabola over the lengths between them. One point alone gives no states: the step then
    goes along `direction`.
    """
    last = points[-1]
    if len(points) == 1:
        return last.vector + step * direction, None
    chords = [float(np.linalg.norm(b.vector - a.vector)) for a, b in pairwise(points)]
    lengths = [sum(chords[k:]) for k in range(len(points))]
    weights = [np.prod([(step + b) / (b - a) for k, b in enumerate(lengths) if k != j]) for j, a in enumerate(lengths)]
    vector = np.tensordot(weights, [point.vector for point in points], 1)
    states = np.tensordot(weights, [point.cycle.states for point in points], 1)
    return vector + (step - (vector - last.vector) @ direction) * direction, states
