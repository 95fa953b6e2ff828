"""The motions of friso's own; an import of the package registers them.

Planned moves are those of drives: each limit is reached as early as the others allow. There are limits up to the jerk,
or the snap. A move of a distance D is its step, smoothed by one moving average for each limit. With widths T1 >= T2 +
T3 + ... of these averages the peaks of its derivatives are D/T1, D/(T1 T2), ...: the widths follow from the limits, the
innermost first (Lambrechts, Boerlage and Steinbuch 2005, doi:10.1016/j.conengprac.2004.04.010, for the third and fourth
order).

Two equal steps go there and back, with bounded acceleration.

A chirp swings ever faster, or ever more slowly. A multisine is the sum of several swings.

With released masses, the masses begin displaced and the reference stands still.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from importlib import import_module
from itertools import product
from math import lcm, pi
from pkgutil import iter_modules
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np

from friso.quantities import Bound, Number, Quantity, Value, any_sign, non_negative, positive
from friso.stage.rig import DURATION, Lowered, Motion, Piece, ReferenceForm, Stand, Tone, register_motion
from friso.stage.section import Rule, Several, Values, element_keys
from friso.stage.tables import TIME_ROUNDING

CHIRP_AMPLITUDE, START, END = (f"motion.{name}" for name in ("amplitude", "start_frequency", "end_frequency"))


@register_motion
class Chirp(Motion):
    """The reference swings about 0; its frequency changes evenly over the duration."""

    kind: Literal["chirp"]
    amplitude: Annotated[Value, Quantity("m", positive, "1 mm")]
    start_frequency: Annotated[Value, Quantity("Hz", non_negative, "0.5 Hz")]
    end_frequency: Annotated[Value, Quantity("Hz", positive, "20 Hz")]

    rests = False

    @staticmethod
    def form(flat: Mapping[str, Any]) -> ReferenceForm:
        """Say that the reference consists of one sinusoid."""
        return ReferenceForm(tones=1)

    @staticmethod
    def tones(flat: Mapping[str, Any]) -> Sequence[Tone]:
        """Return the sinusoid, with its changing frequency."""
        return [Tone(flat[CHIRP_AMPLITUDE], 0.0, flat[START], (flat[END] - flat[START]) / flat[DURATION])]

    @staticmethod
    def motion_size(flat: Mapping[str, Any]) -> Any:
        """Return the amplitude [m]."""
        return flat[CHIRP_AMPLITUDE]


@register_motion
class Hold(Motion):
    """The reference stays 0."""

    kind: Literal["hold"]


AMPLITUDES, FREQUENCIES, PHASES = (f"motion.{name}" for name in ("amplitude", "frequency", "phase"))


def _numbers(flat: Mapping[str, Any], key: str) -> list[Any]:
    return [flat[name] for name in element_keys(flat, key)]


_MOST_TONES = 24
"""Most sinusoids of a reference. Each adds to the code of every step, which takes longer to compile."""


@register_motion
class Multisine(Motion):
    """The reference is a sum of sinusoids."""

    kind: Literal["multisine"]
    amplitude: Annotated[Values, Several(Quantity("m", positive, "1 mm"), ("1 mm", "0.5 mm"), 2, _MOST_TONES)]
    frequency: Annotated[Values, Several(Quantity("Hz", positive, "1 Hz"), ("1 Hz", "3 Hz"), 2, _MOST_TONES)]
    phase: Annotated[
        Values | None, Several(Quantity("rad", any_sign, "0 deg"), ("0 deg", "90 deg"), 2, _MOST_TONES)
    ] = None
    """Phases at time 0; default: 0."""

    rests = False
    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            (AMPLITUDES, FREQUENCIES, PHASES),
            lambda f: (
                len(_numbers(f, AMPLITUDES)) == len(_numbers(f, FREQUENCIES))
                and len(_numbers(f, PHASES)) in (0, len(_numbers(f, FREQUENCIES)))
            ),
            "as many amplitudes as frequencies, and as many phases, if any",
            'amplitude = ["1 mm", "0.5 mm"], frequency = ["1 Hz", "3 Hz"]',
        ),
    )

    @staticmethod
    def form(flat: Mapping[str, Any]) -> ReferenceForm:
        """Say of how many sinusoids the reference consists: one for each frequency."""
        return ReferenceForm(tones=len(_numbers(flat, FREQUENCIES)))

    @staticmethod
    def tones(flat: Mapping[str, Any]) -> Sequence[Tone]:
        """Return the sinusoids."""
        amplitudes, frequencies = _numbers(flat, AMPLITUDES), _numbers(flat, FREQUENCIES)
        phases = _numbers(flat, PHASES) or [0.0] * len(frequencies)
        return [Tone(a, phase / (2 * pi), f) for a, f, phase in zip(amplitudes, frequencies, phases, strict=True)]

    @staticmethod
    def motion_size(flat: Mapping[str, Any]) -> Any:
        """Return the sum of the amplitudes [m]."""
        return sum(_numbers(flat, AMPLITUDES))

    @staticmethod
    def period(flat: Mapping[str, Any]) -> float | None:
        """Return the time [s] after which all sinusoids repeat.

        The result is None if they never repeat together, or only after more than the duration.
        """
        first, *others = (float(frequency) for frequency in _numbers(flat, FREQUENCIES))
        most = max(1, int(first * flat[DURATION]))
        ratios = [Fraction(other / first).limit_denominator(most) for other in others]
        exact = all(
            abs(other / first - ratio) <= TIME_ROUNDING * ratio for other, ratio in zip(others, ratios, strict=True)
        )
        periods = lcm(*(ratio.denominator for ratio in ratios))
        return periods / first if exact and periods <= most else None


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


_MOST_MOVES = 100
"""Most moves of a profile. Each has eight pieces or more, and its own settling time."""


@register_motion
class MoveProfile(Motion):
    """Moves planned as drives do, one after the other with a dwell after each.

    Velocity, acceleration and, if given, jerk and snap stay within their limits; a distance too short for a limit
    lowers its peak.
    """

    kind: Literal["profile"]
    distance: Annotated[
        Values,
        Several(Quantity("m", not_zero, "5 mm"), ("5 mm", "-5 mm", "20 um"), 1, _MOST_MOVES, alone=True),
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


VELOCITY = "motion.velocity"


@register_motion
class Ramp(Motion):
    """The reference moves at constant velocity."""

    kind: Literal["ramp"]
    velocity: Annotated[Value, Quantity("m/s", any_sign, "0.1 m/s")]

    rests = False

    @staticmethod
    def pieces(flat: Mapping[str, Any]) -> Sequence[Piece]:
        """Return the one piece of the reference: constant velocity, from position 0 at time 0."""
        return [(0.0, 0.0, flat[VELOCITY], 0.0)]

    @staticmethod
    def motion_size(flat: Mapping[str, Any]) -> Any:
        """Return the distance that the reference travels [m]."""
        return np.abs(flat[VELOCITY] * flat[DURATION])


DISPLACEMENT = "motion.displacement"


@register_motion
class Release(Motion):
    """Everything displaced and at rest, the reference 0."""

    kind: Literal["release"]
    displacement: Annotated[Value, Quantity("m", any_sign, "2 mm")]

    @staticmethod
    def motion_size(flat: Mapping[str, Any]) -> Any:
        """Return the initial displacement of the masses [m]."""
        return np.abs(flat[DISPLACEMENT])

    @staticmethod
    def initial_displacement(flat: Mapping[str, Any]) -> Any:
        """Return the position from which the masses are released [m]."""
        return flat[DISPLACEMENT]

    @staticmethod
    def stretched(flat: Mapping[str, Any], factor: Any) -> Mapping[str, Any]:
        """Return the displacement of a motion that is larger by a factor, by key [SI].

        The result is empty for a displacement of 0.
        """
        return {DISPLACEMENT: flat[DISPLACEMENT] * factor} if np.any(flat[DISPLACEMENT]) else {}


AMPLITUDE, FREQUENCY = "motion.amplitude", "motion.frequency"


@register_motion
class Sine(Motion):
    """The reference swings about 0, forward at first."""

    kind: Literal["sine"]
    amplitude: Annotated[Value, Quantity("m", positive, "1 mm")]
    frequency: Annotated[Value, Quantity("Hz", positive, "2 Hz")]

    rests = False

    @staticmethod
    def form(flat: Mapping[str, Any]) -> ReferenceForm:
        """Say that the reference consists of one sinusoid."""
        return ReferenceForm(tones=1)

    @staticmethod
    def tones(flat: Mapping[str, Any]) -> Sequence[Tone]:
        """Return the sinusoid."""
        return [Tone(flat[AMPLITUDE], 0.0, flat[FREQUENCY])]

    @staticmethod
    def motion_size(flat: Mapping[str, Any]) -> Any:
        """Return the amplitude [m]."""
        return flat[AMPLITUDE]

    @staticmethod
    def period(flat: Mapping[str, Any]) -> float | None:
        """Return the period [s]."""
        return 1 / flat[FREQUENCY]


SIZE = "motion.size"


@register_motion
class Step(Motion):
    """The reference jumps at the start."""

    kind: Literal["step"]
    size: Annotated[Value, Quantity("m", any_sign, "1 mm")]

    @staticmethod
    def pieces(flat: Mapping[str, Any]) -> Sequence[Piece]:
        """Return the one piece of the reference: it stands at the end of the step from the start."""
        return [(0.0, flat[SIZE], 0.0, 0.0)]

    @staticmethod
    def motion_size(flat: Mapping[str, Any]) -> Any:
        """Return the size of the step [m]."""
        return np.abs(flat[SIZE])

    @staticmethod
    def stretched(flat: Mapping[str, Any], factor: Any) -> Mapping[str, Any]:
        """Return the size of a step that is larger by a factor, by key [SI].

        The result is empty for a step of 0.
        """
        return {SIZE: flat[SIZE] * factor} if np.any(flat[SIZE]) else {}


ACCELERATION, TIME, RETURN, CRUISE = (
    f"motion.{name}" for name in ("acceleration", "acceleration_time", "return_at", "cruise_ratio")
)


def _time_there(flat: Mapping[str, Any]) -> Any:
    """Return the time that the outward move takes [s]."""
    return (2 + flat.get(CRUISE, 0.0)) * flat[TIME]


@register_motion
class ThereAndBack(Motion):
    """Two equal steps, there and back, each accelerating for acceleration_time and braking so.

    With a cruise_ratio, a step has constant speed in between, for so many times the acceleration_time.
    """

    kind: Literal["there_and_back"]
    acceleration: Annotated[Value, Quantity("m/s^2", non_negative, "100 m/s^2")]
    acceleration_time: Annotated[Value, Quantity("s", non_negative, "30 ms")]
    return_at: Annotated[Value, Quantity("s", non_negative, "5 s")]
    cruise_ratio: Annotated[float | None, Number(positive, "1.0")] = None

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            (TIME, RETURN),
            lambda f: _time_there(f) <= f[RETURN] * (1 + TIME_ROUNDING),
            "the move there (2 + cruise_ratio times acceleration_time) finished before return_at",
            'acceleration_time = "30 ms", return_at = "5 s"',
        ),
        Rule(
            (TIME, RETURN, DURATION),
            lambda f: f[RETURN] + _time_there(f) <= f[DURATION] * (1 + TIME_ROUNDING),
            "the move back (return_at + 2 + cruise_ratio times acceleration_time) finished within the duration",
            'acceleration_time = "30 ms", return_at = "5 s", duration = "20 s"',
        ),
    )

    @staticmethod
    def motion_size(flat: Mapping[str, Any]) -> Any:
        """Return the length of the step there [m]."""
        return flat[ACCELERATION] * flat[TIME] ** 2 * (1 + flat.get(CRUISE, 0.0))

    @staticmethod
    def pieces(flat: Mapping[str, Any]) -> Sequence[Piece]:
        """Return the pieces of the move: start [s], position [m], velocity [m/s], and acceleration.

        The acceleration is in [m/s^2].
        """
        a, ramp, back = (flat[key] for key in (ACCELERATION, TIME, RETURN))
        size, top, cruise = ThereAndBack.motion_size(flat), a * ramp, flat.get(CRUISE)
        if cruise is not None:
            middle = size - top * ramp / 2
            return [
                (0.0, 0.0, 0.0, a),
                (ramp, top * ramp / 2, top, 0.0),
                ((1 + cruise) * ramp, middle, top, -a),
                ((2 + cruise) * ramp, size, 0.0, 0.0),
                (back, size, 0.0, -a),
                (back + ramp, middle, -top, 0.0),
                (back + (1 + cruise) * ramp, top * ramp / 2, -top, a),
                (back + (2 + cruise) * ramp, 0.0, 0.0, 0.0),
            ]
        return [
            (0.0, 0.0, 0.0, a),
            (ramp, size / 2, top, -a),
            (2 * ramp, size, 0.0, 0.0),
            (back, size, 0.0, -a),
            (back + ramp, size / 2, -top, a),
            (back + 2 * ramp, 0.0, 0.0, 0.0),
        ]

    @classmethod
    def stands(cls, flat: Mapping[str, Any]) -> Sequence[Stand]:
        """Return where the reference stands: at the far end until its return, then at the start."""
        rows = cls.pieces(flat)
        return [Stand(rows[len(rows) // 2 - 1][0], flat[RETURN]), Stand(rows[-1][0], flat[DURATION])]

    @staticmethod
    def stretched(flat: Mapping[str, Any], factor: Any) -> Mapping[str, Any]:
        """Return the acceleration time of a move that is longer by a factor, by key [SI].

        The result is empty for a move without duration.
        """
        return {TIME: flat[TIME] * factor**0.5} if np.any(flat[TIME]) else {}

    @staticmethod
    def varied(flat: Mapping[str, Any], shares: tuple[float, float]) -> Mapping[str, tuple[float, float]]:
        """Return the ranges in which acceleration and its time are varied, by key [SI].

        `shares` are the ends of these ranges, as multiples of the stage's own values. The outward move must end before
        the return. The result is empty for a move of length 0.
        """
        least, most = shares
        acceleration, time = flat[ACCELERATION], flat[TIME]
        if not acceleration * time:
            return {}
        longest = min(most * time, flat[RETURN] / (2 + flat.get(CRUISE, 0.0)))
        return {ACCELERATION: (least * acceleration, most * acceleration), TIME: (least * time, longest)}


for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")
