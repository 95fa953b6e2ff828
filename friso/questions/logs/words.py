"""What files of logs hold in words, figures and blocks."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from friso.identification.logs.signals import LARGEST_VALUE
from friso.identification.sources import ChannelContent, LogContent
from friso.platform.system import shell_word
from friso.shown.blocks import AnswerBlock
from friso.shown.documents import entries, plain_json
from friso.shown.drawing.figure import BLUE, GREEN, ORANGE, Axis, Figure, Panel, Series
from friso.shown.text import NOTHING, range_with_unit, with_unit

COLUMNS = ("Unit", "Role, and why", "Range", "Course", "Samples")
"""Columns of the table of channels."""


PLAIN_BELOW = 1e7
"""Numbers below this are written without an exponent."""


_BLOCKS = "▁▂▃▄▅▆▇█"


def file_sentences(content: LogContent) -> list[str]:
    """Say what a file is, and what is still open about it."""
    return [
        *(sentence for _, sentence in conclusions(content)),
        *(f"open: {line}" for line in open_questions(content)),
        *(f"note: {line}" for line in (*sampled_note(content), *content.lost, *content.warnings)),
    ]


def sampled_note(content: LogContent) -> tuple[str, ...]:
    """Return the line on which part of the file was looked at; nothing for all of it."""
    return (content.sampled,) if content.sampled else ()


def next_steps(contents: Sequence[LogContent], files: Sequence[Path]) -> list[str]:
    """Return the command that identifies a machine from each file that allows it."""
    return [command for content in contents if (command := next_command(content))]


def title(content: LogContent) -> str:
    """Write a file's name with its format in brackets."""
    return f"{content.path.name} ({content.title})"


def conclusions(content: LogContent) -> list[tuple[str, str]]:
    """Say what the file holds, and its kind or what is open; each sentence has a colour."""
    holds = f"{title(content)} holds {_holds(content)}"
    if content.kind:
        return [(GREEN, f"{holds}. friso identify takes it as {content.kind}: {content.reason}.")]
    things = f"{len(content.gaps)} things are" if len(content.gaps) > 1 else "one thing is"
    return [(ORANGE, f"{holds}; {things} open before friso identify can use it.")]


def open_questions(content: LogContent) -> list[str]:
    """Say what the user must state, each in a sentence with its option."""
    return [
        f"{gap.key}: {gap.expected}; given: {gap.actual}" + (f"; for example {gap.example}" if gap.example else "")
        for gap in content.gaps
    ]


def next_command(content: LogContent) -> str | None:
    """Return the command that identifies a machine from the file.

    It holds the options given and those still needed. Returns None if no option supplies what the file lacks.
    """
    scales = [f'--scale force="YOUR MOTOR CONSTANT N/{channel.unit}"' for channel in _currents(content)]
    scaled = any(option.startswith("--scale force") for option in content.options)
    examples = [gap.example for gap in content.gaps]
    shown: list[str] = [*content.options, *examples, *([] if scaled else scales)]
    options = dict.fromkeys(shown)
    if "" in options:
        return None
    return " ".join(["friso identify", shell_word(str(content.path)), *options])


def _currents(content: LogContent) -> list[ChannelContent]:
    """Return the channels taken for the force that are in amperes."""
    return [one for one in content.channels if one.role == "force" and re.fullmatch(r"[mk]?A", one.unit)]


def channel_rows(content: LogContent) -> list[tuple[str, list[str]]]:
    """Return the channels by name, with the texts of `COLUMNS`."""
    return [(channel.name, _cells(channel)) for channel in content.channels]


def _cells(channel: ChannelContent) -> list[str]:
    """Write a channel as a row of the table."""
    role = f"{channel.role.replace('_', ' ')}: {channel.reason}" if channel.role else channel.reason or NOTHING
    return [channel.unit or NOTHING, role, _range(channel), sparkline(channel.course()), _samples(channel)]


def _range(channel: ChannelContent) -> str:
    """Write the least and the greatest number as they stand in the file."""
    ends = channel.range
    if ends is None:
        return NOTHING
    return " to ".join(_number(end) for end in dict.fromkeys(ends))


def _number(value: float) -> str:
    """Write four digits, without an exponent where a plain number is as short."""
    text = f"{value:.4g}"
    return f"{float(text):.0f}" if "e+" in text and abs(value) < PLAIN_BELOW else text


def _samples(channel: ChannelContent) -> str:
    """Write the number of samples, and how many are missing."""
    rate = "" if channel.sample_rate is None else f" at {with_unit(channel.sample_rate, 'Hz', 4)}"
    of_sample = "" if channel.growth is None else " in the sample"
    gaps = f", {channel.missing} not numbers{of_sample}" if channel.missing else ""
    return f"{_count(channel)}{rate}{gaps}"


def _count(channel: ChannelContent) -> str:
    """Write how many samples a channel has; "about" where that was estimated."""
    return f"{'' if channel.growth is None else 'about '}{channel.count}"


def sparkline(values: np.ndarray) -> str:
    """Return a line of blocks as high as the values, shape (n,).

    Blocks reach from the least to the greatest value. NaN is a space.
    """
    values = values / max(float(np.abs(values[np.isfinite(values)]).max(initial=0.0)), np.finfo(float).tiny)
    finite = values[np.isfinite(values)]
    low, span = (float(finite.min()), float(np.ptp(finite))) if finite.size else (0.0, 0.0)
    heights = (values - low) / span if span > 0 else np.where(np.isfinite(values), 0.0, np.nan)
    return "".join(_BLOCKS[min(int(8 * height), 7)] if np.isfinite(height) else " " for height in heights)


def _holds(content: LogContent) -> str:
    """Say how much a file holds: frequency lines, or channels, samples and duration."""
    if content.response is not None:
        frequency = content.response.frequency
        ends = range_with_unit(float(frequency[0]), float(frequency[-1]), "Hz")
        return f"a frequency response of {frequency.size} lines, {ends}, {content.response.unit or 'without a unit'}"
    longest = max(content.channels, key=lambda channel: channel.values.size)
    duration, channels = longest.duration, len(content.channels)
    lasts = "" if duration is None else f" over {with_unit(duration, 's', 4)}"
    return f"{channels} channel{'s' * (channels != 1)}, {_count(longest)} sample{'s' * (longest.count != 1)}{lasts}"


def logs_document(contents: Sequence[LogContent]) -> dict[str, Any]:
    """Return the JSON document of all files that were read, without those written."""
    return plain_json({"logs": [_log(content) for content in contents]})


def _log(content: LogContent) -> dict[str, Any]:
    """Return what a file holds, for the document."""
    response = content.response
    return {
        "file": str(content.path),
        "format": content.title,
        "conclusion": conclusions(content)[0][1],
        "kind": content.kind or None,
        "reason": content.reason or None,
        "channels": [_channel(channel) for channel in content.channels],
        "response": None if response is None else {"lines": len(response.frequency), "unit": response.unit},
        "open": [
            {"about": gap.key, **entries(gap, "actual", "expected"), "example": gap.example or None}
            for gap in content.gaps
        ],
        "command": next_command(content),
        **entries(content, "read", "warnings"),
        "sampled": content.sampled or None,
    }


def _channel(channel: ChannelContent) -> dict[str, Any]:
    """Return a channel of a log for the document, such as its name, unit, role and range."""
    low, high = channel.range or (None, None)
    return {
        "name": channel.name,
        "unit": channel.unit or None,
        "role": channel.role or None,
        "reason": channel.reason or None,
        "samples": channel.count,
        "samples_estimated": channel.growth is not None,
        "sample_rate_Hz": channel.sample_rate,
        "missing": channel.missing,
        "low": low,
        "high": high,
        "course": channel.course(),
    }


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
        words += f" (values beyond {LARGEST_VALUE:g} not drawn)"
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
    return np.where(sizes <= LARGEST_VALUE, np.where(sizes < 1 / LARGEST_VALUE, 0.0, values), np.nan)


def blocks(contents: Sequence[LogContent]) -> list[AnswerBlock]:
    """Return a block for each file, the first with all figures and the document."""
    files = [
        AnswerBlock(title=item.path.name, sentences=file_sentences(item), columns=COLUMNS, rows=channel_rows(item))
        for item in contents
    ]
    return [*files, AnswerBlock(draw=partial(logs_figures, contents), numbers=partial(logs_document, contents))]


def page_values(contents: Sequence[LogContent]) -> dict[str, Any]:
    """Return what the page shows file by file: what is open, the channels, and how the file was read."""
    files = [
        {
            "name": content.path.name,
            "rows": channel_rows(content),
            "open": open_questions(content),
            "command": next_command(content),
            "read": content.read,
            "warnings": (*sampled_note(content), *content.warnings),
            "figure": f"logs_{number}",
        }
        for number, content in enumerate(contents, 1)
    ]
    verdicts = [verdict for content in contents for verdict in conclusions(content)]
    return {"verdicts": verdicts, "columns": COLUMNS, "files": files}
