"""The JSON document of what files of logs hold; numbers of channels in the units of the file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from friso.identification.contents import ChannelContent, LogContent
from friso.questions.logs.words import conclusions, next_command
from friso.shown.documents import entries, plain_json


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
    }


def _channel(channel: ChannelContent) -> dict[str, Any]:
    """Return a channel of a log for the document, such as its name, unit, role and range."""
    low, high = channel.range or (None, None)
    return {
        "name": channel.name,
        "unit": channel.unit or None,
        "role": channel.role or None,
        "reason": channel.reason or None,
        "samples": channel.values.size,
        "sample_rate_Hz": channel.sample_rate,
        "missing": channel.missing,
        "low": low,
        "high": high,
        "course": channel.course(),
    }
