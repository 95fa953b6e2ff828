"""Moves as drives plan them: each limit is reached as early as the others allow.

There are limits up to the jerk, or the snap. A move of a distance is its step, smoothed by one moving average for each
limit. With widths T1 >= T2 + T3 + ... of these averages the peaks of its derivatives are D/T1, D/(T1 T2), ...: the
widths follow from the limits, the innermost first (Lambrechts, Boerlage and Steinbuch 2005,
doi:10.1016/j.conengprac.2004.04.010, for the third and fourth order).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np

from friso.equations.motions.settings import MotionSettings
from friso.quantities import Bound, Quantity, Value, non_negative, positive
from friso.stage.rig import DURATION, Lowered, Motion, Piece, ReferenceForm, Stand, register_motion
from friso.stage.section import Rule, Several, Values, element_keys
from friso.stage.tables import TIME_ROUNDING

LIMITS = {"velocity": "m/s", "acceleration": "m/s^2", "jerk": "m/s^3", "snap": "m/s^4"}
"""Limits of a move, from velocity to its highest derivative, and their units."""

DISTANCE, DWELL = "motion.distance", "motion.dwell"

not_zero = Bound("not 0", lambda value: value != 0)


class Plan(NamedTuple):
    """A planned move of a distance [m].

    A move is a step, smoothed by moving averages: `widths` are their widths [s], shape (order, ...). `top` is the
    move's highest derivative [SI].
    """

    distance: Any
    widths: np.ndarray
    top: Any

    @property
    def time(self) -> Any:
        """Return how long the move takes [s]."""
        return self.widths.sum(axis=0)

    @property
    def peaks(self) -> list[Any]:
        """Return the largest velocity, acceleration, ... that the move reaches [SI]."""
        return [np.abs(self.distance) / np.prod(self.widths[: k + 1], axis=0) for k in range(len(self.widths))]


def plan(distance: Any, limits: Sequence[Any]) -> Plan:
    """Plan a move of a distance [m] within limits of velocity, acceleration and so on [SI].

    Limits may be numbers or arrays.
    """
    peaks = np.broadcast_arrays(np.abs(distance), *limits)
    order = len(limits)
    widths: list[Any] = []
    for k in range(order, 0, -1):
        inner, scale = sum(widths), peaks[order] * np.prod(widths, axis=0)
        reached = (_widest(peaks[m] / scale, k - 1 - m, inner) for m in range(k))
        widths.insert(0, np.maximum(np.minimum.reduce([*reached]), inner))
    return Plan(distance, np.array(widths), np.sign(distance) * peaks[order])


def _widest(product_of_widths: Any, further: int, inner: Any) -> Any:
    """Return the largest width x of an average for which a derivative stays within its limit.

    It solves x (x + inner)^p 2^(p (p - 1)/2) = limit. The p `further` averages outside are as narrow as they can be:
    each as wide as all averages within it together. Newton's method starts from the right, where it cannot overshoot.
    """
    target = product_of_widths / 2 ** (further * (further - 1) // 2)
    x = target ** (1 / (further + 1))
    for _ in range(100 * further):
        power = (x + inner) ** (further - 1)
        change = (x * power * (x + inner) - target) / (power * (x + inner + further * x))
        x = np.maximum(x - change, 0.0)
        if np.all(np.abs(change) <= 4 * np.finfo(float).eps * x):
            break
    return x


def corners(move: Plan, start: Any, position: Any) -> list[Piece]:
    """Return the pieces of a move that begins at a time [s] and a position [m].

    Some pieces may have no duration. A piece begins at every sum of some of the averages' widths (`Plan.widths`), where
    the highest derivative changes. The second half mirrors the first, so that the move ends exactly at its target, at
    rest.
    """
    order = len(move.widths)
    choices = np.array(list(product((0, 1), repeat=order)))
    times = np.tensordot(choices, move.widths, axes=1)
    which = np.argsort(times, axis=0, kind="stable")
    times = np.take_along_axis(times, which, axis=0)
    signs = np.reshape((-1.0) ** choices.sum(axis=1), (-1,) + (1,) * (times.ndim - 1)) * np.ones_like(times)
    tops = np.cumsum(np.take_along_axis(signs, which, axis=0), axis=0) * move.top
    half = len(times) // 2
    states = [[0.0] * order]
    for i in range(half - 1):
        states.append(_later([*states[-1], tops[i]], times[i + 1] - times[i])[:order])
    mirror = [(-1.0) ** (k + 1) for k in range(order)]
    for row in reversed(states[:half]):
        states.append([sign * number for sign, number in zip(mirror, row, strict=True)])
        states[-1][0] = states[-1][0] + move.distance
    tops[-1] = 0.0
    return [
        (start + time, position + state[0], *state[1:], top)
        for time, state, top in zip(times, states, tops, strict=True)
    ]


def _later(derivatives: Sequence[Any], time: Any) -> list[Any]:
    """Return the derivatives of a polynomial, position included, at a later time [s]."""
    later: list[Any] = []
    for k in range(len(derivatives)):
        total = derivatives[-1]
        for m in range(len(derivatives) - 1, k, -1):
            total = total * time / (m - k) + derivatives[m - 1]
        later.append(total)
    return later


def _distances(flat: Mapping[str, Any]) -> list[Any]:
    return [flat[key] for key in element_keys(flat, DISTANCE)]


def _limits(flat: Mapping[str, Any]) -> list[Any]:
    return [flat[f"motion.{name}"] for name in LIMITS if f"motion.{name}" in flat]


def _moves(flat: Mapping[str, Any]) -> list[tuple[Plan, Any, Any]]:
    """Return the planned moves, each with its start [s] and the position there [m]."""
    moves, start, position, limits = [], 0.0, 0.0, _limits(flat)
    for distance in _distances(flat):
        move = plan(distance, limits)
        moves.append((move, start, position))
        start, position = start + move.time + flat[DWELL], position + distance
    return moves


def _end(flat: Mapping[str, Any]) -> Any:
    """Return the time [s] at which the last move ends."""
    move, start, _ = _moves(flat)[-1]
    return start + move.time


_MOST = MotionSettings().most_moves


@register_motion
class MoveProfile(Motion):
    """Moves planned as drives do, one after the other with a dwell after each.

    Velocity, acceleration and, if given, jerk and snap stay within their limits; a distance too short for a limit
    lowers its peak.
    """

    kind: Literal["profile"]
    distance: Annotated[
        Values,
        Several(Quantity("m", not_zero, "5 mm"), ("5 mm", "-5 mm", "20 um"), 1, _MOST, alone=True),
    ]
    """Distances of the moves in turn: forward (positive) or back (negative)."""
    velocity: Annotated[Value, Quantity("m/s", positive, "0.5 m/s")]
    acceleration: Annotated[Value, Quantity("m/s^2", positive, "10 m/s^2")]
    jerk: Annotated[Value | None, Quantity("m/s^3", positive, "1000 m/s^3")] = None
    snap: Annotated[Value | None, Quantity("m/s^4", positive, "1e5 m/s^4")] = None
    dwell: Annotated[Value, Quantity("s", non_negative, "0.5 s")]
    """Time for which the reference stands still after each move."""
    duration: Annotated[Value | None, Quantity("s", positive, "20 s")] = None
    """Duration of the run; default: that of all moves with their dwells."""

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            ("motion.snap", "motion.jerk"),
            lambda f: "motion.snap" not in f or "motion.jerk" in f,
            "a limit of jerk beside one of snap",
            'jerk = "1000 m/s^3", snap = "1e5 m/s^4"',
        ),
        Rule(
            (DISTANCE, DURATION),
            lambda f: _end(f) <= f[DURATION] * (1 + TIME_ROUNDING),
            "a duration in which all moves end; left out, it is that of all moves with their dwells",
            'duration = "20 s"',
        ),
    )

    @staticmethod
    def form(flat: Mapping[str, Any]) -> ReferenceForm:
        """Say what the reference consists of: polynomials whose degree is the number of limits."""
        return ReferenceForm(len(_limits(flat)))

    @staticmethod
    def pieces(flat: Mapping[str, Any]) -> Sequence[Piece]:
        """Return the pieces of all moves; during the last piece the reference stands."""
        return [piece for move, start, position in _moves(flat) for piece in corners(move, start, position)]

    @staticmethod
    def motion_size(flat: Mapping[str, Any]) -> Any:
        """Return the distance [m] between the outermost positions at which the reference stands."""
        places = np.cumsum([np.zeros_like(_distances(flat)[0]), *_distances(flat)], axis=0)
        return places.max(axis=0) - places.min(axis=0)

    @classmethod
    def stands(cls, flat: Mapping[str, Any]) -> Sequence[Stand]:
        """Return where the reference stands: from the end of each move to the start of the next."""
        moves = _moves(flat)
        leaves = [*(start for _, start, _ in moves[1:]), flat[DURATION]]
        return [Stand(start + move.time, until) for (move, start, _), until in zip(moves, leaves, strict=True)]

    @staticmethod
    def lowered(flat: Mapping[str, Any]) -> Sequence[Lowered]:
        """Return the limits that short moves do not reach, with the peaks that they reach instead."""
        return [
            Lowered(float(move.distance), name, float(flat[f"motion.{name}"]), float(peak), unit)
            for move, _, _ in _moves(flat)
            for (name, unit), peak in zip(LIMITS.items(), move.peaks, strict=False)
            if peak < flat[f"motion.{name}"] * (1 - TIME_ROUNDING)
        ]

    @staticmethod
    def with_defaults(flat: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the default duration: the time of all moves with their dwells."""
        return {} if DURATION in flat else {DURATION: _end(flat) + flat[DWELL]}

    @staticmethod
    def stretched(flat: Mapping[str, Any], factor: Any) -> Mapping[str, Any]:
        """Return the distances of moves longer by a factor, within equal limits, by key [SI]."""
        return {key: flat[key] * factor for key in element_keys(flat, DISTANCE)}

    @staticmethod
    def varied(flat: Mapping[str, Any], shares: tuple[float, float]) -> Mapping[str, tuple[float, float]]:
        """Return the ranges in which acceleration and velocity are varied, by key [SI].

        `shares` are the ends of these ranges, as multiples of the stage's own values.
        """
        keys = ("motion.acceleration", "motion.velocity")
        return {key: (shares[0] * flat[key], shares[1] * flat[key]) for key in keys}
