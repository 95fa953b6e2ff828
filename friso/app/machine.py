"""Hold the machine that a page shows: its stage file, the keys changed since, its uploads, and the archive of answers.

Files that were dropped on the page stay in a folder of the server while it runs.

The archive has what a command would write; no other file is written.

A shell command and a line of Python repeat what the page shows.
"""

from __future__ import annotations

import io
import json
import re
import secrets
import zipfile
from collections.abc import AsyncIterable, Container, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from threading import Lock
from typing import Any

from friso.axis import speaking_of
from friso.errors import InputError
from friso.interface.answer import Answer
from friso.interface.starting import stage_schema
from friso.platform.leftovers import temporary_folder
from friso.platform.system import name_refused, remove_folder, shell_word
from friso.quantities import Number, Quantity, as_toml, exactly
from friso.shown.blocks import pictures
from friso.stage import ControllerSection, Stage, loads, numeric_keys
from friso.stage.controllers import CONTROLLERS, KIND, controller_of
from friso.stage.section import numeric_fields

MOST_BYTES = 64_000_000
"""Largest size of a log in bytes."""

MOST_FILES = 50
"""Largest number of files kept."""


PREFIX = "friso-uploads-"
"""Prefix of the servers' folders."""


class Uploads:
    """Dropped files by the names under which the page knows them.

    The page can name no file that was not dropped. Names are random, so a page left open cannot reach files of a later
    server. Files that a killed server left behind are deleted by the next one.
    """

    def __init__(self) -> None:
        self.held = ExitStack()
        self.folder = self.held.enter_context(temporary_folder(PREFIX))
        self.files: dict[str, Path] = {}

    async def keep(self, name: str, chunks: AsyncIterable[bytes]) -> str:
        """Store a file as it arrives, and return the name under which it is asked for.

        Raises InputError for a file that is too large, or one file too many. Raises OSError if it cannot be written.
        """
        place = self.folder / secrets.token_hex(8)  # several may come at the same time
        if sum(1 for entry in self.folder.iterdir() if entry.is_dir()) >= MOST_FILES:
            most = f"at most {MOST_FILES}: Other files lets those go that are shown"
            raise InputError("file", f"more than {MOST_FILES} files", most)
        plain = plain_name(name, "log")
        place.mkdir()
        size = 0
        try:
            with open(place / plain, "wb") as file:
                async for chunk in chunks:
                    size += len(chunk)
                    if size > MOST_BYTES:
                        most = f"at most {MOST_BYTES / 1e6:g} MB; friso identify on the command line takes larger ones"
                        raise InputError(plain, f"more than {MOST_BYTES / 1e6:g} MB", most)
                    file.write(chunk)
        except BaseException:
            remove_folder(place)
            raise
        label = f"{place.name}/{plain}"
        self.files[label] = place / plain
        return label

    def path(self, name: object) -> Path:
        """Return where a dropped file is stored. Raises InputError for an unknown name."""
        path = self.files.get(name) if isinstance(name, str) else None
        if path is None:
            raise InputError("file", str(name)[:60], "a file that was dropped on the page while this server ran")
        return path

    def let_go(self, name: str) -> None:
        """Delete one dropped file. Raises InputError for an unknown name."""
        place = self.path(name).parent
        del self.files[name]
        remove_folder(place)

    def remove(self) -> None:
        """Delete all dropped files and their folder."""
        self.held.close()


_OUTSIDE = re.compile(r"[^\w.+ -]")

LONGEST_NAME = 150
"""Longest file name in bytes. File systems take 255, and names of accompanying files are longer."""


def plain_name(name: str, otherwise: str) -> str:
    """Return the last part of a path as a safe file name, or `otherwise` if nothing is left.

    The name cannot lead to another folder, hide the file, or read as an option of a command.
    """
    last = _OUTSIDE.sub("_", name.replace("\\", "/").rpartition("/")[2])
    plain = last.encode()[-LONGEST_NAME:].decode(errors="ignore").lstrip(".- ").rstrip(". ") or otherwise
    return f"_{plain}" if name_refused(Path(plain)) else plain


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
            raise InputError("changes", "other values", "texts, numbers, arrays, true or false, by key")
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


_VALUES = (str, bool, int, float, list, type(None))


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


def controllers() -> dict[str, type[ControllerSection]]:
    """Return the classes of controllers by what the page calls them: their kind, and the key by which it is given."""
    forms = ((kind, form) for kind, of_kind in CONTROLLERS.forms.items() for form in of_kind)
    return {" by ".join([kind, *form.recognised_by[:1]]): form for kind, form in forms}


def as_controller(stage: Stage, name: str) -> dict[str, Any]:
    """Return the changed keys, None for keys to remove, that give a stage the controller called `name`.

    What both controllers have stays; the others' keys follow from the gains of the present one, or are the examples of
    the new one. Raises InputError for an unknown name.
    """
    if name not in controllers():
        raise InputError(KIND, name[:60], f"one of {', '.join(controllers())}")
    form, flat = controllers()[name], stage.flat()
    own, written, axis = controller_of(flat), stage.as_written()["controller"], stage.axis_kind
    pid, fields = own.as_pid(flat), numeric_fields(form)
    alike = [key for key in form.model_fields if numeric_fields(own).get(key) == fields.get(key)]
    values: dict[str, Any] = dict.fromkeys(key for key in written if key not in alike)
    values |= {"kind": name.partition(" by ")[0]}
    for key, field in form.model_fields.items():
        if field.is_required() and key != "kind" and values.get(key, written.get(key)) is None:
            example = fields[key].on(axis).example if key in fields else "0"
            values[key] = float(example) if isinstance(fields.get(key), Number) else example
    for key, value in (form.like_pid(pid) if pid else {}).items():
        unit = getattr(fields.get(key), "unit", "")
        number = float(f"{value:.4g}") or None if isinstance(value, float) else value  # 0 is what absent gains are
        values[key] = exactly(number, axis.unit(unit)) if unit and number else number
    return {form.key(key): value for key, value in values.items()}


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
    if path == KIND:
        own, about["kind"] = controller_of(flat), "controller"
        about |= {"options": [*controllers()], "own": next(k for k, form in controllers().items() if form is own)}
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


def command_line(command: str, files: Sequence[str], options: Mapping[str, Any]) -> str:
    """Return a friso command with its files and options, quoted for this system's shell.

    `options` holds the options by their names in Python.
    """
    words = ["friso", command, *files]
    for name, value in _each(options):
        option = f"--{name.strip('_').replace('_', '-')}"
        words += [option] if value is True else [option, str(value)]
    return " ".join(map(shell_word, words))


def python_line(function: str, files: Sequence[str], options: Mapping[str, Any]) -> str:
    """Return the call of a friso function with its files and options as a line of Python."""
    first = repr(files[0] if len(files) == 1 else [*files])
    return f"friso.{function}({', '.join([first, *(f'{name}={value!r}' for name, value in options.items())])})"


def _each(options: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield every option with its value; an option for several keys comes once per key."""
    for name, value in options.items():
        if isinstance(value, Mapping):
            yield from ((name, f"{key}={_bare(item)}") for key, item in value.items())
        else:
            yield name, value


def _bare(value: Any) -> str:
    """Write a value behind KEY= as the command line reads it, texts without quotes."""
    return value if isinstance(value, str) else as_toml(value)


def archive(answer: Answer, more: Mapping[str, str]) -> bytes:
    """Return a ZIP file with everything that an answer's command would write.

    The archive holds the files, the figures in all formats, and the answer as JSON. `more` adds text files by name.
    """
    held = io.BytesIO()
    packing = zipfile.ZipFile(held, "w", zipfile.ZIP_DEFLATED)
    with temporary_folder("friso-app-") as folder, packing as file:
        out = folder / "out"
        written = answer.report(out)
        with speaking_of(answer.axis_kind):
            for name, save in pictures(answer.figures()).items():  # some commands show figures in their page alone
                if out / name not in written and callable(save):
                    save(out / name)
        for path in sorted(out.rglob("*")):
            file.write(path, path.relative_to(out))
        file.writestr(f"{answer.command}.json", json.dumps(answer.to_dict(), indent=1, allow_nan=False))
        for name, text in more.items():
            file.writestr(name, text)
    return held.getvalue()
