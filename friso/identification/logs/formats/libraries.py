"""Formats of logs that libraries read, and texts."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from friso.identification.logs.log import Channel, ChannelTable
from friso.identification.logs.measured_response import is_response, response_of
from friso.identification.logs.read import (
    FileHead,
    LogFormat,
    UnpackedFile,
    content,
    content_by,
    cut_short,
    filled_table,
    is_of_arrays,
    is_workbook,
    members,
)
from friso.identification.logs.sniff import NumberFormat, layout
from friso.identification.logs.text import column_values, read_text, with_times
from friso.identification.logs.units import split_heading, unit_since_1970


def table_of_columns(kind: str, content: Mapping[str, Any], path: Path) -> ChannelTable:
    """Make a table of the "columns" of a file of some kind, arrays or lists of texts by name, and of its "scalars".

    Raises LogError for a file without numbers, and for a text among the numbers of a column.
    """
    channels, notes = [], []
    columns: dict[str, Any] = content["columns"]
    for heading, values in columns.items():
        name, unit = split_heading(heading)
        read = (values, "")
        if isinstance(values, list):
            read = column_values(pd.Series(values), NumberFormat("."), 0, name, path)
        if read is None or not np.isfinite(read[0]).any():
            notes.append(f"left out: {heading}, no numbers")
            continue
        numbers, of_time = read
        channels.append(Channel(name, unit or of_time or unit_since_1970(name, numbers), numbers, None, heading))
    return replace(filled_table(kind, [*with_times(channels)], notes, path), scalars=content["scalars"])


TEXT = LogFormat(
    "CSV, TXT, TSV",
    lambda head: bool(head.lines),
    read_text,
    rank=2,
    times=False,
    of_lines=True,
    holds_response=lambda path: is_response(layout(path).names),
    read_response=lambda path: response_of(read_text(path), path),
)


_BEGINS = re.compile(rb"(?:\xef\xbb\xbf)?\s*(?:\{\s*\"|\[\s*[\[{])")
"""Beginning of an object with a name, or of a list of objects or lists."""

JSON_COLUMNS = LogFormat(
    "JSON",
    lambda head: _BEGINS.match(head.start) is not None,
    lambda path: table_of_columns("JSON", content("JSON", path), path),
    times=False,
)


NUMPY_ARRAYS = LogFormat(
    "NPY, NPZ",
    lambda head: head.start.startswith(b"\x93NUMPY") or is_of_arrays(members(head.path)),
    lambda path: table_of_columns("NumPy", content("NumPy", path), path),
    times=False,
)


PARQUET = LogFormat(
    "Parquet, Feather",
    lambda head: head.start.startswith((b"PAR1", b"ARROW1", b"FEA1")),
    lambda path: table_of_columns("Parquet", content_by("pyarrow", "Parquet", path), path),
    times=False,
)


_OLD = b"\xd0\xcf\x11\xe0"
"""First bytes of a workbook of an old Excel."""


def read_sheet(path: Path) -> ChannelTable:
    """Read the table on the largest sheet of a workbook, as the text of its cells is read.

    Raises LogError if the library python-calamine is missing, and for a sheet without a table.
    """
    content = content_by("python_calamine", "Workbook", path)
    text = UnpackedFile(path.stem)
    text.path.write_text(content["text"], encoding="utf-8")
    table = read_text(text.path)
    others = content["others"]
    left = [f"left out: the other sheets, {', '.join(others)}"] if others else []
    return replace(table, read=(f"format: workbook, sheet {content['sheet']}", *table.read[1:], *left))


SPREADSHEET = LogFormat(
    "XLSX, ODS, XLS",
    lambda head: head.start.startswith(_OLD) or is_workbook(members(head.path)),
    read_sheet,
    times=False,
)


def read_tdms(path: Path) -> ChannelTable:
    """Read the channels of a TDMS file of National Instruments.

    Raises LogError if the library nptdms is missing or cannot read the file.
    """
    file = content_by("nptdms", "TDMS", path)
    channels, notes = [], []
    for item in file["channels"]:
        values, place = item["values"], f"{item['group']}/{item['name']}"
        if values is None:
            notes.append(f"left out: {place}, no numbers")
            continue
        time = item["start"] + item["step"] * np.arange(values.size) if item["step"] > 0 else None
        name, unit = split_heading(item["name"])
        channels.append(Channel(name, item["unit"] or unit, values.astype(float), time, place))
    return filled_table("TDMS", channels, notes + file["heard"], path)


TDMS = LogFormat("TDMS", lambda head: head.start.startswith(b"TDSm"), read_tdms)


def read_lvm(path: Path) -> ChannelTable:
    """Read a LabVIEW measurement text.

    Raises LogError if the library lvm_read is missing or cannot read the file.
    """
    file = content_by("lvm_read", "LVM", path)
    segments = range(int(file["Segments"]))
    read = [item for k in segments for item in _lvm_segment(file[str(k)], file, f"segment {k + 1}")]
    channels, stated = [channel for channel, _, _ in read], [count for _, count, _ in read]
    notes = [*cut_short(channels, stated), *dict.fromkeys(line for _, _, lines in read for line in lines)]
    return filled_table("LVM", channels, notes, path)


def _lvm_segment(segment: dict[str, Any], content: dict[str, Any], source: str) -> list[tuple[Channel, Any, list[str]]]:
    """Return the channels of a segment, each with the number of samples that its header states, and contradictions.

    The number may be None. Contradictions between header and columns are told in words. Values stand over an X column
    in seconds (the first, or one per channel). Header values stand above the column of their channel; the first column
    holds the names of the header's keys.
    """
    names, data = segment["Channel names"], np.atleast_2d(np.asarray(segment["data"], dtype=float))
    each_own, none = content.get("X_Columns") == "Multi", content.get("X_Columns") == "No"
    above = 0 if none else -1  # the reader leaves out the empty first column of files without X values
    out, time = [], None
    for i, name in enumerate(names):
        if name == "Comment" or i >= data.shape[1]:
            continue
        if not none and (i == 0 or (each_own and name == "X_Value")):
            time = data[:, i]
            continue
        start, step, unit_above = (_above(segment, key, i + above) for key in ("X0", "Delta_X", "Y_Unit_Label"))
        clock = time if time is not None else _even(start, step, len(data))
        heading, unit = split_heading(name)
        present = ~np.isnan(data[:, i])
        times = None if clock is None else clock[present]
        channel = Channel(heading, unit_above or unit, data[present, i], times, source)
        stated = _above(segment, "Samples", i + above)
        out.append((channel, stated, _contradictions(channel, stated, step)))
    return out


SHARE_OF_A_STATED_STEP = 0.01
"""Largest difference of a header's time step from that of its time column, relative to it."""


def _contradictions(channel: Channel, stated: float | None, step: float | None) -> list[str]:
    """Write where the columns contradict the number of samples and the time step [s] that the header states."""
    notes, count = [], channel.values.size
    if stated is not None and count > stated:
        notes.append(
            f"contradiction: {channel.name} has {count} samples, and its header says {stated:.15g}: all are read"
        )
    own = float(np.median(np.diff(channel.time))) if channel.time is not None and count > 1 else None
    if step and own and abs(step - own) > SHARE_OF_A_STATED_STEP * abs(own):
        notes.append(f"contradiction: Delta_X is {step:.6g} s, the time column rises by {own:.6g} s: the column counts")
    return notes


def _above(segment: dict[str, Any], key: str, column: int) -> Any:
    """Return the value of a header's key above a column; None if the header lacks the key."""
    row = segment.get(key, [])
    return row[column] if 0 <= column < len(row) else None


def _even(start: float | None, step: float | None, n: int) -> np.ndarray | None:
    """Return `n` instants [s] from `start` on; None without a start or a positive `step`."""
    return start + step * np.arange(n) if start is not None and step is not None and step > 0 else None


def _recognise(head: FileHead) -> bool:
    """Tell whether a file is a LabVIEW measurement text, by its first bytes."""
    return head.start.lstrip(b"\xef\xbb\xbf").startswith(b"LabVIEW Measurement")


LVM = LogFormat("LVM", _recognise, read_lvm)
