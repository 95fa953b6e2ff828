"""Guess friction that nobody measured from the kind of contact: ranges of what similar machines have."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import Any, Protocol

from friso.axis import LINEAR, AxisKind
from friso.errors import InputError, StageError
from friso.intervals import WIDE_RATIO, Interval, UncertainValue, is_range, uncertain_value
from friso.quantities import Quantity, positive, quoted
from friso.stage.section import UNKNOWN, nearest_name, numeric_fields
from friso.stage.tables import FRICTION, MOTOR_FRICTION, USUAL

ContactRange = tuple[float, float]
"""Lowest and highest value of a range [SI]."""

_FORCE = Quantity("N", positive, "5 N")

FRICTIONS = ("friction", MOTOR_FRICTION)
"""Tables of a stage file that state friction."""

_HOW_LARGE = (
    "static or Coulomb friction, if only as a wide range, or a guess with the size of the contact; without [friction], "
    "friso check says from which friction on such machines hunt"
)

_EXAMPLE = 'guess = "recirculating ball, size 25, light preload, 4 carriages"'


@dataclass(frozen=True, kw_only=True)
class ContactKind:
    """A kind of contact, with ranges of what nearly all machines with it show (file contacts.toml, with sources).

    `ratio` is static over Coulomb friction, `stribeck_velocity` is in m/s. Over `presliding` [m] the contact gives way
    before it slides. `settling` [s] is bristle damping over bristle stiffness, and `viscous` [s/m] is viscous over
    Coulomb friction. A rotary contact has radians for metres. `sizes`, `preloads`, `seals` and `friction_coefficient`
    say how much a carriage drags, for contacts of which makers publish that.
    """

    name: str
    source: str
    ratio: ContactRange
    stribeck_velocity: ContactRange
    presliding: ContactRange
    settling: ContactRange
    viscous: ContactRange
    axis: str = LINEAR.name
    sizes: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    preloads: Mapping[str, ContactRange] = field(default_factory=dict)
    seals: ContactRange = (1.0, 1.0)
    friction_coefficient: ContactRange = (0.0, 0.0)

    def drag(self, size: str, preload: str) -> ContactRange:
        """Return the Coulomb friction [N] of one carriage of a size, with a preload."""
        one, shares = self.sizes[size], self.preloads[preload]
        return tuple(
            seal * one["seal"] + coefficient * share * one["rating"]
            for seal, coefficient, share in zip(self.seals, self.friction_coefficient, shares, strict=True)
        )  # type: ignore[return-value]

    def ranges(self, coulomb: ContactRange, stiffness: ContactRange = (0.0, math.inf)) -> dict[str, ContactRange]:
        """Return the ranges [SI] of the keys of [friction] for a range of Coulomb friction [N].

        A range of bristle `stiffness` [N/m] that something else shows cuts that of the contact. Static friction spans
        orders of magnitude only where Coulomb friction does, so that their centres fit together.
        """
        low, high = coulomb
        least = low if high > WIDE_RATIO * low else high * self.ratio[1] / WIDE_RATIO / self.ratio[0]
        soft, stiff = cut((low / self.presliding[1], high / self.presliding[0]), stiffness)
        return {
            "coulomb": coulomb,
            "static": (max(low, least) * self.ratio[0], high * self.ratio[1]),
            "stribeck_velocity": self.stribeck_velocity,
            "bristle_stiffness": (soft, stiff),
            "bristle_damping": (soft * self.settling[0], stiff * self.settling[1]),
            "viscous": (low * self.viscous[0], high * self.viscous[1]),
        }


@cache
def contacts(axis: str = LINEAR.name) -> dict[str, ContactKind]:
    """Return the kinds of contact of an axis, "linear" or "rotary", by name; the first one is any contact."""
    rows = tomllib.loads(files("friso").joinpath("contacts.toml").read_text(encoding="utf-8"))["contact"]
    several = [ContactKind(**{key: _ends(value) for key, value in row.items()}) for row in rows]
    return {one.name: one for one in several if one.axis == axis}


def _ends(value: Any) -> Any:
    """Return lists of a row, and of the tables in it, as pairs."""
    if isinstance(value, dict):
        return {key: _ends(item) for key, item in value.items()}
    return tuple(map(float, value)) if isinstance(value, list) else value


def any_contact(axis: AxisKind) -> ContactKind:
    """Return the ranges that hold for every contact on a kind of axis."""
    return next(iter(contacts(axis.name).values()))


def with_guess(tables: Mapping[str, Any], axis: AxisKind) -> dict[str, Any]:
    """Complete the tables of a stage file in which friction is "unknown", or has a `guess`, which names the contact.

    Keys that are "unknown", and those that a table with a guess lacks, get ranges. Other tables stay as they are.
    Raises StageError for a guess that is not understood, or if nothing says how large the friction is.
    """
    frictions = {name: table for name in FRICTIONS if isinstance(table := tables.get(name), Mapping)}
    return {**tables, **{name: _with_ranges(name, table, axis) for name, table in frictions.items()}}


def _with_ranges(name: str, friction: Mapping[str, Any], axis: AxisKind) -> Mapping[str, Any]:
    """Return a table of friction with ranges for the keys that nobody knows; `name` is that of the table."""
    guess = friction.get("guess")
    asked = {key for key, value in friction.items() if getattr(value, "text", value) == UNKNOWN}
    if not asked and not isinstance(guess, str):
        return friction
    contact, drag = _understood(guess, axis, name) if isinstance(guess, str) else (any_contact(axis), None)
    table = {"model": "lugre", **friction}
    law = FRICTION.named(table["model"]) if isinstance(table["model"], str) else None
    if law is None:  # a later check reports this error, as it does keys that the law does not have
        return table
    if "guess" in table:
        asked |= {*law.model_fields} - {*table}
    fields, coulomb = numeric_fields(law), _stated(table, "coulomb", axis)
    coulomb = coulomb or _from_static(_stated(table, "static", axis), contact) or drag
    if coulomb is None and {*table} <= {*law.model_fields} and asked & {*fields} & {*USUAL}:
        actual = quoted(UNKNOWN) if "coulomb" in table else "nothing"
        raise StageError(f"{name}.coulomb", actual, _HOW_LARGE, f'coulomb = "1 {axis.force} .. 20 {axis.force}"')
    ranges = contact.ranges(coulomb or (1.0, 1.0))
    added = {key: _guessed(ends, fields[key].on(axis).unit) for key, ends in ranges.items() if key in asked & {*fields}}
    exponent = {"stribeck_exponent": 2} if "stribeck_exponent" in asked & {*fields} else {}  # a Gaussian curve
    return {**table, **added, **exponent}


def _guessed(ends: ContactRange, unit: str) -> UncertainValue:
    """Return a value that nobody knows, which a stage file writes as "unknown", from the ends of its range [SI]."""
    interval = Interval(*ends, written(ends, unit))
    return UncertainValue(interval.middle, UNKNOWN, interval)


class _GuessedStage(Protocol):
    """What guesses need of a stage: its axis, its keys, and those that nobody knows."""

    @property
    def axis_kind(self) -> AxisKind: ...
    @property
    def unknown_keys(self) -> tuple[str, ...]: ...
    @property
    def guessed_keys(self) -> tuple[str, ...]: ...
    def flat(self) -> dict[str, Any]: ...
    def uncertain(self) -> dict[str, Interval]: ...


def followed(stage: _GuessedStage, swept: Mapping[str, Any]) -> dict[str, tuple[str, Any]]:
    """Return the guessed keys of a stage that follow a swept one, each with that key and its values [SI].

    `swept` has SI numbers or arrays by key. Values follow from Coulomb friction, or from static friction where that
    alone is stated.
    """
    found = {}
    for table in FRICTIONS:
        keys = {key for key in stage.guessed_keys if key.startswith(f"{table}.")}
        lead, static = f"{table}.coulomb", f"{table}.static"
        if lead in keys and lead not in swept and static not in keys:
            lead = static
        if lead not in swept:
            continue
        contact = _contact_of(stage, table)
        ranges = contact.ranges((1.0, 1.0) if lead != static else (1 / contact.ratio[1], 1 / contact.ratio[0]))
        for name, ends in ranges.items():  # all but the velocity are proportional to the level of friction
            if (key := f"{table}.{name}") in keys - {*swept} and name != "stribeck_velocity":
                found[key] = lead, Interval(*ends, "").middle * swept[lead]
    return found


def usual_ranges(
    stage: _GuessedStage, keys: Collection[str], bounds: Mapping[str, ContactRange]
) -> dict[str, ContactRange]:
    """Return what similar machines have for some keys of [friction] that nobody knows, as ranges [SI] by key.

    They follow from Coulomb friction, or else from static friction, and from the contact that the stage's guess names;
    `bounds` cut them. A key has no range if nobody knows these either, or if nothing is usual for it.
    """
    flat, intervals = stage.flat(), stage.uncertain()
    contact = _contact_of(stage)

    def stated(key: str) -> ContactRange | None:
        """Return the range of a key's value; None if the stage has none, or if nobody knows it."""
        if key in keys or key not in flat:
            return None
        interval = intervals.get(key)
        return (flat[key], flat[key]) if interval is None else (max(interval.low, flat[key] / 10), interval.high)

    coulomb = stated("friction.coulomb") or _from_static(stated("friction.static"), contact)
    if coulomb is None:
        return {}
    stiffness = bounds.get("friction.bristle_stiffness", (0.0, math.inf))
    ranges = {f"friction.{key}": ends for key, ends in contact.ranges(coulomb, stiffness).items()}
    return {key: cut(ranges[key], bounds.get(key, ranges[key])) for key in keys if key in ranges and key in flat}


def guessed_ratios(stage: _GuessedStage) -> dict[str, tuple[str, Interval]]:
    """Return, for keys of [friction] that grow with another one over machines, that key and the range of their ratio.

    They are static friction with Coulomb friction, and the damping of bristles with their stiffness. Both keys must be
    uncertain, and nobody may know either: it is listed as unknown, or its range spans orders of magnitude.
    """
    intervals = stage.uncertain()
    open_keys = {key for key, one in intervals.items() if one.wide or key in stage.unknown_keys}
    if not open_keys:
        return {}
    pairs = (("static", "coulomb", "ratio"), ("bristle_damping", "bristle_stiffness", "settling"))
    found = {}
    for table in FRICTIONS:
        for key, lead, name in pairs:
            if {f"{table}.{key}", f"{table}.{lead}"} <= open_keys:
                low, high = getattr(_contact_of(stage, table), name)
                found[f"{table}.{key}"] = f"{table}.{lead}", Interval(low, high, "")
    return found


def _contact_of(stage: _GuessedStage, table: str = "friction") -> ContactKind:
    """Return the contact that the guess in a `table` of a stage names, or any contact."""
    guess = getattr(getattr(stage, table), "guess", None)
    return _understood(guess, stage.axis_kind)[0] if guess else any_contact(stage.axis_kind)


def cut(ends: ContactRange, other: ContactRange) -> ContactRange:
    """Return the common part of two ranges, or the first one if they have none."""
    low, high = max(ends[0], other[0]), min(ends[1], other[1])
    return (low, high) if low < high else ends


def written(ends: ContactRange, unit: str) -> str:
    """Write a range for a stage file: "1.2 N .. 3 N"."""
    return " .. ".join(f"{float(f'{end:.3g}'):.12g} {unit}".rstrip() for end in ends)


def _stated(table: Mapping[str, Any], key: str, axis: AxisKind) -> ContactRange | None:
    """Return the range in which a table states a force [N]; None without one, or if it cannot be read."""
    text = getattr(table.get(key), "text", table.get(key))
    if text is None or text == UNKNOWN:
        return None
    try:
        if is_range(text):
            interval = uncertain_value(text, _FORCE.on(axis)).interval
            return max(interval.low, interval.high / 1e3), interval.high
        value = float(_FORCE.on(axis).read(text))
    except InputError:  # a later check reports this error
        return 1.0, 1.0
    return value, value


def _from_static(static: ContactRange | None, contact: ContactKind) -> ContactRange | None:
    """Return the Coulomb friction [N] of a contact with a range of static friction."""
    return static and (static[0] / contact.ratio[1], static[1] / contact.ratio[0])


def _understood(guess: str, axis: AxisKind, table: str = "friction") -> tuple[ContactKind, ContactRange | None]:
    """Return the contact that a guess names, and its Coulomb friction [N], or None if the guess has no size.

    Raises StageError, for a key of the `table`, for words that are not understood.
    """
    name, *words = (part.strip() for part in guess.split(","))
    kinds = contacts(axis.name)
    contact = kinds[_named(name, kinds, table)]
    size, preload, carriages = None, None, 1
    for word in words:
        what, _, rest = word.partition(" ")
        if what == "size" and contact.sizes:
            size = _named(rest, contact.sizes, table)
        elif rest == "preload" and contact.preloads:
            preload = _named(what, contact.preloads, table)
        elif rest in ("carriage", "carriages") and what.isdecimal() and what.strip("0") and len(what) < 3:
            carriages = int(what)
        else:
            raise _not_understood(word, "size, preload and number of carriages, of contacts that have sizes", table)
    if size is None:
        return contact, None
    drags = [contact.drag(size, share) for share in ([preload] if preload else contact.preloads)]
    low, high = carriages * min(low for low, _ in drags), carriages * max(high for _, high in drags)
    return contact, (low, high)


def _named(word: str, names: Iterable[str], table: str) -> str:
    """Return a word if it is one of some names. Raises StageError, which lists them, for another word."""
    if word in (names := [*names]):
        return word
    near = nearest_name(word, names)
    raise _not_understood(word, f"one of {', '.join(names)}{f'; did you mean {near}?' if near else ''}", table)


def _not_understood(word: str, expected: str, table: str) -> StageError:
    """Make the error for a word of a guess that is not understood."""
    return StageError(f"{table}.guess", quoted(word, "not understood"), expected, _EXAMPLE)
