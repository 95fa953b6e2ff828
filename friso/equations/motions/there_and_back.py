"""Two equal steps, there and back, with bounded acceleration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from friso.quantities import Number, Quantity, Value, non_negative, positive
from friso.stage.rig import DURATION, Motion, Piece, Stand, register_motion
from friso.stage.section import Rule
from friso.stage.tables import TIME_ROUNDING

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
