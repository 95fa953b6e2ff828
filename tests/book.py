"""The book of machines, `machines.toml`: stages with what is known of each, and by whom."""

import tomllib
from pathlib import Path
from typing import Any

import maxwell_slip as maxwell_slip  # the law of some of them

from friso.stage import Stage

_BOOK = tomllib.loads(Path(__file__).with_name("machines.toml").read_text(encoding="utf-8"))


def _named(entries: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    return {entry["name"]: {key: table for key, table in entry.items() if key != "name"} for entry in entries}


_MACHINES = _named(_BOOK["machines"])
KNOWN: dict[str, dict[str, Any]] = {name: tables.pop("known", {}) for name, tables in _MACHINES.items()}
BOOK = {name: Stage(**tables) for name, tables in _MACHINES.items()}

VARIANTS = {name: Stage(**tables) for name, tables in _named(_BOOK["variants"]).items()}
"""Every kind of stage that the equations distinguish."""

CONTROLLERS = _named(_BOOK["controllers"])
"""Tables of a controller and its drive."""


def knowing(*facts: str) -> list[str]:
    """Return the names of the machines of which these facts are known."""
    return [name for name, known in KNOWN.items() if {*facts} <= known.keys()]
