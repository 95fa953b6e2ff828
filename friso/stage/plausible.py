"""Warn of valid but probably wrong stage files: implausible values, unused encoders."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import inf
from typing import Any

from friso.axis import ROTARY
from friso.quantities import Quantity, any_sign
from friso.stage.section import element_keys
from friso.stage.stage import Stage
from friso.stage.tables import BACKLASH, INERTIA, LEAD, MOTOR_FRICTION, MOTOR_MASS, TRANSMISSION, moving_mass

ROUND_GRAVITY = 9.81
"""Acceleration of gravity [m/s^2]."""

STRONGEST_FRICTION = 30.0
"""Largest plausible friction of a contact bearing, in units of the load's weight. Preload may exceed the weight, but
not by that much."""


PRESLIDING_RANGE = (1e-10, 1e-2)
"""Plausible range of displacements [m] before sliding."""


@dataclass(frozen=True)
class _Usual:
    """A range of values [SI] that is usual for positioning stages, with the unit to show."""

    low: float
    high: float
    unit: str
    units: tuple[str, ...]


_MASS = _Usual(1e-3, 2000.0, "kg", ("g", "kg", "mg", "t"))
_FREQUENCY = _Usual(0.05, 20_000.0, "Hz", ("Hz", "kHz", "mHz", "rad/s", "rpm"))
_LENGTH = _Usual(1e-7, 10.0, "m", ("mm", "um", "nm", "m"))
_TIME = _Usual(1e-7, 1e5, "s", ("ms", "us", "ns", "s"))
_CYCLE = _Usual(1e-7, 0.1, "s", ("us", "ms", "ns", "s"))
_SLOWLY = _Usual(1e-7, 2.0, "m/s", ("mm/s", "um/s", "m/s"))
_STIFFNESSES = ("N/um", "N/mm", "N/m")

_USUAL: Mapping[str, _Usual] = {
    "masses.cart": _MASS,
    "masses.stage": _MASS,
    "parasitic.frequency": _FREQUENCY,
    "joint.stroke": _LENGTH,
    "motion.size": _LENGTH,
    "motion.displacement": _LENGTH,
    "motion.duration": _TIME,
    "drive.sample_time": _CYCLE,
    "drive.delay": _CYCLE,
    "drive.current_bandwidth": _Usual(5.0, 1e5, "Hz", ("kHz", "Hz")),
    "drive.encoder_resolution": _Usual(1e-12, 1e-4, "m", ("nm", "um", "pm")),
    "friction.stribeck_velocity": _SLOWLY,
    f"{MOTOR_FRICTION}.stribeck_velocity": _SLOWLY,
    MOTOR_MASS: _MASS,
    INERTIA: _Usual(1e-9, 1.0, "kg*m^2", ("kg*cm^2", "g*cm^2", "kg*mm^2")),
    LEAD: _Usual(1e-5, 2.0, "m", ("mm", "um", "m")),
    f"{TRANSMISSION}.stiffness": _Usual(1e3, 1e11, "N/m", _STIFFNESSES),
    BACKLASH: _Usual(1e-8, 2e-3, "m", ("um", "mm", "nm")),
}


_INERTIA = _Usual(1e-9, 1e4, "kg*m^2", ("kg*m^2", "g*m^2", "kg*cm^2", "g*cm^2", "kg*mm^2"))
_TORQUE = _Usual(1e-7, 1e5, "N*m", ("N*m", "mN*m", "uN*m", "kN*m"))
_ANGLE = _Usual(1e-8, 1e3, "rad", ("rad", "mrad", "urad", "deg"))

_ROTARY: Mapping[str, _Usual] = {
    **{key: usual for key, usual in _USUAL.items() if usual.unit in ("Hz", "s", "1/s")},
    INERTIA: _USUAL[INERTIA],
    **dict.fromkeys(("masses.cart", "masses.stage"), _INERTIA),
    **dict.fromkeys(("joint.stroke", "motion.size", "motion.displacement"), _ANGLE),
    **dict.fromkeys(("friction.static", "friction.coulomb"), _TORQUE),
    "friction.stribeck_velocity": _Usual(1e-7, 100.0, "rad/s", ("rad/s", "mrad/s", "urad/s", "deg/s")),
}
"""Usual values of rotary axes, from a mirror to a telescope."""


def idle_encoder(stage: Stage) -> Iterator[str]:
    """Yield a sentence if a separate velocity encoder is stated that the controller ignores."""
    sides, controller = stage.encoder, stage.controller
    if sides and controller and sides.velocity != sides.position and not controller.takes_velocity(stage.flat()):
        yield (
            f'encoder.velocity = "{sides.velocity}" has no effect: this controller takes no velocity, and acts on the '
            f"position of the {sides.position} alone"
        )


def implausible_values(stage: Stage) -> Iterator[str]:
    """Yield a sentence on each implausible value, with the unit that was probably meant.

    Friction and gains are judged relative to the mass. If another unit of a mass would make several of them usual, the
    sentence names the mass instead.
    """
    flat = stage.flat()
    complaints = _complaints(stage, flat)
    for key in ("masses.cart", "masses.stage") if len(complaints) > 1 else ():
        for unit, factor in _other_units(stage, key):
            usual = _complaints(stage, {**flat, key: flat[key] * factor})
            others = [name for name in complaints if name not in usual and not name.startswith("masses.")]
            if len(others) > 1 and key not in usual and usual.keys() <= complaints.keys():
                named = ", ".join(others[:-1]) + f" and {others[-1]}"
                text = (
                    f"{key} = {_written(stage, key)} makes {named} unusual for a positioning stage: was {unit} meant?"
                )
                complaints = {key: text} | {name: complaints[name] for name in usual if name in complaints}
                break
    yield from complaints.values()


def _other_units(stage: Stage, key: str) -> Iterator[tuple[str, float]]:
    """Yield the units in which a mass may have been meant, with factors that convert its value.

    There are none on a rotary axis, and none for a value without a unit of mass.
    """
    written = _written(stage, key)
    unit = written.partition(" ")[2].strip()
    if stage.axis_kind == ROTARY or unit not in _MASS.units:
        return
    factors = {other: Quantity("kg", any_sign, "").factor(other) for other in _MASS.units}
    yield from ((other, factors[other] / factors[unit]) for other in _MASS.units if other != unit)


def _complaints(stage: Stage, flat: Mapping[str, Any]) -> dict[str, str]:
    """Return a sentence on each implausible value of a stage, by key; `flat` has its keys in SI."""
    return dict(_judged(stage, flat))


def _judged(stage: Stage, flat: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    usual_values = dict(_ROTARY) if stage.axis_kind == ROTARY else _usual(flat)
    usual_values |= {key: _FREQUENCY for key in flat if _OF_FILTER.fullmatch(key)}
    if stage.controller:
        mass = moving_mass(flat)
        for name, (low, high, unit, units) in stage.controller.usual.items():
            times = mass if "N" in unit else 1.0  # usual gains grow with the mass
            if stage.axis_kind == ROTARY and "N" in unit:
                continue
            usual_values[stage.controller.key(name)] = _Usual(times * low, times * high, unit, units)
    if (bandwidth := stage.controller and stage.controller.bandwidth_key) is not None:
        usual_values[bandwidth] = _FREQUENCY
    for key, usual in usual_values.items():
        value = flat.get(key)
        if value and not usual.low <= value <= usual.high:
            if not (written := _written(stage, key)) and key == MOTOR_MASS:
                continue  # the motor's inertia is judged instead
            written = written or f"{value:.6g} {usual.unit}"
            yield key, f"{key} = {written} is unusual for a positioning stage{_question(written, usual)}"


_OF_FILTER = re.compile(r"controller\.filters\.\d+\.(frequency|width)")


def _usual(flat: Mapping[str, Any]) -> dict[str, _Usual]:
    """Return usual ranges of values by key, for a stage with the keys `flat` in SI.

    Friction scales with the weight, and stiffness before sliding with friction.
    """
    carried, moving = sum(flat.get(f"masses.{body}", 0.0) for body in ("cart", "stage")), moving_mass(flat)
    usual = dict(_USUAL)
    for table, mass in {"friction": carried, MOTOR_FRICTION: moving}.items():
        most = STRONGEST_FRICTION * ROUND_GRAVITY * mass
        usual |= dict.fromkeys(
            (f"{table}.static", f"{table}.coulomb"), _Usual(1e-6, most, "N", ("N", "mN", "uN", "kN"))
        )
        force = flat.get(f"{table}.static", 0.0)
        force = force if force <= most else 0.0  # such a force is questioned on its own
        usual[f"{table}.bristle_stiffness"] = _presliding(force)
        for key in element_keys(flat, f"{table}.element_stiffness"):
            share = flat.get(key.replace("element_stiffness", "element_share"), 1.0)
            usual[key] = _presliding(share * force)
    return usual


def _presliding(force: float) -> _Usual:
    """Return the usual range of a contact's stiffness before sliding, for a friction force [N]."""
    low, high = (force / way for way in reversed(PRESLIDING_RANGE))
    return _Usual(low, high or inf, "N/m", _STIFFNESSES)


def _written(stage: Stage, key: str) -> str:
    """Return the value of a key as the user wrote it; "" if it follows from other keys."""
    here: Any = stage.as_written()
    for name in key.split("."):
        here = here[int(name) - 1] if isinstance(here, list) else here.get(name, "")
        if here == "":
            break
    return here if isinstance(here, str) else ""


def _question(written: str, usual: _Usual) -> str:
    """Return a question whether another unit was meant, in which the value would be usual.

    `written` is the value as the user wrote it, and its number must be usual in that unit. The result is "" if there is
    no such unit, or if an interval was written.
    """
    number, _, unit = written.partition(" ")
    for other in usual.units:
        factor = Quantity(usual.unit, any_sign, "").factor(other)
        try:
            fits = usual.low <= float(number) * factor <= usual.high
        except ValueError:  # the text is an interval
            return ""
        if fits and other != unit.strip():
            return f": was {other} meant?"
    return ""
