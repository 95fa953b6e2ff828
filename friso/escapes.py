"""Escape texts from files before they are shown.

Their characters must not control a terminal, reverse the reading direction, or become a formula.
"""

from __future__ import annotations

import json
import logging
import re

_STEERING = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\ud800-\udfff\U000e0000-\U000e007f]"
)
"""Pattern of characters to escape.

They are control characters except line feed and tab, marks and overrides of the writing direction, characters without
width, surrogates, and tags."""

_MARKUP = re.compile(r"[\\`*\[\]<>&|~$#]|(?<![^\W_])_|_(?![^\W_])")
"""Pattern of characters with a meaning in Markdown, where they have one."""


def escaped(text: str) -> str:
    r"""Return a text with every unsafe character written out, such as "\x1b" or "\u202e"; lines are kept."""
    return _STEERING.sub(_written_out, text)


def one_line(text: str) -> str:
    """Return a text escaped on one line; line feeds and tabs are written out as well."""
    return escaped(text).replace("\n", "\\n").replace("\t", "\\t")


def markdown(text: str) -> str:
    """Return a text as Markdown that shows it as it is: what would be markup, HTML or a formula gets a backslash."""
    return _MARKUP.sub(r"\\\g<0>", text)


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


def _escape_record(record: logging.LogRecord) -> bool:
    """Escape the message of a log record; return True, so that the record is logged."""
    record.msg, record.args = escaped(record.getMessage()), None
    return True


logging.getLogger("friso").addFilter(_escape_record)  # whoever collects the records gets safe texts, too
