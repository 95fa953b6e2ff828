"""Check paths before use: find names that no operating system accepts."""

from __future__ import annotations

import os
from pathlib import Path

from friso.platform.system import name_refused

LONGEST_NAME = 255
"""Longest name in bytes on Linux, macOS and Windows."""

LONGEST_PATH = 1024
"""Longest path in characters, as on macOS."""

LONGEST_WRITTEN = 200
"""Longest name in bytes of a file or store to be written; its draft has a longer name."""

EXPECTED = f"a path with names of at most {LONGEST_NAME} bytes, and of at most {LONGEST_PATH} characters"


def flaw_of(path: str | os.PathLike[str], longest_name: int = LONGEST_NAME) -> str:
    """Return why a path cannot name a file or a folder; "" if it can.

    Names in the path may have at most `longest_name` bytes.
    """
    text = os.fspath(path)
    if not text:
        return "an empty path"
    if "\0" in text:
        return "a path with a null character in it"
    try:
        longest = max(len(os.fsencode(part)) for part in Path(text).parts or [text])
    except UnicodeEncodeError:
        return "a path with half a character in it"
    if longest > longest_name:
        return f"a path with a name of {longest} bytes"
    if len(text) > LONGEST_PATH:
        return f"a path of {len(text)} characters"
    return ""


def unwritable(path: Path) -> tuple[str, str] | None:
    """Return why nothing can be written to a path, and what is expected instead; None if it can.

    Both are in words. The path may have no name, a name that is too long, or one that Windows does not accept.
    """
    if flaw := flaw_of(path, LONGEST_WRITTEN):
        return flaw, f"names of at most {LONGEST_WRITTEN} bytes"
    if why := name_refused(path):
        return str(path), f"another name: {why}"
    return None
