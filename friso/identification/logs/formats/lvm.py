"""LVM, the measurement text of LabVIEW."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from friso.identification.logs.channel import Channel, ChannelTable
from friso.identification.logs.confined import content_by, cut_short, filled_table
from friso.identification.logs.format import FileHead, LogFormat
from friso.identification.logs.settings import settings
from friso.identification.logs.units import split_heading


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


def _contradictions(channel: Channel, stated: float | None, step: float | None) -> list[str]:
    """Write where the columns contradict the number of samples and the time step [s] that the header states."""
    notes, count = [], channel.values.size
    if stated is not None and count > stated:
        notes.append(
            f"contradiction: {channel.name} has {count} samples, and its header says {stated:.15g}: all are read"
        )
    own = float(np.median(np.diff(channel.time))) if channel.time is not None and count > 1 else None
    if step and own and abs(step - own) > settings.share_of_a_stated_step * abs(own):
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


FORMAT = LogFormat("LVM", _recognise, read_lvm)
