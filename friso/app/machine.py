"""Hold the machine that a page shows: a stage file, and the keys changed since."""

from __future__ import annotations

import json
from collections.abc import Container, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from threading import Lock
from typing import Any

from friso.app.uploads import plain_name
from friso.errors import InputError
from friso.interface.starting import stage_schema
from friso.quantities import Number, Quantity
from friso.stage import Stage, loads, numeric_keys

SLIDER_REACH = 10.0
"""Ratio by which a slider can enlarge and reduce a value."""


@dataclass(frozen=True)
class Machine:
    """A stage file by its text and name, and the keys changed on the page.

    `changed` holds the changes as JSON, in which null removes a key. `made` is true if the machine was made on the
    page, so that no file has its text.
    """

    text: str
    name: str
    changed: str = "{}"
    made: bool = False

    @classmethod
    def of(cls, data: Any) -> Machine:
        """Return the machine that a page sent, a stage file's text and changed keys.

        Raises InputError for data of any other kind.
        """
        if not isinstance(data, Mapping) or not isinstance(data.get("text"), str):
            raise InputError("machine", type(data).__name__, "the text of a stage file, and the keys changed")
        changes = data.get("changes") or {}
        if not isinstance(changes, Mapping) or not all(isinstance(value, _VALUES) for value in changes.values()):
            raise InputError("changes", "other values", "texts, numbers, true or false, by key")
        name = plain_name(str(data.get("name") or ""), "stage.toml")
        return cls(data["text"], name, json.dumps(changes), data.get("made") is True)

    @property
    def changes(self) -> dict[str, Any]:
        """Return the changed keys and their values."""
        return json.loads(self.changed)

    @property
    def is_of_page(self) -> bool:
        """Tell whether only a stage file saved by the page describes this machine.

        A machine made on the page has no file. Nor has one with removed keys, because no option of a command removes a
        key.
        """
        return self.made or None in self.changes.values()

    @property
    def to_set(self) -> dict[str, Any]:
        """Return the changed keys as the option `set` of a command.

        The result is empty if the stage file that the page saves already holds the changes.
        """
        return {"set": self.changes} if self.changes and not self.is_of_page else {}

    @property
    def stage(self) -> Stage:
        """Build the stage, with all changes.

        Raises StageError if they do not make a valid stage.
        """
        return _stage(self)


_VALUES = (str, bool, int, float, type(None))


MOST_KEPT = 16
"""Number of latest stages in the cache. While a slider moves, several questions concern one machine. The text of a
stage may take 4 MB."""


@lru_cache(MOST_KEPT)
def _stage(machine: Machine) -> Stage:
    """Build the stage of a machine, or return it from the cache.

    Changes that remove a key which the file does not have are ignored.
    """
    base = loads(machine.text, machine.name)
    written = base.as_written()
    changes = {key: value for key, value in machine.changes.items() if value is not None or _has(written, key)}
    return base.replace(changes) if changes else base


def _has(tables: Mapping[str, Any], key: str) -> bool:
    """Tell whether a dotted key is there in nested tables."""
    table, _, name = key.partition(".")
    return name in tables[table] if table in tables and name else table in tables


def machine_on_page(machine: Machine) -> dict[str, Any]:
    """Return what the page shows of a machine: its tables and keys in the file's order."""
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
    """Choose, among the schemas that a table may have, the one that the stage file uses.

    `node` is the schema of the table, and `present` its keys in the file.
    """

    def fits(form: Mapping[str, Any]) -> bool:
        """Tell whether a schema has all keys of the table, and allows its `kind` or `model`."""
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
    """Describe a key for the page: its value, kind, unit and example.

    `plain` is true in the result unless the key is in `uncertain`. A number also gets its value in SI and the range of
    its slider.
    """
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
    """Return how the page edits a key: by choice of a word, switch, array or value."""
    if "enum" in node:
        return "word"
    return {"boolean": "switch", "array": "array", "object": "array"}.get(str(node.get("type")), "value")


def _range(field: Quantity | Number, value: float) -> dict[str, Any]:
    """Return the range of a slider [SI], and whether it moves by ratio.

    The slider reaches from a tenth of the value to ten times the value, within the bounds of the key.
    """
    if value == 0:
        most = abs(float(field.read(field.example))) * SLIDER_REACH if isinstance(field, Quantity) else 1.0
        return {"low": 0.0, "high": most, "log": False}
    ends = sorted((value / SLIDER_REACH, value * SLIDER_REACH))
    while not field.bound.holds(ends[1]) and ends[1] > abs(value):
        ends[1] = value + 0.5 * (ends[1] - value) if ends[1] > 1.001 * value else value
    while not field.bound.holds(ends[0]) and ends[0] < value:
        ends[0] = value - 0.5 * (value - ends[0]) if ends[0] < 0.999 * value else value
    return {"low": ends[0], "high": ends[1], "log": value > 0}


def _schema() -> dict[str, Any]:
    """Return the schema of the stage file, which is read once and by one thread.

    Python 3.11 cannot parse in several threads at a time ("AST constructor recursion depth mismatch",
    github.com/python/cpython/issues/106905).
    """
    with _reading:
        return _read_schema()


_reading = Lock()
_read_schema = cache(stage_schema)
