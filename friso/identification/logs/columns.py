"""Make channels of the columns of a file that has names, and perhaps units, in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from friso.identification.logs.channel import Channel, ChannelTable
from friso.identification.logs.confined import filled_table
from friso.identification.logs.number_format import NumberFormat
from friso.identification.logs.text import column_values, with_times
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
