"""Find the edges of a map more finely than its cells: where verdicts change between neighbouring cells.

Where a cell has a closed orbit that attracts, hunting ends where the orbit ceases to attract; elsewhere, where verdicts
between the cells change.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from friso.hunting import KeyRange, Space, find_cycles
from friso.hunting.criteria import ATTRACTED
from friso.progress import Progress, silent
from friso.studies.axes import SAMPLE, SweptAxis
from friso.studies.cells import flat_cells
from friso.studies.metric import in_order, metrics
from friso.studies.study import Dimension, Study
from friso.studies.sweep import Crew, run_in_memory

if TYPE_CHECKING:
    import xarray as xr

SETTLES_LEVEL, SLOW_LEVEL, HUNTS_LEVEL = range(3)
"""Levels of verdicts: nothing swings; the motion has not ended by the end of its run; hunting attracts."""


def verdict_levels(words: np.ndarray) -> np.ndarray:
    """Return the level of each verdict, in the shape of the words; NaN for any other word."""
    kinds = [np.isin(words, ATTRACTED), words == "transient", words == "settles"]
    return np.select(kinds, [HUNTS_LEVEL, SLOW_LEVEL, SETTLES_LEVEL], np.nan)


@dataclass(frozen=True)
class OwnLine:
    """What a stage does where one axis of a map varies and the other has the stage's own value.

    `own` is the stage's value on the axis [SI]. `begins` tells whether hunting attracts at the low end of the axis, and
    each row of `changes`, shape (n, 2), holds the values [SI] between which that changes, upwards.
    """

    key: str
    own: float
    begins: bool
    changes: np.ndarray

    @property
    def attracts(self) -> bool:
        """Tell whether hunting attracts at the stage's own value."""
        return self.begins ^ bool((self.changes.mean(axis=1) < self.own).sum() % 2)

    @property
    def beside(self) -> list[int]:
        """Return the numbers of the changes next to the stage's own value: below it, and above it."""
        below = int((self.changes.mean(axis=1) < self.own).sum())
        return [number for number in (below - 1, below) if 0 <= number < len(self.changes)]

    @property
    def nearest(self) -> np.ndarray | None:
        """Return the change next to the stage's own value, shape (2,) [SI]; None without any."""
        if not len(self.changes):
            return None
        return self.changes[np.abs(np.log(self.changes.mean(axis=1) / self.own)).argmin()]


@dataclass(frozen=True)
class MapEdges:
    """Edges of a map over two axes, on a mesh of its n x m cell centres and half-way between them.

    `near` and `far` are shape (2, 2 n - 1, 2 m - 1, 2): for the edge of what is not settled and that of hunting, the
    place [SI, an axis each] of every point of the mesh. Between two cells on different sides of the edge, `near` is the
    last place inside, and `far` the first outside. `own` are the lines through the stage itself, if it is on the map,
    and `verdict` is that on it.
    """

    near: np.ndarray
    far: np.ndarray
    own: tuple[OwnLine, ...] = ()
    verdict: str = ""


def coarse_edges(first: np.ndarray, second: np.ndarray, log: tuple[bool, bool]) -> MapEdges:
    """Return edges half-way between the cells of a map, whose axes have values (n,) and (m,) [SI], ascending."""
    ranges = tuple(
        KeyRange("", float(side[0]), float(side[-1]), is_log) for side, is_log in zip((first, second), log, strict=True)
    )
    mesh = _mesh([one.place(side) for one, side in zip(ranges, (first, second), strict=True)])
    placed = np.stack([_placed(mesh, ranges)] * 2)
    return MapEdges(placed, placed)


def fine_edges(
    study: Study, runs: xr.Dataset, metric: str, own: Mapping[str, object], crew: Crew, progress: Progress = silent
) -> MapEdges | None:
    """Locate the edges between neighbouring cells, and those along the lines through a stage's `own` values.

    `runs` are those of the study. Returns None for a map that is not over two axes of numbers, or has no verdicts.
    """
    axes = study.axes
    if len(axes) != 2 or len(study.dimensions) != 2 or not (metric in metrics() and metrics()[metric].verdict):
        return None
    if metric not in runs or not all(axis.numeric and len(axis.values) > 1 for axis in axes):
        return None
    if any(axis.scale == "log" and axis.values.min() <= 0 for axis in axes):
        return None
    ranges = tuple(
        KeyRange(axis.name, float(axis.values.min()), float(axis.values.max()), axis.scale == "log", axis.unit)
        for axis in axes
    )
    sides = [one.place(np.sort(axis.values)) for one, axis in zip(ranges, axes, strict=True)]
    first, second = (np.argsort(axis.values) for axis in axes)
    levels = verdict_levels(runs[metric].transpose(*study.names).to_numpy().astype(str)[first][:, second])
    space = Space(ranges, lambda values: flat_cells(study.stage, study.links, values))
    search = _Search(study, metric, space, crew, progress)
    near, far = (np.stack([_mesh(sides)] * 2) for _ in range(2))
    if rows := [row for limit in (SLOW_LEVEL, HUNTS_LEVEL) for row in _pairs(levels, limit)]:
        at = np.array(rows)
        starts, ends = (near[at[:, 0], 2 * at[:, k], 2 * at[:, k + 1]] for k in (1, 3))
        between = at[:, 0], at[:, 1] + at[:, 3], at[:, 2] + at[:, 4]
        near[between], far[between] = search.edge(starts, ends, at[:, 0] + SLOW_LEVEL)
    here = search.place_of(own)
    placed = _placed(near, ranges), _placed(far, ranges)
    return MapEdges(*placed) if here is None else MapEdges(*placed, *search.around(here, sides))


SEEN_EDGE_PRECISION = 5e-3  # [ranges]
"""Precision of edges of a map by verdicts alone, which take longer. It is a fifth of a cell of a usual map."""

EDGE_PRECISION = 5e-4  # [ranges]
"""Precision of edges of a map at which a closed orbit ceases to attract. Three digits of them are sure."""


@dataclass(frozen=True)
class _Search:
    """Verdicts and cycles at further places of a map, whose axes are the ranges of a `space`."""

    study: Study
    metric: str
    space: Space
    crew: Crew
    progress: Progress

    def levels(self, places: np.ndarray) -> np.ndarray:
        """Return the levels of the verdicts at places, shape (count, 2)."""
        return verdict_levels(self.verdicts(places))

    def verdicts(self, places: np.ndarray) -> np.ndarray:
        """Return the verdicts at places, shape (count, 2)."""
        values = self.space.values(places)
        axes = tuple(SweptAxis(axis.name, values[axis.name], axis.unit, axis.scale) for axis in self.study.axes)
        study = replace(self.study, dimensions=(Dimension(SAMPLE, axes),), metrics=in_order((self.metric,)))
        (runs,) = run_in_memory([study], self.crew, self.progress)
        return runs[self.metric].to_numpy().astype(str)

    def cycles(self, places: np.ndarray) -> np.ndarray:
        """Return 1 where the hunting cycle attracts at places, shape (count, 2), 0 where it repels or there is none.

        It is NaN where a cycle may exist that was not closed, and for a stage that may not be.
        """
        closed = np.full(len(places), np.nan)
        allowed = np.flatnonzero(self.space.allowed(places))
        if allowed.size:
            cycles = find_cycles(self.space.stages(places[allowed]))
            closed[allowed] = np.where(cycles.uncertain, np.nan, cycles.attracting)
        return closed

    def edge(self, inside: np.ndarray, outside: np.ndarray, limits: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the ends of what is left of the ways from places inside to places outside, shape (count, 2).

        Inside, the level is at least the limit, shape (count,). A way is halved until it is as short as wanted; by the
        cycle, if it attracts inside and does not outside, else by verdicts. Where these are uncertain between, the way
        that is left is that from the last certain place inside to the first outside.
        """
        inside, outside = inside.copy(), outside.copy()
        hunts = np.flatnonzero(limits == HUNTS_LEVEL)
        both = self.cycles(np.concatenate([inside[hunts], outside[hunts]])).reshape(2, -1)
        closed = hunts[(both[0] == 1) & (both[1] == 0)]
        others = np.setdiff1d(np.arange(len(limits)), closed)
        for members, tell in ((closed, self.cycles), (others, self.levels)):
            at_least = limits[members] if tell == self.levels else np.ones(len(members))
            beyond = outside[members]
            near, far, unsure = self._halved(inside[members], beyond, at_least, tell, False)
            far_off = self._halved(far[unsure], beyond[unsure], at_least[unsure], tell, True)[1]
            far[unsure] = far_off
            inside[members], outside[members] = near, far
        return inside, outside

    def _halved(
        self,
        start: np.ndarray,
        end: np.ndarray,
        limits: np.ndarray,
        tell: Callable[[np.ndarray], np.ndarray],
        uncertain_is_in: bool,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Bisect, and return both ends of what is left, and whether what `tell` says of the second one is uncertain.

        A place is inside where that is at least the limit. An uncertain one counts as inside or outside, as said.
        """
        start, end, unsure = start.copy(), end.copy(), np.zeros(len(limits), bool)
        precision = SEEN_EDGE_PRECISION if tell == self.levels else EDGE_PRECISION
        while (going := np.flatnonzero(np.abs(end - start).max(axis=1, initial=0.0) > precision)).size:
            middle = (start[going] + end[going]) / 2
            values = tell(middle)
            is_in = ~(values < limits[going]) if uncertain_is_in else values >= limits[going]
            start[going[is_in]], end[going[~is_in]] = middle[is_in], middle[~is_in]
            unsure[going[~is_in]] = np.isnan(values[~is_in])
        return start, end, unsure

    def place_of(self, own: Mapping[str, object]) -> np.ndarray | None:
        """Return the place, shape (2,), of the stage with its `own` values; None if it is not on the map."""
        values = [own.get(one.key) for one in self.space.ranges]
        pairs = list(zip(self.space.ranges, values, strict=True))
        if not all(isinstance(value, float) and one.low <= value <= one.high for one, value in pairs):
            return None
        return np.array([one.place(np.array(value)) for one, value in pairs])

    def around(self, here: np.ndarray, sides: list[np.ndarray]) -> tuple[tuple[OwnLine, ...], str]:
        """Return the lines through the stage at the place `here`, and the verdict on it.

        `sides` are the places of the cells along the axes. There is no line along an axis with an uncertain verdict.
        """
        lines = []
        for number, side in enumerate(sides):
            places = np.tile(here, (len(side), 1))
            places[:, number] = side
            lines.append(places)
        verdicts = self.verdicts(np.concatenate([*lines, here[None]]))
        levels = np.split(verdict_levels(verdicts)[:-1], [len(sides[0])])
        own = [self._own_line(number, lines[number], levels[number], here) for number in range(2)]
        return tuple(line for line in own if line is not None), str(verdicts[-1])

    def _own_line(self, number: int, places: np.ndarray, levels: np.ndarray, here: np.ndarray) -> OwnLine | None:
        """Return the line along an axis, by its number, with the levels at its places; None if one is uncertain."""
        if np.isnan(levels).any():
            return None
        hunts = levels == HUNTS_LEVEL
        first = np.flatnonzero(hunts[1:] != hunts[:-1])
        inner, outer = (places[np.where(hunts[first] == is_inner, first, first + 1)] for is_inner in (True, False))
        inner, outer = self.edge(inner, outer, np.full(len(first), HUNTS_LEVEL))
        axis = self.space.ranges[number]
        changes = np.sort(axis.at(np.stack([inner[:, number], outer[:, number]], axis=1)), axis=1)
        return OwnLine(axis.key, float(axis.at(here[number])), bool(hunts[0]), changes)


def _placed(places: np.ndarray, ranges: tuple[KeyRange, ...]) -> np.ndarray:
    """Return the values [SI] at places of both axes, shape (..., 2)."""
    return np.stack([one.at(places[..., k]) for k, one in enumerate(ranges)], axis=-1)


def _mesh(sides: list[np.ndarray]) -> np.ndarray:
    """Return the places of all cell centres and of the points half-way between, shape (2 n - 1, 2 m - 1, 2)."""
    halved = [np.interp(np.arange(2 * len(side) - 1) / 2, np.arange(len(side)), side) for side in sides]
    return np.stack(np.meshgrid(*halved, indexing="ij"), axis=-1)


def _pairs(levels: np.ndarray, limit: int) -> list[tuple[int, int, int, int, int]]:
    """List neighbouring cells of which the first reaches a level and the second does not.

    Each row has the number of the edge, from 0, and the indices of both cells. `levels` have the shape (n, m).
    """
    rows = []
    for di, dj in ((1, 0), (0, 1)):
        low, high = levels[: len(levels) - di, : levels.shape[1] - dj], levels[di:, dj:]
        for upwards, (inner, outer) in ((True, (low, high)), (False, (high, low))):
            for i, j in np.argwhere((inner >= limit) & (outer < limit)).tolist():
                ends = (i, j, i + di, j + dj) if upwards else (i + di, j + dj, i, j)
                rows.append((limit - SLOW_LEVEL, *ends))
    return rows
