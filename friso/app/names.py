"""Make file names sent by a page safe for this machine."""

from __future__ import annotations

import re
from pathlib import Path

from friso.platform.system import name_refused

_OUTSIDE = re.compile(r"[^\w.+ -]")

LONGEST = 150
"""Longest file name in bytes. File systems take 255, and names of accompanying files are longer."""


def plain_name(name: str, otherwise: str) -> str:
    """Return the last part of a path as a safe file name, or `otherwise` if nothing is left.

    The name cannot lead to another folder, hide the file, or read as an option of a command.
    """
    last = _OUTSIDE.sub("_", name.replace("\\", "/").rpartition("/")[2])
    plain = last.encode()[-LONGEST:].decode(errors="ignore").lstrip(".- ").rstrip(". ") or otherwise
    return f"_{plain}" if name_refused(Path(plain)) else plain
