"""Read CSV, TSV and TXT with one table of numbers: any delimiter, decimal sign and encoding.

All cells of the table have one number format. The lines above it may state the sampling interval, and the units of its
columns.
"""

from __future__ import annotations

import codecs
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import pandas as pd

from friso.errors import LogError
from friso.identification.logs.log import Channel, ChannelTable, unique
from friso.identification.logs.roles import role_of
from friso.identification.logs.sniff import (
    CLOCK,
    DECIMAL_SIGNS,
    DOS_END,
    ISO,
    MINUTES,
    STAMP,
    NumberFormat,
    TextLayout,
    are_grouped,
    are_numbers,
    are_whole,
    as_floats,
    as_numbers,
    csv_cells,
    fitting,
    formats_with,
    layout,
    may_be_grouped,
    number_texts,
    split_line,
)
from friso.identification.logs.units import channel_words, is_unit, spelled, split_heading, unit_factor, unit_since_1970
from friso.quantities import quoted


def read_cells(path: Path, form: TextLayout) -> tuple[TextLayout, Any]:
    """Read all cells from the first row of numbers on; columns without text are floats.

    The layout comes back with the number format that fits all columns together. Raises LogError for ragged rows, for
    columns that no format fits together, and where nothing tells whether digits are decimals or grouped.
    """
    first = _Reading.of(path, form)
    if first.numbers is not None and first.is_settled:
        return replace(form, numbers=first.numbers), first.frame
    second = _Reading.of(path, replace(form, numbers=NumberFormat(first.other_sign)))
    fits = [reading for reading in (first, second) if reading.numbers is not None]
    if not fits:
        cells = "; ".join(dict(sorted((first.misfits | second.misfits).items())).values())
        expected = "one decimal sign, one sign that groups thousands, and groups in all numbers of a column or in none"
        raise LogError("log", f"numbers in more than one format: {cells}", expected, "1234,5 and 0,5", str(path))
    plain = [reading for reading in fits if not reading.groups]
    grouped = [reading for reading in fits if reading.groups]
    if len(fits) == 2 and (not plain or any(len(reading.groups) > 1 for reading in grouped)):
        sign = grouped[0].other_sign
        actual = f"{' beside '.join((grouped[0].groups + grouped[-1].groups)[:2])}: decimals or thousands"
        example = f"1234 and 512, or 1{sign}234 and 512{sign}000"
        raise LogError("log", actual, "thousands that are not grouped, or all decimals written", example, str(path))
    chosen = (plain or fits)[0]
    return replace(form, numbers=chosen.numbers), chosen.frame


@dataclass(frozen=True)
class _Reading:
    """The cells of a table, read with one decimal sign.

    `texts` are the different cells that are numbers in any format, by column, of columns that pandas leaves as texts.
    """

    form: TextLayout
    frame: Any
    texts: dict[int, Any]

    @classmethod
    def of(cls, path: Path, form: TextLayout) -> _Reading:
        """Read all cells with the decimal sign of a layout."""
        frame = read_frame(path, form)
        columns = enumerate(frame.iloc[:, i] for i in range(frame.shape[1]))
        texts = {i: _number_cells(cells) for i, cells in columns if not pd.api.types.is_numeric_dtype(cells.dtype)}
        return cls(form, frame, {i: cells for i, cells in texts.items() if cells.size})

    @property
    def other_sign(self) -> str:
        """Return the decimal sign that is not read as one here, and may group digits."""
        return next(sign for sign in DECIMAL_SIGNS if sign != self.form.numbers.decimal)

    @cached_property
    def numbers(self) -> NumberFormat | None:
        """Return the format that fits all columns, without a sign for grouping if no digits are grouped."""
        fits = next((numbers for numbers in self._formats if not self._first(_misfits, numbers)), None)
        return fits if fits is None or self._first(are_grouped, fits) else NumberFormat(fits.decimal)

    @property
    def _formats(self) -> list[NumberFormat]:
        return formats_with(self.form.numbers.decimal)

    @property
    def misfits(self) -> dict[tuple[int, int], str]:
        """Return by its place the first cell that does not fit, of each format."""
        cells = (self._first(_misfits, numbers) for numbers in self._formats)
        return {cell: self._shown(cell) for cell in cells if cell}

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Return a cell in which the other decimal sign groups digits, and a whole number of the same column, if any.

        A column with both comes first. Without any such cell, the result is empty.
        """
        if self.numbers is None or self.numbers.grouping != self.other_sign:
            return ()
        pairs = []
        for i, texts in self.texts.items():
            rows = [texts.index[cells] for cells in (are_grouped(texts, self.numbers), are_whole(texts))]
            if rows[0].size:
                pairs.append(tuple(self._shown((int(of_kind[0]), i)) for of_kind in rows if of_kind.size))
        return max(pairs, key=len)

    @property
    def is_settled(self) -> bool:
        """Tell whether a number has this decimal sign in any format, or no number may have one."""
        columns = (self.frame.iloc[:, i] for i in range(self.frame.shape[1]))
        floats = [cells.to_numpy() for cells in columns if pd.api.types.is_float_dtype(cells.dtype)]
        if not self.texts and all(np.isnan(values).all() for values in floats):
            return True
        if any((~may_be_grouped(values)).any() for values in floats):
            return True
        return any((~are_numbers(cells, self.other_sign)).any() for cells in self.texts.values())

    def _first(self, test: Callable[[Any, NumberFormat], np.ndarray], numbers: NumberFormat) -> tuple[int, int] | None:
        """Return row and column of the first cell that passes a test; None for none."""
        passed = {i: np.flatnonzero(test(cells, numbers)) for i, cells in self.texts.items()}
        return min(((int(self.texts[i].index[rows[0]]), i) for i, rows in passed.items() if rows.size), default=None)

    def _shown(self, cell: tuple[int, int]) -> str:
        """Describe a cell by its text, line and column."""
        row, column = cell
        name = self.form.names[column] if any(self.form.names) else str(column + 1)
        text = quoted(str(self.frame.iloc[row, column]).strip())
        return f"{text} in line {self.form.first + 1 + row}, column {name or 'without a name'}"


def _misfits(texts: Any, numbers: NumberFormat) -> np.ndarray:
    """Tell which texts of a column are no numbers in a format."""
    return ~fitting(texts, numbers)


def _number_cells(cells: Any) -> Any:
    """Return the first of equal cells of a column that are numbers in any format; none if most cells are words."""
    texts = number_texts(cells)
    numbers = are_numbers(texts)
    return texts[numbers].drop_duplicates() if 2 * numbers.sum() >= (texts != "").sum() else texts[:0]


def read_frame(path: Path, form: TextLayout) -> Any:
    """Read all cells from the first row of numbers on, with the decimal sign of a layout.

    Columns without text are floats. Lines before the table are skipped here, because pandas would take a lone quotation
    mark in them as opening. Raises LogError for ragged rows.
    """
    options: dict[str, Any] = {
        "header": None, "decimal": form.numbers.decimal,
        "skip_blank_lines": False, "low_memory": False, "names": range(form.columns + 1),
        "index_col": False, "sep": form.delimiter, "skipinitialspace": not form.exact,
    }  # fmt: skip
    if form.delimiter == " " and not form.exact:
        options["sep"] = r"\s+"
    try:
        with path.open(encoding=form.encoding, errors=_AS_WINDOWS, newline="") as file:
            for _ in range(form.first):
                file.readline()
            with warnings.catch_warnings():
                warnings.simplefilter("error", pd.errors.ParserWarning)  # pandas warns that cells are dropped
                frame = pd.read_csv(_WithoutDosEnd(file), **options, on_bad_lines="error")  # pyright: ignore
    except (pd.errors.ParserError, pd.errors.ParserWarning, ValueError) as error:
        raise ragged(path, form, str(error)) from None
    if frame.iloc[:, -1].notna().any():  # one cell more than columns: a row may end with a delimiter
        raise ragged(path, form)
    return frame.iloc[:, :-1]


def _as_windows(error: UnicodeError) -> tuple[str, int]:
    """Read bytes that are no UTF-8 as cp1252: the first no-break space of a file may be what tells them apart."""
    if not isinstance(error, UnicodeDecodeError):
        raise error
    return error.object[error.start : error.end].decode("cp1252", "replace"), error.end


_AS_WINDOWS = "friso.identification.logs.text"
"""Name by which decoders find what to do with such bytes."""
codecs.register_error(_AS_WINDOWS, _as_windows)


class _WithoutDosEnd:
    """A text file without the end mark of DOS programs."""

    def __init__(self, file: TextIO) -> None:
        """Wrap a text file, from whose text the mark is removed."""
        self._file = file

    def read(self, size: int = -1) -> str:
        """Read `size` characters (-1: all), without the mark."""
        return self._file.read(size).replace(DOS_END, "")

    def __iter__(self) -> Iterator[str]:
        """Yield lines without the mark."""
        return (line.replace(DOS_END, "") for line in self._file)


def ragged(path: Path, form: TextLayout, why: str = "") -> LogError:
    """Return the error for a line with too many cells, or an unclosed quotation mark.

    Other errors of the parser are quoted in its own words.
    """
    with path.open(encoding=form.encoding, errors="replace") as file:
        for number, line in enumerate(file, 1):
            cells = split_line(line.rstrip("\r\n"), form.delimiter) if number > form.first else []
            if len(cells) > form.columns and any(cells[form.columns :]):
                actual = f"{len(cells)} cells in line {number}"
                return LogError("log", actual, f"{form.columns} cells in every row", "", str(path))
    if quote := re.search(r"EOF inside string starting at row (\d+)", why):
        why = f"a quotation mark in line {form.first + 1 + int(quote[1])} that is not closed"
    return LogError("log", why.strip(), f"rows of {form.columns} numbers", "", str(path))


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


CHARACTERS_OF_AN_AMOUNT = 100
"""Longest text that is read as an amount with its unit."""


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
        asked = key in RATES | STEPS and len(value) < CHARACTERS_OF_AN_AMOUNT
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


def read_text(path: Path) -> ChannelTable:
    """Read the table of a text file.

    Raises LogError, with the line, for ragged rows and for a text among the numbers.
    """
    form, frame = read_cells(path, layout(path))
    names = unique(list(form.names) or [f"column {i + 1}" for i in range(form.columns)])
    heading = preamble(form.above, names, form.delimiter, form.numbers.decimal)
    stated = form.units or [""] * len(names)
    units = [_agreed(name, unit or heading.units.get(name, "")) for unit, name in zip(stated, names, strict=True)]
    notes, columns = list(heading.read), []
    _no_short_rows(path, form, frame)
    blank = frame.isna().all(axis=1).to_numpy()
    frame, blanks = (frame[~blank], int(blank.sum())) if blank.any() else (frame, 0)
    for i, (name, unit) in enumerate(zip(names, units, strict=True)):
        cells = frame.iloc[:, i]
        values = column_values(cells, form.numbers, form.first, name, path)
        if values is None and not name and cells.isna().all():
            continue  # each row ends with a delimiter
        if values is None:
            notes += [f"left out: column {i + 1} ({name or 'no name'}), which holds no numbers{_such_as(cells)}"]
        else:
            unit = unit or values[1] or unit_since_1970(name, values[0])
            columns.append(Channel(name or f"column {i + 1}", unit, values[0], None, f"column {i + 1}"))
    if blanks:
        notes.append(f"{blanks} empty lines left out")
    channels = with_times(_same_ends(path, form, columns, frame), heading.interval)
    read = (f"format: text, {form.in_words}", f"{len(frame)} rows, {len(columns)} columns", *notes)
    return ChannelTable(channels, heading.scalars, read, heading.interval)


def _agreed(name: str, unit: str) -> str:
    """Return the unit of a column from a row of units; "" if the column's name has another one."""
    own = spelled(split_heading(name)[1])
    return "" if own and unit and own != spelled(unit) else unit


def _such_as(cells: Any) -> str:
    """Return an example of a column's texts, for a message; "" if it contains no digit."""
    texts = cells.dropna().astype(str).str.strip()
    first = next(iter(texts[texts != ""]), "")
    return f", but texts such as {quoted(first[:40])}" if re.search(r"\d", first) else ""


def _no_short_rows(path: Path, form: TextLayout, frame: Any) -> None:
    """Check that no row lacks its last cells while later rows have them.

    Raises LogError, with the line, if one does.
    """
    present = frame.iloc[:, -1].notna().to_numpy()
    missing = np.flatnonzero(~present[: int(np.flatnonzero(present)[-1])]) if present.any() else np.empty(0, dtype=int)
    if not missing.size:
        return
    suspects = set((missing + form.first + 1).tolist())
    with path.open(encoding=form.encoding, errors="replace") as file:
        for number, line in enumerate(file, 1):
            cells = split_line(line.rstrip("\r\n"), form.delimiter) if number in suspects and line.strip() else []
            if 0 < len(cells) < form.columns:
                actual = f"{len(cells)} cells in line {number}"
                raise LogError("log", actual, f"{form.columns} cells in every row", "", str(path))


def column_values(
    cells: Any, numbers: NumberFormat, first: int, name: str, path: Path
) -> tuple[np.ndarray, str] | None:
    """Return a column's values, with "s" if they are time stamps; None for a column of texts.

    The texts are `numbers` of a format, below the `first` lines of a file. Raises LogError for a text among numbers.
    """
    if cells.dtype == bool or pd.api.types.is_numeric_dtype(cells.dtype):
        values = cells.to_numpy(dtype=float)
        return None if np.isnan(values).all() else (values, "")
    texts = cells.astype(str).str.strip()
    present = cells.notna() & (texts != "")
    if texts[present].str.fullmatch(STAMP.pattern).all() and present.any():
        return _stamped(path, texts, present), "s"
    values = as_floats(number_texts(cells), numbers)
    wrong = present.to_numpy() & np.isnan(values) & (texts.str.lower() != "nan").to_numpy()
    if wrong.sum() > 0.5 * present.sum() or not present.any():
        return None
    if wrong.any():
        row = int(np.flatnonzero(wrong)[0])
        line = first + 1 + int(cells.index[row])
        actual = f"{quoted(str(texts.iloc[row]))} in line {line}, column {name or 'without a name'}"
        raise LogError("log", actual, "numbers in every row", "", str(path))
    return values, ""


def _stamped(path: Path, texts: Any, present: Any) -> np.ndarray:
    """Return the seconds since the first of some time stamps; NaN where none is `present`.

    In dates that are not ISO 8601, day or month may come first: only the time of day counts, and a time that steps back
    belongs to the next day. Raises LogError for impossible dates and times.
    """
    texts = texts.str.replace(",", ".", regex=False)
    try:
        if texts[present].str.fullmatch(ISO.pattern).all():
            stamps: Any = pd.to_datetime(texts.where(present), format="ISO8601", utc=True)
            seconds = (stamps - stamps[present].iloc[0]).dt.total_seconds().to_numpy(dtype=float)
        elif texts[present].str.fullmatch(MINUTES).all():
            parts = texts.where(present).str.extract(rf"^{MINUTES}$")
            seconds = 60 * as_numbers(parts[0]) + as_numbers(parts[1])
        else:
            seconds = _time_of_day(texts.where(present))
            seconds = seconds + 86400.0 * np.cumsum(np.r_[0.0, np.nan_to_num(np.diff(seconds)) < -43200.0])
    except ValueError as error:
        why = re.split(r"\.? You might|\n", str(error))[0]  # the other texts may come from home-made programs
        raise LogError("log", why, "dates and times as in ISO 8601", "2026-01-31T12:00:00.001", str(path)) from None
    return seconds - seconds[int(np.flatnonzero(present)[0])]


def _time_of_day(texts: Any) -> np.ndarray:
    """Return seconds since midnight from texts that end with a time of day; NaN for others."""
    parts = texts.str.extract(rf"{CLOCK}$")
    hours, minutes, seconds = (as_numbers(parts[i].fillna("0").where(parts[0].notna())) for i in range(3))
    behind_colon = texts.str.count(":") == 3  # fractions may lack leading zeros: 9:05:00:7 is 7 ms before 9:05:00:14
    digits = parts[3].where(~behind_colon, parts[3].str.zfill(int(parts[3].str.len().fillna(0).max())))
    fractions = as_numbers("0." + digits.fillna("0"))
    halves = parts[4].str.lower().to_numpy()
    hours = np.where(parts[4].notna(), hours % 12, hours) + 12.0 * (halves == "p")
    return 3600 * hours + 60 * minutes + seconds + fractions


SHARE_OF_CELLS_OF_OTHER_TOPICS = 0.25
"""Share of empty cells above which rows belong to several topics with instants of their own. Two topics of equal
rates leave half of the cells empty."""


def _same_ends(path: Path, form: TextLayout, columns: list[Channel], frame: Any) -> list[Channel]:
    """Return the columns without the empty cells below their last value.

    Raises LogError if one of the last two rows of the file ends before a column that the others have. Columns with
    times of their own may have different lengths, and so may topics that have cells of their own rows only.
    """
    out, sparse = [], False
    for column in columns:
        last = int(np.flatnonzero(~np.isnan(column.values))[-1]) + 1
        sparse = sparse or bool(np.isnan(column.values[:last]).mean() > SHARE_OF_CELLS_OF_OTHER_TOPICS)
        out.append(replace(column, values=column.values[:last]))
    if (
        not sparse
        and len({len(column.values) for column in out}) > 1
        and sum(role_of(c.name) == ("time", "time") for c in out) < 2
    ):
        shortest = min(out, key=lambda column: len(column.values))
        missing = len(frame) - len(shortest.values)
        if missing <= 2 and missing < 0.01 * len(frame):
            line = form.first + 1 + int(frame.index[len(shortest.values)])
            actual = f"a row in line {line} that ends before {shortest.name}"
            raise LogError("log", actual, f"{form.columns} cells in every row", "", str(path))
    return out


def with_times(columns: list[Channel], interval: float | None = None) -> tuple[Channel, ...]:
    """Give each column the instants of the nearest time column to its left with equal length.

    If there is none to the left, the file's only time column is used, which may be longer. A time column has a name of
    time and a unit of time. If no column has instants, samples are an `interval` [s] apart, which the file may state.
    """
    clocks = [(i, c) for i, c in enumerate(columns) if (role_of(c.name, c.unit) or ("",))[0] == "time"]
    clocks = [(i, c, unit_factor(c.unit, "s")) for i, c in clocks if c.unit]
    out = []
    for i, column in enumerate(columns):
        size = len(column.values)
        ended = len(clocks) == 1 and size < len(clocks[0][1].values)
        fitting = [clock for clock in clocks if clock[2] is not None and (ended or len(clock[1].values) == size)]
        left = [clock for clock in fitting if clock[0] < i] or (fitting if len(fitting) == 1 else [])
        is_clock = any(i == clock[0] for clock in clocks)
        if left and not is_clock:
            _, clock, seconds = left[-1]
            out.append(replace(column, time=clock.values[:size] * (seconds or 1.0)))
        else:
            out.append(column)
    if interval is not None and all(column.time is None for column in out):
        out = [replace(column, time=interval * np.arange(column.values.size)) for column in out]
    return tuple(out)
