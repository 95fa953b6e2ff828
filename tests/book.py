"""The book of machines, `machines.toml`: stages with what is known of each, and by whom."""

import tomllib
from pathlib import Path
from typing import Any

from friso.stage import Stage

_ENTRIES = tomllib.loads(Path(__file__).with_name("machines.toml").read_text(encoding="utf-8"))["machines"]

BOOK: dict[str, Stage] = {
    entry["name"]: Stage(**{key: table for key, table in entry.items() if key not in ("name", "known")})
    for entry in _ENTRIES
}

KNOWN: dict[str, dict[str, Any]] = {entry["name"]: entry.get("known", {}) for entry in _ENTRIES}


def knowing(*facts: str) -> list[str]:
    """Return the names of the machines of which these facts are known."""
    return [name for name, known in KNOWN.items() if {*facts} <= known.keys()]
