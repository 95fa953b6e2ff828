"""Define the result of a reader: channels, each with its own time, and single numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from friso.errors import one_line


@dataclass(frozen=True)
class Channel:
    """A channel of a file: its values, (n,), as stored, and its unit ("" for none).

    `time` has the instants in seconds, shape (n,), or None if the file has no time; `source` is the place in the file
    ("column 3", "exp1.Y(2)"). Texts are one line each, escaped, because messages and tables show them.
    """

    name: str
    unit: str
    values: np.ndarray
    time: np.ndarray | None
    source: str

    def __post_init__(self) -> None:
        """Escape the texts of the channel."""
        for name in ("name", "unit", "source"):
            object.__setattr__(self, name, one_line(getattr(self, name)))


@dataclass(frozen=True)
class ChannelTable:
    """The channels of a file, under unique names (`unique`).

    `scalars` are single numbers of the file by name, and `read` has lines on how the file was read (format, delimiter,
    decimal sign, rows left out and why). `interval` is the sampling interval [s] that the file states above its
    columns, or None.
    """

    channels: tuple[Channel, ...]
    scalars: Mapping[str, float] = field(default_factory=dict)
    read: tuple[str, ...] = ()
    interval: float | None = None

    def __post_init__(self) -> None:
        """Make the names unique, and escape the texts."""
        names = unique([channel.name for channel in self.channels])
        channels = tuple(replace(c, name=name) for c, name in zip(self.channels, names, strict=True))
        object.__setattr__(self, "channels", channels)
        object.__setattr__(self, "scalars", {one_line(name): value for name, value in self.scalars.items()})
        object.__setattr__(self, "read", tuple(map(one_line, self.read)))


def unique(names: Sequence[str]) -> list[str]:
    """Return names with numbers appended to repeated ones; empty names stay."""
    taken, counts, out = {*names}, Counter[str](), []
    for name in names:
        counts[name] += 1
        numbered = name
        if counts[name] > 1 and name:
            while (numbered := f"{name} #{counts[name]}") in taken:
                counts[name] += 1
            taken.add(numbered)
        out.append(numbered)
    return out
