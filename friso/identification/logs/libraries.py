"""Shared parts of the readers that need optional libraries."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from friso.errors import LogError
from friso.identification.logs.channel import Channel, ChannelTable
from friso.identification.logs.confined import content
from friso.platform.extras import install, is_installed


def content_by(library: str, kind: str, path: Path) -> dict[str, Any]:
    """Read the contents of a log in the format `kind`, which needs an optional library.

    Raises LogError, which says how to install a missing library.
    """
    if not is_installed(library):
        actual = f"a {kind} file, and the library {library} is not installed"
        raise LogError("log", actual, "the library", install(kind.lower()), str(path))
    return content(kind, path)


def cut_short(channels: Iterable[Channel], stated: Iterable[float | None]) -> list[str]:
    """Write a line for each channel that has fewer samples than the (truncated) file states.

    `stated` has the stated number for each channel, or None. Returns [] if no channel is shorter.
    """
    return [
        f"{channel.name} ends early: {channel.values.size} of {count:.15g} samples"
        for channel, count in zip(channels, stated, strict=True)
        if count is not None and channel.values.size < count < math.inf
    ]


def filled_table(kind: str, channels: list[Channel], notes: list[str], path: Path) -> ChannelTable:
    """Make a table of the channels with samples.

    Raises LogError if no channel has samples.
    """
    filled = tuple(channel for channel in channels if channel.values.size)
    if not filled:
        raise LogError("log", f"a {kind} file without numbers", "a file with channels", "", str(path))
    return ChannelTable(filled, {}, (f"format: {kind}", f"{len(filled)} channels", *notes))
