"""Convert a friction law to another that keeps what was measured, and report the losses.

Hysteresis loops over a slow motion to and fro, before sliding, are among what is compared.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from friso.engine.batch import Inputs, run_driven
from friso.engine.kernel import kernel
from friso.equations.dragged import Dragged
from friso.equations.friction.measured import MeasuredFriction
from friso.errors import InputError
from friso.frequency.system import steady_force
from friso.quantities import exactly
from friso.stage import Stage
from friso.stage.section import list_fields, numeric_fields
from friso.stage.tables import FrictionSection, friction_law, friction_laws, passive_where
from friso.studies.settings import settings


@dataclass(frozen=True)
class HysteresisLoop:
    """A loop of force over displacement.

    The loop encloses the `area` [J], the energy lost in one period. `stiffness` [N/m] is the difference of the forces
    at both ends, divided by the difference of the displacements.
    """

    area: float
    stiffness: float


def hysteresis_loop(flat: Mapping[str, Any], amplitude: float, speed: float) -> HysteresisLoop:
    """Compute the last of several hysteresis loops of a stage's friction law.

    `flat` has the stage's keys. A body is moved back and forth by the `amplitude` [m] at a steady `speed` [m/s], from
    rest with unbent bristles.
    """
    law, points = flat["friction.model"], settings.points_of_a_loop
    shape = kernel(Dragged(law, friction_law(law).variant(flat)))
    # first a quarter, then whole loops from one end, as triangles with the same speed throughout
    phase = np.arange(points // 4 + settings.loop_periods * points + 1) / points
    place = amplitude * (2 / np.pi) * np.arcsin(np.sin(2 * np.pi * phase))
    inputs = Inputs(place, np.zeros(len(place)), 4 * amplitude / speed / points)
    starts = np.zeros((1, shape.initial_size))
    starts[:, shape.velocity] = inputs.velocity[0]
    (run,) = run_driven(shape, {**flat, "motion.duration": 1.0}, 1, inputs, starts, settings.loop_tolerance)
    force = np.diff(run.states[0, :, -1]) / inputs.sample_time
    last, moved = force[-points:], np.diff(place)[-points:]
    middles = (place[1:] + place[:-1])[-points:] / 2
    ends = int(middles.argmax()), int(middles.argmin())
    stiffness = (last[ends[0]] - last[ends[1]]) / (middles[ends[0]] - middles[ends[1]])
    return HysteresisLoop(float(np.sum(last * moved)), float(stiffness))


ELEMENTS_IN_PARALLEL = 6
"""Number of elements of a law that has several."""

UNCHANGED_SHARE = 1e-6
"""Relative difference below which a number counts as unchanged."""

COMPARED_SPEEDS = np.geomspace(1e-2, 1e3, 201)
"""Speeds, in Stribeck velocities, at which steady friction is compared."""


MeasuredKind = Literal[
    "curve", "static", "stiffness", "virgin", "damping", "viscous", "conditions", "loop area", "loop stiffness"
]
"""Measured quantities of friction.

They are steady friction over speed, break-away, stiffness before sliding, the virgin curve (force over displacement
from rest), damping at rest, and viscous damping. Then come the conditions under which they were taken. Last are the
energy lost in a hysteresis loop before sliding, and the loop's stiffness from end to end.
"""


@dataclass(frozen=True)
class MeasuredChange:
    """The change of a measured quantity by the conversion of a friction law.

    `off` is the error by the conversion: relative to static friction for curves, and relative to the number itself for
    numbers. An error of at most `allowed` counts as none.
    """

    kind: MeasuredKind
    off: float
    allowed: float = UNCHANGED_SHARE

    @property
    def kept(self) -> bool:
        """Tell whether the conversion keeps the measured quantity, within the allowed error."""
        return self.off <= self.allowed


@dataclass(frozen=True)
class LawConversion:
    """A stage converted to another friction law, and how its measured friction changed.

    `compared` has the changes of the measured quantities, and `open` the ranges [SI] of the keys that the measurements
    leave open. `active` names the condition of passivity that the law violates ("" if it is passive).
    """

    stage: Stage
    compared: tuple[MeasuredChange, ...]
    open: Mapping[str, tuple[float, float]]
    active: str

    @property
    def law(self) -> str:
        """Return the name of the law to which the stage was converted."""
        return self.stage.flat()["friction.model"]

    @property
    def lost(self) -> tuple[MeasuredChange, ...]:
        """Return the measured quantities that the conversion does not keep."""
        return tuple(item for item in self.compared if not item.kept)


def convertible() -> list[str]:
    """Return the laws to which friction can be converted, in alphabetical order."""
    return sorted(name for name, law in friction_laws().items() if law.keeping is not FrictionSection.keeping)


def measure_friction(flat: Mapping[str, Any]) -> MeasuredFriction:
    """Compute what measurements would show of a stage's friction in forward motion.

    `flat` has the stage's keys, such as "friction.static", and their SI values. Raises InputError for a friction law
    that cannot say what would be measured.
    """
    name = flat["friction.model"]
    law = friction_law(name)
    if law.shown is FrictionSection.shown:
        actual = (
            "no friction at the guide" if name == "none" else f'"{name}", which does not declare what is measured of it'
        )
        raise InputError("friction.model", actual, f"one of {', '.join(convertible())}", 'model = "lugre"')
    return law.shown(flat)


def convert(stage: Stage, law: str) -> LawConversion:
    """Replace the friction law of a stage by another, `convertible` one that measurements can hardly tell apart.

    Raises InputError for a stage whose own law does not stick.
    """
    before = measure_friction(stage.flat())
    if not before.stiffness:
        actual = f'"{stage.flat()["friction.model"]}", which does not stick: it has no stiffness before sliding to keep'
        raise InputError("friction.model", actual, "a law that sticks", 'model = "lugre"')
    made = friction_law(law)
    converted = with_friction(stage, law, made.keeping(before, ELEMENTS_IN_PARALLEL))
    return compared(stage, converted, made.left_open(before))


def with_friction(stage: Stage, law: str, keys: Mapping[str, Any]) -> Stage:
    """Return the stage with another friction law and that law's keys [SI].

    If some of its friction is unknown, all of the new law's is.
    """
    of_friction = ("friction" if key.startswith("friction.") else key for key in stage.unknown_keys)
    unknown = {"unknown": ", ".join(dict.fromkeys(of_friction))} if stage.unknown_keys else {}
    return stage.replace({"friction": _table(stage, law, keys), **unknown})


def compared(
    source: Stage, made: Stage, left_open: Mapping[str, tuple[float, float]] = MappingProxyType({})
) -> LawConversion:
    """Compare the friction of a converted stage, `made`, with that of the stage before, `source`.

    `left_open` are the ranges [SI] of the keys that measurements leave open in the new stage.
    """
    flat = made.flat()
    before, after = measure_friction(source.flat()), measure_friction(flat)
    items = (
        _curve(source, made, before),
        _number("static", before.levels.static, after.levels.static),
        _number("stiffness", before.stiffness, after.stiffness),
        _virgin_change(before, after),
        _number("damping", before.damping, after.damping),
        _number("viscous", before.levels.viscous, after.levels.viscous),
        *(_loops(source, made, before) if before.stiffness and after.stiffness else ()),
    )
    return LawConversion(made, items, left_open, passive_where(flat))


def _loops(source: Stage, made: Stage, before: MeasuredFriction) -> Iterator[MeasuredChange]:
    """Yield the changes of slow hysteresis loops between both laws: of their area and stiffness.

    The loops have fractions of the deflection at break-away as amplitudes.
    """
    deflection, speed = before.levels.static / before.stiffness, settings.loop_speed * before.levels.stribeck_velocity
    for share in settings.loop_amplitudes:
        old, new = (hysteresis_loop(stage.flat(), share * deflection, speed) for stage in (source, made))
        yield _number("loop area", old.area, new.area, settings.loop_error)
        yield _number("loop stiffness", old.stiffness, new.stiffness, settings.loop_error)


def _table(stage: Stage, law: str, keys: Mapping[str, Any]) -> dict[str, Any]:
    """Return the table [friction] of a stage file for a law and its keys [SI].

    Values are written in the units of the stage's axis.
    """
    cls, kind = friction_law(law), stage.axis_kind
    table: dict[str, Any] = {"model": law}
    for name, field in numeric_fields(cls).items():
        if f"friction.{name}" in keys:
            table[name] = _text(float(keys[f"friction.{name}"]), getattr(field.on(kind), "unit", ""))
    for name, several in list_fields(cls).items():
        values = [value for key, value in keys.items() if key.startswith(f"friction.{name}.")]
        if values:
            table[name] = [_text(float(value), getattr(several.on(kind).of, "unit", "")) for value in values]
    return table


def _text(value: float, unit: str) -> Any:
    """Return a value as text with this unit for a stage file, which reads back exactly."""
    return exactly(value, unit) if unit else value


def _number(kind: MeasuredKind, before: float, after: float, allowed: float = UNCHANGED_SHARE) -> MeasuredChange:
    size = max(abs(before), abs(after)) or 1.0
    return MeasuredChange(kind, abs(after - before) / size, allowed)


def _curve(source: Stage, made: Stage, before: MeasuredFriction) -> MeasuredChange:
    """Return the change of steady friction, at the speed where both laws differ most.

    Motion forward and back is compared.
    """
    speeds = COMPARED_SPEEDS * before.levels.stribeck_velocity
    old, new = (
        np.stack([steady_force(stage.flat(), speeds, way) for way in (True, False)]) for stage in (source, made)
    )
    return MeasuredChange("curve", float(np.abs(new - old).max() / before.levels.static))


def _virgin_change(before: MeasuredFriction, after: MeasuredFriction) -> MeasuredChange:
    """Return the change of the virgin curve, at the displacement where it differs most."""
    if not after.stiffness:
        return MeasuredChange("virgin", float(before.stiffness > 0), settings.curve_error)
    new = np.interp(before.displacement, after.displacement, after.force)
    return MeasuredChange("virgin", before.misfit(new), settings.curve_error)
