"""TDMS of National Instruments."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from friso.identification.logs.channel import Channel, ChannelTable
from friso.identification.logs.confined import content_by, filled_table
from friso.identification.logs.format import LogFormat
from friso.identification.logs.units import split_heading


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


FORMAT = LogFormat("TDMS", lambda head: head.start.startswith(b"TDSm"), read_tdms)
