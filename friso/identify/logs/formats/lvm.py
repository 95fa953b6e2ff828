"""LVM, the measurement text of LabVIEW."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from friso.identify.logs.channel import Channel, ChannelTable
from friso.identify.logs.format import FileHead, LogFormat
from friso.identify.logs.libraries import broken, library, named_table
from friso.identify.logs.units import split_heading


def read_lvm(path: Path) -> ChannelTable:
    """LabVIEW measurement text. Raises LogError."""
    lvm_read = library("lvm_read", "lvm", path)
    channels = []
    try:
        content = lvm_read.read(str(path), read_from_pickle=False, dump_file=False)
        for k in range(content["Segments"]):
            segment = content[k]
            channels += _lvm_segment(segment, content, f"segment {k + 1}")
    except Exception as error:  # lvm_read lets through whatever a broken file makes it stumble over
        raise broken("LVM", error, path) from None
    return named_table("LVM", channels, [], path)


def _lvm_segment(segment: dict[str, Any], content: dict[str, Any], source: str) -> list[Channel]:
    """The channels of a segment: values over an X column in seconds (the first, or one per channel)."""
    names, data = segment["Channel names"], np.asarray(segment["data"], dtype=float)
    each_own, none = content.get("X_Columns") == "Multi", content.get("X_Columns") == "No"
    units = segment.get("Y_Unit_Label", [])
    out, time, k = [], None, 0
    for i, name in enumerate(names):
        if name == "Comment" or i >= data.shape[1]:
            continue
        if not none and (i == 0 or (each_own and name == "X_Value")):
            time = data[:, i]
            continue
        start, step = (segment.get(key, [np.nan])[k : k + 1] for key in ("X0", "Delta_X"))
        clock = time if time is not None else _even(start, step, len(data))
        heading, unit = split_heading(name)
        told = units[k] if k < len(units) else ""
        there = ~np.isnan(data[:, i])
        out.append(Channel(heading, told or unit, data[there, i], None if clock is None else clock[there], source))
        k += 1
    return out


def _even(start: list[float], step: list[float], n: int) -> np.ndarray | None:
    return start[0] + step[0] * np.arange(n) if start and step and step[0] > 0 else None


def _recognise(head: FileHead) -> bool:
    return head.start.lstrip(b"\xef\xbb\xbf").startswith(b"LabVIEW Measurement")


FORMAT = LogFormat("LVM", _recognise, read_lvm)
