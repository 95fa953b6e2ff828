"""Follow the edge of hunting in two keys: the curve on which a cycle changes its stability.

The cycle has a flip, fold or torus there. Each point is predicted, then corrected on a line across the curve, along
which the cycle forms a branch. At a flip or torus the correction moves along the keys. At a fold it moves along the
cycle's distance and time, because there is no cycle beyond.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.polynomial.polynomial import polyder, polyfit, polyval

from friso.engine.side_by_side import side_by_side
from friso.hunting.boundary.space import Space
from friso.hunting.continuation.branch import END_OF_RANGE, Tracer
from friso.hunting.continuation.locate import ALONG_KEY, Bifurcation, LocatedPoint, met, met_by_secants
from friso.hunting.continuation.settings import continuation_settings
from friso.hunting.cycle.find import CYCLE_RTOL


@dataclass(frozen=True)
class Spot:
    """Point of a curve on which a cycle changes its stability: a flip, fold or torus.

    `at`, shape (2,), are its coordinates in the box of the two keys, each from 0 to 1. `special` is the located point
    of the cycle. `across`, shape (2,), is the direction of the line on which it was located.
    """

    at: np.ndarray
    special: LocatedPoint
    across: np.ndarray

    @property
    def size(self) -> np.ndarray:
        """Return logarithms of the cycle's distance [m] and time [s], shape (2,)."""
        return self.special.point.vector[1:]

    @property
    def error(self) -> np.ndarray:
        """Return the error of the point's coordinates along each key, shape (2,).

        It is infinite if the error is not known.
        """
        if not np.isfinite(self.special.error):
            return np.full(2, np.inf)
        return np.abs(self.special.error * self.across)


@dataclass(frozen=True)
class Curve:
    """Curve on which cycles of one kind change their stability: its spots in order.

    `kind` says how: by a flip, fold or torus. `sign` is -1 for cycles closed over half a period, 1 for a whole one.
    `ends` say in words why the curve ends on either side; both are "closed" for a ring.
    """

    kind: Bifurcation
    sign: float
    spots: tuple[Spot, ...]
    ends: tuple[str, str]

    @property
    def points(self) -> np.ndarray:
        """Return the curve in the box of the keys, shape (spots, 2)."""
        return np.array([spot.at for spot in self.spots])


@dataclass(frozen=True)
class Expected:
    """Prediction of the next point of a curve.

    `at`, shape (2,), are its coordinates in the box of the keys, each from 0 to 1; `size` are the logarithms of the
    cycle's distance [m] and time [s]. `states` (1, states) lie on the cycle, and `direction`, shape (2,), is the
    direction of the curve there.
    """

    at: np.ndarray
    size: np.ndarray
    states: np.ndarray
    direction: np.ndarray

    @classmethod
    def beyond(cls, spots: Sequence[Spot], step: float) -> Expected:
        """Extrapolate a curve one step, by a parabola through its last three points or a line."""
        last = spots[-3:]
        away = [-float(np.linalg.norm(spot.at - last[-1].at)) for spot in last]
        rows = [np.concatenate([spot.at, spot.size, spot.special.point.cycle.states[0]]) for spot in last]
        parabola = polyfit(away, rows, len(last) - 1)
        there, ahead = (np.asarray(polyval(step, of)) for of in (parabola, polyder(parabola)))
        return cls(there[:2], there[2:4], there[None, 4:], unit_vector(ahead[:2]))


class CurveTracer:
    """Tracer of the points of a flip, a fold or a torus through the box of two keys."""

    def __init__(self, space: Space, kind: Bifurcation, sign: float, rtol: float = CYCLE_RTOL) -> None:
        self.space, self.sign, self.rtol = space, sign, rtol
        self.kind: Bifurcation = kind

    def on_line(
        self, origin: np.ndarray, across: np.ndarray, near: Spot, reach: float, expected: Expected | None = None
    ) -> Spot | None:
        """Find the point of the curve on a line, at most `reach` from the line's `origin`.

        The line has the direction `across`. The search starts from the known point `near` the one sought, or from the
        `expected` one. Returns None if it fails.
        """
        hundredth = self.space.hundredth(origin, across)
        tracer = Tracer(self.space.lines(origin[None], across[None]), self.sign, self.rtol, hundredth=hundredth)
        special, size, states = near.special, near.size, near.special.point.cycle.states
        if expected is not None:
            size, states = expected.size, expected.states
        direction, far = ALONG_KEY, reach
        if self.kind == "fold":
            direction, far = special.direction * [0.0, 1.0, 1.0], continuation_settings.fold_search_depth
            direction = direction / np.linalg.norm(direction)
        search = (tracer, special, np.concatenate([[0.0], size]), direction, far, states)
        located = met_by_secants(*search, self._slope(near, across, expected)) if tracer.chatters else met(*search)
        if located is None or abs(located.point.place) > reach:
            return None
        return Spot(origin + located.point.place * across, located, across)

    def _slope(self, near: Spot, across: np.ndarray, expected: Expected | None) -> float:
        """Estimate how fast the multiplier changes along the line on which a point is expected.

        The slope across the curve is taken from the point `near`; along an oblique line it is smaller. Returns NaN if
        the line through that point is almost tangent to the curve.
        """
        if self.kind == "fold":
            return near.special.slope
        if expected is None:  # the lines are parallel
            return near.special.slope / float(near.special.direction[0])
        normal = expected.direction[::-1] * [-1.0, 1.0]
        crossing = float(normal @ near.across)
        if abs(crossing) < continuation_settings.grazing_sine:
            return np.nan
        return near.special.slope * float(normal @ across) / crossing / float(near.special.direction[0])

    def curve(self, first: Spot) -> Curve | None:
        """Follow the whole curve through a point; None if no second point is found next to it."""
        aside = first.across[::-1] * [1.0, -1.0]
        for side in (continuation_settings.second_point_distance, -continuation_settings.second_point_distance):
            neighbour = first.at + side * aside
            if np.any((neighbour < 0) | (neighbour > 1)):
                continue
            second = self.on_line(neighbour, first.across, first, 20 * continuation_settings.second_point_distance)
            if second is not None:
                break
        else:
            return None
        ways = [first, second], [second, first]
        (after, last), (before, beginning) = side_by_side([partial(self.walk, way) for way in ways])
        if last == CLOSED:
            return Curve(self.kind, self.sign, tuple(after), (CLOSED, CLOSED))
        return Curve(self.kind, self.sign, (*before[:1:-1], *after), (beginning, last))

    def walk(self, spots: list[Spot]) -> tuple[list[Spot], str]:
        """Follow a curve from its first points, two or more; return all points, and why it ends."""
        start, step = spots[0], continuation_settings.first_curve_step
        direction = unit_vector(spots[1].at - spots[0].at)
        while len(spots) <= continuation_settings.most_curve_steps:
            last = spots[-1]
            ahead = last.at + step * direction
            if np.any((ahead < 0) | (ahead > 1)):
                side = self._at_the_side(spots, direction, step)
                return [*spots, *side], END_OF_RANGE if side else self._lost(last)
            across, expected = direction[::-1] * [-1.0, 1.0], Expected.beyond(spots, step)
            ahead = ahead + (expected.at - ahead) @ across * across
            spot = self.on_line(ahead, across, last, continuation_settings.aside_of_prediction * step, expected)
            moved = np.zeros(2) if spot is None else spot.at - last.at
            if spot is None or moved @ direction < np.cos(continuation_settings.curve_turn_per_step) * np.linalg.norm(
                moved
            ):
                step /= 2
                if step < continuation_settings.shortest_curve_step:
                    return spots, self._lost(last)
                continue
            spots = [*spots, spot]
            direction, step = unit_vector(moved), min(1.4 * step, continuation_settings.longest_curve_step)
            if len(spots) > 7 and np.linalg.norm(spot.at - start.at) < step:
                return spots, CLOSED
        return spots, "it was followed for as many steps as there may be"

    def _at_the_side(self, spots: list[Spot], direction: np.ndarray, step: float) -> list[Spot]:
        """Find where the curve leaves the box of the keys; return that point in a list, or none.

        The curve goes on from the last of `spots` in this `direction`, shape (2,), and leaves within a `step`.
        """
        last = spots[-1]
        with np.errstate(divide="ignore", invalid="ignore"):
            times = np.where(
                direction > 0, (1 - last.at) / direction, np.where(direction < 0, -last.at / direction, np.inf)
            )
        side = int(np.argmin(times))
        across = np.array([0.0, 1.0]) if side == 0 else np.array([1.0, 0.0])
        expected = Expected.beyond(spots, times[side])
        spot = self.on_line(np.clip(last.at + times[side] * direction, 0, 1), across, last, 2 * step, expected)
        inside = spot is not None and bool(np.all((spot.at >= 0) & (spot.at <= 1)))
        return [spot] if spot is not None and inside else []

    def _lost(self, last: Spot) -> str:
        """Return the reason why a curve ends at its last spot, if no further one is found."""
        return f"it could not be followed farther than {self._named(last.at)}"

    def _named(self, at: np.ndarray) -> str:
        """Return keys with their values and units, in words, at coordinates (2,) in the box."""
        values = self.space.values(at[None])
        units = [swept.unit for swept in self.space.ranges]
        named = zip(values.items(), units, strict=True)
        return ", ".join(f"{key} = {value[0]:.6g} {unit}".rstrip() for (key, value), unit in named)


def unit_vector(vector: np.ndarray) -> np.ndarray:
    """Scale a vector, shape (n,), to length one."""
    return vector / np.linalg.norm(vector)


CLOSED = "closed"
"""Reason given when a curve comes back to its start."""
