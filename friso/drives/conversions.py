"""Convert the gains of a stage to the units that drives use.

One turn of the motor moves the load by a travel L, in m, or in rad on a rotary axis. A force F then equals a torque F
L/(2 pi). A velocity v equals v/L turns per second. A torque equals a current times the motor's constant.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from math import isclose, isfinite, pi
from typing import Any

from friso.axis import LINEAR, AxisKind, axis_of
from friso.drives.ask import TRAVEL, TRAVELS, Ask
from friso.errors import InputError
from friso.quantities import Quantity, positive
from friso.stage.controllers import controller_of

MOTOR_CONSTANT = "motor_constant"
"""Key of the user's answer: torque per ampere [N m/A], or force per ampere [N/A] without a turn."""

TORQUE_PER_AMPERE, FORCE_PER_AMPERE = Quantity("N*m/A", positive, "0.5 N*m/A"), Quantity("N/A", positive, "30 N/A")


Other = tuple[float, str]
"""A value in another unit."""


@dataclass(frozen=True)
class Conversion:
    """One gain of a controller: its name, its symbol, and its value in several units.

    Values stand beside their units; the first one is in SI.
    """

    name: str
    symbol: str
    values: tuple[tuple[float, str], ...]

    @property
    def finite(self) -> bool:
        """Tell whether all values of the gain are finite numbers."""
        return all(isfinite(value) for value, _ in self.values)


def travel_of(flat: Mapping[str, Any]) -> float | None:
    """Return how far one turn of the motor moves the load [m or rad].

    The transmission's ratio or lead gives it. Returns None for a stage without a transmission.
    """
    if "transmission.ratio" in flat:
        return 2 * pi / flat["transmission.ratio"]
    return flat.get("transmission.lead")


Commands = tuple[tuple[str, float], ...]
"""Force or torque [N or N m] per unit of each command that a drive may have."""


@dataclass(frozen=True)
class Turn:
    """Travel of a turn and force per command, which convert units between motor and load.

    `travel` is how far one turn moves the load [m or rad], None if unknown. `exerts` has the force or torque at the
    load [N or N m] per unit of command, such as ("A", 50.0).
    """

    travel: float | None
    exerts: Commands

    @property
    def per_ampere(self) -> float | None:
        """Return the force or torque at the load per ampere [N/A or N m/A]; None if unknown."""
        return dict(self.exerts).get("A")

    @classmethod
    def of(cls, flat: Mapping[str, Any], answers: Ask, exerts: Commands = ()) -> Turn:
        """Collect travel and force per command from the stage file and the user's answers.

        The transmission gives the travel, the actuator gives `exerts`; the user may add what is missing. Raises
        InputError for an answer in a wrong unit, or one that contradicts the stage.
        """
        kind, travel, per_ampere = axis_of(flat), travel_of(flat), dict(exerts).get("A")
        if TRAVEL in answers:
            answer = answers.value(TRAVEL, TRAVELS[kind])
            if travel is not None and not isclose(answer, travel, rel_tol=1e-6):
                unit = kind.unit("m")
                expected = f"that of the transmission, {travel:.6g} {unit}, which is enough"
                raise InputError(TRAVEL, f"{answer:.6g} {unit}", expected)
            travel = answer
        if MOTOR_CONSTANT not in answers:
            return cls(travel, exerts)
        if travel is not None:
            exerted = answers.value(MOTOR_CONSTANT, TORQUE_PER_AMPERE) * 2 * pi / travel
        else:
            exerted = answers.value(MOTOR_CONSTANT, FORCE_PER_AMPERE if kind == LINEAR else TORQUE_PER_AMPERE)
        if per_ampere is not None and not isclose(exerted, per_ampere, rel_tol=1e-6):
            unit = kind.unit("N/A")
            expected = f"that of [actuator], {per_ampere:.6g} {unit} at the load, which is enough"
            raise InputError(MOTOR_CONSTANT, f"{exerted:.6g} {unit} at the load", expected)
        return cls(travel, (("A", exerted), *(one for one in exerts if one[0] != "A")))


Convert = Callable[[float, Turn, AxisKind], list[Other]]
"""Function that converts a value in SI to other units."""


def conversions(flat: Mapping[str, Any], answers: Ask, exerts: Commands = ()) -> tuple[Conversion, ...]:
    """Return every gain of a stage in SI and in the units that drives use.

    `flat` holds the stage as flat keys such as controller.kp. Units that need an unknown travel or motor constant are
    left out; `exerts` has the force or torque [N or N m] per unit of command. Raises InputError for gains too large or
    too small to convert, and for answers that contradict the stage.
    """
    turn = Turn.of(flat, answers, exerts)
    try:
        return tuple(row for row in _rows(flat, turn) if row.finite)
    except (ArithmeticError, ValueError):
        actual = "gains or a travel that are too large or too small for the conversions"
        raise InputError("controller", actual, "numbers that a drive could take", 'kp = "500 N*s/m"') from None


def _rows(flat: Mapping[str, Any], turn: Turn) -> Iterator[Conversion]:
    """Yield each gain that the controller declares, in SI and in other units."""
    kind = axis_of(flat)
    for gain in controller_of(flat).gains(flat):
        convert = BY_UNIT.get(gain.unit)
        others = convert(gain.value, turn, kind) if convert else []
        yield Conversion(gain.name, gain.symbol, ((gain.value, kind.unit(gain.unit)), *others))


def _mass(value: float, turn: Turn, kind: AxisKind) -> list[Other]:
    """Convert an inertia [kg or kg m^2] to command per acceleration, and to the motor's side.

    Units that need an unknown travel or motor constant are left out.
    """
    commanded = [(value / exerted, f"{name}*s^2/{kind.length}") for name, exerted in turn.exerts]
    at_motor = [(value * (turn.travel / (2 * pi)) ** 2, "kg*m^2 at the motor")] if turn.travel else []
    return [*commanded, *at_motor]


def _force(value: float, turn: Turn, kind: AxisKind) -> list[Other]:
    """Convert a force [N or N m] to commands and motor torque, as far as they are known."""
    at_motor = [(value * turn.travel / (2 * pi), "N*m at the motor")] if turn.travel else []
    return [*at_motor, *((value / exerted, name) for name, exerted in turn.exerts)]


def _per(unit: str, *per: tuple[str, float]) -> Convert:
    """Build a converter for gains that are a force per motion, such as N/m or N s/m.

    The converter also gives the gain per turn of the motor, as torque and as current.
    """

    def others(value: float, turn: Turn, kind: AxisKind) -> list[Other]:
        """Return the gain with commands for force, and per turn of the motor, as far as known.

        On a linear axis the gain per millimetre is added.
        """
        values = []
        for name, exerted in turn.exerts:
            shown = kind.unit(unit).replace("N*m", name, 1) if kind != LINEAR else unit.replace("N", name, 1)
            values.append((value / exerted, shown))
        if turn.travel:
            at_motor = value * (turn.travel / (2 * pi)) ** 2
            place = "" if kind == LINEAR else " at the motor"  # gains of the load are per angle too
            values += [(at_motor * factor, f"N*m{angle}{place}") for angle, factor in per]
            if turn.per_ampere:
                ampere = turn.per_ampere * turn.travel / (2 * pi)  # torque of an ampere
                values += [(at_motor * factor / ampere, f"A{angle}{place}") for angle, factor in per]
        return [*values, *([(value / 1e3, unit.replace("m", "mm"))] if kind == LINEAR else [])]

    return others


BY_UNIT: Mapping[str, Convert] = {
    "N/m": _per("N/m", ("/rad", 1.0), ("/turn", 2 * pi)),
    "N*s/m": _per("N*s/m", ("/(rad/s)", 1.0), ("/(turn/s)", 2 * pi), ("/rpm", 2 * pi / 60)),
    "N/(m*s)": _per("N/(m*s)", ("/(rad*s)", 1.0), ("/(turn*s)", 2 * pi)),
    "N": _force,
    "kg": _mass,
    "m": lambda value, turn, kind: [(value / turn.travel, "turn")] if turn.travel else [],
    "s": lambda value, turn, kind: [(value * 1e3, "ms"), (1 / (2 * pi * value), "Hz (corner)")],
    "1/s": lambda value, turn, kind: [(value * 0.06, "(m/min)/mm")],
    "Hz": lambda value, turn, kind: [(value * 2 * pi, "rad/s")],
}
"""Converters of SI values to other units, by their unit on a linear axis.

A length becomes turns of the motor if the travel is known, a time also its corner frequency, and a rate the speed in
metres per minute for each millimetre of error."""
