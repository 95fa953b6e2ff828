"""What a reader finds in a file: channels, each with its own time, and single numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from friso.escapes import one_line


@dataclass(frozen=True)
class Channel:
    """A channel of a file: its values, (n,), as they stand there, and its unit ("" for none).

    `time` holds the instants in seconds, shape (n,), or None if the file has no time; `source` says where in the file
    the channel stands ("column 3", "exp1.Y(2)"). Texts are one line each, escaped: messages and tables name them.
    """

    name: str
    unit: str
    values: np.ndarray
    time: np.ndarray | None
    source: str

    def __post_init__(self) -> None:
        """Escape the texts."""
        for name in ("name", "unit", "source"):
            object.__setattr__(self, name, one_line(getattr(self, name)))


@dataclass(frozen=True)
class ChannelTable:
    """The channels of a file, under names of their own (`unique`).

    `scalars` are single numbers in it by name, and `read` says what was read, a line each (format, delimiter, decimal
    sign, rows left out and why).
    """

    channels: tuple[Channel, ...]
    scalars: Mapping[str, float] = field(default_factory=dict)
    read: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Make the names unique, and escape the texts."""
        names = unique([channel.name for channel in self.channels])
        channels = tuple(replace(c, name=name) for c, name in zip(self.channels, names, strict=True))
        object.__setattr__(self, "channels", channels)
        object.__setattr__(self, "scalars", {one_line(name): value for name, value in self.scalars.items()})
        object.__setattr__(self, "read", tuple(map(one_line, self.read)))


def unique(names: Sequence[str]) -> list[str]:
    """Return names, with a number behind those that are taken; empty ones stay."""
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
