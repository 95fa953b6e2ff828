"""Texts from files that are shown: no character of theirs may steer a terminal, turn the reading direction, or become a
formula."""

from __future__ import annotations

import json
import re

_STEERING = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\ud800-\udfff\U000e0000-\U000e007f]"
)
"""Control characters but for line feed and tab, marks and overrides of the direction of writing, characters without
width, halves of surrogate pairs, tags."""

_FORMULA = ("=", "+", "-", "@", "\t", "\n", "\uff1d", "\uff0b", "\uff0d", "\uff20")
"""How a cell begins that a spreadsheet takes for a formula; the last four are the wide forms of the first, which Excel
takes in East Asian languages."""


def escaped(text: str) -> str:
    r"""The text with each such character written out, "\x1b" or "\u202e"; lines stay lines."""
    return _STEERING.sub(_written_out, text)


def one_line(text: str) -> str:
    r"""The text, escaped, on one line: line feeds and tabs are written out too."""
    return escaped(text).replace("\n", "\\n").replace("\t", "\\t")


def table_cell(text: str) -> str:
    """The text as a cell of a CSV file: escaped, and with an apostrophe before what would be a formula."""
    return f"'{escaped(text)}" if text.startswith(_FORMULA) else escaped(text)


def toml_text(text: str) -> str:
    r"""Return the text as a quoted TOML string that reads back as the same text.

    Control characters are written as escapes, such as "\u202e".
    """
    return _STEERING.sub(_as_in_toml, json.dumps(text, ensure_ascii=False))


def _as_in_toml(match: re.Match[str]) -> str:
    code = ord(match[0])
    if 0xD800 <= code < 0xE000:  # half a character, for which TOML has no escape
        return match[0]
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def _written_out(match: re.Match[str]) -> str:
    code = ord(match[0])
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
