"""Read the lines above a table: the sampling interval, and the units of its columns."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from friso.identification.logs.settings import settings
from friso.identification.logs.sniff import csv_cells
from friso.identification.logs.units import is_unit, split_heading, unit_factor
from friso.identification.logs.word_lists import channel_words

RATES, STEPS = (channel_words()[name] for name in ("sample_rate", "sample_time"))
"""Names of a sample rate and of a sample time, in lower case without separators."""
_OF_A_CLOCK = re.compile("|".join(sorted(RATES | STEPS)))
_BEFORE, _BEHIND = ' \t\f\v#%*/"', ' \t\f\v;,"'
"""Characters around a key and its value that belong to neither."""
_SEPARATOR = re.compile(r"\t\s*[:=;,]|[:=;,\t]")
_AMOUNT = re.compile(r"(?P<number>[+-]?(?:\d++(?:[.,]\d*+)?+|\.\d++)(?:[eE][+-]?\d++)?+)[\s;,]*(?P<unit>[^\s;,]*)")
"""Pattern of a number and its unit. A comma in front of all digits is no decimal sign: it may end a field."""
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(?P<sign>[.,])\d{3}")
"""Pattern of digits in which a sign may group thousands or begin the decimals: 10,000 Hz."""
_OF_UNITS = re.compile(r"(?:vertical |y )?units?|einheit(?:en)?", re.IGNORECASE)
_OF_UNIT = re.compile(r"(?:units?|einheit)(?: of)? (?P<after>.+)|(?P<before>.+?)[ _](?:units?|einheit)", re.IGNORECASE)


@dataclass(frozen=True)
class Preamble:
    """Information from the lines above a table.

    Fields are the sampling `interval` [s], if a line states it with its unit; numbers without a unit, by name; units by
    column name; and lines on what was read.
    """

    interval: float | None = None
    scalars: Mapping[str, float] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    read: tuple[str, ...] = ()


def preamble(lines: Iterable[str], names: Sequence[str], delimiter: str, decimal: str = ".") -> Preamble:
    """Read the lines above a table with columns of the given names, and its delimiter and decimal sign.

    If lines state different sampling intervals, none is used. Where a sign may group thousands, a number is taken only
    if it has a point, and so have the decimals of the table.
    """
    lines = [line for line in lines if line.strip()]
    units = _row_of_units(lines, names, delimiter)
    units = units or _units_by_name([pair for line in lines if (pair := _pair(line))], names)
    pairs = [(line.strip(), *pair) for line in lines for pair in _pairs_of_fields(line, delimiter)]
    pairs += [(f"{name} {value}", name, value) for name, value in _below_names(lines[-2:], delimiter)]
    read = [f"units from the lines above the table: {', '.join(units.values())}"] if units else []
    intervals, scalars = list[tuple[float, str]](), {}
    for line, stated, value in pairs:
        name, unit = split_heading(stated)
        key = _letters(name)
        asked = key in RATES | STEPS and len(value) < settings.characters_of_an_amount
        amount = _AMOUNT.fullmatch(value) if asked else None
        grouped = amount and _GROUPED.fullmatch(amount["number"])
        if amount is None or (grouped and not grouped["sign"] == decimal == "."):
            continue
        number = float(amount["number"].replace(",", "."))
        seconds = _seconds(number, amount["unit"].strip("[]()") or unit)
        if seconds is not None:
            intervals.append((seconds, line))
        else:
            scalars[name] = number
    if intervals and max(intervals)[0] <= min(intervals)[0] * (1 + 1e-9):
        interval, line = intervals[0]
        return Preamble(interval, scalars, units, (*read, f"sample time {interval:g} s, from the line {line!r}"))
    return Preamble(None, scalars, units, tuple(read))


def _below_names(lines: Sequence[str], delimiter: str) -> list[tuple[str, str]]:
    """Return names and numbers from two lines, a row of names above a row of numbers.

    Oscilloscopes write such rows. Returns [] for fewer than two lines.
    """
    if len(lines) < 2:
        return []
    names, values = ([cell.strip() for cell in line.split(delimiter)] for line in lines)
    return [(name, value) for name, value in zip(names, values, strict=False) if name and _AMOUNT.fullmatch(value)]


def _pairs_of_fields(line: str, delimiter: str) -> list[tuple[str, str]]:
    """Return keys and values of a line that is split into fields as its table is: "key:,1,ms" or "key: 1 ms,...".

    A value is what stands behind its key, in the same field or the next ones, up to a field that is no unit. A line
    without the delimiter may have one pair, with any sign between key and value.
    """
    fields = csv_cells(line, delimiter) if delimiter != " " else [line]
    fields = [cell for part in fields if (cell := part.strip(_BEFORE + _BEHIND)).strip(":=")]
    if len(fields) < 2:
        return [pair] if (pair := _pair(line)) else []
    pairs = []
    for i, cell in enumerate(fields):
        if not _OF_A_CLOCK.search(_letters(cell)):
            continue
        key, value = _pair(cell) or (cell.rstrip(" :="), "")
        value, *behind = [value, *fields[i + 1 : i + 2]] if value else [*fields[i + 1 : i + 3], ""]
        unit = next((one for one in behind if _seconds(1.0, one.strip("[]()")) is not None), "")
        goes_on = not unit and any(one[:1].isdigit() for one in behind)  # decimals or thousands behind a comma
        pairs += [] if goes_on else [(key, f"{value} {unit}".strip())]
    return pairs


def _letters(text: str) -> str:
    """Return the letters of a text alone, in lower case."""
    return re.sub(r"[\W\d_]+", "", text.lower())


def _pair(line: str) -> tuple[str, str] | None:
    """Return key and value of a line such as "key: value"; None if it lacks either."""
    line = line.lstrip(_BEFORE)
    if (separator := _SEPARATOR.search(line)) is None:
        return None
    key = line[: separator.start()].rstrip().removesuffix('"').rstrip()
    value = line[separator.end() :].strip().rstrip(_BEHIND)
    return (key, value) if key and value and '"' not in key else None


def _seconds(number: float, unit: str) -> float | None:
    """Convert a sample time or rate to seconds; None for another unit or if not positive."""
    for si, power in (("s", 1), ("Hz", -1)):
        if number > 0 and unit and (size := unit_factor(unit, si)) is not None:
            return (number * size) ** power
    return None


def _row_of_units(lines: Sequence[str], names: Sequence[str], delimiter: str) -> dict[str, str]:
    """Return the units of columns from a line that lists them, with or without a leading word.

    `names` are those of the columns. Returns {} if no line fits.
    """
    for line in lines:
        key, value = _pair(line) or ("", "")
        listed = _OF_UNITS.fullmatch(key) is not None
        cells = re.split(r"\s*[;,\t]\s*|\s+", value) if listed else line.lstrip("#% ").split(delimiter)
        cells = [cell for cell in cells if cell] if listed and len(cells) != len(names) else cells
        if listed and key.lower().startswith(("vertical", "y ")) and len(cells) == len(names) - 1:  # the first has none
            cells = [_horizontal(lines), *cells]
        units = [cell.strip(' []()"') for cell in cells]
        stated = [unit for unit in units if unit and unit != "-"]
        if len(units) == len(names) and stated and all(is_unit(unit) for unit in stated):
            return {name: unit for name, unit in zip(names, units, strict=True) if unit and unit != "-"}
    return {}


def _horizontal(lines: Iterable[str]) -> str:
    """Return the unit of the first column of an oscilloscope's table; "" if no line states it."""
    pairs = [pair for line in lines if (pair := _pair(line))]
    return next((value.split(",")[0] for key, value in pairs if key.lower() in ("horizontal units", "x units")), "")


def _units_by_name(pairs: Iterable[tuple[str, str]], names: Sequence[str]) -> dict[str, str]:
    """Return units of columns from lines such as "position unit: mm" or "position: mm"."""
    plain = {name.lower(): name for name in names if name}
    units = {}
    for key, value in pairs:
        unit = value.strip("[]() ")
        of_unit = _OF_UNIT.fullmatch(key)
        column = (of_unit["after"] or of_unit["before"]) if of_unit else key
        if column.lower() in plain and is_unit(unit):
            units[plain[column.lower()]] = unit
    return units
