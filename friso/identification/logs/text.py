"""CSV, TSV and TXT with one table of numbers: any delimiter, decimal sign and encoding; lines before the table."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from friso.errors import LogError
from friso.identification.logs.cells import read_cells
from friso.identification.logs.channel import Channel, ChannelTable, unique
from friso.identification.logs.number_format import NumberFormat, as_floats, as_numbers, number_texts
from friso.identification.logs.preamble import preamble
from friso.identification.logs.roles import role_of
from friso.identification.logs.settings import settings
from friso.identification.logs.sniff import CLOCK, ISO, MINUTES, STAMP, TextLayout, layout, split_line
from friso.identification.logs.units import unit_factor, unit_since_1970
from friso.quantities import quoted


def read_text(path: Path) -> ChannelTable:
    """Read the table of a text file.

    Raises LogError, with the line, for ragged rows and for a text among the numbers.
    """
    form, frame = read_cells(path, layout(path))
    names = unique(list(form.names) or [f"column {i + 1}" for i in range(form.columns)])
    heading = preamble(form.above, names, form.delimiter, form.numbers.decimal)
    stated = form.units or [""] * len(names)
    units = [unit or heading.units.get(name, "") for unit, name in zip(stated, names, strict=True)]
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


def _same_ends(path: Path, form: TextLayout, columns: list[Channel], frame: Any) -> list[Channel]:
    """Return the columns without the empty cells below their last value.

    Raises LogError if one of the last two rows of the file ends before a column that the others have. Columns with
    times of their own may have different lengths, and so may topics that have cells of their own rows only.
    """
    out, sparse = [], False
    for column in columns:
        last = int(np.flatnonzero(~np.isnan(column.values))[-1]) + 1
        sparse = sparse or bool(np.isnan(column.values[:last]).mean() > settings.share_of_cells_of_other_topics)
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
