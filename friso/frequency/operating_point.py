"""Find the friction law's steady state: stuck under a bias force, or sliding at a speed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from friso.frequency.friction import FORWARD, law_of
from friso.frequency.members import Members
from friso.stage.transmission import STATE_PREFIX, of_motor


def operating_point(flat: Mapping[str, Any], members: Members) -> dict[str, Any]:
    """Return the steady values of a stage's friction law in each state of `members`, by name.

    Each has the shape (members,). They are the values of its internal states, of its modes with memory, of the sides of
    its kinks (where derivatives jump), and of its direction. The result is empty without friction.
    """
    law, forward = law_of(flat), members.forward.astype(float)
    if law is None:
        return {}
    sign = 2 * forward - 1
    at = {**flat, "velocity": sign * np.maximum(members.speed, np.finfo(float).tiny), FORWARD: forward}
    sliding, stuck = law.sliding(at), law.stuck({**at, "bias": sign * members.bias})
    internal = {
        name: np.where(members.stuck, rest, moving)
        for name, rest, moving in zip((*law.states, *law.modes), stuck, sliding, strict=True)
    }
    return {FORWARD: forward, **internal}


def operating_point_of_motor(flat: Mapping[str, Any], members: Members) -> dict[str, Any]:
    """Return the steady values of the friction law at the motor in each state, by name.

    The motor moves with the load and bears no bias force.
    """
    unbiased = replace(members, bias=np.zeros(len(members)))
    point = operating_point(of_motor(flat), unbiased)
    beyond = "beyond_"
    return {
        f"{beyond}{STATE_PREFIX}{name.removeprefix(beyond)}" if name.startswith(beyond) else f"{STATE_PREFIX}{name}": at
        for name, at in point.items()
    }
