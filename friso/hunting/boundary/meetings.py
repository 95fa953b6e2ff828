"""Find where curves of the edge of hunting meet in the plane of two keys.

They cross, run together, or end on one another. Curves are straight between their points, which are at most a twentieth
of the ranges apart. A crossing is then refined with cycles. That two curves meet says nothing about their cycles: one
stage may have both at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal, NamedTuple

import numpy as np

from friso.hunting.boundary.curve import CLOSED, Curve, CurveTracer, Spot, unit_vector
from friso.hunting.boundary.settings import meeting_settings
from friso.hunting.boundary.space import Space
from friso.hunting.continuation.branch import END_OF_RANGE

MeetingKind = Literal["cross", "together", "end"]
"""Kind of meeting of two curves: they cross, run together over a stretch, or the first one ends on the second."""


@dataclass(frozen=True)
class Meeting:
    """Meeting of two curves in a plane; a curve that crosses itself has its number twice.

    `places` are coordinates in the box of the keys, 0 to 1 along each: shape (1, 2), or (2, 2) for both ends of a
    stretch. `error` is their error along each key (infinite: not refined). `same_cycle` is true if both curves are
    changes of one cycle, false for two cycles of one stage.
    """

    curves: tuple[int, int]
    kind: MeetingKind
    places: np.ndarray
    error: np.ndarray
    same_cycle: bool


def find_meetings(space: Space, curves: Sequence[Curve], rtol: float) -> tuple[Meeting, ...]:
    """Find where curves cross, run together or end on one another.

    Crossings are refined by cycles closed to the relative tolerance `rtol`. A crossing or end is left out if it lies at
    another crossing of both curves, or where they run together.
    """
    meetings: list[Meeting] = []
    for first, second in combinations(range(len(curves)), 2):
        pair = [*_stretches(curves, first, second)] or [*_stretches(curves, second, first)]
        others = [_crossings(space, curves, (first, second), rtol), *_ends_on(curves, first, second)]
        for meeting in (*others[0], *others[1:], *_ends_on(curves, second, first)):
            pair += [meeting] if not any(_lies_on(meeting.places[0], other) for other in pair) else []
        meetings += pair
    for number in range(len(curves)):
        meetings += _crossings(space, curves, (number, number), rtol)
    return tuple(meetings)


def _lies_on(place: np.ndarray, meeting: Meeting) -> bool:
    """Tell whether a place in the box, shape (2,), lies at a meeting: near its point or stretch."""
    path = np.vstack([meeting.places, meeting.places[-1:]])
    shares = leg_shares(path, place)
    away = np.linalg.norm(path[:-1] + shares[:, None] * np.diff(path, axis=0) - place, axis=1).min()
    return bool(away < meeting_settings.end_distance)


def _closed_path(curve: Curve) -> tuple[np.ndarray, list[Spot]]:
    """Return the points of a curve, (n, 2), and its spots with their cycles.

    A ring repeats its first point in both.
    """
    again = CLOSED in curve.ends
    spots = [*curve.spots, *curve.spots[:1]] if again else [*curve.spots]
    return (np.vstack([curve.points, curve.points[:1]]) if again else curve.points), spots


class _Nearest(NamedTuple):
    """What is nearest on a curve to some point: the distance `away`, and the cycle there.

    `cycle` holds log amplitude and log period of the cycle, shape (2,).
    """

    away: float
    cycle: np.ndarray


def _nearest(curve: Curve, at: np.ndarray) -> _Nearest:
    """Find the point of a curve nearest to coordinates in the box, shape (2,), and its cycle.

    The curve is straight between its points.
    """
    path, spots = _closed_path(curve)
    sizes = np.array([_size(spot) for spot in spots])
    shares = leg_shares(path, at)
    away = np.linalg.norm(path[:-1] + shares[:, None] * np.diff(path, axis=0) - at, axis=1)
    leg = int(away.argmin())
    return _Nearest(float(away[leg]), sizes[leg] + shares[leg] * (sizes[leg + 1] - sizes[leg]))


def leg_shares(path: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return where on each leg of a path the point nearest to `at`, shape (2,), lies.

    The legs are the straight pieces between the points of the path, (n, 2). The results, (n - 1,), run from 0 at the
    start of a leg to 1 at its end.
    """
    legs = np.diff(path, axis=0)
    return np.clip(((at - path[:-1]) * legs).sum(axis=1) / np.maximum((legs**2).sum(axis=1), 1e-30), 0, 1)


def _size(spot: Spot) -> np.ndarray:
    """Return log amplitude [m] and log period [s] of the cycle at a point of a curve, (2,)."""
    cycle = spot.special.point.cycle
    return np.log([cycle.amplitude[0], cycle.period[0]])


def _alike(one: np.ndarray, other: np.ndarray) -> bool:
    """Tell from log amplitude and log period, shape (2,), whether two cycles are the same.

    A cycle of twice the period counts as the same.
    """
    size, period = np.abs(one - other)
    return bool(max(size, min(period, abs(period - np.log(2)))) < meeting_settings.same_cycle_log)


def _stretches(curves: Sequence[Curve], first: int, second: int) -> Iterator[Meeting]:
    """Find stretches over which curve `second` repeats curve `first`, with the same cycle.

    This happens where a curve was lost and then followed again. A curve that crosses at an angle stays near over a
    shorter stretch.
    """
    on: list[np.ndarray] = []
    for spot in (*curves[second].spots, None):
        near = None if spot is None else _nearest(curves[first], spot.at)
        if spot and near and near.away < meeting_settings.together_distance and _alike(near.cycle, _size(spot)):
            on.append(spot.at)
            continue
        if len(on) > 1 and np.linalg.norm(on[-1] - on[0]) > meeting_settings.together_length:
            error = np.full(2, meeting_settings.together_distance)
            yield Meeting((first, second), "together", np.array([on[0], on[-1]]), error, True)
        on = []


def _crossings(space: Space, curves: Sequence[Curve], numbers: tuple[int, int], rtol: float) -> Iterator[Meeting]:
    """Find where two curves cross, or one crosses itself if both `numbers` are equal."""
    first, second = (curves[number] for number in numbers)
    (path, spots), (other_path, other_spots) = _closed_path(first), _closed_path(second)
    legs, others = np.diff(path, axis=0), np.diff(other_path, axis=0)
    apart = other_path[None, :-1] - path[:-1, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        across = _cross(legs[:, None], others[None])
        shares = _cross(apart, others[None]) / across, _cross(apart, legs[:, None]) / across
    crossed = np.all([(share >= 0) & (share < 1) for share in shares], axis=0)
    ring = numbers[0] == numbers[1] and CLOSED in first.ends
    if numbers[0] == numbers[1]:  # neighbouring legs have a point in common
        crossed = np.triu(crossed, 2)
    for k, m in zip(*(index.tolist() for index in np.nonzero(crossed)), strict=True):
        place = path[k] + shares[0][k, m] * legs[k]
        pairs = spots[k : k + 2], other_spots[m : m + 2]
        if ring and np.linalg.norm(place - path[0]) < meeting_settings.end_distance:
            continue  # the start of the ring, which was followed a little beyond its end
        yield _refined(space, curves, numbers, place, pairs, rtol)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return cross products, shape (...), of vectors in the plane, shape (..., 2)."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _refined(
    space: Space,
    curves: Sequence[Curve],
    numbers: tuple[int, int],
    guess: np.ndarray,
    pairs: Sequence[Sequence[Spot]],
    rtol: float,
) -> Meeting:
    """Refine a guessed crossing of two curves by their `numbers`, or of one curve with itself.

    `pairs` are the two neighbouring points of each curve about it. The next guess is where the tangents of both curves
    cross. The first guess is returned if a cycle is lost on the way. It is also returned if a limiter chatters, because
    one point then costs as much as many.
    """
    place = guess
    refinements = 0 if space.stages(guess[None]).chatters else meeting_settings.crossing_refinements
    ways = [unit_vector(last.at - first.at) for first, last in pairs]
    spots = [min(pair, key=lambda spot: float(np.linalg.norm(spot.at - guess))) for pair in pairs]
    tracers = [CurveTracer(space, curves[number].kind, curves[number].sign, rtol) for number in numbers]
    for _ in range(refinements):
        near = [
            tracer.on_line(place, way[::-1] * [-1.0, 1.0], spot, meeting_settings.crossing_reach)
            for tracer, way, spot in zip(tracers, ways, spots, strict=True)
        ]
        one, other = near
        if one is None or other is None:
            break
        chords = [new.at - old.at for new, old in zip((one, other), spots, strict=True)]
        ways = [_turned(way, chord) for way, chord in zip(ways, chords, strict=True)]
        spots, before = [one, other], place
        place = one.at + _cross(other.at - one.at, ways[1]) / _cross(*ways) * ways[0]
        if not np.abs(place - guess).max() < meeting_settings.crossing_reach:
            break
        moved = np.abs(place - before)
        if moved.max() < meeting_settings.crossing_precision:
            error = moved + one.error + other.error
            return Meeting(numbers, "cross", place[None], error, _alike(_size(one), _size(other)))
    sizes = [_nearest(curves[number], guess).cycle for number in numbers]
    return Meeting(numbers, "cross", guess[None], np.full(2, np.inf), _alike(*sizes))


def _turned(way: np.ndarray, chord: np.ndarray) -> np.ndarray:
    """Return the direction of a curve after a step from one of its points to the next.

    `chord` is the step, and `way` the direction before it. The direction stays if the step is tiny, or almost across
    the curve. Directions have length one, shape (2,).
    """
    along, length = abs(float(chord @ way)), float(np.linalg.norm(chord))
    return (
        unit_vector(chord)
        if along > max(meeting_settings.crossing_precision, meeting_settings.chord_along * length)
        else way
    )


def _ends_on(curves: Sequence[Curve], number: int, other: int) -> Iterator[Meeting]:
    """Find the ends of the curve `number` that lie on the curve `other`, with the same cycle.

    Ends on the sides of the box, and those of a ring, do not count.
    """
    curve = curves[number]
    for how, spot in zip(curve.ends, (curve.spots[0], curve.spots[-1]), strict=True):
        if how not in (END_OF_RANGE, CLOSED):
            near = _nearest(curves[other], spot.at)
            if near.away < meeting_settings.end_distance and _alike(near.cycle, _size(spot)):
                yield Meeting((number, other), "end", spot.at[None], np.full(2, near.away), True)
