"""Draw the channels of log files over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from friso.identification.contents import ChannelContent, LogContent
from friso.identification.logs.settings import settings
from friso.questions.logs.words import title
from friso.shown.drawing.figure import BLUE, Axis, Figure, Panel, Series

MOST_CHANNELS = 12
"""Largest number of channels of a file that are drawn."""


def logs_figures(contents: Sequence[LogContent]) -> list[Figure]:
    """Draw a figure for each file with a channel beside time; channels with a role come first."""
    drawn = [[channel for channel in content.channels if channel.role != "time"] for content in contents]
    return [_figure(content, drawn[k], k + 1) for k, content in enumerate(contents) if drawn[k]]


def _figure(content: LogContent, drawn: Sequence[ChannelContent], number: int) -> Figure:
    """Draw channels of one file; `number` is that of the file, for the figure's name."""
    channels = sorted(drawn, key=lambda channel: not channel.role)
    left = (
        f" {MOST_CHANNELS} of {len(channels)} channels are drawn, those with a role first."
        if len(channels) > MOST_CHANNELS
        else ""
    )
    caption = f"As they stand in the file, in its own units.{left}"
    panels = tuple(_panel(channel) for channel in channels[:MOST_CHANNELS])
    return Figure(f"logs_{number}", title(content), caption, panels, columns=2 if len(panels) > 1 else 1)


def _panel(channel: ChannelContent) -> Panel:
    """Draw a channel over time, or over its samples."""
    time = channel.time
    timed = time is not None and time.size == channel.values.size and not np.isnan(_within_range(time)).all()
    x = _within_range(time) if timed and time is not None else np.arange(channel.values.size, dtype=float)
    values = _within_range(channel.values)
    role = channel.role.replace("_", " ")
    words = f"{channel.name}: {role}" if role and role != channel.name else channel.name
    if np.isnan(values[np.isfinite(channel.values)]).any():
        words += f" (values beyond {settings.largest_value:g} not drawn)"
    finite = values[np.isfinite(values)]
    level, limits = float(np.median(finite)) if finite.size else 0.0, None
    if finite.size and np.ptp(finite) <= 1e-12 * abs(level):
        reach = abs(level) or 1.0
        values, limits = np.where(np.isfinite(values), level, np.nan), (level - reach, level + reach)
    across = Axis("Time", "s", prefixed=False) if timed else Axis("Sample", "", prefixed=False)
    line = Series(x, values, "", BLUE, width=1.0)
    return Panel(words, across, Axis("", channel.unit, limits, prefixed=False), (line,))


def _within_range(values: np.ndarray) -> np.ndarray:
    """Return values, shape (n,), of which those too large for a picture are NaN.

    The limit is the setting `largest_value`. Values smaller than its inverse become 0.
    """
    sizes = np.abs(values)
    return np.where(sizes <= settings.largest_value, np.where(sizes < 1 / settings.largest_value, 0.0, values), np.nan)
