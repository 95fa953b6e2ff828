"""Compute the boundary of hunting over ranges given by a user, as numbers for all outputs.

The numbers are the points of branches and curves, and the verdicts at stages between them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from friso.engine.allowance import checked_rtol
from friso.engine.kernel import KernelRequest, kernels
from friso.equations.bandwidth import range_example
from friso.equations.motion import rests
from friso.errors import InputError
from friso.hunting import (
    CYCLE_RTOL,
    DITHERS,
    Branch,
    Curve,
    Cycles,
    Diagram,
    KeyRange,
    LocatedPoint,
    LossKind,
    Plane,
    Space,
    cannot_hunt,
    diagram,
    is_moved_evenly,
    plane,
)
from friso.progress import Progress, silent
from friso.stage import Stage, violations
from friso.studies.axes import SweptAxis, read_axis
from friso.studies.cells import flat_cells

LOOSEST_RTOL = 1e-6
"""Loosest tolerance of orbits. Looser ones lose the branch at a fold."""


def boundary(
    stage: Stage,
    axes: Mapping[str, str],
    rtol: float = CYCLE_RTOL,
    begins: Callable[[], None] = lambda: None,
    progress: Progress = silent,
) -> Diagram | Plane:
    """Return where the hunting cycle of a stage loses stability, over one key or two.

    `axes` are keys with their ranges, ``{"joint.stroke": "0.1 mm..2 mm"}``. A range is logarithmic with ":log" behind
    it. With one axis the result is a `Diagram`: all branches of cycles over the range, with their flips, folds and
    tori. With two it is a `Plane`: the curves on which hunting ends. The motion of the stage file plays no part.

    `begins` is called once the input has been checked, and `progress` while cycles are followed. Raises InputError for
    a wrong range, tolerance or stage (one that cannot hunt).
    """
    checked_rtol(rtol)
    example = range_example(stage.flat())
    ranges = tuple(_range(stage, name, text) for name, text in axes.items())
    if len(ranges) not in (1, 2):
        raise InputError("axes", f"{len(ranges)} keys", "one key or two", example)
    if reason := cannot_hunt(stage):
        if reason == DITHERS:
            raise InputError("controller", reason, "a controller without dither", example)
        raise InputError("stage", f"one that cannot hunt: {reason}", "friction and integral action", example)
    if not rests(stage.flat()):
        actual = f'motion.kind = "{stage.flat()["motion.kind"]}", whose reference keeps moving'
        expected = "a reference that comes to stand, as there is a verdict on hunting only there"
        if is_moved_evenly(stage):
            expected += "; friso check and friso map tell at which speeds a ramp sticks and slips"
        raise InputError("motion", actual, expected, """--set 'motion={kind="hold", duration="20 s"}'""")
    for key in (swept.key for swept in ranges):
        if key.startswith("motion."):
            problem = "a key of the motion, which plays no part"
            raise InputError(key, problem, "a key of the stage or its controller", example)
    if rtol > LOOSEST_RTOL:
        raise InputError("rtol", f"{rtol:g}", f"at most {LOOSEST_RTOL:g}, since multipliers are derivatives", "1e-9")
    space = Space(ranges, lambda values: flat_cells(stage, {}, values))
    _refuse_impossible(space, example)
    kernels([KernelRequest(space.form, variational) for variational in (False, True)])
    begins()
    return (diagram if len(ranges) == 1 else plane)(space, rtol, progress=progress)


TRIED_VALUES = 9
"""Values tried over a range. Fewer miss a range with cycles in its middle only."""


def _refuse_impossible(space: Space, example: str) -> None:
    """Raise InputError if no stage in the ranges is valid, from a coarse grid of stages."""
    points = space.grid(TRIED_VALUES)
    if not space.allowed(points).any():
        key, why = space.ranges[0].key, violations(space.flat(space.values(points)))[0][1]
        raise InputError(key, "ranges that no stage may have", why, example)


def _range(stage: Stage, name: str, text: str) -> KeyRange:
    """Read the text of a range, such as "0.1 mm..2 mm", for the boundary of hunting.

    `name` is a key of the stage. Raises InputError for a range with a number of points, or with ends that the key may
    not have.
    """
    read, example = read_axis(stage, name, text, False), range_example(stage.flat())
    if isinstance(read, SweptAxis) or read.count is not None:
        raise InputError(name, repr(text), "a range FIRST..LAST, without a number of points", example)
    field = stage.numeric_keys().get(name)
    if field is not None and not (field.bound.holds(read.first) and field.bound.holds(read.last)):
        raise InputError(name, repr(text), f"values {field.bound.text}", example)
    return KeyRange(name, read.first, read.last, read.scale == "log", read.unit)


CycleShape = Literal["symmetric", "asymmetric", "whole"]
"""Kind of a cycle: symmetric (its own mirror image), asymmetric (of a symmetric stage), or whole (of a stage that is
not symmetric)."""

ATTRACTS, REPELS, UNKNOWN, INVALID = "attracting cycle", "no attracting cycle", "unknown", "invalid"
"""Verdicts on the stages of a boundary, from simulations and followed branches.

UNKNOWN marks stages whose simulations failed or did not settle; INVALID marks stages that break a rule.
"""


@dataclass(frozen=True)
class Line:
    """A branch of cycles over one key: its n points in order.

    `at` [SI], shape (n, 1), has the values of the key. `error`, of this shape, is their error [SI], NaN except at
    special points (flips, folds and tori). `kinds` has the kind of each special point, "" for an ordinary one.
    `amplitude` [m], `middle` [m], `period` [s] and `multiplier` of the cycles have the shape (n,). `ends` are texts on
    how the line ends on either side.
    """

    shape: CycleShape
    at: np.ndarray
    error: np.ndarray
    kinds: tuple[str, ...]
    amplitude: np.ndarray
    middle: np.ndarray
    period: np.ndarray
    multiplier: np.ndarray
    ends: tuple[str, str]

    @property
    def special(self) -> np.ndarray:
        """Return the indices of the special points (flips, folds and tori)."""
        return np.flatnonzero([bool(kind) for kind in self.kinds])

    @property
    def ordinary(self) -> np.ndarray:
        """Return the indices of the points that are not special."""
        return np.flatnonzero([not kind for kind in self.kinds])

    @property
    def attracts(self) -> np.ndarray:
        """Tell whether the cycle is stable between each point and the next, shape (n - 1,)."""
        return np.abs(self.multiplier[1:] + self.multiplier[:-1]) < 2


class _Row(NamedTuple):
    """Point of a line: its key and its error as fractions of the range, its cycle and kind."""

    at: np.ndarray
    error: np.ndarray
    cycle: Cycles
    kind: str


def lines(result: Diagram) -> tuple[Line, ...]:
    """Return all branches of a diagram with their special points."""
    pairs = zip(result.branches, result.special, strict=True)
    return tuple(_line(result, branch, _of_branch(branch, special)) for branch, special in pairs)


def _of_branch(branch: Branch, special: tuple[LocatedPoint, ...]) -> list[_Row]:
    """Return the points of a branch and its `special` points inside the range, in order.

    Ordinary points within the error of a special point are left out, because it is unknown whether they are stable.
    """
    path = np.array([point.vector for point in branch.points])
    ordinary = [
        (k, point) for k, point in enumerate(branch.points) if not any(spot.in_doubt(point) for spot in special)
    ]
    placed = [(float(k), point, np.nan, "") for k, point in ordinary]
    placed += [
        (_path_coordinate(path, spot.point.vector), spot.point, spot.error, spot.kind)
        for spot in special
        if 0 <= spot.point.place <= 1
    ]
    return [
        _Row(np.array([point.place]), np.array([error]), point.cycle, kind)
        for _, point, error, kind in sorted(placed, key=lambda row: row[0])
    ]


def _path_coordinate(path: np.ndarray, vector: np.ndarray) -> float:
    """Return how many legs from the start of a path a point lies; part of a leg counts in part.

    `path` (n, d) has the points of the path, and `vector` (d,) is the point.
    """
    before, after = (np.linalg.norm(end - vector, axis=1) for end in (path[:-1], path[1:]))
    leg = int(np.argmin(before + after - np.linalg.norm(path[1:] - path[:-1], axis=1)))
    return leg + before[leg] / (before[leg] + after[leg])


def _line(result: Diagram, traced: Branch, rows: list[_Row]) -> Line:
    """Make a line from the rows of a branch: keys [SI], their errors, and the numbers of the cycles."""
    at = np.array([row.at for row in rows])
    values = _values(result.space, at)
    return Line(
        "symmetric" if traced.sign < 0 else "asymmetric" if result.cycles.sign < 0 else "whole",
        values,
        np.abs(_values(result.space, at + np.array([row.error for row in rows])) - values),
        tuple(row.kind for row in rows),
        np.array([row.cycle.amplitude[0] for row in rows]),
        np.array([row.cycle.middle[0] for row in rows]),
        np.array([row.cycle.period[0] for row in rows]),
        np.array([row.cycle.multiplier[0] for row in rows]),
        traced.ends,
    )


def _values(space: Space, at: np.ndarray) -> np.ndarray:
    return np.stack(list(space.values(at).values()), axis=1)


def place_verdicts(result: Diagram) -> list[str]:
    """Return the verdicts at stages spaced evenly over the range of a diagram.

    Verdicts come from simulations, and from all branches of cycles that reach these stages.
    """
    verdicts = _verdicts(result)
    return [
        ATTRACTS if _attracts_at(result, place) else verdict
        for place, verdict in zip(result.places.tolist(), verdicts, strict=True)
    ]


def end_verdicts(result: Diagram) -> tuple[str, str]:
    """Return the verdicts at the lower and the upper end of the range of a diagram.

    An end at which no stage was simulated counts as invalid.
    """
    verdict_at = dict(zip(result.places.tolist(), place_verdicts(result), strict=True))
    return verdict_at.get(0.0, INVALID), verdict_at.get(1.0, INVALID)


class StabilityChange(NamedTuple):
    """Change between stages that hunt and stages that do not, along a key.

    `begins` is true if hunting begins there as the key rises. The change lies between the values `low` and `high` [SI],
    which are equal if a followed cycle gains or loses stability there.
    """

    begins: bool
    low: float
    high: float


def stability_changes(result: Diagram) -> list[StabilityChange]:
    """Return the changes at which hunting begins and ends over the range, in order.

    Verdicts within the error of a special point (flip, fold or torus) do not locate a change: cycles are so weakly
    unstable there that runs may stay on them. Between stages that do not hunt, however, even such a verdict shows that
    hunting begins and ends.
    """
    special = [spot for own in result.special for spot in own if np.isfinite(spot.error)]
    doubtful = np.any([np.abs(result.places - spot.point.place) < spot.error for spot in special], axis=0)
    values = _values(result.space, result.places[:, None])[:, 0].tolist()
    verdicts = zip(values, place_verdicts(result), np.broadcast_to(doubtful, len(values)), strict=True)
    decisive = [(value, word == ATTRACTS, unclear) for value, word, unclear in verdicts if word in (ATTRACTS, REPELS)]
    decided = [(value, attracts) for value, attracts, unclear in decisive if not unclear]
    quiet = [(-np.inf, False), *decided, (np.inf, False)]
    apart = [(low, high) for (low, before), (high, after) in pairwise(quiet) if not before and not after]
    hunting = [value for value, attracts, unclear in decisive if attracts and unclear]
    decided = sorted(decided + [(value, True) for value in hunting if any(a < value < b for a, b in apart)])
    turns = followed_changes(result)
    changes = []
    for (low, before), (high, after) in pairwise(decided):
        if before != after:
            inside = [value for value, begins in turns if begins == after and low <= value <= high]
            at = (min(inside) if after else max(inside)) if inside else None
            changes.append(StabilityChange(after, low if at is None else at, high if at is None else at))
    return changes


def followed_changes(result: Diagram) -> list[tuple[float, bool]]:
    """Return the values [SI] at which a followed cycle changes its stability.

    With each value comes True if the cycle gains stability as the key rises, or False if it loses stability.
    """
    return sorted(
        (float(line.at[k, 0]), begins)
        for line in lines(result)
        for k in line.special
        if (begins := begins_at(line, k)) is not None
    )


def begins_at(line: Line, k: int) -> bool | None:
    """Tell whether a cycle gains stability at point `k` of a line as the key rises.

    The point is a special one (flip, fold or torus). None if the cycle is stable on both sides of it, or on neither.
    """
    beside = [bool(0 <= j < len(line.attracts) and line.attracts[j]) for j in (k - 1, k)]
    if beside[0] == beside[1]:
        return None
    other = k - 1 if beside[0] else k + 1
    return bool(line.at[other, 0] > line.at[k, 0]) if 0 <= other < len(line.at) else None


def _attracts_at(result: Diagram, place: float) -> bool:
    """Tell whether a branch of stable cycles passes a stage in the range of a diagram.

    `place` is the stage's fraction of the range. The cycles at the neighbouring points on both sides must be stable.
    False if the stability of a branch is unknown there.
    """
    if result.in_doubt(np.array([place]))[0]:
        return False
    pairs = [pair for branch in result.branches for pair in pairwise(branch.points)]
    across = [(a, b) for a, b in pairs if (a.place - place) * (b.place - place) <= 0]
    return any(max(abs(a.multiplier), abs(b.multiplier)) < 1 for a, b in across)


def node_verdicts(result: Plane) -> list[tuple[float, float, str]]:
    """Return the values [SI] of both keys at every node of a plane's grid, and the verdict.

    The first key varies slowest.
    """
    verdicts = np.full(result.nodes**2, INVALID, object)
    verdicts[result.allowed] = _verdicts(result)
    values = _values(result.space, result.space.grid(result.nodes)).tolist()
    return [(x, y, verdict) for (x, y), verdict in zip(values, verdicts.tolist(), strict=True)]


def corner_verdicts(result: Plane) -> list[tuple[float, float, str]]:
    """Return the values [SI] of both keys at the four corners of a plane, and the verdict.

    The order is both low, second high, first high, both high.
    """
    nodes, last = node_verdicts(result), result.nodes - 1
    return [nodes[k] for k in (0, last, result.nodes * last, -1)]


class PlaneEdge(NamedTuple):
    """Edge of hunting along one key of a plane, for n values of the other key.

    `along`, 0 or 1, is the key along which the edge is sought, and `across` (n,) are the ascending values [SI] of the
    other key. `below` is true if hunting is possible below the edge. The edge lies between `low` and `high` [SI] (n,),
    which are equal if a curve passes.
    """

    along: int
    below: bool
    across: np.ndarray
    low: np.ndarray
    high: np.ndarray


def plane_edge(result: Plane) -> PlaneEdge | None:
    """Return the edge of hunting along one of the keys of a plane, the first if possible.

    Along this key, hunting must end exactly once, on the same side for every value of the other key. Returns None
    otherwise, and if the verdict at a node is unknown.
    """
    verdicts = np.full(result.nodes**2, np.nan)
    verdicts[result.allowed[result.decided]] = result.attracts[result.decided]
    if np.isnan(verdicts).any():
        return None
    attracts = verdicts.reshape(result.nodes, result.nodes) == 1
    for along in (0, 1):
        rows = np.moveaxis(attracts, along, 1)  # one row per value of the other key
        changes = np.diff(rows.astype(int), axis=1)
        below, numbers = bool(rows[0, 0]), np.arange(result.nodes)
        if np.all(np.abs(changes).sum(axis=1) == 1) and np.all(rows[:, 0] == below):
            first = 2 * np.abs(changes).argmax(axis=1) + 1
            i, j = (first, 2 * numbers) if along == 0 else (2 * numbers, first)
            near, far = (_values(result.space, side[i, j]) for side in (result.near, result.far))
            far = np.where((result.kinds[i, j] == "seen")[:, None], far, near)
            low, high = np.sort([near[:, along], far[:, along]], axis=0)
            return PlaneEdge(along, below, near[:, 1 - along], low, high)
    return None


EndKind = Literal["range", "closed", "lost"]
"""How a curve ends: at the end of the range, as a ring, or beside stages that are unknown or invalid."""


class PlaneCurve(NamedTuple):
    """A curve in the plane of two keys on which hunting ends: its n points in order.

    `at` [SI], shape (n, 2), are its values of both keys, with their `error` (n, 2); `kinds` say how hunting ends there,
    and `ends` how the curve ends on either side.
    """

    at: np.ndarray
    error: np.ndarray
    kinds: tuple[LossKind, ...]
    ends: tuple[EndKind, EndKind]


def curves(result: Plane) -> tuple[PlaneCurve, ...]:
    """Return the curves of a plane, the longest first."""
    return tuple(map(partial(_curve, result.space), result.curves))


def _curve(space: Space, curve: Curve) -> PlaneCurve:
    """Return a curve with values [SI] of the keys."""
    at, far = _values(space, curve.points), _values(space, curve.outside)
    ends: list[EndKind] = ["closed" if curve.ring else "range" if at_side else "lost" for at_side in curve.ends_at_side]
    return PlaneCurve(at, np.abs(far - at), tuple(curve.kinds), (ends[0], ends[1]))


def _verdicts(result: Diagram | Plane) -> list[str]:
    """Return whether each simulated stage of a diagram or a plane has an attractor, as words.

    The words are ATTRACTS, REPELS and UNKNOWN. Their order is that of `result.attracts`.
    """
    return np.select([result.attracts, ~result.decided], [ATTRACTS, UNKNOWN], REPELS).tolist()
