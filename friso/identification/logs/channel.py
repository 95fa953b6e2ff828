"""What a reader finds in a file: channels, each with its own time, and single numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Channel:
    """Values of shape (n,) as they stand in the file, with the unit that it states ("" for none).

    `time` holds the instants in seconds, shape (n,), or None where the file has no time; `source` says where in the
    file the channel stands ("column 3", "exp1.Y(2)").
    """

    name: str
    unit: str
    values: np.ndarray
    time: np.ndarray | None
    source: str


@dataclass(frozen=True)
class ChannelTable:
    """The channels of a file, the single numbers in it by name, and what was read, a line each (format, delimiter,
    decimal sign, rows left out and why)."""

    channels: tuple[Channel, ...]
    scalars: Mapping[str, float] = field(default_factory=dict)
    read: tuple[str, ...] = ()
