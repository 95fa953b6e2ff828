"""The tables [transmission], [motor_friction] and [encoder] between motor and load."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Annotated, Any, Literal, Self

from pydantic import model_validator

from friso.errors import StageError
from friso.quantities import Number, Quantity, Value, non_negative, positive
from friso.stage.section import UncertainSection
from friso.stage.tables import CONDITIONS

TRANSMISSION, MOTOR_FRICTION, ENCODER = "transmission", "motor_friction", "encoder"
MOTOR_MASS, INERTIA, LEAD, RATIO, BACKLASH = (
    f"{TRANSMISSION}.{name}" for name in ("mass", "inertia", "lead", "ratio", "backlash")
)
STATE_PREFIX = "motor_"
"""Prefix of the names of states that belong to the motor."""

MOTOR_STATES = ("motor_position", "motor_velocity")
"""Names of the motor's position and velocity, converted to the load."""

Side = Literal["motor", "load"]
"""A side of the transmission."""


class Transmission(UncertainSection):
    """A screw, belt or gear: the motor's mass at the load, and the connecting spring."""

    mass: Annotated[Value | None, Quantity("kg", positive, "2 kg")] = None
    """Mass of everything that moves with the motor, reflected to the load; alternatively its `inertia` with `lead` or
    `ratio`."""
    inertia: Annotated[Value | None, Quantity("kg*m^2", positive, "1.2e-4 kg*m^2")] = None
    """Moment of inertia of motor, coupling and screw, about the motor's axis, on linear and rotary axes alike."""
    lead: Annotated[Value | None, Quantity("m", positive, "10 mm")] = None
    """Travel of the load per turn of the motor."""
    ratio: Annotated[float | None, Number(positive, "5")] = None
    """Turns of the motor per turn of the load, on a rotary axis."""
    stiffness: Annotated[Value, Quantity("N/m", positive, "120 N/um")]
    damping: Annotated[Value, Quantity("N*s/m", non_negative, "2e3 N*s/m")]
    backlash: Annotated[Value | None, Quantity("m", non_negative, "5 um")] = None
    """Total backlash, from flank to flank."""

    @model_validator(mode="after")
    def _motor_has_one_mass(self) -> Self:
        geared = [name for name in ("lead", "ratio") if getattr(self, name) is not None]
        either = 'mass = "2 kg", or inertia = "1.2e-4 kg*m^2" with lead = "10 mm"'
        if self.mass is not None and (self.inertia is not None or geared):
            actual = f"mass together with {'inertia' if self.inertia is not None else geared[0]}"
            raise StageError("mass", actual, "the mass of the motor at the load, or what it follows from", either)
        if self.mass is None and self.inertia is None:
            raise StageError("mass", "neither mass nor inertia of the motor", "one of the two", either)
        if self.inertia is not None and len(geared) != 1:
            actual = "an inertia with both lead and ratio" if geared else "an inertia without lead or ratio"
            expected = "the lead of a linear axis, or the ratio of a rotary one"
            raise StageError("inertia", actual, expected, 'inertia = "1.2e-4 kg*m^2", lead = "10 mm"')
        return self


class Encoder(UncertainSection):
    """Sides of the transmission on which the controller's position and velocity are measured."""

    position: Side
    velocity: Side


def motor_mass(flat: Mapping[str, Any]) -> Any:
    """Return the motor's mass at the load [kg], from its inertia and its travel per turn.

    The result is None if either is missing. `flat` has the stage's keys in SI.
    """
    lead = flat[LEAD] if LEAD in flat else 2 * pi / flat[RATIO] if RATIO in flat else None
    return None if INERTIA not in flat or lead is None else flat[INERTIA] * (2 * pi / lead) ** 2


def leading_friction(flat: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a stage's keys with the motor's friction as [friction], if the guide has none."""
    alone = flat["friction.model"] == "none" and f"{MOTOR_FRICTION}.model" in flat
    return of_motor(flat) if alone else flat


def moving_mass(flat: Mapping[str, Any]) -> Any:
    """Return the whole mass that the controller moves [kg], reflected to the load."""
    return sum(flat.get(key, 0.0) for key in ("masses.cart", "masses.stage", MOTOR_MASS))


def of_motor(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return a stage's keys with the motor's friction under [friction], without [conditions].

    The conditions belong to the guide, whose friction is left out.
    """
    kept = {key: value for key, value in flat.items() if not key.startswith(("friction.", f"{CONDITIONS}."))}
    return {**kept, "friction.model": "none", **as_friction(flat)}


def as_friction(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys of [motor_friction] under the names that a friction law uses."""
    before = f"{MOTOR_FRICTION}."
    return {f"friction.{key.removeprefix(before)}": value for key, value in flat.items() if key.startswith(before)}
