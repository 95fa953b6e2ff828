"""TDMS of National Instruments."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from friso.identify.logs.channel import Channel, ChannelTable
from friso.identify.logs.format import LogFormat
from friso.identify.logs.libraries import broken, library, named_table
from friso.identify.logs.units import split_heading


def read_tdms(path: Path) -> ChannelTable:
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
        raise broken("TDMS", error, path) from None
    finally:
        logger.handlers = handlers
    return named_table("TDMS", channels, notes + heard.lines, path)


class _Heard(logging.Handler):
    """What a library logs, kept as lines: a file that ends early is read as far as it goes, and that must be told."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a line."""
        self.lines.append(record.getMessage()[:120])


FORMAT = LogFormat("TDMS", lambda head: head.start.startswith(b"TDSm"), read_tdms)
