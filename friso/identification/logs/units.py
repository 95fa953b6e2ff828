"""Convert unit texts of files and options to SI where possible, by lists of words.

The TOML files beside this one have the words by which channels and units are recognised.
"""

from __future__ import annotations

import re
import tomllib
import unicodedata
from collections.abc import Iterable
from functools import cache, lru_cache
from importlib.resources import files
from typing import Any

import numpy as np

from friso.axis import LINEAR, AxisKind
from friso.errors import InputError, LogError
from friso.identification.logs.log import ROLES
from friso.quantities import Quantity, any_sign, quoted


@cache
def read_lists(name: str) -> dict[str, Any]:
    """Return the tables of `NAME.toml`, read once."""
    return tomllib.loads(files("friso.identification.logs").joinpath(f"{name}.toml").read_text("utf-8"))


@cache
def channel_words() -> dict[str, Any]:
    """Return the words in a channel's name that tell what it is, from names.toml.

    Keys are the tables of that file, nested as there. Values are sets of words, all languages together.
    """
    return _joined(read_lists("names"))


def _joined(table: dict[str, Any]) -> dict[str, Any]:
    """Join word lists, one for each language, into one set; nested tables likewise."""
    return {
        key: frozenset(word for words in value.values() for word in words)
        if all(isinstance(words, list) for words in value.values())
        else _joined(value)
        for key, value in table.items()
    }


_WORDS = read_lists("units")
RMS, COUNTS = (frozenset(_WORDS[name]) for name in ("rms", "counts"))
"""Spellings of RMS amperes (of a drive's phases), and of sensor counts."""

OTHERS = {
    "m": ("rad",),
    "m/s": ("rad/s",),
    "m/s^2": ("rad/s^2",),
    "N": ("A", "V", "N*m"),
    "rad": ("m",),
    "rad/s": ("m/s",),
    "rad/s^2": ("m/s^2",),
    "N*m": ("A", "V", "N"),
}
"""Units that may replace the SI unit of a role, on a linear or rotary axis, if the caller allows them."""
FOREIGN = (*OTHERS["N"], "count")
"""Units in place of a force for which estimates per unit are useful."""
RESPONSES = tuple(
    f"{place}{rate}/{force}"
    for place, torque in (("m", "N"), ("rad", "(N*m)"))
    for rate in ("", "/s", "/s^2")
    for force in (torque, "A", "V")
)
"""Units of frequency responses: positions and their rates over forces, or over substitutes of forces."""
_SPELLINGS = {text: unit for unit, texts in _WORDS["spellings"].items() for text in texts} | dict.fromkeys(RMS, "A")
"""The units that friso knows, by their usual spellings."""
MISSPELT_FROM = 1e5
"""Factor above which a unit is a misspelling: no log is in megametres, megaseconds or gigaradians."""
_GLUED = re.compile(
    r"(?P<stem>.*[A-Za-z0-9]?)_(?:(?P<letter>[smNAV])|(?P<unit>"
    r"secs?|ms|msec|us|usec|ns|mm|um|µm|nm|deg|rad|mrad|urad|Nm|mNm|kN|mN|mA|mV|Hz|kHz|rpm|counts?|cnts?|incs?|lsb|ticks|hz|khz))"
)
_OVER = re.compile(r"(?P<name>[^/\[(]*?[^/\[(\s])(?:\s*/\s*|\s+in\s+)(?P<unit>\([^()]+\)|[^\s()\[\]]+)")
"""Headings in the style of ISO 80000, a quantity over its unit, also in words."""
_QUOTIENT = re.compile(r"(?P<name>.*[^\s_](?<!\sin))[\s_]+(?P<over>[^\s_/\[(]+)\s*/\s*(?P<under>[^\s_/\[(\])]+)")
"""Headings that end, or may end, with a quotient of units: "Speed m/s"."""
_MULTIPLE = re.compile(r"(?P<number>\d+(?:\.\d+)?(?:[eE][+-]?\d+)?) +(?P<unit>[^\d\s].*)")
"""A multiple of a unit, "10 mN"."""
POWERS_OF_TEN = frozenset(float(f"1e{power}") for power in range(-9, 10))
"""Numbers before a unit in a heading. Others say something else."""
_DECIBELS = re.compile(r"dB(?![A-Za-z])(?:\s*(?:rel?\b\.?|ref\b\.?))?\s*[(\[]?([^()\[\]]*)[)\]]?", re.IGNORECASE)
_RATE = re.compile(r".+_(?P<length>m|mm|um|nm|rad|mrad|deg)_(?:per_)?(?P<time>s|s\^?2)")
"""Names that end with an unambiguous unit; pos_in and pos_min have no unit."""
_MEASURED_IN = channel_words()["measured_in"]
"""Words in a name that imply the unit."""


def likely_unit(words: Iterable[str]) -> str:
    """Return the unit that the words of a name imply; "" for none.

    Single letters imply no unit.
    """
    long_words = {word for word in words if len(word) > 1}
    return next((unit for unit, names in _MEASURED_IN.items() if names & long_words), "")


def without_accents(name: str) -> str:
    """Return a name in plain letters: "força" is "forca"."""
    return "".join(sign for sign in unicodedata.normalize("NFD", name) if not unicodedata.combining(sign))


CHARACTERS_OF_A_UNIT = 100
"""Longest text of a unit."""


def spelled(text: str) -> str:
    """Convert a unit text to the spelling of `friso.quantities`; "" for none.

    "m/s2" becomes "m/s^2", "µm" "um", "sec" "s". A text too long for a unit stays.
    """
    if len(text) > CHARACTERS_OF_A_UNIT:
        return text
    text = re.sub(r"(?:(?<!\s)\s+\([A-Z][\w /]*\)|^\(None\))$", "", text.strip())  # TwinCAT: "V (Voltage)", "(None)"
    text = text.replace("µ", "u").replace("μ", "u").replace("Ω", "ohm")
    text = "" if text.lower() in ("none", "-", "n/a") else _SPELLINGS.get(text, text)
    parts = re.split(r"([*/· ])", text)
    parts = [_below(_SPELLINGS.get(part, part), before) for before, part in zip(["", *parts], parts, strict=False)]
    return "".join(re.sub(r"^([A-Za-z]+)([2-4])$", r"\1^\2", part) for part in parts)


def _below(part: str, before: str) -> str:
    """Return the unit text after an operator, in brackets if it is a product after a slash.

    `before` is the operator. Without brackets "rad/N*m" would read as rad/N times m.
    """
    return f"({part})" if before == "/" and "*" in part else part


@lru_cache(maxsize=1024)
def unit_factor(unit: str, si_unit: str) -> float | None:
    """Return the SI value of 1 `unit`, or None if it is not of the kind of `si_unit`.

    A unit may have a number, "10 mN".
    """
    if multiple := _MULTIPLE.fullmatch(unit):
        factor = unit_factor(multiple["unit"], si_unit)
        return None if factor is None else float(multiple["number"]) * factor
    try:
        factor = Quantity(si_unit, any_sign, "").factor(spelled(unit))
    except InputError:
        return None
    return None if si_unit in ("m", "s", "rad") and factor > MISSPELT_FROM else factor


def is_unit(text: str) -> bool:
    """Tell whether a text is a unit that a log could have."""
    text = spelled(text) if _MULTIPLE.fullmatch(text) is None else text
    is_special = text.lower() in COUNTS or text == "%" or of_decibels(text) is not None
    return is_special or any(unit_factor(text, unit) is not None for unit in _KINDS)


def of_decibels(text: str) -> str | None:
    """Return the reference of decibels, "" if not stated; None if the unit is not decibels.

    For "dB re 1 m/N" the result is "1 m/N".
    """
    match = _DECIBELS.fullmatch(text)
    return None if match is None else match[1].strip()


_KINDS = ("s", "Hz", *OTHERS, "A", "V", "N/V", *RESPONSES, "V/m", "N/m", "K")


def split_heading(heading: str) -> tuple[str, str]:
    """Split a heading into name and unit: "Position (mm)" is ("Position", "mm").

    Text in square brackets is a unit unless it is an index. Text in parentheses, after a slash or after "in" is a unit
    only if it is known: "x/mm", "Kraft in N", but not "current (filtered)". In "Speed m/s" the slash belongs to the
    unit, and "Gain A/V" has none. Otherwise a name may end with its unit, and keeps it: "angle_deg".
    """
    heading = heading.strip()
    quotient = _QUOTIENT.fullmatch(heading)
    if quotient is not None and is_unit(unit := f"{quotient['over']}/{quotient['under']}"):
        return quotient["name"], unit
    if quotient is not None and quotient["over"] != "s" and ("*" in quotient["over"] or is_unit(quotient["over"])):
        return heading, ""  # except for "Weg s/mm"
    over = _OVER.fullmatch(heading)
    if over is not None and is_unit(over["unit"].strip("()")) and not is_unit(heading):
        return over["name"], over["unit"].strip("()")
    opening, closing = "[]" if heading.endswith("]") else "()"
    name, bracket, inner = heading.removesuffix(closing).rpartition(opening)
    if not (heading.endswith(closing) and bracket and name.strip()) or closing in inner:
        return heading, _last_part(heading)
    multiple = _MULTIPLE.fullmatch(inner)
    if multiple and float(multiple["number"]) not in POWERS_OF_TEN:
        return heading, ""  # "(25 Hz)" says how it was filtered
    is_in = not re.fullmatch(r"[\d:, ]*", inner) if opening == "[" else is_unit(inner)
    return (name.rstrip(), inner.strip()) if is_in else (heading, "")


def _last_part(name: str) -> str:
    """Return the unit at the end of a name: ms for "tempo_ms", mm/s for "vel_mm_s"; else "".

    A single letter counts only if the name says what is measured: "force_N", but not "pos_s".
    """
    if rate := _RATE.fullmatch(name):
        return f"{rate['length']}/{rate['time'].replace('^', '')}"
    match = _GLUED.fullmatch(name)
    if match is None:
        return ""
    words = {*re.split(r"[^a-z]+", without_accents(match["stem"]).lower())}
    return match["unit"] or (match["letter"] if words & _MEASURED_IN[match["letter"]] else "")


def in_si(unit: str, role_unit: str) -> tuple[float, str]:
    """Return the factor that converts a unit as far as possible, and the resulting unit.

    The result is the unit of the role if possible, else a unit that may replace it, else the given unit with factor 1
    ("1" for no unit).
    """
    for target in (role_unit, *OTHERS.get(role_unit, ())):
        value = unit_factor(unit, target) if unit else None
        if value is not None:
            return value, target
    text = spelled(unit)
    return 1.0, "count" if text.lower() in COUNTS else text or "1"


def unit_since_1970(name: str, values: np.ndarray) -> str:
    """Return the unit of a clock that counts from 1970, as computers' clocks do; "" for another channel.

    The name says that it is a time, and between 2001 and 2096 no other unit gives such values.
    """
    if not {"time", "stamp", "timestamp", "t"} & {*re.split(r"[^a-z]+", name.lower())}:
        return ""
    finite = values[np.isfinite(values)]
    units = (("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9))
    return next((unit for unit, size in units if finite.size and (abs(finite / size - 2.5e9) < 1.5e9).all()), "")


def read_scale(role: str, text: str, channel_unit: str, axis: AxisKind = LINEAR) -> tuple[float, str]:
    """Return the factor of a scale such as "35.1507 N/V", and the unit assumed for the channel.

    The factor leads to the SI unit of the role on that axis. A channel without a unit gets the unit after the slash.
    Raises LogError for units that do not fit role and channel.
    """
    number = r"[+-]?[0-9.]++(?:[eE][+-]?[0-9]++)?+"
    match = re.fullmatch(rf"\s*({number})\s*(\S.*?)(?<!\s)\s*/\s*+(\([^()]+\)|[^/]++)\s*", text)
    role_unit = axis.unit(ROLES[role])
    example = f'--scale {role}="35.1507 {role_unit}/V"'
    if match is None:
        raise LogError("scale", quoted(text), f"number and unit, {role_unit} over the unit of the channel", example)
    below = spelled(match[3].strip("() "))
    above = _scale_part(f"{match[1]} {match[2]}", role_unit, text, example)
    unit = spelled(channel_unit) or below
    if below.lower() in COUNTS and unit.lower() in COUNTS:
        return above, "count"
    for kind in ("m", "rad", "A", "V", "N*m", "N", "m/s", "rad/s", "m/s^2"):
        of_unit, of_scale = unit_factor(unit, kind), unit_factor(below, kind)
        if of_unit is not None and of_scale is not None:
            return above * of_unit / of_scale, unit
    if unit == below:
        return above, unit
    actual = f"{quoted(text)}, and the channel is in {unit}"
    if unit_factor(unit, role_unit) is not None:
        expected = "no scale for this log: identify the other by itself first, which keeps its scale beside it"
        raise LogError("scale", actual, expected, f"friso identify other.csv --scale {role}={quoted(text)}")
    raise LogError("scale", actual, f"a scale from {unit} to {role_unit}", f'--scale {role}="1.5 {role_unit}/{unit}"')


def _scale_part(text: str, role_unit: str, scale: str, example: str) -> float:
    """Return the SI value of the part of a scale before its slash.

    Raises LogError for a part in another unit than `role_unit`.
    """
    try:
        return float(Quantity(role_unit, any_sign, "").read(text))
    except InputError:
        raise LogError("scale", quoted(scale), f"number and unit, {role_unit} over a unit", example) from None
