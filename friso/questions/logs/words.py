"""Describe a file of logs in words that terminal and page share."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from friso.identification.contents import ChannelContent, LogContent
from friso.platform.system import shell_word
from friso.shown.documents import entries, plain_json
from friso.shown.drawing.figure import GREEN, ORANGE
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
