"""What is refused, as rows of tests/refusals.toml: each names its key, shows what was given, and writes nothing."""

import tomllib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import log_files
import numpy as np
import pytest
from inside import friso_inside
from refusals import refused, rows_of

import friso

FOLDER = Path(__file__).parent
TABLE: dict[str, Any] = tomllib.loads((FOLDER / "refusals.toml").read_text(encoding="utf-8"))
MOTION = log_files.motion(2000)

Row = dict[str, Any]


def rows() -> list[Row]:
    """Return the rows of all groups; each has what its group says, and its own."""
    result = []
    for group in TABLE["group"]:
        for row in group["rows"]:
            both = {key: {**group[key], **row[key]} for key in group.keys() & row.keys() if isinstance(row[key], dict)}
            result.append({**group, **row, **both})
    return result


def text_of(pieces: str | list[str | int]) -> str:
    """Return a text of pieces, of which a number repeats the one before, each time with its number for {n}."""
    parts: list[str] = []
    for piece in [pieces] if isinstance(pieces, str) else pieces:
        if isinstance(piece, int):
            once = parts.pop()
            parts += [once.replace("{n}", str(n)) for n in range(piece)]
        else:
            parts.append(piece)
    return "".join(parts)


def path_of(name: str) -> Path:
    return Path(friso.example(name))


@cache
def stage_of(name: str) -> friso.Stage:
    """Return an example, or a stage of the table [texts]."""
    return friso.loads(TABLE["texts"][name]) if name in TABLE["texts"] else friso.load(path_of(name))


def written(row: Row, folder: Path) -> Path:
    """Write the file of a row: the `text`; `columns` of a log by heading; or an example of which parts are replaced."""
    path = folder / row.get("file", "given.toml")
    if "columns" in row:
        values = {**MOTION, "i": np.arange(2000)}
        columns = [np.asarray(eval(text, vars(np) | values)) for text in row["columns"].values()]
        return log_files.write_text(path, [*row["columns"]], columns)
    if "text" in row:
        text = text_of(row["text"])
    else:
        text = TABLE["texts"].get(row["of"]) or path_of(row["of"]).read_text("utf-8")
    edits = [text_of(item) for item in row.get("edit", ())]
    for old, new in zip(edits[::2], edits[1::2], strict=True):
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path.write_bytes(text.encode(row.get("encoding", "utf-8")))
    return path


def load(row: Row, folder: Path) -> None:
    """Read a stage file."""
    friso.load(written(row, folder))


def change(row: Row, folder: Path) -> None:
    """Change keys of an example, or remove those `without`."""
    stage_of(row["of"]).replace(row.get("change", {}) | dict.fromkeys(row.get("without", ())))


def log(row: Row, folder: Path) -> None:
    """Read a log to identify from it."""
    path = written({"file": "log.csv", **row}, folder)
    if "kept" in row:
        (folder / "log.csv.friso.toml").write_text(text_of(row["kept"]), row.get("encoding", "utf-8"))
    friso.identify(path, folder=folder, **row.get("options", {}))


def drive(row: Row, folder: Path) -> None:
    """Make a stage of the parameter file of a drive; an empty answer is none."""
    answers = {key: value for key, value in row["answers"].items() if value}
    friso.init(folder / "new.toml", from_=written(row, folder), axis=row.get("axis"), set=answers)


def spec(row: Row, folder: Path) -> None:
    """Read the specification of a design, for a stage."""
    friso.design(row.get("stage") or path_of("thesis_rig"), written({"of": "specs/thesis", **row}, folder))


def ask(row: Row, folder: Path) -> None:
    """Ask a question from Python; a text that begins with @ is an example, @file the file of the row."""
    path = written(row, folder) if {"text", "edit", "columns"} & row.keys() else None

    def given(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: given(item) for key, item in value.items()}
        if isinstance(value, list):
            return [given(item) for item in value]
        if isinstance(value, str) and value.startswith("@"):
            return path if value == "@file" else path_of(value[1:]) if "/" in value else stage_of(value[1:])
        return value

    getattr(friso, row["ask"])(**given(row["with"]))


CALLS: dict[str, tuple[Callable[[Row, Path], None], type[friso.InputError]]] = {
    "load": (load, friso.StageError),
    "change": (change, friso.StageError),
    "log": (log, friso.InputError),
    "drive": (drive, friso.InputError),
    "spec": (spec, friso.InputError),
    "ask": (ask, friso.InputError),
}


def told(row: Row, what: str) -> list[str]:
    return [row[what]] if isinstance(row.get(what), str) else row.get(what, [])


def named(row: Row) -> str:
    """Return a name of a row's test."""
    parts = (row["call"], row.get("ask", ""), row.get("key", ""), *told(row, "given"), *told(row, "words"))
    return " ".join(part for part in parts if part)[:60]


@pytest.mark.parametrize("row", rows(), ids=named)
def test_what_is_wrong_is_refused(row: Row, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    if row["call"] == "command":
        arguments = [str(path_of(text[1:])) if text.startswith("@") else text for text in row["arguments"]]
        done = friso_inside(tmp_path, *arguments)
        assert (done.returncode, done.stdout) == (2, "")
        assert rows_of(done.stderr)
        assert all(part in " ".join(done.stderr.split()) for part in told(row, "words")), done.stderr
        assert not [*tmp_path.iterdir()]
        return
    call, kind = CALLS[row["call"]]
    with refused(row.get("key"), kind) as caught:
        call(row, tmp_path)
    error = caught.value
    assert all(part in error.actual for part in told(row, "given")), error.actual
    assert all(part in str(error) for part in told(row, "words")), str(error)
    files = {path.name for path in tmp_path.iterdir()}
    assert files <= {row.get("file", "given.toml"), "log.csv", "log.csv.friso.toml"}, files
    assert not files or error.origin.startswith(str(tmp_path)) or error.key in row.get("options", ())
