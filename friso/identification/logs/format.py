"""Define what a log format declares, and the registry of formats."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from friso.errors import LogError
from friso.identification.logs.channel import ChannelTable
from friso.identification.logs.measured_response import MeasuredResponse
from friso.identification.logs.sniff import decoded_head
from friso.registry import Registry


@dataclass(frozen=True)
class FileHead:
    """Data from which the format of a file is recognised: its path, and its first 520 bytes."""

    path: Path
    start: bytes

    @cached_property
    def lines(self) -> list[str]:
        """Return the first lines of the file; [] for one that is no text."""
        try:
            return decoded_head(self.path)[1]
        except LogError:
            return []


@dataclass(frozen=True)
class LogFormat:
    """A format of logs: its `title`, how it is recognised, and the reader of its channels.

    Formats are tried by rank: 0 for those recognised by their first bytes, 1 by their first lines, 2 for any text.
    `units` tells whether files can contain units; `times` whether channels come with their instants, so that no time
    column is needed. `of_lines` tells whether any lines of a file can be read without the others, below its first ones.
    `holds_response` tells whether a file contains a frequency response instead of signals over time,
    which `read_response` reads. Readers raise LogError.
    """

    title: str
    recognise: Callable[[FileHead], bool]
    read: Callable[[Path], ChannelTable]
    rank: int = 0
    units: bool = True
    times: bool = True
    of_lines: bool = False
    holds_response: Callable[[Path], bool] = lambda path: False
    read_response: Callable[[Path], MeasuredResponse] | None = None


FORMATS: Registry[LogFormat] = Registry("friso.identification.logs.formats", "FORMAT")
"""All log formats; every module of `friso/identification/logs/formats/` declares one."""
