"""Interpolate a stage's return map, and iterate it to attractors.

The map takes one landing, the distance at which the stage sticks, to the next.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from friso.hunting.attractors.rounds import LEAST_SWING
from friso.hunting.return_map.curve import (
    BREAK_JUMP_LOG,
    FIRST_COORDINATE,
    NEGATIVE_SIDE_SHIFT,
    REST_COORDINATE,
    SCATTER_RANGE_LOG,
    Cubics,
    at_rest,
    curve,
    fitted,
    join,
    piece_about,
    shifts_of,
    side_by_side,
)
from friso.hunting.return_map.iterated import SAME_ATTRACTOR_SHARE, MapLine, repeats_after
from friso.hunting.return_map.landings import Landings

BISECTIONS = 40
"""Halvings of an interval of coordinates, after which it is as exact as `repeated_share`."""


@dataclass(frozen=True)
class MapAttractor:
    """Attractor of a return map.

    `distances`, shape (swings,), are signed distances of successive landings, in deflections of the loop by the
    break-away force. `basin` (points,) are the points of the map that lead to the attractor. A `periodic` attractor is
    a cycle of as many swings; otherwise the distances are the last landings of an irregular motion.
    """

    distances: np.ndarray
    basin: np.ndarray
    periodic: bool


@dataclass(frozen=True)
class FixedPoint:
    """Simple cycle of a return map: of one swing, or of two if its sides differ.

    `distance` is that of a landing, signed, in deflections of the loop by the break-away force. `slope` is the factor
    by which a small deviation grows per repetition, with its sign, and `error` its standard error (infinite: too few
    landings tell it). Landings scatter about the map by the share `scatter`.
    """

    distance: float
    slope: float
    error: float
    scatter: float


REPEATED_SHARE = 1e-9
"""Largest error of a repetition that is exact. Beside a break of the map a landing differs by more."""

SURE_ERRORS = 3.0  # [standard errors]
"""Errors of a slope by which a cycle must be unstable to be told so for sure."""

LEAST_ARRIVING_POINTS = 4
"""Fewest points of a map that must lead to an attractor. Fewer come from gaps of the map."""

HARDLY_ATTRACTING_SHARE = 0.95
"""Largest fraction of a deviation left per repetition at which a sketched attractor is trusted. Above it, 51 of 149
sketched attractors did not attract."""


@dataclass(frozen=True)
class LandingMap:
    """Return map of one stage: landings and the next ones, in ascending order of distance.

    A landing is where the stage sticks after a swing.

    - `before` (points,): signed distances of landings; without sign where the stage is `symmetric`.
    - `after` (points,): distances of the next landings, 0 where the stage rests, infinite where it diverges.
    - `run` (points,): number of the run of each point; `final` (points,): whether that run ended with the next landing,
      so that it may be continued.
    - `lost`: number of runs that were not completed.

    Distances are in deflections of the loop by the break-away force.
    """

    before: np.ndarray
    after: np.ndarray
    run: np.ndarray
    final: np.ndarray
    symmetric: bool
    lost: int

    @classmethod
    def of(cls, landings: Landings, length: float, symmetric: bool) -> LandingMap:
        """Make the map from the landings of runs of one stage: where it sticks after each swing.

        The starts are left out, because the landing after a start depends on how the run began. `length` [m] is the
        deflection of the loop by the break-away force. If the stage is `symmetric`, distances lose their signs.
        """
        distances = landings.distances / length
        ended = np.where(landings.rest, 0.0, np.where(landings.away, np.inf, np.nan))
        distances, count = _without_excursions(np.abs(distances) if symmetric else distances, landings.count)
        columns: list[tuple[Any, ...]] = []
        for k in range(1, distances.shape[1]):
            here = distances[:, k]
            ahead = distances[:, min(k + 1, distances.shape[1] - 1)]
            following = np.where(k < count, ahead, ended)
            following = np.where(np.abs(following) < LEAST_SWING, 0.0, following)
            which = np.flatnonzero((np.abs(here) >= LEAST_SWING) & ~np.isnan(following) & (k <= count))
            columns.append((here[which], following[which], which, k + 1 == count[which]))
        before, after, run, final = (np.concatenate(part) for part in zip(*columns, strict=True))
        order = np.argsort(before, kind="stable")
        lost = int(np.count_nonzero(landings.lost & ~landings.away))
        return cls(before[order], after[order], run[order], final[order], symmetric, lost)

    def renumbered(self, runs: np.ndarray) -> LandingMap:
        """Return the map with its runs renumbered: run k gets the number `runs[k]`."""
        return replace(self, run=runs[self.run])

    @property
    def sides(self) -> tuple[float, ...]:
        """Return the sides of the reference that the map treats separately: 1 alone, or 1 and -1."""
        return (1.0,) if self.symmetric else (1.0, -1.0)

    def points(self, side: float) -> np.ndarray:
        """Return the numbers of the points on a side, 1 or -1, by ascending distance."""
        return np.flatnonzero(self.before * side > 0)[:: int(side)]

    @property
    def gain(self) -> np.ndarray:
        """Return the distance of the next landing over that of the present one, shape (points,)."""
        return np.abs(self.after / self.before)

    @cached_property
    def _curve(self) -> Cubics:
        """Return the map as a function of coordinates (see `_place`)."""
        parts = [at_rest(FIRST_COORDINATE)]
        for side in self.sides:
            places, after = self._going(side)
            if places.size:
                parts.append(curve(places, after, bool(self.gain[self.points(side)[-1]] < 1)))
            parts.append(at_rest(NEGATIVE_SIDE_SHIFT / 2 if side > 0 else np.inf))
        return join(parts)

    def _going(self, side: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the coordinates of landings on a side and of the next ones, -inf for rest, by ascending distance."""
        points = self.points(side)
        after = self.after[points]
        goes = np.isfinite(after) & (after != 0)
        return _place(self.before[points]), np.where(goes, _place(np.where(goes, after, 1.0)), -np.inf)

    @cached_property
    def _line(self) -> MapLine:
        """Return the map as one that may be iterated."""
        return MapLine(self._curve)

    def _repeated(self, places: np.ndarray) -> np.ndarray:
        """Return the coordinates after as many landings as there are sides, which bring a simple cycle back."""
        for _ in self.sides:
            places = self._line.next(places)
        return places

    def fixed_points(self) -> Iterator[FixedPoint]:
        """Yield the simple cycles of the map, by their landings on the first side, in ascending order of distance."""
        begins = self._curve.begins
        begins = begins[np.abs(begins) < NEGATIVE_SIDE_SHIFT / 2]
        places = np.sort(np.concatenate([begins, (begins[1:] + begins[:-1]) / 2]))
        off = self._repeated(places) - places
        k = np.flatnonzero((off[:-1] * off[1:] <= 0) & (off[1:] != 0))
        low, high, rises = places[k], places[k + 1], off[k] > 0
        for _ in range(BISECTIONS):
            at = (low + high) / 2
            below = (self._repeated(at) > at) == rises
            low, high = np.where(below, at, low), np.where(below, high, at)
        for at in low[np.abs(self._repeated(low) - low) < REPEATED_SHARE]:  # not a break of the map
            slope, error, scatter, place = 1.0, 0.0, 0.0, np.array([at])
            for _ in self.sides:
                places, after = self._going(-1.0 if place[0] > NEGATIVE_SIDE_SHIFT / 2 else 1.0)
                near = piece_about(places, after, float(place[0]))
                fit = fitted(places[near], after[near], place)
                one = float((fit.slope if fit.good[0] else self._curve.slope(place))[0])
                slope, error = slope * one, float(np.hypot(error * one, slope * fit.error[0]))
                scatter, place = max(scatter, float(np.nan_to_num(fit.scatter[0]))), self._line.next(place)
            yield FixedPoint(float(_distance(np.array([at]))[0]), slope, error, scatter)

    @cached_property
    def attractors(self) -> tuple[MapAttractor, ...]:
        """Return the map's attractors, in which a stage swings for ever, from any of its points."""
        return attractors_of((self,))[0]

    def surely_attracts(self, attractors: Sequence[MapAttractor]) -> bool:
        """Tell whether one of the map's `attractors` can be trusted though its points are few.

        It is a simple cycle that is surely stable, or one that is strongly stable and reached from enough points. Other
        motions that go on may come from gaps between points.
        """
        return any(
            one.periodic
            and len(one.distances) == len(self.sides)
            and one.basin.size >= LEAST_ARRIVING_POINTS
            and self.slope(one) <= HARDLY_ATTRACTING_SHARE
            for one in attractors
        ) or any(abs(point.slope) + SURE_ERRORS * point.error < 1 for point in self.fixed_points())

    def foretold(self, distances: np.ndarray) -> np.ndarray:
        """Predict the landings that follow landings at signed distances, (count,); 0 for rest.

        All distances are in the unit of the map, deflections of the loop by the break-away force.
        """
        return _distance(self._line.next(self._places(distances)))

    def goes_on(self, distances: np.ndarray) -> np.ndarray:
        """Return which landings, as signed distances, lead to swinging for ever, (count,)."""
        at = self._places(distances)
        return np.all(self._line.followed(at, np.zeros(len(at))) > REST_COORDINATE, axis=1)

    def _places(self, distances: np.ndarray) -> np.ndarray:
        """Return the coordinates on the map (see `_place`) of landings at signed distances."""
        at = np.abs(distances) if self.symmetric else distances
        moves = np.isfinite(at) & (np.abs(at) >= LEAST_SWING)
        return np.where(moves, _place(np.where(moves, at, 1.0)), REST_COORDINATE)

    def _told_apart(self, paths: np.ndarray) -> Iterator[MapAttractor]:
        """Yield each attractor once, from paths that end on attractors.

        Paths are coordinates on the map (see `_place`), shape (points, landings).
        """
        left = np.all(paths > REST_COORDINATE, axis=1)
        swings = repeats_after(paths, self.symmetric)
        while left.any():
            number = int(np.flatnonzero(left)[0])
            if not swings[number]:  # the path that spreads most shows the whole attractor
                number = int(np.where(left & (swings == 0), np.ptp(paths, axis=1), -1.0).argmax())
            first, count = paths[number], int(swings[number])
            near = np.abs(paths[:, :, None] - first[None, None, : max(count, 1)]) < SAME_ATTRACTOR_SHARE
            same = left & (near.any(axis=1).all(axis=1) if count else (swings == 0) & _mixed(paths, first))
            same[number] = True
            yield MapAttractor(_distance(first[: count or len(first)]), np.flatnonzero(same), count > 0)
            left &= ~same

    def slope(self, attractor: MapAttractor) -> float:
        """Return by what factor a small deviation from an attractor grows per repetition.

        It is read off the map, without sign, and infinite if the attractor does not repeat.
        """
        if not attractor.periodic:
            return np.inf
        return float(np.abs(np.prod(self._curve.slope(self._places(attractor.distances)))))

    @property
    def scatter(self) -> float:
        """Return the largest relative error of a landing predicted by neighbours.

        It is infinite if a stage comes to rest after one landing but swings on alike after both neighbours of it, or
        the reverse, and 0 if no three points are close together. Only points whose next landing is at more than half of
        their distance count.
        """
        worst = 0.0
        for side in self.sides:
            points = self.points(side)
            if len(points) < 3:
                continue
            u, after = np.log(np.abs(self.before[points])), self.after[points]
            goes = np.isfinite(after) & (after != 0)
            with np.errstate(all="ignore"):
                v = np.log(np.abs(after))
                share = (u[1:-1] - u[:-2]) / np.maximum(u[2:] - u[:-2], 1e-12)
                off = np.abs(v[1:-1] - (1 - share) * v[:-2] - share * v[2:])
                alike = (goes[:-2] == goes[2:]) & ~(np.abs(v[2:] - v[:-2]) > BREAK_JUMP_LOG)
            off = np.where(goes[1:-1] & goes[:-2] & goes[2:], off, np.where(goes[:-2] != goes[1:-1], np.inf, 0.0))
            off = np.where(alike & (u[2:] - u[:-2] < SCATTER_RANGE_LOG), off, 0.0)
            off[np.fmax(v[1:-1] - u[1:-1], v[2:] - u[2:]) < np.log(0.5)] = 0.0
            worst = max(worst, float(off.max()))
        return worst


def attractors_of(maps: Sequence[LandingMap]) -> list[tuple[MapAttractor, ...]]:
    """Return the attractors of each of several maps, which are iterated together from their points."""
    counts = [one.after.size for one in maps]
    starts = np.concatenate([one._places(one.after) for one in maps])
    paths = MapLine(side_by_side([one._curve for one in maps])).followed(starts, shifts_of(counts))
    parts = np.split(paths, np.cumsum(counts[:-1]))
    return [tuple(one._told_apart(part)) for one, part in zip(maps, parts, strict=True)]


def _place(distances: np.ndarray) -> np.ndarray:
    """Return coordinates on the map: logarithms of distances, shifted where they are negative."""
    return np.log(np.abs(distances)) + NEGATIVE_SIDE_SHIFT * (distances < 0)


def _distance(places: np.ndarray) -> np.ndarray:
    """Return signed distances from coordinates on the map (see `_place`)."""
    negative = places > NEGATIVE_SIDE_SHIFT / 2
    return np.where(negative, -1.0, 1.0) * np.exp(np.where(negative, places - NEGATIVE_SIDE_SHIFT, places))


FARTHEST_STICKING = 3.0  # [deflections at break-away]
"""Farthest distance of sticking. From farther off a stage passes its reference without sticking."""


def _without_excursions(distances: np.ndarray, count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Leave out landings beyond `farthest_sticking` from which a run comes back.

    From so far a stage passes its reference without sticking, so distance alone does not decide what follows.
    `distances` have the shape (runs, landings), the start first. Returns the remaining distances, and how many there
    are in each run, without the start.
    """
    rows, order = np.arange(len(distances))[:, None], np.arange(distances.shape[1])
    near = (np.abs(distances) <= FARTHEST_STICKING) & (order <= count[:, None])
    last = np.where(near.any(axis=1), distances.shape[1] - 1 - near[:, ::-1].argmax(axis=1), -1)
    kept = (near | (order > last[:, None]) | (order == 0)) & (order <= count[:, None])
    kept_first = np.argsort(~kept, axis=1, kind="stable")
    left = kept.sum(axis=1)
    return np.where(order < left[:, None], distances[rows, kept_first], np.nan), left - 1


def _mixed(paths: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Return which paths are on the irregular attractor of the path `first`, shape (points,).

    Paths are on it if they spread over the same range.
    """
    return (paths.min(axis=1) > first.min() - 10 * SAME_ATTRACTOR_SHARE) & (
        paths.max(axis=1) < first.max() + 10 * SAME_ATTRACTOR_SHARE
    )
