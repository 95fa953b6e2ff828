"""Describe a boundary of hunting in words: where hunting ends, and what happens at each point."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from friso.hunting import END_OF_RANGE, Diagram, KeyRange, LossKind, Plane, Space
from friso.questions.map.words import friction_held
from friso.shown.drawing.figure import Array
from friso.shown.text import listed, pretty, swing_with_unit, with_unit
from friso.studies import boundary
from friso.studies.boundary import (
    ATTRACTS,
    INVALID,
    REPELS,
    UNKNOWN,
    CycleShape,
    Line,
    PlaneCurve,
    PlaneEdge,
    StabilityChange,
)

VERDICTS = {
    ATTRACTS: "hunting is possible",
    REPELS: "no hunting was found",
    UNKNOWN: "unknown (some simulations failed or had not settled when they were stopped, or something may attract "
    "beyond them)",
    INVALID: "not a valid stage",
}
CYCLES: dict[CycleShape, str] = {
    "symmetric": "the hunting cycle",
    "asymmetric": "an asymmetric cycle",
    "whole": "the hunting cycle",
}
MEANINGS = {
    "flip": "it still exists, but repels",
    "fold": "it has merged with another cycle, and neither exists",
    "torus": "it still exists, but motions spiral away from it",
}
"""State of a cycle on the other side of a special point."""


DIGITS = 4
"""Most significant digits of a value."""

PLAIN_ERROR = 5e-4
"""Largest relative error with which a value is stated without its interval, in four significant digits."""


@dataclass(frozen=True)
class ShownKey:
    """A key and the unit in which its values are printed; `factor` is the SI value of the unit.

    `varied` are all keys that vary, with those that links tie to others.
    """

    key: str
    unit: str = ""
    factor: float = 1.0
    varied: frozenset[str] = frozenset()

    @property
    def named(self) -> str:
        """Return the key, and which friction it means if it is one of friction."""
        if self.key == "friction":
            return "friction (all of it scaled)"
        return f"{self.key}{friction_held(self.key, self.varied)}"

    def number(self, value: float) -> float:
        """Convert a value [SI] to the unit shown."""
        return float(f"{value / self.factor:.15g}")

    def text(self, value: float, digits: int = DIGITS) -> str:
        """Write a value [SI] in the unit shown, to at most `digits` digits."""
        return self._with_unit(f"{self.number(value):.{digits}g}")

    def uncertain(self, value: float, error: float) -> str:
        """Write a value and its error [SI], to one digit beyond the error's first."""
        if not math.isfinite(error):
            return f"{self.text(value)} (error unknown)"
        number, off = self.number(value), self.number(error)
        rounded = round(number, 1 - math.floor(math.log10(off))) if off > 0 else number
        return self._with_unit(f"{rounded:.6g} ± {float(f'{off:.1g}'):g}")

    def as_known(self, value: float, error: float) -> str:
        """Write a value [SI], with its error unless the error is too small to show in the digits."""
        return self.text(value) if error < PLAIN_ERROR * abs(value) else self.uncertain(value, error)

    def extent(self, values: Array, swept: KeyRange) -> str:
        """Write the lowest and highest of some values [SI], cut to the range `swept`."""
        low, high = self.number(max(swept.low, float(values.min()))), self.number(min(swept.high, float(values.max())))
        return self._with_unit(f"{low:.{DIGITS}g} to {high:.{DIGITS}g}")

    def _with_unit(self, numbers: str) -> str:
        """Add the unit to numbers, if the key has one."""
        return f"{numbers} {pretty(self.unit)}".rstrip()


END_DIGITS = 3
"""Significant digits of the ends of a curve in the answer."""


MOST_SENTENCES = 3
"""Largest number of sentences in the answer; figure and details have all curves."""


def sentences(traced: Diagram | Plane, keys: tuple[ShownKey, ...]) -> list[str]:
    """Return all sentences in order, the answer first."""
    return [conclusion(traced, keys), *details(traced, keys)]


def conclusion(traced: Diagram | Plane, keys: tuple[ShownKey, ...]) -> str:
    """Return the answer as one text."""
    return " ".join(answer(traced, keys))


def answer(traced: Diagram | Plane, keys: tuple[ShownKey, ...]) -> list[str]:
    """Say in at most three sentences where hunting is possible and where it ends.

    The first sentence says where the loop is unstable even without friction.
    """
    where = _edges(traced, keys[0]) if isinstance(traced, Diagram) else _in_plane(traced, keys)
    return [*_unstable(traced, keys), *where][:MOST_SENTENCES]


def details(traced: Diagram | Plane, keys: tuple[ShownKey, ...]) -> list[str]:
    """Describe every branch or curve, with its flips, folds and other special points."""
    return _of_diagram(traced, keys[0]) if isinstance(traced, Diagram) else _of_plane(traced, keys)


def _unstable(traced: Diagram | Plane, keys: tuple[ShownKey, ...]) -> list[str]:
    """Say at which of the values tried the loop is unstable, whatever the friction.

    The list is empty if the loop is stable at all of them.
    """
    if not traced.unstable.any():
        return []
    points = traced.places[:, None] if isinstance(traced, Diagram) else traced.space.grid(traced.nodes)[traced.allowed]
    values = traced.space.values(points[traced.unstable]).values()
    box = zip(keys, values, traced.space.ranges, strict=True)
    places = listed([f"{key.key} {key.extent(column, swept)}" for key, column, swept in box], "and")
    return [
        f"The loop is unstable, whatever the friction, at {np.count_nonzero(traced.unstable)} of the "
        f"{traced.unstable.size} stages tried ({places}): there, retune the controller (friso bode)."
    ]


def _in_plane(traced: Plane, keys: tuple[ShownKey, ...]) -> list[str]:
    """Say where in the plane of two keys hunting is possible, and along which curves it begins or ends."""
    if edge := boundary.plane_edge(traced):
        return [_along_one(edge, keys)]
    corners, curves = _hunting_corners(traced, keys), boundary.curves(traced)
    if curves:
        more = len(curves) - 1
        rest = [f"There {'are' if more > 1 else 'is'} {more} more curve{'s' if more > 1 else ''}."] if more else []
        return [corners, f"{_course(curves[0], keys, END_DIGITS)}.", *rest]
    if UNKNOWN in [verdict for _, _, verdict in boundary.corner_verdicts(traced)]:
        return [corners]
    return [corners, _no_boundary(traced.space, keys)]


def _along_one(edge: PlaneEdge, keys: tuple[ShownKey, ...]) -> str:
    """Describe an edge of hunting that runs across the whole plane of two keys.

    The sentence gives the values of one key at both ends of the other, and the farthest values in between.
    """
    along, across = keys[edge.along], keys[1 - edge.along]
    side, other = ("below", "above") if edge.below else ("above", "below")

    def ends(k: int) -> str:
        """Write the value of one key at which hunting ends, or a range, at point `k` along the edge."""
        low, high = (along.text(float(column[k]), END_DIGITS) for column in (edge.low, edge.high))
        return low if edge.low[k] == edge.high[k] else f"{low} to {high}"

    def at(k: int) -> str:
        """Write the value of the other key at point `k` along the edge."""
        return f"{across.key} = {across.text(float(edge.across[k]), END_DIGITS)}"

    answer = f"Hunting is possible {side} {along.named} = {ends(0)} at {at(0)}, and {side} {ends(-1)} at {at(-1)}"
    farther = [int(np.argmin(edge.low)), int(np.argmax(edge.high))]
    beyond = [f"{ends(k)} at {at(k)}" for k in dict.fromkeys(farther) if ends(k) not in (ends(0), ends(-1))]
    between = f", {side} {listed(beyond, 'and')} in between" if beyond else ""
    return f"{answer}{between}; {other}, none was found."


def _hunting_corners(traced: Plane, keys: tuple[ShownKey, ...]) -> str:
    """Say at which corners of the plane hunting is possible."""
    corners = boundary.corner_verdicts(traced)
    hunting = [_place((x, y), keys) for x, y, verdict in corners if verdict == ATTRACTS]
    unknown = sum(verdict == UNKNOWN for _, _, verdict in corners)
    others = f" (unknown at {unknown})" if unknown else ""
    if len(hunting) in (0, len(corners)):
        return f"Hunting is possible at {'all' if hunting else 'none'} of the corners of the plane{others}."
    return f"Of the corners of the plane, hunting is possible at {'; '.join(hunting)}{others}."


def _course(curve: PlaneCurve, keys: tuple[ShownKey, ...], digits: int = DIGITS) -> str:
    """Say from which point to which a curve of a plane runs, and how it ends there; values have `digits` digits."""
    start, stop = (_place(at.tolist(), keys, digits) for at in curve.at[[0, -1]])
    first, last = curve.ends
    if first == "closed":
        return f"The edge of hunting runs in a ring through {start}"
    if first == last:
        return f"The edge of hunting runs from {start} to {stop}; at both, {ENDS[first]}"
    return f"The edge of hunting runs from {start}, where {ENDS[first]}, to {stop}, where {ENDS[last]}"


ENDS = {
    "range": "the range ends",
    "lost": "stages are invalid or unknown",
}
"""Ways in which a curve of the plane ends, in words."""


def _edges(traced: Diagram, key: ShownKey) -> list[str]:
    """Say where hunting begins and ends over the range."""
    changes, verdicts = boundary.stability_changes(traced), boundary.place_verdicts(traced)
    unknown = f"; unknown at {verdicts.count(UNKNOWN)} of {len(verdicts)} values tried" if UNKNOWN in verdicts else ""
    errors = {float(line.at[k, 0]): float(line.error[k, 0]) for line in boundary.lines(traced) for k in line.special}
    if not changes:
        return [f"{_no_boundary(traced.space, (key,))[:-1]}{unknown}.", end_sentence(traced, key)]
    places = [
        f"{'begins' if change.begins else 'ends'} {_between(change, key, errors)}{_if_unstable(traced, change)}"
        for change in changes
    ]
    return [f"Hunting {listed(places, 'and')}{unknown}."]


def _also_attracting(traced: Diagram, key: ShownKey) -> list[str]:
    """Say in which ranges, between neighbouring values tried, a cycle attracts as well.

    Values that bound no such range are listed by themselves. The list is empty if cycles change nowhere else.
    """
    at = {change.low for change in boundary.stability_changes(traced)}
    turns = [(value, begins) for value, begins in boundary.followed_changes(traced) if value not in at]
    errors = {float(line.at[k, 0]): float(line.error[k, 0]) for line in boundary.lines(traced) for k in line.special}
    text = {value: key.uncertain(value, errors[value]) for value, _ in turns}
    ranges = [(low, high) for (low, begins), (high, begins_too) in pairwise(turns) if begins and not begins_too]
    within = {value for ends in ranges for value in ends}
    others = [text[value] for value, _ in turns if value not in within]
    spans = [f"from {text[low]} to {text[high]}" for low, high in ranges]
    return [
        *([f"Between values tried, a cycle attracts {listed(spans, 'and')} as well."] if spans else []),
        *([f"Cycles also begin or stop attracting at {listed(list(dict.fromkeys(others)), 'and')}."] if others else []),
    ]


def _if_unstable(traced: Diagram, change: StabilityChange) -> str:
    """Return a remark if hunting begins or ends where the loop is unstable anyway; else empty."""
    beside = np.argmin(np.abs([traced.value(place) - change.low for place in traced.places]))
    return " (where the loop is unstable anyway)" if traced.unstable[beside] else ""


def _between(change: StabilityChange, key: ShownKey, errors: Mapping[float, float]) -> str:
    """Say at which value, or between which values, hunting begins or ends.

    `errors` holds errors [SI] by the values of flips, folds and other special points.
    """
    if change.low == change.high:
        return f"at {key.named} = {key.as_known(change.low, errors[change.low])}"
    return f"between {key.named} = {key.text(change.low)} and {key.text(change.high)}, where no cycle could be followed"


def _of_diagram(traced: Diagram, key: ShownKey) -> list[str]:
    """Describe each branch over one key, and its flips, folds and other special points."""
    branches = boundary.lines(traced)
    turns = sorted((line.at[k, 0], _turn(line, k, key)) for line in branches for k in line.special)
    also = _also_attracting(traced, key)
    return [*also, *(text for _, text in turns), *(_branch_sentence(line, key, traced.space) for line in branches)]


def _turn(line: Line, k: int, key: ShownKey) -> str:
    """Say what happens to a cycle at a flip, fold or other special point as the key rises."""
    value = float(line.at[k, 0])
    above = [j for j in (k - 1, k + 1) if 0 <= j < len(line.at) and line.at[j, 0] > value]
    goes_on = bool(above) if line.kinds[k] == "fold" else any(line.attracts[min(j, k)] for j in above)
    verb = _VERBS[line.kinds[k] == "fold", goes_on]
    size = f"{swing_with_unit(line.amplitude[k], line.middle[k], 'm')} every {with_unit(line.period[k], 's')}"
    where = f"{key.key} = {key.uncertain(value, float(line.error[k, 0]))}"
    meaning = f"{line.kinds[k]}: {'below' if goes_on else 'above'}, {MEANINGS[line.kinds[k]]}"
    return f"{CYCLES[line.shape].capitalize()} ({size}) {verb} at {where} ({meaning})."


_VERBS = {
    (True, True): "appears",
    (True, False): "vanishes",
    (False, True): "begins to attract",
    (False, False): "stops attracting",
}


def _branch_sentence(line: Line, key: ShownKey, space: Space) -> str:
    """Say over which values a branch was followed, and how it ends."""
    pair = "Asymmetric cycles, which bound the basin of the hunting cycle where they repel,"
    name = pair if line.shape == "asymmetric" else "Hunting cycles"
    return f"{name} were followed over {key.extent(line.at[:, 0], space.ranges[0])}{_ends(line)}."


def end_sentence(traced: Diagram, key: ShownKey) -> str:
    """Give the verdicts at both ends of the key's range."""
    swept = traced.space.ranges[0]
    first, last = boundary.end_verdicts(traced)
    return f"At {key.text(swept.low)}: {VERDICTS[first]}; at {key.text(swept.high)}: {VERDICTS[last]}."


def _of_plane(traced: Plane, keys: tuple[ShownKey, ...]) -> list[str]:
    """Describe each curve in the plane of two keys, and the corners."""
    curves = boundary.curves(traced)
    text = [f"{_course(curve, keys)} ({_accuracy(curve, keys)})." for curve in curves]
    kinds = dict.fromkeys(kind for curve in curves for kind in curve.kinds if kind in MEANINGS)
    return [*text, *(f"{kind.capitalize()}: beyond, {MEANINGS[kind]}." for kind in kinds), *_corners(traced, keys)]


def _accuracy(curve: PlaneCurve, keys: tuple[ShownKey, ...]) -> str:
    """Say how many points a curve has of each kind, and how far apart the stages beside it are at most."""
    kinds = [f"{curve.kinds.count(kind)} by {KINDS[kind]}" for kind in dict.fromkeys(curve.kinds)]
    errors = ", ".join(key.text(error, 1) for key, error in zip(keys, curve.error.max(axis=0), strict=True))
    return f"{len(curve.at)} points, {', '.join(kinds)}; largest error: {errors}"


KINDS: dict[LossKind, str] = {
    "flip": "a flip",
    "fold": "a fold",
    "torus": "a torus",
    "lost": "the end of the cycle",
    "seen": "simulation",
}
"""What ends hunting at points of a curve, in words."""


def _corners(traced: Plane, keys: tuple[ShownKey, ...]) -> list[str]:
    """Give the verdicts at the corners of the plane, in one sentence if they agree."""
    corners = boundary.corner_verdicts(traced)
    if len({verdict for _, _, verdict in corners}) == 1:
        return [f"At all four corners: {VERDICTS[corners[0][2]]}."]
    return [f"At {_place((x, y), keys)}: {VERDICTS[verdict]}." for x, y, verdict in corners]


def _place(values: Sequence[float], keys: tuple[ShownKey, ...], digits: int = DIGITS) -> str:
    """Write a point in the plane of two keys, given by its `values` [SI]."""
    return ", ".join(f"{key.key} = {key.text(value, digits)}" for key, value in zip(keys, values, strict=True))


def _no_boundary(space: Space, keys: tuple[ShownKey, ...]) -> str:
    """Say that hunting neither begins nor ends in the range."""
    between = (
        f"{key.named} {key.text(swept.low)} to {key.text(swept.high)}"
        for key, swept in zip(keys, space.ranges, strict=True)
    )
    return f"No beginning or end of hunting was found for {', '.join(between)}."


def _ends(line: Line) -> str:
    """Say how a branch of cycles ends at both ends, as the last part of a sentence."""
    if set(line.ends) == {END_OF_RANGE}:
        return ", to both ends of the range"
    return f"; ends: {'; '.join(dict.fromkeys(line.ends))}"
