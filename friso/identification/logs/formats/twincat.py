"""TwinCAT Scope CSV export: rows of keys, then a time column and value columns per group of channels.

A row of the file is not one instant: groups with different sample times stand side by side and end at different rows.
Layout after the exports of Scope 3.4 in github CagtayFabry/pytcs (tests/data) and Beckhoff's page "Scope Settings"
(infosys, tcscope2): a key ("Name", "Unit", ...) is repeated at the head of each time column, or of each channel.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from friso.errors import LogError
from friso.identification.logs.log import Channel, ChannelTable
from friso.identification.logs.read import LogFormat
from friso.identification.logs.sniff import (
    TextLayout,
    as_floats,
    csv_cells,
    decoded_head,
    is_number,
    likely_format,
    number_texts,
)
from friso.identification.logs.text import read_cells
from friso.identification.logs.units import spelled
from friso.quantities import quoted

LEAST_FILETIME = 1e15
"""Value above which a time is a FILETIME, which counts 100 ns since 1601 (1.3e17 in 2022). As milliseconds the value
would be 30 000 years. A double resolves a FILETIME to 16 steps, 1.6 us, which the fit of an even time base averages
out."""
CERTAIN = ("\t", ";", ",")
DELIMITERS = (*CERTAIN, ":", " ")
"""Delimiters that Scope may write. With one of the last two, a first line "Name x" may come from any text."""
_MARKS = ("Starttime of export", "StartRecord", "SampleTime[ms]", "SymbolName", "Data-Type")


def is_twincat(lines: list[str]) -> bool:
    """Tell whether a file with these first lines is a Scope export."""
    first = lines[0] if lines else ""
    if first[:4] != "Name" or not (delimiter := first[4:5]) or delimiter not in DELIMITERS:
        return False
    head = [line for line in lines[:60] if line.strip(delimiter + " ")]
    if any(line.startswith(_MARKS) for line in head):
        return True
    named = [i for i, line in enumerate(head) if line.startswith(first[:5])]
    below = [head[i + 1] for i in named if i + 1 < len(head)]  # a row of numbers where no other row has keys
    return delimiter in CERTAIN and any(_is_data(_cells(line, delimiter)) for line in below)


def read_twincat(path: Path) -> ChannelTable:
    """Read the channels of a Scope export with their own times.

    Raises LogError for an export without data, or with rows that lack cells.
    """
    encoding, lines = decoded_head(path)
    delimiter = lines[0][4]
    rows = [_cells(line, delimiter) for line in lines]
    first = next((i for i, cells in enumerate(rows) if i and _is_data(cells)), None)
    names_at = max((i for i, cells in enumerate(rows[:first]) if cells and cells[0] == "Name"), default=None)
    if first is None or names_at is None:
        raise LogError("log", "a TwinCAT Scope export without rows of numbers", "an export with data", "", str(path))
    table = {cells[0]: cells for cells in rows[names_at:first] if cells and cells[0]}
    columns = max(len(table["Name"]), max(len(cells) for cells in rows[first : first + 50]))
    numbers = likely_format(cell for cells in rows[first:] for cell in cells)
    form, frame = read_cells(path, TextLayout(encoding, delimiter, numbers, first, columns, exact=True))
    frame = _without_end(frame)
    channels, notes = _channels(path, form, table, frame)
    return ChannelTable(channels, {}, (f"format: TwinCAT Scope CSV, {form.in_words}", f"{len(frame)} rows", *notes))


def _cells(line: str, delimiter: str) -> list[str]:
    """Split a line into cells; trailing separators are the empty cells of groups that have ended."""
    return [cell.strip() for cell in csv_cells(line, delimiter)]


def _is_data(cells: list[str]) -> bool:
    """Tell whether all cells of a row that are filled are numbers."""
    filled = [cell for cell in cells if cell]
    return bool(filled) and all(is_number(cell) for cell in filled)


def _without_end(frame: Any) -> Any:
    """Return a table without a last row "EOF" and empty rows below."""
    marked = frame.iloc[:, 0].astype(str).str.strip().eq("EOF").to_numpy()
    return frame[~marked] if marked.any() else frame


def _channels(
    path: Path, form: TextLayout, table: dict[str, list[str]], frame: Any
) -> tuple[tuple[Channel, ...], list[str]]:
    """Return the channels of all groups, and lines on how they were read.

    Raises LogError for rows that lack cells in the middle.
    """
    labels, notes, out = table["Name"], [], []
    clocks = [i for i, cell in enumerate(labels) if cell == "Name"]
    times = [_floats(path, form, frame, start) for start in clocks]
    times = [time[: int(np.flatnonzero(~np.isnan(time)).max(initial=-1)) + 1] for time in times]
    _no_shifted_rows(path, form, frame, times)
    for start, end, time in zip(clocks, [*clocks[1:], len(labels)], times, strict=True):
        if not time.size:
            notes.append(f"left out: {', '.join(labels[start + 1 : end])}, without samples")
            continue
        seconds = (time - time[0]) * 1e-7 if time[0] > LEAST_FILETIME else time * 1e-3
        for column in range(start + 1, end):
            if not labels[column]:
                continue  # files of old versions end each row with a delimiter
            values = _floats(path, form, frame, column)[: len(time)]
            info = {key: cells[column] for key, cells in table.items() if column < len(cells)}
            out.append(Channel(labels[column], spelled(info.get("Unit", "")), values, seconds, _source(column, info)))
        notes.append(f"group {labels[start + 1 : end]}: {len(time)} samples, {seconds[0]:g} s to {seconds[-1]:g} s")
    if not out:
        raise LogError("log", "no channel with samples", "an export with data", "", str(path))
    return tuple(out), notes + _scaled(table)


def _no_shifted_rows(path: Path, form: TextLayout, frame: Any, times: list[np.ndarray]) -> None:
    """Check that no row lacks cells in the middle.

    Cells of a group that has ended may be missing together with their delimiters. The cells behind them have then moved
    to the left, and the clock of another group jumps. Raises LogError for such a row.
    """
    ends = np.array(sorted({time.size for time in times} - {0}))
    for time in times:
        rows = ends[(ends > 2) & (ends < time.size)]
        if not rows.size:
            continue
        every, steps = np.diff(time), time[rows] - time[rows - 1]
        usual = np.median(every[np.isfinite(every)]) if np.isfinite(every).any() else np.nan
        wrong = rows[~(abs(steps - usual) < 0.5 * usual)]
        if wrong.size:
            row = int(wrong[0])
            line = form.first + 1 + int(frame.index[row])
            jump = f"from {time[row - 1]:.12g} to {time[row]:.12g}"
            actual = f"fewer cells in line {line}, and the times of a group jump there {jump}"
            expected = "empty cells, with their delimiters, where a group has ended"
            raise LogError("log", actual, expected, "", str(path))


def _source(column: int, info: dict[str, str]) -> str:
    """Describe a channel's place in the file: its column, symbol and data type."""
    texts = [info[key] for key in ("SymbolName", "Data-Type") if info.get(key)]
    return ", ".join([f"column {column + 1}", *texts])


def _scaled(table: dict[str, list[str]]) -> list[str]:
    """Write a line on channels with an offset or a scale, already applied to exported values."""
    scaled = []
    for i, name in enumerate(table["Name"]):
        offset, scale = (table.get(key, [])[i : i + 1] for key in ("Offset", "ScaleFactor"))
        if name and name != "Name" and (offset not in ([], ["0"], [""]) or scale not in ([], ["1"], [""])):
            scaled.append(f"{name} (Offset {''.join(offset)}, ScaleFactor {''.join(scale)})")
    return [f"taken as already applied to the values: {', '.join(scaled)}"] if scaled else []


def _floats(path: Path, form: TextLayout, frame: Any, column: int) -> np.ndarray:
    """Return a column as floats.

    Raises LogError with the line of a text among the numbers.
    """
    cells = frame.iloc[:, column]
    if pd.api.types.is_numeric_dtype(cells.dtype):
        return cells.to_numpy(dtype=float)
    texts = number_texts(cells)
    values = as_floats(texts, form.numbers)
    wrong = np.flatnonzero(np.isnan(values) & (texts != "").to_numpy())
    if wrong.size:
        line = form.first + 1 + int(cells.index[wrong[0]])
        actual = f"{quoted(str(cells.iloc[wrong[0]]))} in line {line}, column {column + 1}"
        raise LogError("log", actual, "numbers in every row", "", str(path))
    return values


FORMAT = LogFormat("TwinCAT Scope CSV", lambda head: is_twincat(head.lines), read_twincat, rank=1)
