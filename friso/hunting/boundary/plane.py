"""Find the edge of hunting in the plane of two keys, from a grid of stages.

Between neighbours of which only one hunts, its orbit is followed on the straight line to where it ceases to attract, or
stages between them are surveyed. The edge is the contour of the grid through these places.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Literal

import numpy as np

from friso.engine.side_by_side import side_by_side
from friso.hunting.attractors import Attractors
from friso.hunting.attractors.survey import Swinging
from friso.hunting.boundary.space import Space
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import CYCLE_RTOL
from friso.hunting.cycle.hunting import surely_told
from friso.hunting.loop import unstable_among
from friso.hunting.path import BEYOND_BANDWIDTHS, LossKind, OrbitLine, ParameterPath
from friso.hunting.path_search import EDGE_BRACKET_SHARE
from friso.hunting.what_attracts import has_a_map, sketched, surveyed_roughly, what_attracts
from friso.progress import Progress, Tally, silent

INVALID = -1.0
"""State of a stage of the grid that is not valid."""

EDGES = "following the edge of hunting"
"""Progress message while the edge is located."""


@dataclass(frozen=True)
class Curve:
    """A curve on which hunting ends, in the box of two keys: its n points in order.

    Something attracts at the coordinates `inside` and nothing at `outside`, both (n, 2). Between them hunting ends by
    the `kinds` of `friso.hunting.path.LossKind`. `ends_at_side` tells for either end whether it lies at a side of the
    box, or beside a stage that is invalid or unknown. A `ring` has no end.
    """

    inside: np.ndarray
    outside: np.ndarray
    kinds: np.ndarray
    ends_at_side: tuple[bool, bool]
    ring: bool

    @property
    def points(self) -> np.ndarray:
        """Return the curve in the box of the keys, shape (n, 2): where orbits end, or half-way between stages."""
        return np.where((self.kinds == "seen")[:, None], (self.inside + self.outside) / 2, self.inside)


@dataclass(frozen=True)
class Plane:
    """Edge of hunting in the box of two keys, from `nodes` stages along each side.

    `allowed` are the numbers of the valid stages in C order, the first key along the first side. Of these, `attracts`
    tells which have an attractor, `decided` for which that is known, and `unstable` whose loop is unstable regardless
    of friction. `near` and `far`, shape (2 nodes - 1, 2 nodes - 1, 2), are the coordinates of all stages and the places
    half-way between them; between neighbours of which one hunts, something attracts at `near` and nothing at `far`, and
    hunting ends by the `kinds` (2 nodes - 1, 2 nodes - 1), "" elsewhere.
    """

    space: Space
    nodes: int
    allowed: np.ndarray
    attracts: np.ndarray
    decided: np.ndarray
    unstable: np.ndarray
    near: np.ndarray
    far: np.ndarray
    kinds: np.ndarray

    @cached_property
    def curves(self) -> tuple[Curve, ...]:
        """Return the edge as curves, the longest first."""
        from contourpy import contour_generator

        levels = np.ma.masked_all((self.nodes, self.nodes))
        levels.flat[self.allowed[self.decided]] = self.attracts[self.decided].astype(float)
        contours = contour_generator(z=levels.T, line_type="Separate").lines(0.5)
        lines = [np.round(2 * np.asarray(line)).astype(int) for line in contours]
        lines = [line[self.kinds[*line.T] != ""] for line in lines]  # beside a masked stage it crosses a diagonal
        return tuple(self._curve(line) for line in sorted(lines, key=len, reverse=True) if len(line) > 1)

    def _curve(self, line: np.ndarray) -> Curve:
        """Return the curve through places of the mesh with the given indices, shape (n, 2)."""
        i, j = line.T
        first, last = (bool(np.any((end == 0) | (end == 2 * self.nodes - 2))) for end in (line[0], line[-1]))
        ring = bool(np.array_equal(line[0], line[-1]))
        return Curve(self.near[i, j], self.far[i, j], self.kinds[i, j], (first, last), ring)


GRID_STAGES = 13
"""Stages along each side of the grid of two keys. Curves between equal neighbours are missed; cost grows with the
square."""


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def plane(space: Space, rtol: float = CYCLE_RTOL, nodes: int | None = None, progress: Progress = silent) -> Plane:
    """Find the edge of hunting in the plane of two keys, between `nodes` x `nodes` stages.

    Orbits are closed to the relative tolerance `rtol`. Parts of the edge that pass between neighbours twice are not
    seen.
    """
    nodes = GRID_STAGES if nodes is None else nodes
    points = space.grid(nodes)
    allowed = np.flatnonzero(space.allowed(points))
    stages = space.stages(points[allowed])
    unstable = np.any([*unstable_among(stages).values()], axis=0)
    state = np.full(nodes * nodes, INVALID)
    state[allowed] = _hunts(stages, surveyed_roughly(stages))
    search = _Search(space, points, state, rtol)
    search.run(progress)
    mesh = space.grid(2 * nodes - 1).reshape(2 * nodes - 1, 2 * nodes - 1, 2)
    near, far, kinds = mesh.copy(), mesh.copy(), np.full(mesh.shape[:2], "", object)
    for pair, (inside, outside, kind) in search.found.items():
        place = tuple(np.sum(np.unravel_index(pair, (nodes, nodes)), axis=1))
        near[place], far[place], kinds[place] = inside, outside, kind
    attracts, decided = state[allowed] == 1, np.isfinite(state[allowed])
    return Plane(space, nodes, allowed, attracts, decided, unstable, near, far, kinds)


Pair = tuple[int, int]
"""Numbers of two neighbours of the grid, of which only the first hunts."""


@dataclass
class _Search:
    """Search for the edge of hunting on the lines between neighbours of a grid.

    `points` are the coordinates of the stages, (n, 2), and `hunts`, (n,), tells which hunt: 1, 0, NaN if that is not
    known, or INVALID. `motions` are those of stages whose orbits were closed, `reached` others that an orbit reached.
    `found` holds between which places hunting ends, and how; "" where surveys did not decide.
    """

    space: Space
    points: np.ndarray
    hunts: np.ndarray
    rtol: float
    motions: dict[int, tuple[Swinging, ...]] = field(default_factory=dict)
    reached: set[int] = field(default_factory=set)
    found: dict[Pair, tuple[np.ndarray, np.ndarray, LossKind | Literal[""]]] = field(default_factory=dict)

    def run(self, progress: Progress) -> None:
        """Locate the edge between all neighbours of which only one hunts."""
        while pairs := [pair for pair in self._pairs() if pair not in self.found]:
            if new := sorted({inner for inner, _ in pairs} - self.motions.keys()):
                self._inspect(new)
            else:
                self._locate(pairs, progress)

    def _pairs(self) -> Iterator[Pair]:
        """Return the pairs of neighbours of which only the first surely hunts."""
        nodes = round(len(self.points) ** 0.5)
        numbers = np.arange(len(self.points)).reshape(nodes, nodes)
        for one, other in ((numbers[:-1], numbers[1:]), (numbers[:, :-1], numbers[:, 1:])):
            for inner, outer in ((one, other), (other, one)):
                changes = (self.hunts[inner] == 1) & ((self.hunts[outer] == 0) | np.isnan(self.hunts[outer]))
                yield from zip(inner[changes].tolist(), outer[changes].tolist(), strict=True)

    def _inspect(self, numbers: list[int]) -> None:
        """Close orbits of stages that seem to hunt, by number."""
        stages = self.space.stages(self.points[numbers])
        survey = what_attracts(stages, self.rtol)
        for k, (number, hunts) in enumerate(zip(numbers, _hunts(stages, survey).tolist(), strict=True)):
            self.motions[number] = survey.take(np.array([k])).motions
            if number not in self.reached:
                self.hunts[number] = hunts

    def _locate(self, pairs: Sequence[Pair], progress: Progress) -> None:
        """Locate the edge on the lines between pairs of neighbours, all at once.

        Where an orbit reaches the second of them, that hunts as well. Where it was closed on both sides of its end just
        before, that does not: motions take too long there for a survey to decide.
        """
        lines = [_Line.between(self.space, self.points[inner], self.points[outer]) for inner, outer in pairs]
        tally = Tally(progress, len(pairs))
        ends = side_by_side(
            [
                partial(line.end, self.motions[inner], self.rtol, tally)
                for line, (inner, _) in zip(lines, pairs, strict=True)
            ]
        )
        for end, (_, outer) in zip(ends, pairs, strict=True):
            if end is None:
                self.hunts[outer] = 1
                self.reached.add(outer)
        ended = [(line, pair, *end) for line, pair, end in zip(lines, pairs, ends, strict=True) if end]
        inside, kinds = np.array([factor for *_, factor, _ in ended]), [kind for *_, kind in ended]
        lines, farthest = [line for line, *_ in ended], np.array([line.farthest for line, *_ in ended])
        nearest, *others = BEYOND_BANDWIDTHS
        outside, begin, unknown = np.minimum(nearest * inside, farthest), inside.copy(), np.zeros(len(lines), bool)
        for factor in (nearest, *others):
            hunts = self._told(lines, factor * inside, factor * inside < farthest, roughly=factor > nearest)
            begin[hunts == 1] = factor * inside[hunts == 1]
        seen = (begin > inside) | (np.array(kinds) == "seen")
        inside, outside[seen] = begin, farthest[seen]
        while (wide := seen & ~unknown & (outside > inside * (1 + EDGE_BRACKET_SHARE))).any():
            middle = np.sqrt(inside * outside)
            hunts = self._told(lines, middle, wide)
            inside[hunts == 1], outside[hunts == 0] = middle[hunts == 1], middle[hunts == 0]
            unknown |= wide & np.isnan(hunts)
        for k, (line, pair, _, kind) in enumerate(ended):
            passed = kind in ("flip", "fold", "torus") and not seen[k]
            if np.isnan(self.hunts[pair[1]]) and passed and farthest[k] < inside[k] * others[0]:
                self.hunts[pair[1]] = 0
            told = "" if unknown[k] else "seen" if seen[k] else kind
            self.found[pair] = line.at(inside[k]), line.at(outside[k]), told

    def _told(
        self, lines: Sequence[_Line], factors: np.ndarray, which: np.ndarray, roughly: bool = False
    ) -> np.ndarray:
        """Return on which of the lines stages hunt at their factors, (lines,): 1, 0, or NaN if that is not known.

        Only some are asked; of the others it is not known. If it is to be told `roughly`, orbits are closed only where
        a sketch of a map, or a simulation without a map, shows an attractor.
        """
        hunts, numbers = np.full(len(lines), np.nan), np.flatnonzero(which)
        places = np.array([lines[k].at(factors[k]) for k in numbers.tolist()]).reshape(-1, 2)
        if roughly and numbers.size:
            stages = self.space.stages(places)
            shown = sketched(stages)[0] if has_a_map(stages) else surveyed_roughly(stages).attracts
            numbers, places = numbers[shown], places[shown]
        if numbers.size:
            stages = self.space.stages(places)
            hunts[numbers] = _hunts(stages, what_attracts(stages, self.rtol))
        return hunts


def _hunts(stages: Ensemble, survey: Attractors) -> np.ndarray:
    """Return which surveyed stages hunt, (count,): 1, 0, or NaN if that is not known."""
    return np.where(surely_told(stages, survey), survey.attracts, np.nan)


@dataclass(frozen=True)
class _Line:
    """A line in the box of the keys from `start` along `way`, both (2,), as a path on which factors grow from 1.

    A factor of 1.01 leads as far as the key that changes fastest changes by 1 %, the `farthest` factor to the end.
    """

    space: Space
    start: np.ndarray
    way: np.ndarray
    farthest: float

    @classmethod
    def between(cls, space: Space, start: np.ndarray, end: np.ndarray) -> _Line:
        """Make a line from its ends; keys are compared with their values at its middle."""
        length = float(np.linalg.norm(end - start))
        hundredths = length / space.hundredth(start, (end - start) / length)(length / 2)
        return cls(space, start, end - start, float(1.01**hundredths))

    def at(self, factors: np.ndarray | float) -> np.ndarray:
        """Return the coordinates at factors, (..., 2)."""
        return self.start + np.multiply.outer(np.log(factors) / np.log(self.farthest), self.way)

    def end(self, motions: tuple[Swinging, ...], rtol: float, tally: Tally) -> tuple[float, LossKind] | None:
        """Follow a closed orbit from the start to the factor at which it ceases to attract, and tell how it does.

        Returns None if it attracts up to the end. Without a closed orbit the first factor is told, as seen.
        """
        tally.add(1, EDGES)
        orbit = next((motion for motion in motions if motion.cycles is not None), None)
        if orbit is None:
            return 1.0, "seen"
        path = ParameterPath(lambda factors: self.space.stages(self.at(factors)), np.ones(1), 0, BEYOND_BANDWIDTHS)
        return OrbitLine.of(path, 1.0, 1.0, orbit, rtol).end(self.farthest, self.farthest)
