"""The machine of a page: a stage file as it was opened, the keys changed since, and what the page shows of them."""

from __future__ import annotations

import json
from collections.abc import Container, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from threading import Lock
from typing import Any

from friso.app.names import plain_name
from friso.errors import InputError
from friso.interface.schema import stage_schema
from friso.quantities import Number, Quantity
from friso.stage import Stage, loads, numeric_keys

REACH = 10.0
"""How many times as large and as small a slider makes a value."""


@dataclass(frozen=True)
class Machine:
    """A stage file by its `text` and its `name`, and the keys `changed`, as JSON; null removes one. `made` on the page:
    no file has this text."""

    text: str
    name: str
    changed: str = "{}"
    made: bool = False

    @classmethod
    def of(cls, data: Any) -> Machine:
        """The machine that a page sends. Raises InputError for anything else."""
        if not isinstance(data, Mapping) or not isinstance(data.get("text"), str):
            raise InputError("machine", type(data).__name__, "the text of a stage file, and the keys changed")
        changes = data.get("changes") or {}
        if not isinstance(changes, Mapping) or not all(isinstance(value, _VALUES) for value in changes.values()):
            raise InputError("changes", "other values", "texts, numbers, true or false, by key")
        name = plain_name(str(data.get("name") or ""), "stage.toml")
        return cls(data["text"], name, json.dumps(changes), data.get("made") is True)

    @property
    def changes(self) -> dict[str, Any]:
        """The keys changed."""
        return json.loads(self.changed)

    @property
    def is_of_page(self) -> bool:
        """Whether only the stage file that the page saves is this machine: no command says to take a key away."""
        return self.made or None in self.changes.values()

    @property
    def to_set(self) -> dict[str, Any]:
        """The keys to be set in its file, as an option: none in the stage file that the page saves, which has them."""
        return {"set": self.changes} if self.changes and not self.is_of_page else {}

    @property
    def stage(self) -> Stage:
        """The stage. Raises StageError."""
        return _stage(self)


_VALUES = (str, bool, int, float, type(None))


MOST_KEPT = 16
"""Stages that are kept of the machines asked about last, whose texts may be of 4 MB each: while a slider moves, several
questions are about the same one."""


@lru_cache(MOST_KEPT)
def _stage(machine: Machine) -> Stage:
    base = loads(machine.text, machine.name)
    written = base.as_written()
    changes = {key: value for key, value in machine.changes.items() if value is not None or _has(written, key)}
    return base.replace(changes) if changes else base


def _has(tables: Mapping[str, Any], key: str) -> bool:
    """Whether a dotted key of nested tables is there: one that was added on the page and taken away again is not."""
    table, _, name = key.partition(".")
    return name in tables[table] if table in tables and name else table in tables


def machine_on_page(machine: Machine) -> dict[str, Any]:
    """What a page shows of a machine: its tables with their keys, in the order of the stage file."""
    stage = machine.stage
    flat, written, uncertain = stage.flat(), stage.as_written(), stage.uncertain()
    fields, tables = numeric_keys(flat), []
    for name, node in _schema()["properties"].items():
        if node.get("type") != "object":
            continue
        present = written.get(name)
        row = {"name": name, "description": node.get("description", ""), "present": present is not None, "keys": []}
        if present is not None:
            row["keys"] = [
                _key(f"{name}.{key}", item, present, flat, fields, uncertain)
                for key, item in _variant(node, present)["properties"].items()
            ]
        tables.append(row)
    axis = stage.axis_kind.name
    return {
        "title": stage.name,
        "source": stage.source,
        "axis": axis,
        "tables": tables,
        "uncertain": [*uncertain],
        "toml": stage.to_toml(),
    }


def _variant(node: Mapping[str, Any], present: Mapping[str, Any]) -> Mapping[str, Any]:
    """The form of a table that is written: the one whose words are these, and which has all its keys."""

    def fits(form: Mapping[str, Any]) -> bool:
        keys = form["properties"]
        words = (present.get(key) in item["enum"] for key, item in keys.items() if key in ("kind", "model"))
        return all(words) and all(key in keys for key in present)

    forms = node.get("anyOf") or [node]
    return next(filter(fits, forms), forms[0])


def _key(
    path: str,
    node: Mapping[str, Any],
    present: Mapping[str, Any],
    flat: Mapping[str, Any],
    fields: Mapping[str, Quantity | Number],
    uncertain: Container[str],
) -> dict[str, Any]:
    """A key as the page shows it: its value as written, whether that is `plain` (certain), what it takes, and the range
    of its slider in SI."""
    key = path.partition(".")[2]
    value, field = present.get(key), fields.get(path)
    about = {"path": path, "value": value, "description": node.get("description", ""), "kind": _kind(node)}
    about |= {"options": node.get("enum", []), "example": (node.get("examples") or [""])[0]}
    about["plain"] = path not in uncertain
    if field is not None:
        about |= {"unit": field.unit, "si": flat.get(path), "example": field.example}
        if isinstance(flat.get(path), float):
            about["range"] = _range(field, flat[path])
    return about


def _kind(node: Mapping[str, Any]) -> str:
    if "enum" in node:
        return "word"
    return {"boolean": "switch", "array": "array", "object": "array"}.get(str(node.get("type")), "value")


def _range(field: Quantity | Number, value: float) -> dict[str, Any]:
    """From where to where a slider goes [SI], and whether by ratio: ten times as small and as large, as far as the key
    takes such values."""
    if value == 0:
        most = abs(float(field.read(field.example))) * REACH if isinstance(field, Quantity) else 1.0
        return {"low": 0.0, "high": most, "log": False}
    ends = sorted((value / REACH, value * REACH))
    while not field.bound.holds(ends[1]) and ends[1] > abs(value):
        ends[1] = value + 0.5 * (ends[1] - value) if ends[1] > 1.001 * value else value
    while not field.bound.holds(ends[0]) and ends[0] < value:
        ends[0] = value - 0.5 * (value - ends[0]) if ends[0] < 0.999 * value else value
    return {"low": ends[0], "high": ends[1], "log": value > 0}


def _schema() -> dict[str, Any]:
    """The schema of the stage file: read once, and by one thread, for Python 3.11 cannot parse in several at a time
    ("AST constructor recursion depth mismatch", github.com/python/cpython/issues/106905)."""
    with _reading:
        return _read_schema()


_reading = Lock()
_read_schema = cache(stage_schema)
