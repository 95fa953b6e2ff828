"""Find all edges of hunting in the plane of two keys, from a grid of cycles."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count

import numpy as np

from friso.engine.side_by_side import side_by_side
from friso.hunting.attractors.survey import Swinging
from friso.hunting.boundary.curve import Curve, CurveTracer, Spot
from friso.hunting.boundary.space import Space
from friso.hunting.continuation.branch import Point, Tracer
from friso.hunting.continuation.locate import changes, located
from friso.hunting.continuation.settings import continuation_settings
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import CYCLE_RTOL, Cycles, families, symmetric_cycles, whole_cycles
from friso.hunting.cycle.hunting import surely_surveyed
from friso.hunting.edge_search import Beyond, EdgeSearch
from friso.hunting.loop import unstable_among
from friso.hunting.path import ParameterPath
from friso.hunting.settings import edge_settings
from friso.hunting.what_attracts import what_attracts
from friso.progress import Progress, Tally, silent

CURVES = "following the edge of hunting"
"""Progress message while curves are followed."""


@dataclass(frozen=True)
class Plane:
    """Edges of hunting in the box of two keys.

    - `curves`: the edges.
    - `nodes`: stages along each side of the grid; `allowed`: numbers of the valid ones in C order, the first key along
      the first side.
    - `cycles`: hunting cycles of the allowed stages; `attracts`: whether they have an attractor; `decided`: whether
      that is known.
    - `unstable`: whether the loop is unstable regardless of friction.
    - `gaps`: places, shape (2,), at which a change was seen but no curve could be begun.
    - `last_ends`: where hunting ends farther out than the curves between two nodes, by another cycle or motion.
    """

    space: Space
    curves: tuple[Curve, ...]
    nodes: int
    allowed: np.ndarray
    cycles: Cycles
    attracts: np.ndarray
    decided: np.ndarray
    unstable: np.ndarray
    gaps: tuple[np.ndarray, ...]
    last_ends: tuple[LastEnd, ...] = ()


@dataclass(frozen=True)
class LastEnd:
    """Where hunting ends between two neighbours of the grid, beyond the curves that pass between them.

    `inside` and `outside`, shape (2,), are coordinates in the box of the keys: something attracts at the first and
    nothing at the second. The end is `certain` or not, as in `friso.hunting.path.AttractionEnd`.
    """

    inside: np.ndarray
    outside: np.ndarray
    certain: bool


@dataclass(frozen=True)
class _Grid:
    """Grid of stages in the box of two keys: `nodes` along each side.

    `points` are the coordinates of all, shape (points, 2), `allowed` the numbers of the valid ones, and `stages` these.
    """

    nodes: int
    points: np.ndarray
    allowed: np.ndarray
    stages: Ensemble

    @classmethod
    def of(cls, space: Space, nodes: int | None) -> _Grid:
        nodes = continuation_settings.grid_stages if nodes is None else nodes
        points = space.grid(nodes)
        allowed = np.flatnonzero(space.allowed(points))
        return cls(nodes, points, allowed, space.stages(points[allowed]))

    def changes(self, inside: np.ndarray, outside: np.ndarray) -> list[tuple[int, int]]:
        """Return pairs of neighbours on the grid, the first `inside` and the second `outside`.

        Pairs are numbers of points; both arguments are booleans by valid stage.
        """
        return list(_changes(*(_on_grid(self.allowed[side], self.nodes) for side in (inside, outside))))


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def edge_curves(space: Space, rtol: float = CYCLE_RTOL, nodes: int | None = None) -> tuple[Curve, ...]:
    """Find the curves in the plane of two keys on which the hunting cycle stops attracting.

    Changes are looked for between `nodes` x `nodes` stages. Orbits are closed to the relative tolerance `rtol`.
    """
    grid = _Grid.of(space, nodes)
    find = symmetric_cycles if grid.stages.symmetric.all() else whole_cycles
    cycles = find(grid.stages, grid.stages.searching_rtol(rtol))
    return _followed(space, grid, [_losing(cycles)], rtol, silent)[0]


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def plane(space: Space, rtol: float = CYCLE_RTOL, nodes: int | None = None, progress: Progress = silent) -> Plane:
    """Find all curves in the plane of two keys on which the hunting cycle stops attracting.

    Curves on which an asymmetric cycle appears that bounds its basin are found as well. Changes are looked for between
    `nodes` x `nodes` stages. Orbits are closed to the relative tolerance `rtol`.
    """
    grid = _Grid.of(space, nodes)
    points, stages = grid.points, grid.stages
    sought = families(stages, stages.searching_rtol(rtol))
    hunting, searches = sought[0], _searches(*sought)
    curves, gaps = _followed(space, grid, searches, rtol, progress)
    attracts, decided = hunting.attracting.copy(), hunting.attracting.copy()
    undecided = np.flatnonzero(~attracts)  # stages with a stable cycle need no simulation
    if undecided.size:
        others = stages.take(undecided)
        surveyed = what_attracts(others, rtol)
        decided[undecided] = surely_surveyed(others, surveyed)
        attracts[undecided] = surveyed.attracts & decided[undecided]
    ends = grid.changes(decided & attracts, decided & ~attracts)
    for a, b in ends:  # other attractors, too
        middle = (points[a] + points[b]) / 2
        known_gap = any(np.array_equal(middle, at) for at in gaps)
        if not known_gap and not any(_crossed(curve, points[a], points[b]) for curve in curves):
            gaps.append(middle)
    last_ends = _last_ends(space, curves, [(points[a], points[b]) for a, b in ends], rtol)
    unstable = np.any([*unstable_among(stages).values()], axis=0)
    columns = space, curves, grid.nodes, grid.allowed, hunting, attracts, decided, unstable
    return Plane(*columns, tuple(gaps), last_ends)


def _followed(
    space: Space, grid: _Grid, searches: Sequence[CurveSearch], rtol: float, progress: Progress
) -> tuple[tuple[Curve, ...], list[np.ndarray]]:
    """Follow every curve that passes between neighbours of the grid, for each of the searches.

    Returns the curves, and the coordinates at which no curve could be begun.
    """
    changing = [(cycles, grid.changes(inside, outside)) for cycles, inside, outside in searches]
    tally = Tally(progress, sum(len(pairs) for _, pairs in changing))
    parts = side_by_side([partial(_sought, space, grid, *search, rtol, tally) for search in changing])
    return tuple(curve for curves, _ in parts for curve in curves), [gap for _, gaps in parts for gap in gaps]


def _sought(
    space: Space, grid: _Grid, cycles: Cycles, changing: Sequence[tuple[int, int]], rtol: float, tally: Tally
) -> tuple[list[Curve], list[np.ndarray]]:
    """Follow the edge of hunting between grid neighbours of which only the first has the cycle.

    Returns the curves, and the coordinates at which no curve could be begun. `changing` are pairs of neighbours; those
    whose cycle is nearest to a change come first, because the curve found there may pass between others as well.
    """
    points, curves, gaps = grid.points, list[Curve](), list[np.ndarray]()
    to_change = dict(zip(grid.allowed.tolist(), np.abs(np.abs(cycles.multiplier) - 1).tolist(), strict=True))
    for a, b in sorted(changing, key=lambda pair: to_change[pair[0]]):
        tally.add(1, CURVES)
        if any(_crossed(curve, points[a], points[b]) for curve in curves):
            continue
        cycle = cycles.take(np.flatnonzero(grid.allowed == a))
        spot, reached = _first(space, points[a], points[b], cycle, rtol)
        if reached:  # the neighbour has the cycle too, but the search there missed it
            continue
        curve = spot and CurveTracer(space, spot.special.kind, cycle.sign, rtol).curve(spot)
        if curve:
            curves.append(curve)
        else:
            gaps.append((points[a] + points[b]) / 2)
    return curves, gaps


CurveSearch = tuple[Cycles, np.ndarray, np.ndarray]
"""Cycles, and which stages lie inside and outside of a curve on which they change, as booleans."""


def _searches(hunting: Cycles, *pairs: Cycles) -> list[CurveSearch]:
    """Return between which stages to search for curves, from their hunting cycles and asymmetric ones.

    A search names stages inside and outside of a curve. In the first, the cycle attracts inside and not outside. If
    there is a second, an attracting cycle lies between asymmetric ones inside, and has none beside it outside. A stage
    that may have a cycle which was not closed is on neither side.
    """
    searches = [_losing(hunting)]
    for pair in pairs:
        beside_attracting = hunting.attracting & ~pair.uncertain
        searches.append((pair, beside_attracting & pair.closed, beside_attracting & ~pair.closed))
    return searches


def _losing(hunting: Cycles) -> CurveSearch:
    """Return the search for curves on which hunting cycles cease to attract."""
    return hunting, hunting.attracting, ~hunting.attracting & ~hunting.uncertain


def _on_grid(numbers: np.ndarray, nodes: int) -> np.ndarray:
    """Mark the nodes of the grid with these numbers, shape (nodes, nodes)."""
    grid = np.zeros(nodes * nodes, bool)
    grid[numbers] = True
    return grid.reshape(nodes, nodes)


def _changes(inside: np.ndarray, outside: np.ndarray) -> Iterator[tuple[int, int]]:
    """Return pairs of grid neighbours, the first of them inside and the second outside.

    `inside` and `outside`, shape (nodes, nodes), mark the nodes of the grid.
    """
    numbers = np.arange(inside.size).reshape(inside.shape)
    pairs = [(numbers[:-1], numbers[1:]), (numbers[:, :-1], numbers[:, 1:])]
    for first, second in [*pairs, *(pair[::-1] for pair in pairs)]:
        changed = inside.flat[first] & outside.flat[second]
        yield from zip(first[changed].tolist(), second[changed].tolist(), strict=True)


def _crossed(curve: Curve, start: np.ndarray, end: np.ndarray) -> bool:
    """Tell whether a curve passes close to the line between two neighbours of the grid.

    `start` and `end` are their coordinates in the box.
    """
    points, mesh = curve.points, float(np.linalg.norm(end - start))
    for at in start + np.linspace(0, 1, 9)[:, None] * (end - start):
        nearest = points[:-1] + leg_shares(points, at)[:, None] * np.diff(points, axis=0)
        if np.linalg.norm(nearest - at, axis=1).min() < continuation_settings.explained_distance * mesh:
            return True
    return False


def _last_ends(
    space: Space, curves: Sequence[Curve], pairs: Sequence[tuple[np.ndarray, np.ndarray]], rtol: float
) -> tuple[LastEnd, ...]:
    """Find where hunting ends beyond the curves, on lines between neighbours of the grid.

    `pairs` are the coordinates of neighbours of which something attracts the first alone. Just beyond the farthest
    curve on each line, other attractors are looked for, on all lines at once; those found are followed to their end.
    """
    lines, begins = [], []
    for start, end in pairs:
        crossed = [share for curve in curves for share in _crossings(curve, start, end)]
        if crossed:
            line = _Line.between(space, start + max(crossed) * (end - start), end)
            lines.append(line)
            begins.append([factor for factor in edge_settings.beyond_bandwidths if factor < line.farthest])
    owners = np.repeat(np.arange(len(lines)), [len(factors) for factors in begins])
    if not owners.size:
        return ()
    factors = np.concatenate(begins)
    places = np.array(
        [lines[owner].at(factor) for owner, factor in zip(owners.tolist(), factors.tolist(), strict=True)]
    )
    survey = what_attracts(space.stages(places), rtol)
    ends = []
    for number, line in enumerate(lines):
        found_at = np.flatnonzero((owners == number) & survey.attracts)
        if found_at.size:
            ends.append(line.end_of(float(factors[found_at[-1]]), survey.take(found_at[-1:]).motions))
    return tuple(ends)


@dataclass(frozen=True)
class _Line:
    """A line in the box of the keys from `start` to `end`, both (2,), as a path on which factors grow from 1.

    A factor of 1.01 leads as far as one key changes by 1 %, over a length of `hundredth`.
    """

    space: Space
    start: np.ndarray
    end: np.ndarray
    hundredth: float

    @classmethod
    def between(cls, space: Space, start: np.ndarray, end: np.ndarray) -> _Line:
        """Make a line from its ends."""
        direction = (end - start) / np.linalg.norm(end - start)
        return cls(space, start, end, space.hundredth(start, direction)(0.0))

    @property
    def farthest(self) -> float:
        """Return the factor at the end of the line."""
        return float(np.exp(np.log(1.01) * np.linalg.norm(self.end - self.start) / self.hundredth))

    def at(self, factors: np.ndarray | float) -> np.ndarray:
        """Return the coordinates at factors, (..., 2)."""
        share = np.log(factors) / np.log(self.farthest)
        return self.start + np.multiply.outer(share, self.end - self.start)

    def end_of(self, factor: float, motions: tuple[Swinging, ...]) -> LastEnd:
        """Follow `motions`, which attract at a factor, to the end of hunting on the line."""
        farthest = self.farthest
        path = ParameterPath(
            lambda factors: self.space.stages(self.at(factors)),
            np.array([1.0, farthest]),
            0,
            edge_settings.beyond_bandwidths,
        )
        try:
            end = EdgeSearch(path, farthest).end(factor, motions, farthest)
        except Beyond:
            return LastEnd(self.at(factor), self.end, False)
        return LastEnd(self.at(end.inside), self.at(min(end.outside, farthest)), end.certain)


def _crossings(curve: Curve, start: np.ndarray, end: np.ndarray) -> list[float]:
    """Return where a curve crosses the line between two neighbours of the grid, in shares of the line.

    The curve is straight between its points. `start` and `end` are the coordinates of the neighbours in the box.
    """
    way = end - start
    along, aside = (curve.points - start) @ way / (way @ way), (curve.points - start) @ (way[::-1] * [-1.0, 1.0])
    passes = np.flatnonzero(aside[:-1] * aside[1:] <= 0)
    with np.errstate(all="ignore"):
        weights = np.nan_to_num(aside[passes] / (aside[passes] - aside[passes + 1]), nan=0.5)
    shares = along[passes] + weights * (along[passes + 1] - along[passes])
    return shares[(shares >= 0) & (shares < 1)].tolist()


def _first(space: Space, start: np.ndarray, end: np.ndarray, cycle: Cycles, rtol: float) -> tuple[Spot | None, bool]:
    """Follow a cycle towards a neighbouring stage, to where it loses stability or folds.

    `start` and `end` are the coordinates of both stages in the box of the keys. Returns the point of change (None:
    there is none, or it could not be located), and whether the cycle reaches the neighbour unchanged.
    """
    mesh = float(np.linalg.norm(end - start))
    across = (end - start) / mesh
    tracer = Tracer(
        space.lines(start[None], across[None]),
        cycle.sign,
        rtol,
        farthest=mesh,
        pace=edge_settings.edge_pace,
        hundredth=space.hundredth(start, across),
    )
    first = Point.of(space.stages(start[None]), 0.0, cycle)
    steps = count(1)
    points, reason = tracer.walk(
        first,
        1.0,
        lambda last, point: bool(changes(last, point)) or next(steps) >= continuation_settings.most_points_between,
    )
    last, point = [first, first, *points][-2:]
    if not (kinds := changes(last, point)):
        return None, tracer.reaches(points, reason)
    special = located(tracer, last, point, "fold" if "fold" in kinds else kinds[0])
    return (Spot(start + special.point.place * across, special, across) if special else None), False


def leg_shares(path: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return where on each leg of a path the point nearest to `at`, shape (2,), lies.

    The legs are the straight pieces between the points of the path, (n, 2). The results, (n - 1,), run from 0 at the
    start of a leg to 1 at its end.
    """
    legs = np.diff(path, axis=0)
    return np.clip(((at - path[:-1]) * legs).sum(axis=1) / np.maximum((legs**2).sum(axis=1), 1e-30), 0, 1)
