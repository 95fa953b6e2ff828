"""The gains of a stage in the units that drives use.

A turn of the motor moves the load by a travel L [m], or L [rad] on a rotary axis: a force F is a torque F L/(2 pi), a
velocity v is v/L turns per second, and a torque is a current times the motor's constant.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite, pi, sqrt
from typing import Any

from friso.axis import LINEAR, axis_of
from friso.drives.questions import UserAnswers
from friso.errors import InputError
from friso.quantities import Quantity, positive

TRAVEL, MOTOR_CONSTANT = "travel_per_turn", "motor_constant"
"""What the user may say: what a turn moves, and the torque of an ampere [N m/A], or the force [N/A] without a turn."""

TORQUE_PER_AMPERE, FORCE_PER_AMPERE = Quantity("N*m/A", positive, "0.5 N*m/A"), Quantity("N/A", positive, "30 N/A")


@dataclass(frozen=True)
class Conversion:
    """A gain: what it is, its symbol, and its values in units, the first of which is SI."""

    name: str
    symbol: str
    values: tuple[tuple[float, str], ...]

    @property
    def finite(self) -> bool:
        """Whether all its values are finite numbers."""
        return all(isfinite(value) for value, _ in self.values)


@dataclass(frozen=True)
class Turn:
    """What a turn moves [m or rad] and what an ampere exerts at the load [N or N m]; None where unknown."""

    travel: float | None
    per_ampere: float | None

    @classmethod
    def of(cls, flat: Mapping[str, Any], answers: UserAnswers) -> Turn:
        """As the transmission or the user says. Raises InputError for an answer in another unit."""
        kind = axis_of(flat)
        travel = flat.get("transmission.lead")
        if "transmission.ratio" in flat:
            travel = 2 * pi / flat["transmission.ratio"]
        if TRAVEL in answers:
            travel = answers.value(TRAVEL, Quantity("m", positive, "10 mm").on(kind))
        per_ampere = None
        if MOTOR_CONSTANT in answers and travel is not None:
            per_ampere = answers.value(MOTOR_CONSTANT, TORQUE_PER_AMPERE) * 2 * pi / travel
        elif MOTOR_CONSTANT in answers:
            per_ampere = answers.value(MOTOR_CONSTANT, FORCE_PER_AMPERE if kind == LINEAR else TORQUE_PER_AMPERE)
        return cls(travel, per_ampere)


def conversions(flat: Mapping[str, Any], answers: UserAnswers) -> tuple[Conversion, ...]:
    """The gains of a stage given as flat keys, by what is known of motor and screw. Raises InputError."""
    turn = Turn.of(flat, answers)
    try:
        return tuple(row for row in _rows(flat, turn) if row.finite)
    except (ArithmeticError, ValueError):
        actual = "gains or a travel that are too large or too small for the conversions"
        raise InputError("controller", actual, "numbers that a drive could take", 'kp = "500 N*s/m"') from None


def _rows(flat: Mapping[str, Any], turn: Turn) -> tuple[Conversion, ...]:
    """The gains of each kind of controller."""
    key = {name.removeprefix("controller."): v for name, v in flat.items() if name.startswith("controller.")}
    if key["kind"] == "cascade":
        return _of_cascade(key, turn, flat)
    if key["kind"] == "pid" and "crossover" not in key:
        return _of_pid(key, turn, flat)
    if key["kind"] == "pid":
        return _of_van_dijk(flat, turn)
    return ()


def _of_cascade(key: Mapping[str, Any], turn: Turn, flat: Mapping[str, Any]) -> tuple[Conversion, ...]:
    rows = [_kv("gain of the position loop", "kv", key["kv"])]
    if "position_integral_time" in key:
        rows.append(_time("integral time of the position loop", "Tp", key["position_integral_time"]))
    rows.append(_damping("gain of the velocity loop", "kp", key["kp"], turn, flat))
    if time := key.get("velocity_integral_time"):
        rows.append(_time("integral time of the velocity loop", "Tn", time))
        rows.append(_stiffness("the same as a gain, kp/Tn", "ki", key["kp"] / time, turn, flat))
    if key["velocity_filter"]:
        rows.append(_time("filter of the measured velocity", "Tf", key["velocity_filter"]))
    rows.append(Conversion("share of the reference's velocity", "f", ((key["velocity_feedforward"], ""),)))
    return (*rows, *_ahead(key, turn, flat), *_limits(key, turn, flat))


def _of_pid(key: Mapping[str, Any], turn: Turn, flat: Mapping[str, Any]) -> tuple[Conversion, ...]:
    kp, ki, kd = key["kp"], key["ki"], key["kd"]
    rows = [
        _stiffness("proportional gain", "kp", kp, turn, flat),
        _integral("integral gain", "ki", ki, turn, flat),
        _damping("derivative gain", "kd", kd, turn, flat),
    ]
    if key["tau"]:
        rows.append(_time("filter of the derivative", "tau", key["tau"]))
    if ki and kp:
        rows.append(_time("integral time kp/ki", "Ti", kp / ki))
    if kp and kd:
        rows.append(_time("derivative time kd/kp", "Td", kd / kp))
    if ki and kd and not key["tau"] and key["derivative_on"] == "measurement" and kp**2 >= 4 * ki * kd:
        half, root = kp / (2 * kd), sqrt((kp / (2 * kd)) ** 2 - ki / kd)
        rows.append(_kv("as P over PI with kp = kd: kv (or 1/Tn)", "kv", half - root))
        rows.append(_time("as P over PI with kp = kd: Tn (or 1/kv)", "Tn", 1 / (half + root)))
    return (*rows, *_ahead(key, turn, flat), *_limits(key, turn, flat))


def _of_van_dijk(flat: Mapping[str, Any], turn: Turn) -> tuple[Conversion, ...]:
    from friso.equations.controllers.van_dijk import numbers

    values = numbers(flat)
    times = {"tau_z": "lead", "tau_i": "integral", "tau_p": "low-pass, before all terms"}
    return (
        _stiffness("gain k_p of Eq. 8", "k_p", values["k_p"], turn, flat),
        *(_time(f"time constant of the {what}", name, values[name]) for name, what in times.items()),
        *_limits({name.removeprefix("controller."): v for name, v in flat.items()}, turn, flat),
    )


def _ahead(key: Mapping[str, Any], turn: Turn, flat: Mapping[str, Any]) -> list[Conversion]:
    """The feedforwards that there are."""
    rows = []
    if mass := key.get("acceleration_feedforward"):
        values = [(mass, axis_of(flat).unit("kg"))]
        if turn.travel:
            values.append((mass * (turn.travel / (2 * pi)) ** 2, "kg*m^2 at the motor"))
        rows.append(Conversion("feedforward of acceleration", "m", tuple(values)))
    if viscous := key.get("viscous_feedforward"):
        rows.append(_damping("feedforward of viscous friction", "d", viscous, turn, flat))
    if coulomb := key.get("coulomb_feedforward"):
        rows.append(_force("feedforward of Coulomb friction", "Fc", coulomb, turn, flat))
    return rows


def _limits(key: Mapping[str, Any], turn: Turn, flat: Mapping[str, Any]) -> list[Conversion]:
    names = {"force_limit": ("limit of the force", "Fmax"), "integral_limit": ("limit of the integrals", "Imax")}
    return [_force(*words, key[name], turn, flat) for name, words in names.items() if key.get(name)]


def _kv(name: str, symbol: str, kv: float) -> Conversion:
    return Conversion(name, symbol, ((kv, "1/s"), (kv * 0.06, "(m/min)/mm")))


def _time(name: str, symbol: str, time: float) -> Conversion:
    return Conversion(name, symbol, ((time, "s"), (time * 1e3, "ms"), (1 / (2 * pi * time), "Hz (corner)")))


def _force(name: str, symbol: str, force: float, turn: Turn, flat: Mapping[str, Any]) -> Conversion:
    values = [(force, axis_of(flat).unit("N"))]
    if turn.travel:
        values.append((force * turn.travel / (2 * pi), "N*m at the motor"))
    if turn.per_ampere:
        values.append((force / turn.per_ampere, "A"))
    return Conversion(name, symbol, tuple(values))


def _damping(name: str, symbol: str, gain: float, turn: Turn, flat: Mapping[str, Any]) -> Conversion:
    """A gain that is a force per velocity."""
    return _per(name, symbol, gain, "N*s/m", ("/(rad/s)", "/(turn/s)", "/rpm"), (1.0, 2 * pi, 2 * pi / 60), turn, flat)


def _stiffness(name: str, symbol: str, gain: float, turn: Turn, flat: Mapping[str, Any]) -> Conversion:
    """A gain that is a force per displacement."""
    return _per(name, symbol, gain, "N/m", ("/rad", "/turn"), (1.0, 2 * pi), turn, flat)


def _integral(name: str, symbol: str, gain: float, turn: Turn, flat: Mapping[str, Any]) -> Conversion:
    """A gain that is a force per displacement and time."""
    return _per(name, symbol, gain, "N/(m*s)", ("/(rad*s)", "/(turn*s)"), (1.0, 2 * pi), turn, flat)


def _per(
    name: str,
    symbol: str,
    gain: float,
    unit: str,
    per: tuple[str, ...],
    factors: tuple[float, ...],
    turn: Turn,
    flat: Mapping[str, Any],
) -> Conversion:
    """A gain, also per angle of the motor, as a torque and as a current."""
    kind = axis_of(flat)
    values = [(gain, kind.unit(unit))]
    if turn.per_ampere:
        shown = kind.unit(unit).replace("N*m", "A", 1) if kind != LINEAR else unit.replace("N", "A", 1)
        values.append((gain / turn.per_ampere, shown))
    if turn.travel:
        at_motor = gain * (turn.travel / (2 * pi)) ** 2
        values += [(at_motor * factor, f"N*m{text}") for text, factor in zip(per, factors, strict=True)]
        if turn.per_ampere:
            ampere = turn.per_ampere * turn.travel / (2 * pi)  # torque of an ampere
            values += [(at_motor * factor / ampere, f"A{text}") for text, factor in zip(per, factors, strict=True)]
    return Conversion(name, symbol, tuple(values))
