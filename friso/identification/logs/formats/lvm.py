"""LVM, the measurement text of LabVIEW."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from friso.identification.logs.channel import Channel, ChannelTable
from friso.identification.logs.confined import content_by, cut_short, filled_table
from friso.identification.logs.format import FileHead, LogFormat
from friso.identification.logs.units import split_heading


def read_lvm(path: Path) -> ChannelTable:
    """Read a LabVIEW measurement text.

    Raises LogError if the library lvm_read is missing or cannot read the file.
    """
    file = content_by("lvm_read", "LVM", path)
    segments = range(int(file["Segments"]))
    read = [item for k in segments for item in _lvm_segment(file[str(k)], file, f"segment {k + 1}")]
    channels = [channel for channel, _ in read]
    return filled_table("LVM", channels, cut_short(channels, [stated for _, stated in read]), path)


def _lvm_segment(segment: dict[str, Any], content: dict[str, Any], source: str) -> list[tuple[Channel, Any]]:
    """Return the channels of a segment, each with the number of samples that its header states.

    The number may be None. Values stand over an X column in seconds (the first, or one per channel). Header values
    stand above the column of their channel; the first column holds the names of the header's keys.
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
        out.append((channel, _above(segment, "Samples", i + above)))
    return out


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


FORMAT = LogFormat("LVM", _recognise, read_lvm)
