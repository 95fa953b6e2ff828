"""Read the tables of stage files, and the KEY=VALUE of the command line."""

from __future__ import annotations

import codecs
import os
import re
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from friso.errors import InputError, StageError, one_line
from friso.platform.files import LargeFileError, content_of
from friso.platform.system import cause_of, shell_word
from friso.quantities import quoted
from friso.stage.stage import Stage, changed

MOST_BYTES = 4_000_000
"""Largest size of a text file in bytes."""

Read = TypeVar("Read")

_HINTS = {
    ".ini": "friso init stage.toml --from {}",
    ".json": "friso init stage.toml --from {}",
    ".csv": "friso logs {}",
    ".mat": "friso logs {}",
    ".tdms": "friso logs {}",
    ".zarr": "friso map {}",
}
"""The command that reads a file that is no stage file, by the file's suffix."""

_EXPECTED = "a stage file; friso init writes one to start from"
_EXAMPLE = '[masses] and, on the next line, cart = "1.2 kg"'


def read_stage(path: str | os.PathLike[str]) -> Stage:
    """Return the stage of the TOML file at `path`. Raises StageError."""
    return _hinted(path, lambda text: stage_of(text, str(path), Path(path).parent))


def load_tables(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the tables of a stage file, which need not make a whole stage.

    Raises StageError for a file that cannot be read, or that is not TOML.
    """
    return _hinted(path, lambda text: _with_whole_paths(parsed(text, _EXPECTED), Path(path).parent))


def _hinted(path: str | os.PathLike[str], read: Callable[[str], Read]) -> Read:
    """Read the text of a stage file, and return what the function `read` makes of it.

    Raises StageError for a file that cannot be read or does not pass. For another kind of file, the error names the
    command that reads it.
    """
    try:
        return read(text_of(Path(path), _EXPECTED))
    except InputError as error:
        error = error.found_in(str(path))
        hints = _HINTS if os.path.lexists(path) else {".zarr": "a store made by friso map"}
        hint = hints.get(Path(path).suffix.lower(), "").format(shell_word(str(path)))
        if hint:
            error = InputError(error.key, error.actual, f"{error.expected}; or {hint}", "", str(path))
        raise StageError.of(error) from None


def load_changed(path: Path, changes: Mapping[str, Any]) -> Stage:
    """Return the stage of a file with dotted keys set, also if the file lacks them.

    Raises StageError if the file cannot be read, or if the changed tables make no valid stage.
    """
    try:
        return changed(_with_whole_paths(parsed(text_of(path, _EXPECTED), _EXPECTED), path.parent), changes)
    except InputError as error:
        raise StageError.of(error).found_in(str(path)) from None


def stage_of(text: str, origin: str, folder: Path | None = None) -> Stage:
    """Return the stage of a TOML text; files that it names stand in `folder`.

    `origin` names the text in errors. Raises StageError if the text is not TOML, or makes no valid stage.
    """
    try:
        tables = parsed(text, _EXPECTED)
        if "masses" not in tables or "controller" not in tables:
            _refuse_specification(tables)
        return Stage(**_with_whole_paths(tables, folder))
    except InputError as error:
        raise StageError.of(error).found_in(origin) from None


def _with_whole_paths(tables: Mapping[str, Any], folder: Path | None) -> dict[str, Any]:
    """Return tables in which a `file` that stands in `folder` has its full path.

    Without a folder, the tables are returned unchanged.
    """
    whole: dict[str, Any] = dict(tables)
    for name, table in tables.items():
        if folder is not None and isinstance(table, dict) and isinstance(table.get("file"), str):
            whole[name] = {**table, "file": str((folder / table["file"]).absolute())}
    return whole


def _refuse_specification(tables: Mapping[str, Any]) -> None:
    """Raise StageError if tables describe a design instead of a stage."""
    if len({"machine", "moves", "leaves", "position", "safety"} & tables.keys()) > 1:
        raise StageError("", "a specification of a design", _EXPECTED, "friso design STAGE.toml SPECIFICATION.toml")


def parse_set(text: str) -> tuple[str, Any]:
    """Split KEY=VALUE of a command line; a value that is no TOML is a text.

    Raises InputError if there is no key or no equals sign, or if a quote is not closed.
    """
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise InputError("", quoted(text), "KEY=VALUE", 'masses.stage="0.6 kg"', origin="--set")
    value = value.strip()
    if value[:1] in ("'", '"') and (opened := _open_quote(value)) is not None:
        before = one_line(text[: text.index(value, len(key)) + opened])
        shown = f"{_INDENT}{one_line(text)[:SHOWN_WIDTH]}\n{_INDENT}{' ' * len(before)}^"
        actual = f"a quote that is not closed\n{shown}"
        raise InputError("", actual, "KEY=VALUE", 'masses.stage="0.6 kg"', origin="--set")
    return key.strip(), _value(value)


def _value(text: str) -> Any:
    """Return a TOML value, or the text itself if it is no TOML value.

    A text with a comment or a second line is no value, because it is read as part of an inline table.
    """
    if _MANY_PARTS.search(text):
        return text
    try:
        document = tomllib.loads(f"line = {{ value = {text} }}")
    except (ValueError, RecursionError):
        return text
    is_one_value = [*document] == ["line"] and [*document["line"]] == ["value"]
    return document["line"]["value"] if is_one_value else text


def text_of(path: Path, expected: str, example: str = _EXAMPLE, latin: bool = False) -> str:
    """Read a text file; errors say what was `expected`, and show the `example`.

    With `latin` it may be Latin-1, as older programs write it. Raises InputError, also for a device, a pipe, or more
    than MOST_BYTES.
    """
    try:
        content = content_of(path, MOST_BYTES)
        return _utf_8_or_latin(content) if latin and not _NO_TEXT.search(content) else content.decode("utf-8-sig")
    except LargeFileError as error:
        most = f"of at most {MOST_BYTES / 1e6:g} MB"
        raise InputError("", str(error), f"{expected}, {most}", example, str(path)) from None
    except UnicodeDecodeError as error:
        is_wide = error.object[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)  # written by > in PowerShell 5
        text = "UTF-16" if is_wide else f"byte {error.start + 1} is not UTF-8"
        raise InputError("", text, "a text file saved as UTF-8", example, str(path)) from None
    except (OSError, ValueError) as error:
        text = "a folder" if os.path.isdir(path) else reason_of(error)
        raise InputError("", text, expected, example, str(path)) from None


_NO_TEXT = re.compile(rb"[\x00-\x08\x0e-\x19\x80-\x9f]")
"""Bytes that a Latin-1 text does not contain, but UTF-16 and binary data do."""


def _utf_8_or_latin(content: bytes) -> str:
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def reason_of(error: OSError | ValueError) -> str:
    """Return why a file cannot be read or written, in words."""
    cause = cause_of(error) if isinstance(error, OSError) else str(error)
    return cause[:1].lower() + cause[1:]


def parsed(text: str, expected: str, example: str = _EXAMPLE) -> dict[str, Any]:
    """Return the tables of a TOML text.

    `expected` says in errors what the text should be, and `example` shows it. Raises InputError for an empty text, for
    anything but TOML, and for too many lines or tables.
    """
    if not text.strip():
        raise InputError("", "an empty file", expected, example)
    if key := _MANY_PARTS.search(text):
        line = text.count("\n", 0, key.end()) + 1
        raise InputError("", f"a key of more than {MOST_PARTS} parts in line {line}", expected, example)
    if (lines := text.count("\n")) > MOST_LINES:
        raise InputError("", f"{lines} lines", f"at most {MOST_LINES} lines", example)
    if (tables := len(_TABLE.findall(text))) > MOST_TABLES:
        raise InputError("", f"{tables} tables", f"at most {MOST_TABLES} tables", example)
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError("", "tables nested too deeply", expected, example) from None
    except tomllib.TOMLDecodeError as error:
        actual = f"not TOML: {_syntax_error(text, str(error))}"
        raise InputError("", actual, "tables in brackets, then key = value", example) from None
    except ValueError:  # raised by Python itself
        raise InputError("", "not TOML: a whole number of thousands of digits", expected, example) from None


MOST_PARTS = 32
_PART = r"""(?:[\w-]+|"[^"\n]*"|'[^'\n]*')"""
_MANY_PARTS = re.compile(rf"(?:^|[\[{{,])[ \t]*(?:{_PART}[ \t]*\.[ \t]*){{{MOST_PARTS}}}", re.MULTILINE)
"""Pattern of keys with more parts than any table has. With thousands of parts, reading would take a time that grows
with the square of their number."""

_TABLE = re.compile(rf"^[ \t]*\[\[?[ \t]*{_PART}(?:[ \t]*\.[ \t]*{_PART})*[ \t]*\](?!.*,[ \t]*$)", re.MULTILINE)
"""Pattern of the heading of a table. A row of an array looks alike, but ends with a comma."""

MOST_TABLES, MOST_LINES = 1000, 20_000
"""Largest number of tables, and of lines, of a text.

A megabyte of either takes seconds."""

_PLACE = re.compile(r" \(at line (\d+), column (\d+)\)$")

_TYPOGRAPHIC = tuple("\u2018\u2019\u201a\u201c\u201d\u201e\u00ab\u00bb")

SHOWN_WIDTH = 100
"""Largest number of characters shown of a line."""


def _syntax_error(text: str, message: str) -> str:
    """Explain a syntax error of a TOML text, with its line and a caret below the column."""
    place = _PLACE.search(message)
    if place is None:
        return message
    number, column = int(place[1]), int(place[2])
    line = text.split("\n")[number - 1].rstrip("\r")
    # a key in the message is a tuple with one part
    why = re.sub(r"^([^(]*)\('(.*)',\)", r"\1\2", message[: place.start()])
    if (opened := _open_quote(line)) is not None:
        column, why = opened + 1, "a quote that is not closed"
    elif line[column - 1 : column] in _TYPOGRAPHIC:
        why = "a typographic quote in place of a straight one"
    start = max(0, column - SHOWN_WIDTH // 2) if column > SHOWN_WIDTH else 0
    before, line = one_line(line[start : column - 1]), one_line(line[start : start + SHOWN_WIDTH])
    place_in_words = f"(at line {number}, column {column})"
    return f"{why} {place_in_words}\n{_INDENT}{line}\n{_INDENT}{' ' * len(before)}^"


_INDENT = " " * 12
"""Indentation of further lines in the message of an InputError."""


def _open_quote(line: str) -> int | None:
    """Return the index of a quote that is not closed in a line; None if there is none."""
    opened, escaped = None, False
    for place, sign in enumerate(line):
        if escaped:
            escaped = False
        elif opened is not None:
            escaped = sign == "\\" and line[opened] == '"'
            opened = None if sign == line[opened] else opened
        elif sign == "#":
            return None
        elif sign in "\"'":
            opened = place
    return opened
