"""Linear and rotary axes, and their units.

Everything is declared in the units of a linear axis. On a rotary axis angles stand for lengths, torques for forces, and
moments of inertia for masses, in unchanged equations. Every text of a unit comes from this module: units of keys
(`AxisKind.unit`), and units shown for the axis of the current command (`unit_shown`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from itertools import takewhile
from typing import Any

AXIS_KIND = "axis.kind"
"""Stage-file key of the kind of axis."""

LENGTH, FORCE, MASS = "m", "N", "kg"


@dataclass(frozen=True)
class AxisKind:
    """A kind of axis: its name, and its units in place of metre, newton and kilogram.

    `effort` is what its actuator exerts, in words. `exerts` has force or torque of the motor [N, or N m] per unit of
    a drive's command, such as ("A", 50.0), as far as they are known. Forces may then be written in these units.
    `counted` has the length [m or rad] of a "count" of the encoder and the time [s] of a "sample", if they are known.
    """

    name: str
    length: str = LENGTH
    force: str = FORCE
    mass: str = MASS
    effort: str = "force"
    exerts: tuple[tuple[str, float], ...] = field(default=(), compare=False)
    counted: tuple[tuple[str, float], ...] = field(default=(), compare=False)

    @property
    def per_ampere(self) -> float | None:
        """Return the force or torque of the motor per ampere [N, or N m]; None if it is not known."""
        return dict(self.exerts).get("A")

    @property
    def finest(self) -> float:
        """Return the length [m or rad] below which its encoder sees nothing: that of a count; 0 if it is not known."""
        return dict(self.counted).get("count", 0.0)

    @property
    def described(self) -> str:
        """Return the axis in words, for a message about a unit."""
        return f'[axis] kind = "{self.name}"'

    @property
    def plain(self) -> bool:
        """Tell whether its units are those of a linear axis, in which everything is declared."""
        return (self.length, self.force) == (LENGTH, FORCE)

    def named(self, texts: Iterable[str]) -> list[str]:
        """Return names of quantities with what the actuator of this axis exerts in place of {effort}."""
        return [text.format(effort=self.effort) for text in texts]

    def per(self, unit: str) -> AxisKind:
        """Return this axis with forces in the unit in which they were logged, such as amperes.

        Masses are then in that unit times s^2 over the length.
        """
        return replace(self, force=unit, mass=f"{unit}*s^2/{self.length}")

    def unit(self, unit: str) -> str:
        """Return a unit of a linear axis as it is on this one: "N*s/m" becomes "N*m*s/rad".

        A unit that is of this axis already is unchanged.
        """
        if self.plain or _TURNED.search(unit):
            return unit
        return _PARTS.sub(self._part, unit)

    def text(self, sentence: str) -> str:
        """Return a sentence in the units of this axis: "0.1 mm" becomes "0.1 mrad"."""
        return sentence if self.plain else _NUMBERS.sub(lambda match: self.unit(match[0]), sentence)

    def with_units(self, dataset: Any) -> Any:
        """Return an xarray.Dataset, given in the units of a linear axis, in the units of this axis."""
        for array in dataset.variables.values():
            array.attrs.update({key: self.unit(array.attrs[key]) for key in ("units",) if key in array.attrs})
            array.attrs.update({key: self.text(array.attrs[key]) for key in ("criterion",) if key in array.attrs})
        return dataset

    def _part(self, match: re.Match[str]) -> str:
        part = match["prefix"] + {LENGTH: self.length, FORCE: self.force, MASS: self.mass}[match["base"]]
        below = match.string[: match.start()].endswith("/")
        return f"({part})" if below and re.search("[*/]", part) else part

    def suffix(self, key: str) -> str:
        """Return a JSON key with the unit of this axis: "force_n" becomes "force_n_m"."""
        if self.plain:
            return key
        name, *parts = key.split("_")
        unit = [*takewhile(_IN_SUFFIXES.__contains__, reversed(parts))][::-1]
        length, force, mass = (_in_key(text) for text in (self.length, self.force, self.mass))
        names = {"m": length, "n": force, "ns": f"{force}_s", "kg": mass}
        return "_".join([name, *parts[: len(parts) - len(unit)], *(names.get(part, part) for part in unit)])


_TURNED = re.compile(r"rad|N[*· ]m|kg[*· ]m")
_PARTS = re.compile(r"(?<![A-Za-zµ^])(?P<prefix>[numµkM]??)(?P<base>kg|N|m)(?![A-Za-z])")
_NUMBERS = re.compile(r"(?<=\d )(?:[numµkM]?m|k?N|m?N|kg)(?![A-Za-z]|[*·]m)(?:[*·]s/m|/m?s|/m)?(?![A-Za-z])")
_IN_SUFFIXES = frozenset(("m", "n", "ns", "kg", "s", "s2", "per", "hz"))


def _in_key(unit: str) -> str:
    """Return a unit as the suffix of a key: "kg*m^2" becomes "kg_m2"."""
    return unit.lower().replace("^", "").replace("*", "_").replace("/", "_per_")


LINEAR = AxisKind("linear")
ROTARY = AxisKind("rotary", "rad", "N*m", "kg*m^2", "torque")
KINDS: Mapping[str, AxisKind] = {kind.name: kind for kind in (LINEAR, ROTARY)}


def axis_of(flat: Mapping[str, Any]) -> AxisKind:
    """Return the kind of axis of a stage, from its keys."""
    return KINDS[flat.get(AXIS_KIND, LINEAR.name)]


_SPOKEN_OF: ContextVar[AxisKind] = ContextVar("axis", default=LINEAR)


def speak_of(kind: AxisKind) -> None:
    """Show everything from here on, in this context (`contextvars`), in the units of an axis."""
    _SPOKEN_OF.set(kind)


@contextmanager
def speaking_of(kind: AxisKind) -> Iterator[None]:
    """Show everything in the `with` block in the units of an axis."""
    token = _SPOKEN_OF.set(kind)
    try:
        yield
    finally:
        _SPOKEN_OF.reset(token)


def axis_shown() -> AxisKind:
    """Return the kind of axis whose units are shown."""
    return _SPOKEN_OF.get()


def unit_shown(unit: str) -> str:
    """Return the unit to show for a unit of a linear axis: on a rotary axis, "m" becomes "rad".

    The kind of axis is the one set by `speak_of` or `speaking_of`, linear by default.
    """
    return axis_shown().unit(unit)


def unit_of_key(key: str) -> tuple[str, str]:
    """Split a JSON key into name and unit: "velocity_m_per_s" is a velocity in "m/s"."""
    for start in (match.start() for match in re.finditer("(?!^)_", key)):
        above, _, below = key[start + 1 :].partition("_per_")
        parts = [part.split("_") for part in (above, below) if part]
        if all(part in _UNITS_IN_KEYS for group in parts for part in group):
            texts = ["*".join(_UNITS_IN_KEYS[part] for part in group) for group in parts]
            return key[:start], "/".join(
                f"({text})" if "*" in text and text is not texts[0] else text for text in texts
            )
    return key, ""


_UNITS_IN_KEYS: Mapping[str, str] = {
    **{name: name for name in ("m", "s", "kg", "rad", "deg")},
    **{
        "n": "N",
        "hz": "Hz",
        "pa": "Pa",
        "ns": "N*s",
        "s2": "s^2",
        "m2": "m^2",
        "kg_m2": "kg*m^2",
        "j": "J",
        "db": "dB",
    },
}
"""Units by their spelling at the ends of keys."""
