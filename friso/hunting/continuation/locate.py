"""Locate where a cycle on a branch loses stability.

A multiplier passes -1 (flip), 1 (fold) or the unit circle (torus).

Values along a branch scatter. A cubic with an error bound says where they pass zero or turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from friso.hunting.continuation.branch import Branch, Point, Tracer
from friso.hunting.cycle.find import decisive_of
from friso.hunting.cycle.shooting import Condition


class Crossing(NamedTuple):
    """Where values pass zero over a key's range, with an error bound and the slope there.

    `place` runs from 0 to 1 over the range, and `reserve` bounds its error. `slope` is the change of the value per
    place.
    """

    place: float
    reserve: float
    slope: float


LEAST_CUBIC_VALUES = 6
"""Fewest values of a cubic whose scatter can be estimated."""


def crossing(places: np.ndarray, values: np.ndarray) -> Crossing | None:
    """Fit a cubic to values over places, shape (n,), and return where it passes zero.

    A zero counts if it lies within the range of places, and the cubic goes up or down there as the values do overall.
    The last zero that counts is returned.

    Its error is twice the distance by which the scatter of the values may shift it. If another zero within the range,
    counted or not, lies farther away than that, the error is the distance to the farthest.

    Returns None if there are too few values, if no zero counts, or if the error exceeds half of the range of places.
    """
    if len(places) < LEAST_CUBIC_VALUES:
        return None
    trend, curve = (np.polynomial.Polynomial.fit(places, values, degree) for degree in (1, 3))
    slopes, roots = curve.deriv(), curve.roots()
    real = roots.real[np.abs(roots.imag) < 1e-9 * np.ptp(places)]
    inside = real[(real >= places.min()) & (real <= places.max())]
    steepness = float(trend.deriv()(0.0))
    along = inside[slopes(inside) * steepness > 0]
    if not along.size:
        return None
    place = float(along.max())
    slope = float(slopes(place))
    reserve = max(
        2 * _scatter(curve, places, values) / min(abs(slope), abs(steepness)), float(np.abs(inside - place).max())
    )
    return Crossing(place, reserve, slope) if reserve <= np.ptp(places) / 2 else None


class FoldBack(NamedTuple):
    """A fold: how far along the branch it lies, where in the key's range, and with what error.

    `length` is along the branch, from where the curve was fitted. `place` runs from 0 to 1 over the key's range, and
    `reserve` bounds its error.
    """

    length: float
    place: float
    reserve: float


def turn(lengths: np.ndarray, places: np.ndarray) -> FoldBack | None:
    """Fit a cubic to places over lengths along a branch, shape (n,); return where it turns back.

    Of several such points, the one nearest to length 0 counts. The error of the place is twice the scatter about the
    cubic. Returns None if there are too few places, or if the cubic does not turn within the lengths. Returns None as
    well if the error exceeds half of the range of places.
    """
    if len(places) < LEAST_CUBIC_VALUES:
        return None
    curve = np.polynomial.Polynomial.fit(lengths, places, 3)
    turns = curve.deriv().roots()
    real = turns.real[np.abs(turns.imag) < 1e-9 * np.ptp(lengths)]
    inside = real[(real >= lengths.min()) & (real <= lengths.max())]
    reserve = 2 * _scatter(curve, lengths, places)
    if not inside.size or reserve > np.ptp(places) / 2:
        return None
    length = float(inside[np.abs(inside).argmin()])
    return FoldBack(length, float(curve(length)), reserve)


def _scatter(curve: np.polynomial.Polynomial, at: np.ndarray, values: np.ndarray) -> float:
    """Return the standard deviation of values, (n,), about a cubic `curve` through them.

    `at`, shape (n,), are the places of the values.
    """
    return float(np.sqrt(np.sum((values - curve(at)) ** 2) / (len(at) - 4)))


Bifurcation = Literal["flip", "fold", "torus"]


ALONG_KEY = np.array([1.0, 0.0, 0.0])
"""Direction along the key alone, in the space of place, log distance and log time."""


SAME_CYCLE_LOG = 0.02
"""Largest difference in log distance and log time between two computations of one cycle."""


@dataclass(frozen=True)
class LocatedPoint:
    """Point at which a branch loses or gains stability, by a flip, a fold or a torus (`kind`).

    `error` is the error of the place, the position from 0 to 1 in the key's range: the residual of the search plus the
    shift when computed at a hundredth of the tolerance. With a limiter that chatters it is the error bound of a curve
    through orbits beside the point.
    """

    kind: Bifurcation
    point: Point
    error: float

    def in_doubt(self, point: Point) -> bool:
        """Tell whether a cycle of the branch is so near this point that its stability is unknown.

        The result is true if the cycle lies within the error of the special point and has almost its size. It is false
        if that error is not known (infinite).
        """
        apart = np.abs(self.point.vector - point.vector)
        return bool(np.isfinite(self.error) and apart[0] < self.error and apart[1:].max() < SAME_CYCLE_LOG)


def distance_to(kind: Bifurcation, point: Point) -> float:
    """Return how far the multiplier is from its value at this kind of point, with a sign."""
    return float(_off(kind, point.cycle.multiplier)[0])


def _off(kind: Bifurcation, multiplier: np.ndarray) -> np.ndarray:
    """Return how far multipliers are from their value at this kind of point, with a sign, (count,)."""
    return np.abs(multiplier) - 1 if kind == "torus" else multiplier + (1 if kind == "flip" else -1)


def _at(kind: Bifurcation) -> Condition:
    """Return the condition on an orbit that it lies at this kind of point."""
    return lambda stages, shot: _off(kind, decisive_of(stages, shot))


def changes(first: Point, second: Point) -> tuple[Bifurcation, ...]:
    """Return the kinds of special point (flip, fold, torus) between two neighbours on a branch."""
    if _complex(first) or _complex(second):
        return ("torus",) if (abs(first.multiplier) - 1) * (abs(second.multiplier) - 1) < 0 else ()
    kinds: tuple[Bifurcation, ...] = ("flip", "fold")
    return tuple(kind for kind in kinds if distance_to(kind, first) * distance_to(kind, second) < 0)


def _complex(point: Point) -> bool:
    """Tell whether the multiplier that decides is the modulus of a complex pair."""
    leading = complex(point.cycle.local[0, 0])
    return bool(abs(leading.imag) > 1e-3 and np.isclose(abs(leading), point.multiplier))


def located(tracer: Tracer, first: Point, second: Point, kind: Bifurcation) -> LocatedPoint | None:
    """Locate the special point of this kind between two neighbours on a branch.

    Returns None if a cycle on the way cannot be closed.
    """
    direction = towards(first, second)
    points = _enclosed(tracer, first, second, kind, _last_step(tracer, kind, first.place))
    if points is None:
        return None
    nearest = min(points, key=lambda place: abs(distance_to(kind, points[place])))
    return _special_point(tracer, kind, points[nearest], direction, _slope(kind, points))


def towards(first: Point, second: Point) -> np.ndarray:
    """Return the direction from one point of a branch to another, of length one."""
    direction = second.vector - first.vector
    return direction / np.linalg.norm(direction)


SPECIAL_POINT_TRIES = 30
"""Most steps of the search for a special point. A search with more does not converge."""


def _enclosed(
    tracer: Tracer, first: Point, second: Point, kind: Bifurcation, precise: float
) -> dict[float, Point] | None:
    """Search for a special point between two neighbours on a branch, to a length `precise`.

    The next cycle is closed where the cycles so far predict the special point, slightly farther in the wider part of
    the interval that encloses it. It is closed in the middle where that narrows the interval more slowly than halving.
    Returns all computed cycles by their length along the branch, counted from the first neighbour; None if a cycle
    cannot be closed.
    """
    direction, length = towards(first, second), float(np.linalg.norm(second.vector - first.vector))
    points: dict[float, Point] = {0.0: first, length: second}
    for tries in range(SPECIAL_POINT_TRIES):
        places = np.array(sorted(points))
        distances = np.array([distance_to(kind, points[place]) for place in places.tolist()])
        passed = int(np.flatnonzero(distances[:-1] * distances[1:] <= 0)[0])
        low, high = places[passed : passed + 2].tolist()
        if high - low <= precise or not distances[passed : passed + 2].all():
            return points
        middle, predicted = (low + high) / 2, _predicted(places, distances)
        place = predicted + np.copysign(precise / 2, middle - predicted)
        if not low < place < high or high - low > length * 0.5 ** (tries / 1.5):
            place = middle
        near = min((low, high), key=lambda end: abs(end - place))
        point = tracer.solve(points[near], first.vector + place * direction, direction)
        if point is None:
            return None
        points[place] = point
    return None


def _predicted(places: np.ndarray, distances: np.ndarray) -> float:
    """Return where a distance passes zero, by a cubic through the four values nearest to zero.

    `distances`, shape (n,), are the values at `places`, which the cubic gives as a function of them. The result is NaN
    or infinite if two of these values are equal.
    """
    nearest = np.argsort(np.abs(distances))[:4]
    at, values = places[nearest], distances[nearest]
    others = [np.delete(values, k) for k in range(len(values))]
    with np.errstate(all="ignore"):
        weights = [np.prod(rest / (rest - own)) for own, rest in zip(values, others, strict=True)]
        return float(at @ weights)


def _slope(kind: Bifurcation, points: dict[float, Point]) -> float:
    """Return how fast the multiplier passes its special value, per length along the branch.

    It is taken from the two points nearest to that value. `points` are sorted by their length along the branch.
    """
    (a, first), (b, second) = sorted(points.items(), key=lambda item: abs(distance_to(kind, item[1])))[:2]
    return (distance_to(kind, second) - distance_to(kind, first)) / (b - a)


SPECIAL_POINT_STEP = 1e-7
"""Last step of the search for a special point, far below the decimals shown."""

CHATTERING_STEP_SHARE = 0.25  # [distances of the orbits of a cubic]
"""Last step of the search for a special point where a limiter chatters. Nearer, the scatter of multipliers leads
nowhere; farther off, the cubic's orbits may lie on one side."""


def _last_step(tracer: Tracer, kind: Bifurcation, place: float) -> float:
    """Return the step with which the search for a special point ends.

    Steps are in the space of place, log distance and log time. Where a limiter chatters, multipliers scatter, and those
    of several orbits decide in the end: the search need not come nearer than a fraction of their distances.
    """
    if not tracer.chatters:
        return SPECIAL_POINT_STEP
    return CHATTERING_STEP_SHARE * _reach(tracer, kind, place)


CHATTERING_FOLD_REACH = 0.03
"""Largest distance from a fold at which the multiplier may be 1, where a limiter chatters."""


def _reach(tracer: Tracer, kind: Bifurcation, place: float) -> float:
    """Return how far beside a special point the orbits lie whose multipliers or places are fitted."""
    return CHATTERING_FOLD_REACH if kind == "fold" else tracer.hundredth(place)


def _special_point(
    tracer: Tracer, kind: Bifurcation, point: Point, direction: np.ndarray, slope: float
) -> LocatedPoint:
    """Make a special point of the cycle `point` on a branch, and compute its error.

    `direction`, shape (3,), is that of the branch, and `slope` the change of the multiplier along it. The error is
    infinite if the point cannot be computed at the tighter tolerance, or if multipliers scatter too much.
    """
    if tracer.chatters:
        step, most = -distance_to(kind, point), _last_step(tracer, kind, point.place)
        step = float(np.clip(step / slope, -most, most)) if slope else 0.0
        beside = _turning_point if kind == "fold" else _passed
        located = beside(tracer, kind, point, point.vector + step * direction, direction)
        return located or LocatedPoint(kind, point, np.inf)
    point = replace(point, jacobians=None)  # its last row belongs to a plane, not to the special point
    return LocatedPoint(kind, point, tracer.shift(_at(kind), point))


def _passed(
    tracer: Tracer, kind: Bifurcation, near: Point, guess: np.ndarray, direction: np.ndarray
) -> LocatedPoint | None:
    """Locate a flip or torus by a curve through the multipliers of orbits beside a guess.

    Where a limiter chatters, multipliers scatter and may pass -1 several times, so orbits within a hundredth of the key
    are closed, from the cycle `near` the `guess`. The guess and the `direction` of the branch, (3,), are in the space
    of place, log distance and log time. The error is that of the curve, or the distance at which the multiplier of the
    located point is met, if larger. Returns None if the point cannot be located.
    """
    orbits = _beside(tracer, kind, near, guess, ALONG_KEY)
    passed = crossing(*np.array([(point.place, distance_to(kind, point)) for point in orbits]).reshape(-1, 2).T)
    there = passed and _nearest(tracer, orbits, guess + (passed.place - guess[0]) * ALONG_KEY, ALONG_KEY)
    if not passed or not there:
        return None
    error = max(passed.reserve, abs(distance_to(kind, there) / passed.slope))
    within = error <= _reach(tracer, kind, passed.place)
    return LocatedPoint(kind, there, error) if within else None


def _turning_point(
    tracer: Tracer, kind: Bifurcation, near: Point, guess: np.ndarray, direction: np.ndarray
) -> LocatedPoint | None:
    """Locate a fold by a curve through the places of orbits beside a guess, along the branch.

    Where a limiter chatters, each multiplier is an average over a range of distances, and passes 1 beside the fold. The
    orbits are closed from the cycle `near` the `guess`, which like the `direction` of the branch, (3,), is in the space
    of place, log distance and log time. The error reaches to the place at which the multiplier is 1. Returns None if
    the fold cannot be located.
    """
    orbits = _beside(tracer, kind, near, guess, direction)
    lengths = np.array([(point.vector - guess) @ direction for point in orbits])
    places = np.array([point.place for point in orbits])
    at = turn(lengths, places)
    there = at and _nearest(tracer, orbits, guess + at.length * direction, direction)
    if not at or not there:
        return None
    slope, start = np.polyfit(lengths, [distance_to(kind, point) for point in orbits], 1)
    order = np.argsort(lengths)
    met = np.interp(-start / slope, lengths[order], places[order])
    error = max(at.reserve, 2 * abs(there.place - at.place), abs(float(met) - at.place))
    return LocatedPoint(kind, there, error)


CUBIC_VALUES = 9
"""Values through which a cubic is fitted. With fewer it follows their scatter."""


def _beside(tracer: Tracer, kind: Bifurcation, near: Point, guess: np.ndarray, direction: np.ndarray) -> list[Point]:
    """Return orbits on both sides of a guessed special point, in steps along a direction.

    The `guess` and the `direction`, (3,), are in the space of place, log distance and log time. The orbits are closed
    at once, from the cycle `near` them.
    """
    reach, count = _reach(tracer, kind, float(guess[0])), CUBIC_VALUES
    return tracer.solve_all(near, guess + np.linspace(-reach, reach, count)[:, None] * direction, direction)


def _nearest(tracer: Tracer, orbits: Sequence[Point], target: np.ndarray, normal: np.ndarray) -> Point | None:
    """Find the cycle on the plane through `target` with the `normal`, from the nearest of some orbits."""
    near = min(orbits, key=lambda point: float(np.linalg.norm(point.vector - target)))
    return tracer.solve(near, target, normal)


def special_points(tracer: Tracer, branch: Branch) -> list[LocatedPoint]:
    """Locate the points of a branch where a multiplier passes the unit circle.

    A fold at which asymmetric cycles only meet the symmetric one is left out. A point next to which cycles cannot be
    closed is left out, too.
    """
    specials = [located(tracer, *pair, kind) for pair in pairwise(branch.points) for kind in changes(*pair)]
    return [special for special in specials if special and not _meets_symmetric(tracer, special)]


def _meets_symmetric(tracer: Tracer, special: LocatedPoint) -> bool:
    """Tell whether a fold is in fact where an asymmetric branch meets the symmetric one.

    The middle of the cycle then lies on the reference.
    """
    cycle = special.point.cycle
    leans = abs(cycle.middle[0]) > 0.02 * cycle.amplitude[0]
    stages = tracer.family(np.zeros(1, np.int64), np.array([special.point.place]))
    return bool(special.kind == "fold" and tracer.sign > 0 and stages.symmetric[0] and not leans)
