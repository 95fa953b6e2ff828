"""The kinds of motion as pieces of parabola: within a piece, r = r_0 + v_0 t + a_0 t^2/2, t from its start."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

Piece = tuple[Any, Any, Any, Any]
"""Start time [s], and position [m], velocity [m/s] and acceleration [m/s^2] there."""


CRUISE = "motion.cruise_ratio"
"""Time at constant speed between acceleration and braking, over the acceleration time; without it there is none."""


def _there(flat: Mapping[str, Any]) -> Any:
    """Length of the step there [m]."""
    return flat["motion.acceleration"] * flat["motion.acceleration_time"] ** 2 * (1 + flat.get(CRUISE, 0.0))


def _there_and_back(flat: Mapping[str, Any]) -> list[Piece]:
    """Return the pieces of a motion there and back: time, position,
    velocity and acceleration at each corner."""
    a, ramp, return_at = (flat[f"motion.{name}"] for name in ("acceleration", "acceleration_time", "return_at"))
    size, top, cruise = _there(flat), a * ramp, flat.get(CRUISE)
    if cruise is not None:
        middle = size - top * ramp / 2
        return [
            (0.0, 0.0, 0.0, a),
            (ramp, top * ramp / 2, top, 0.0),
            ((1 + cruise) * ramp, middle, top, -a),
            ((2 + cruise) * ramp, size, 0.0, 0.0),
            (return_at, size, 0.0, -a),
            (return_at + ramp, middle, -top, 0.0),
            (return_at + (1 + cruise) * ramp, top * ramp / 2, -top, a),
            (return_at + (2 + cruise) * ramp, 0.0, 0.0, 0.0),
        ]
    return [
        (0.0, 0.0, 0.0, a),
        (ramp, size / 2, top, -a),
        (2 * ramp, size, 0.0, 0.0),
        (return_at, size, 0.0, -a),
        (return_at + ramp, size / 2, -top, a),
        (return_at + 2 * ramp, 0.0, 0.0, 0.0),
    ]


def _constant(position: Any, velocity: Any) -> list[Piece]:
    return [(0.0, position, velocity, 0.0)]


_PIECES: dict[str, Callable[[Mapping[str, Any]], list[Piece]]] = {
    "there_and_back": _there_and_back,
    "release": lambda flat: _constant(0.0, 0.0),
    "step": lambda flat: _constant(flat["motion.size"], 0.0),
    "ramp": lambda flat: _constant(0.0, flat["motion.velocity"]),
    "hold": lambda flat: _constant(0.0, 0.0),
}

_SIZES: dict[str, Callable[[Mapping[str, Any]], Any]] = {
    "there_and_back": _there,
    "release": lambda flat: flat["motion.displacement"],
    "step": lambda flat: flat["motion.size"],
    "ramp": lambda flat: flat["motion.velocity"] * flat["motion.duration"],
    "hold": lambda flat: 0.0,
}


def pieces(flat: Mapping[str, Any], runs: int) -> np.ndarray:
    """Return the reference of each run, shape (runs, pieces, 4): start [s], position [m],
    velocity, acceleration."""
    rows = _PIECES[flat["motion.kind"]](flat)
    full = np.empty((runs, len(rows), 4))
    for i, j in np.ndindex(len(rows), 4):
        full[:, i, j] = rows[i][j]
    return full


def reference(flat: Mapping[str, Any], time: np.ndarray) -> np.ndarray:
    """Reference position [m] at the times [s], of one run."""
    rows = pieces(flat, 1)[0]
    row = rows[np.searchsorted(rows[:, 0], time, side="right") - 1]
    elapsed = time - row[:, 0]
    return row[:, 1] + row[:, 2] * elapsed + row[:, 3] * elapsed**2 / 2


def size(flat: Mapping[str, Any]) -> Any:
    """Length of the motion [m]; 0 where the reference stands still from the start."""
    return np.abs(_SIZES[flat["motion.kind"]](flat))


def initial_displacement(flat: Mapping[str, Any]) -> Any:
    """Position of all masses at the start [m]."""
    return flat["motion.displacement"] if flat["motion.kind"] == "release" else 0.0


@dataclass(frozen=True)
class Stand:
    """A place where the reference comes to stand: from its `corner` [s] on, `until` [s] it leaves or the run ends."""

    corner: Any
    until: Any


def stands(flat: Mapping[str, Any]) -> list[Stand]:
    """Return the places where the reference comes to stand, one after the other:
    both ends of a motion there and back, and of any other motion where it ends; of one that never stands, from its last
    corner on."""
    last = Stand(last_corner(flat), flat["motion.duration"])
    if flat["motion.kind"] != "there_and_back":
        return [last]
    rows = _there_and_back(flat)
    return [Stand(rows[len(rows) // 2 - 1][0], flat["motion.return_at"]), last]


def last_corner(flat: Mapping[str, Any]) -> Any:
    """Time of the last corner of the reference [s]: from then on it stays as it is."""
    return _PIECES[flat["motion.kind"]](flat)[-1][0]


def without_motion(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return the flat keys without those of the motion."""
    return {key: value for key, value in flat.items() if not key.startswith("motion.")}


def standing(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return the flat keys of a stage whose reference stands from the start.

    It stands where the reference of its own motion stands after the last corner. Magnitudes remain those of its own
    motion.
    """
    if flat["motion.kind"] != "there_and_back":
        return dict(flat)
    return {**without_motion(flat), "motion.kind": "release", "motion.displacement": size(flat)}
