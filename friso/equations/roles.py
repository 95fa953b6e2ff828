"""Name the roles of states, and the motion from which runs begin,
for modules that use states by role."""

from __future__ import annotations

from enum import StrEnum
from typing import Any, NamedTuple


class Role(StrEnum):
    """Role of a state in the model."""

    POSITION = "position"
    """Of a mass [m]."""
    VELOCITY = "velocity"
    """Of a mass [m/s]."""
    BRISTLE = "bristle"
    """Of the friction law: what it remembers of the motion. Relaxed, it is 0."""
    INTEGRAL = "integral"
    """Of a controller: it winds up while a stage sticks off its reference."""
    FILTER = "filter"
    """Of a controller: it settles while what it measures stays as it is."""
    LAG = "lag"
    """A force on its way from the controller to the stage."""
    DEVIATION = "deviation"
    """A small deviation of another state (variational equations)."""
    SUM = "sum"
    """Integrated beside a motion, on which it does not act."""


class Steady(NamedTuple):
    """A steady motion: error [m], position [m] and velocity [m/s] of all masses, velocity of the reference [m/s] and
    force of the controller [N]; numbers, arrays or symbols."""

    error: Any
    position: Any
    velocity: Any = 0.0
    reference_velocity: Any = 0.0
    force: Any = 0.0
