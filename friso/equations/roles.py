"""Name the roles of states, and the motion from which runs begin."""

from __future__ import annotations

from enum import StrEnum
from typing import Any, NamedTuple


class Role(StrEnum):
    """Role of a state in the model."""

    POSITION = "position"
    """Position of a mass [m]."""
    VELOCITY = "velocity"
    """Velocity of a mass [m/s]."""
    BRISTLE = "bristle"
    """State of a friction law: its memory of past motion, 0 when relaxed."""
    INTEGRAL = "integral"
    """State of a controller that winds up while the stage sticks away from its reference."""
    FILTER = "filter"
    """State of a controller that settles while its input stays constant."""
    LAG = "lag"
    """A force that lags behind the controller's command."""
    DEVIATION = "deviation"
    """A small deviation of another state (variational equations)."""
    SUM = "sum"
    """An integral computed alongside a motion, without effect on it."""


class Steady(NamedTuple):
    """A steady motion of all masses: error [m], position [m] and velocity [m/s].

    It also has the velocity of the reference [m/s] and the controller's force [N]. `deflected` is 1 if joint and
    transmission carry the constant forces of [bias], and 0 if they are relaxed. Values are numbers, arrays or symbols.
    """

    error: Any
    position: Any
    velocity: Any = 0.0
    reference_velocity: Any = 0.0
    force: Any = 0.0
    deflected: Any = 0.0
