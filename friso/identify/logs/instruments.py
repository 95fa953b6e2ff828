"""Binary and text formats of measuring instruments, through libraries that are installed on demand: TDMS, LVM."""

from __future__ import annotations

import logging
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from friso.errors import LogError
from friso.identify.logs.channel import Channel, Table
from friso.identify.logs.text import unique
from friso.identify.logs.units import split_heading


def library(module: str, extra: str, path: Path) -> Any:
    """An optional library. Raises LogError that says how to install it."""
    try:
        return import_module(module)
    except ImportError:
        given = f"a {extra.upper()} file, and the library {module} is not installed"
        raise LogError("log", given, "the library", f'pip install "friso[{extra}]"', str(path)) from None


def read_tdms(path: Path) -> Table:
    """National Instruments TDMS. Raises LogError."""
    nptdms = library("nptdms", "tdms", path)
    channels, notes = [], []
    heard, logger = _Heard(), logging.getLogger("nptdms")
    handlers, logger.handlers = logger.handlers, list[logging.Handler]([heard])
    try:
        for group in nptdms.TdmsFile.read(path).groups():
            for item in group.channels():
                values = np.asarray(item[:])
                if values.dtype.kind not in "buif":
                    notes.append(f"left out: {group.name}/{item.name}, no numbers")
                    continue
                step = item.properties.get("wf_increment", 0)
                start = item.properties.get("wf_start_offset", 0.0)
                time = start + step * np.arange(values.size) if step > 0 else None
                name, unit = split_heading(item.name)
                told = item.properties.get("unit_string") or item.properties.get("NI_UnitDescription") or unit
                channels.append(Channel(name, str(told), values.astype(float), time, f"{group.name}/{item.name}"))
    except Exception as error:  # npTDMS lets through whatever a broken file makes it stumble over
        raise _broken("TDMS", error, path) from None
    finally:
        logger.handlers = handlers
    return _table("TDMS", channels, notes + heard.lines, path)


class _Heard(logging.Handler):
    """What a library logs, kept as lines: a file that ends early is read as far as it goes, and that must be told."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a line."""
        self.lines.append(record.getMessage()[:120])


def read_lvm(path: Path) -> Table:
    """LabVIEW measurement text. Raises LogError."""
    lvm_read = library("lvm_read", "lvm", path)
    channels = []
    try:
        content = lvm_read.read(str(path), read_from_pickle=False, dump_file=False)
        for k in range(content["Segments"]):
            segment = content[k]
            channels += _lvm_segment(segment, content, f"segment {k + 1}")
    except Exception as error:  # lvm_read lets through whatever a broken file makes it stumble over
        raise _broken("LVM", error, path) from None
    return _table("LVM", channels, [], path)


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


def _broken(kind: str, error: Exception, path: Path) -> LogError:
    return LogError("log", f"a {kind} file that cannot be read ({error})", f"a complete {kind} file", "", str(path))


def _table(kind: str, channels: list[Channel], notes: list[str], path: Path) -> Table:
    """The channels under names of their own. Raises LogError for none."""
    filled = [channel for channel in channels if channel.values.size]
    if not filled:
        raise LogError("log", f"a {kind} file without numbers", "a file with channels", "", str(path))
    names = unique([channel.name for channel in filled])
    renamed = tuple(Channel(name, c.unit, c.values, c.time, c.source) for name, c in zip(names, filled, strict=True))
    return Table(renamed, {}, (f"format: {kind}", f"{len(renamed)} channels", *notes))
