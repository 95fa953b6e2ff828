"""Formats that are read by libraries installed on demand: what their readers share."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from friso.errors import LogError
from friso.identify.logs.channel import Channel, ChannelTable
from friso.identify.logs.text import unique


def library(module: str, extra: str, path: Path) -> Any:
    """An optional library. Raises LogError that says how to install it."""
    try:
        return import_module(module)
    except ImportError:
        given = f"a {extra.upper()} file, and the library {module} is not installed"
        raise LogError("log", given, "the library", f'pip install "friso[{extra}]"', str(path)) from None


def broken(kind: str, error: Exception, path: Path) -> LogError:
    """The error for a file of a kind at which its library stumbles."""
    return LogError("log", f"a {kind} file that cannot be read ({error})", f"a complete {kind} file", "", str(path))


def named_table(kind: str, channels: list[Channel], notes: list[str], path: Path) -> ChannelTable:
    """The channels under names of their own. Raises LogError for none."""
    filled = [channel for channel in channels if channel.values.size]
    if not filled:
        raise LogError("log", f"a {kind} file without numbers", "a file with channels", "", str(path))
    names = unique([channel.name for channel in filled])
    renamed = tuple(Channel(name, c.unit, c.values, c.time, c.source) for name, c in zip(names, filled, strict=True))
    return ChannelTable(renamed, {}, (f"format: {kind}", f"{len(renamed)} channels", *notes))
