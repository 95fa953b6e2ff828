"""Compute springs in series: joint and bearing (Eq. 1), and the touched limiter (Table 1).

The numbers are those of the thesis. The bearing acts as a spring before it slides.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def in_series(first: Any, second: Any) -> Any:
    """Return the stiffness [N/m] of two springs, or damping [N s/m] of two dampers, in series.

    See Eq. 1 of the thesis.
    """
    return first * second / (first + second)


def limiter_in_series(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return a stage's keys with joint and limiter in series as its joint, as Table 1 prints.

    Stiffness and damping are k1 k2 / (k1 + k2), and the limiter never touches.
    """
    pairs = {"stiffness": "limiter_stiffness", "damping": "limiter_damping"}
    free = {"joint.stroke": 1.0}  # so long that the limiter does not touch
    return {**flat, **free, **{f"joint.{a}": _printed(flat, a, b) for a, b in pairs.items() if f"joint.{a}" in flat}}


def _printed(flat: Mapping[str, Any], joint: str, limiter: str) -> Any:
    joint_value, limiter_value = flat[f"joint.{joint}"], flat[f"joint.{limiter}"]
    return in_series(joint_value, limiter_value) if joint_value + limiter_value else joint_value
