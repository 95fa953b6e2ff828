"""Values of a stage file that are possible, but implausible: another unit is the likely reason."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from friso.axis import ROTARY
from friso.quantities import Quantity, any_sign
from friso.stage.stage import Stage

GRAVITY = 9.81
"""In m/s^2."""

STRONGEST = 30.0
"""Friction of a contact bearing, in weights of what it carries: preload may exceed the weight, not by so much."""


@dataclass(frozen=True)
class _Usual:
    """What positioning stages have [SI], and the units in which it is told."""

    low: float
    high: float
    unit: str
    units: tuple[str, ...]


_MASS = _Usual(1e-3, 2000.0, "kg", ("g", "kg", "mg", "t"))
_FREQUENCY = _Usual(0.05, 20_000.0, "Hz", ("Hz", "kHz", "mHz", "rad/s", "rpm"))
_LENGTH = _Usual(1e-7, 10.0, "m", ("mm", "um", "nm", "m"))
_TIME = _Usual(1e-7, 1e5, "s", ("ms", "us", "ns", "s"))

_USUAL: Mapping[str, _Usual] = {
    "masses.cart": _MASS,
    "masses.stage": _MASS,
    "parasitic.frequency": _FREQUENCY,
    "joint.stroke": _LENGTH,
    "motion.size": _LENGTH,
    "motion.displacement": _LENGTH,
    "motion.duration": _TIME,
    "drive.sample_time": _Usual(1e-7, 0.1, "s", ("us", "ms", "ns", "s")),
    "friction.stribeck_velocity": _Usual(1e-7, 2.0, "m/s", ("mm/s", "um/s", "m/s")),
}


_INERTIA = _Usual(1e-9, 1e4, "kg*m^2", ("kg*m^2", "g*m^2", "kg*cm^2", "g*cm^2", "kg*mm^2"))
_TORQUE = _Usual(1e-7, 1e5, "N*m", ("N*m", "mN*m", "uN*m", "kN*m"))
_ANGLE = _Usual(1e-8, 1e3, "rad", ("rad", "mrad", "urad", "deg"))

_ROTARY: Mapping[str, _Usual] = {
    **{key: usual for key, usual in _USUAL.items() if usual.unit in ("Hz", "s")},
    **dict.fromkeys(("masses.cart", "masses.stage"), _INERTIA),
    **dict.fromkeys(("joint.stroke", "motion.size", "motion.displacement"), _ANGLE),
    **dict.fromkeys(("friction.static", "friction.coulomb"), _TORQUE),
    "friction.stribeck_velocity": _Usual(1e-7, 100.0, "rad/s", ("rad/s", "mrad/s", "urad/s", "deg/s")),
}
"""What rotary axes have, from a mirror to a telescope."""


def implausible_values(stage: Stage) -> Iterator[str]:
    """A sentence on each implausible value: key, value, and the unit that probably was."""
    flat = stage.flat()
    usual_values = dict(_ROTARY) if stage.axis_kind == ROTARY else _usual(flat)
    if (bandwidth := stage.controller and stage.controller.bandwidth_key) is not None:
        usual_values[bandwidth] = _FREQUENCY
    for key, usual in usual_values.items():
        value = flat.get(key)
        if value and not usual.low <= value <= usual.high:
            written = _written(stage, key) or f"{value:.6g} {usual.unit}"
            yield f"{key} = {written} is unusual for a positioning stage{_question(written, usual)}"


def _usual(flat: Mapping[str, Any]) -> dict[str, _Usual]:
    """What is usual for the stage: friction follows its weight."""
    carried = sum(flat.get(f"masses.{body}", 0.0) for body in ("cart", "stage"))
    force = _Usual(1e-6, STRONGEST * GRAVITY * carried, "N", ("N", "mN", "uN", "kN"))
    return {**_USUAL, "friction.static": force, "friction.coulomb": force}


def _written(stage: Stage, key: str) -> str:
    """What the user wrote; "" for what follows from other keys."""
    table, name = key.split(".")
    return str(getattr(getattr(getattr(stage, table), name, None), "text", ""))


def _question(written: str, usual: _Usual) -> str:
    """Which unit was probably meant: one with which the same number is usual."""
    number, _, unit = written.partition(" ")
    for other in usual.units:
        factor = Quantity(usual.unit, any_sign, "").factor(other)
        try:
            fits = usual.low <= float(number) * factor <= usual.high
        except ValueError:  # an interval
            return ""
        if fits and other != unit.strip():
            return f": was {other} meant?"
    return ""
