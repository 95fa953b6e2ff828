"""Test friso on Windows and on macOS, as far as possible without them (foreign_host/sitecustomize.py)."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from inside import friso_inside
from pages import Page

from friso.interface.drafts import DRAFTS

EXAMPLES = Path(__file__).parent.parent / "examples"
PRELOAD = Path(__file__).parent / "foreign_host"

AXIS = """# an axis of 20 µm/s and more
[masses]
stage = "3 kg"
[friction]
model = "lugre"
static = "8 N"
coulomb = "5 N"
stribeck_velocity = "2 mm/s"
stribeck_exponent = 2
viscous = "20 N*s/m"
bristle_stiffness = "1 N/um"
bristle_damping = "1 N*s/mm"
[controller]
kind = "pid"
crossover = "20 Hz"
alpha = 0.1
beta = 2
[motion]
kind = "there_and_back"
acceleration = "5 m/s^2"
acceleration_time = "20 ms"
return_at = "1 s"
duration = "2 s"
"""
SPAN = ("--x", "controller.crossover=10 Hz..30 Hz:9", "--y", "masses.stage=2 kg..4 kg:9", "--verify", "0")

on_both = pytest.mark.parametrize("host", ["win32", "darwin"])
on_windows = pytest.mark.parametrize("host", ["win32", pytest.param("darwin", marks=pytest.mark.thorough)])
"""Windows lacks more than macOS does."""


def started(
    host: str, folder: Path, *arguments: object, command: tuple[str, ...] = ("-m", "friso"), **variables: str
) -> subprocess.Popen[str]:
    """`friso ARGUMENTS`, or another command of Python's, in a folder, on the host."""
    paths = os.pathsep.join([str(PRELOAD), *(path for path in sys.path if path)])
    console = "cp1252" if host == "win32" else "utf-8"
    environ = {**os.environ, "PYTHONPATH": paths, "FRISO_FOREIGN_HOST": host, "PYTHONIOENCODING": console, **variables}
    words = [sys.executable, *command, *map(str, arguments)]
    pipe = subprocess.PIPE
    return subprocess.Popen(words, cwd=folder, env=environ, stdout=pipe, stderr=pipe, text=True, encoding=console)


def friso(host: str, folder: Path, *arguments: object, status: int = 0, **variables: str) -> str:
    """Return what friso prints, or why it fails, with the expected status."""
    with started(host, folder, *arguments, **variables) as process:
        out, err = process.communicate()
    assert process.returncode == status, err
    return err if status else out


def with_stage(folder: Path) -> Path:
    """The folder, with a stage file that has the line ends of Windows."""
    (folder / "axis.toml").write_bytes(AXIS.replace("\n", "\r\n").encode())
    return folder


@pytest.fixture
def axis(tmp_path: Path) -> Path:
    """A folder with a name that cp1252 knows."""
    folder = tmp_path / "Stäge 1"
    folder.mkdir()
    return with_stage(folder)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The store of a map that was not disturbed, made on this system."""
    folder = with_stage(tmp_path_factory.mktemp("whole"))
    assert friso_inside(folder, "map", "axis.toml", *SPAN, "--out", "whole.zarr").returncode == 0
    return folder / "whole.zarr"


@on_both
def test_check_writes_its_page(host: str, axis: Path) -> None:
    document = json.loads(friso(host, axis, "check", "axis.toml", "--json", "--out", "Größe"))
    assert document["cases"]["given"]["verdict"] in ("hunts", "settles", "bistable", "transient")
    assert {path.name for path in (axis / "Größe").iterdir()} >= {"report.html", ".friso-output"}
    assert Page((axis / "Größe" / "report.html").read_text(encoding="utf-8")).text


@on_windows
def test_files_are_replaced_unless_another_program_holds_them(host: str, axis: Path) -> None:
    export = ("export", "gains", "axis.toml", "--out", "run")
    for _ in range(2):
        friso(host, axis, *export)
    assert not list(axis.rglob(f"{DRAFTS}*"))
    there = {path: path.read_bytes() for path in (axis / "run").iterdir()}
    if host == "win32":
        with next(path for path in there if path.suffix == ".html").open("rb") as held:
            message = " ".join(friso(host, axis, *export, status=2).split())
            assert f"{Path(held.name).name} cannot be replaced" in message
            assert "open in another program" in message
        assert there == {path: path.read_bytes() for path in (axis / "run").iterdir()}


def test_folders_in_which_windows_lets_nothing_be_made_are_refused_at_once(axis: Path) -> None:
    """Neither the folder's mode nor os.access shows it. Nothing is computed, because that would compile."""
    (axis / "read-only").mkdir()
    kernels = axis / "kernels"
    for out in (("--out", "read-only/run"), ("--out", "read-only")):
        message = friso("win32", axis, "check", "axis.toml", *out, status=2, FRISO_CACHE_DIR=str(kernels))
        assert "can be written (Permission denied)" in " ".join(message.split())
    export = (*SPAN, "--out", "map.zarr", "--export", "read-only/map.csv")
    assert "can be written" in friso("win32", axis, "map", "axis.toml", *export, status=2, FRISO_CACHE_DIR=str(kernels))
    assert {path.name for path in axis.iterdir()} == {"axis.toml", "read-only"}


@on_windows
@pytest.mark.thorough
def test_a_map_is_killed_resumed_and_drawn_again(host: str, axis: Path, whole: Path) -> None:
    process = started(host, axis, "map", "axis.toml", *SPAN, "--out", "killed.zarr", "--workers", "2")
    while not (axis / "killed.zarr").exists() and process.poll() is None:
        time.sleep(0.01)
    process.kill()
    process.communicate()
    friso(host, axis, "map", "axis.toml", *SPAN, "--out", "killed.zarr")
    with xr.open_zarr(whole) as one, xr.open_zarr(axis / "killed.zarr") as other:
        assert one.identical(other)


STORES = """
import shutil, sys
from pathlib import Path
import friso
from friso.studies.study import Request
from friso.studies.store import Store, read_store

def opened(text, **options):
    study = Request(stage, {"controller.crossover": text}).study()
    with Store.opened(store, study, **options) as other:
        return len(other.read()["controller.crossover"])

if __name__ == "__main__":
    stage, store = friso.load("axis.toml"), Path("a.zarr")
    store.mkdir()
    assert opened("10 Hz, 20 Hz") == 2
    shutil.copytree(store, f".a.zarr.{'a' * 32}/store")  # a killed process left this
    assert opened("1 Hz, 2 Hz, 3 Hz", overwrite=True) == 3
    store.rename(f".a.zarr.{'b' * 32}.old")  # one was killed while it replaced the store
    assert opened("1 Hz, 2 Hz, 3 Hz") == 3
    with Store.opened(store, Request(stage, {"controller.crossover": "1 Hz, 2 Hz, 3 Hz"}).study()):
        try:
            opened("10 Hz, 20 Hz", overwrite=True)
        except friso.StoreError as error:
            assert "another friso" in str(error), error
        else:
            raise AssertionError("replaced while it was in use")
"""


@on_windows
@pytest.mark.thorough
def test_a_store_is_made_in_an_empty_folder_replaced_and_put_back(host: str, axis: Path) -> None:
    """The lock of a store is a file in it, and Windows renames and deletes no folder with a file that is open."""
    (axis / "stores.py").write_text(STORES)
    with started(host, axis, command=("stores.py",)) as process:
        _, err = process.communicate()
    assert process.returncode == 0, err
    assert {path.name for path in axis.iterdir()} == {"axis.toml", "stores.py", "a.zarr"}


@on_both
def test_names_of_devices_are_refused_on_windows_alone(host: str, axis: Path) -> None:
    there = {*axis.iterdir()}
    span = ("--x", "controller.crossover=10 Hz, 20 Hz", "--verify", "0")
    for command in (("map", "axis.toml", *span, "--out", "com1.zarr"), ("bode", "axis.toml", "--out", "Nul/report")):
        if host == "win32":
            assert f"{Path(command[-1]).parts[0]} is a device" in friso(host, axis, *command, status=2)
    friso(host, axis, "init", "con.toml", status=2 if host == "win32" else 0)
    friso(host, axis, "init", "console.toml")
    assert {path.name for path in {*axis.iterdir()} - there} == {"console.toml", *(["con.toml"] * (host == "darwin"))}


def test_what_windows_alone_calls_otherwise(axis: Path) -> None:
    """A pipe that nobody reads any more, a path that is too long, names, and quotes."""
    with started("win32", axis, "--help") as process:
        assert process.stdout is not None
        process.stdout.close()
        assert process.stderr is not None
        assert process.stderr.read() == ""
    assert process.returncode
    folder = axis / ("a" * 120) / ("b" * 120)
    assert "long paths" in friso("win32", axis, "simulate", "axis.toml", "--out", folder, status=2)
    (axis / "words.py").write_text(WORDS)
    with started("win32", axis, command=("words.py",)) as process:
        _, err = process.communicate()
    assert process.returncode == 0, err


WORDS = r"""
import errno, os, shutil
from pathlib import Path
from unittest.mock import patch

from friso.app.uploads import plain_name
from friso.platform.bounded_file import content_of
from friso.engine import building
from friso.platform.private import read_private
from friso.platform.system import cause_of, check_free, delete_file, name_new_file, name_refused, path_of, remove_folder
from friso.platform.system import replace_file, shell_word

assert [plain_name(name, "log") for name in ("nul", "Con.csv", "a. ", "x.csv")] == ["_nul", "_Con.csv", "a", "x.csv"]
assert shell_word("position=Act Pos") == 'position="Act Pos"'
assert shell_word("a&b,c") == '"a&b,c"'
assert shell_word(r"C:\logs\x.csv") == r"C:\logs\x.csv"
assert shell_word("a,b\\") == r'"a,b\\"'
assert shell_word('a\\"b') == r'"a\\\"b"'
assert shell_word("") == '""'

assert all(map(name_refused, map(Path, ("a?b", "x/end./y", "run ", "rig.toml:hidden", "x/nul.txt"))))
assert not any(map(name_refused, map(Path, ("C:/Users/x", r"\\server\share\run", r"C:\x", "../out", ".", "a.b c"))))

assert cause_of(OSError(22, "Invalid argument", 3)) == "Invalid argument"
moved = FileNotFoundError(2, "none", "a", 3, "b" * 300)
assert cause_of(moved).endswith("only if long paths are enabled") and path_of(moved) == "b" * 300

class Request:
    builder, task = "none", b"0" * 100_000

for name in ("busy-1", "busy-2", "busy-3", "busy-4", "draft"):
    Path(name).write_bytes(name.encode())
assert (content_of(Path("busy-1"), 100), read_private(Path("busy-2"))) == (b"busy-1", b"busy-2")
replace_file(Path("draft"), Path("busy-3"))
assert Path("busy-3").read_bytes() == b"draft"
delete_file(Path("busy-4"))
with open("busy-1") as held:
    for refused in (delete_file, check_free):
        try:
            refused(Path("busy-1"))
        except PermissionError as error:
            assert cause_of(error).endswith("it may be open in another program"), error
        else:
            raise AssertionError(refused)
assert not Path("busy-4").exists()

def raises(kind, use, *arguments):
    try:
        use(*arguments)
    except OSError as error:
        return isinstance(error, kind)
    return False

Path("draft").write_bytes(b"new")
assert raises(FileExistsError, name_new_file, Path("draft"), Path("busy-3"))
assert Path("busy-3").read_bytes() == b"draft"
name_new_file(Path("draft"), Path("new"))
assert (Path("new").read_bytes(), Path("draft").exists()) == (b"new", False)

Path("folder").mkdir()
with patch.object(os, "open", side_effect=PermissionError(13, "Permission denied", "folder")):
    assert raises(IsADirectoryError, content_of, Path("folder"), 100)  # no file that another program holds
with patch.object(os, "access", return_value=False):  # the attribute of a file that may not be written
    assert raises(OSError, check_free, Path("busy-3"))

def in_deletion(folder, ignore_errors=False, calls=[1, 2]):
    if not ignore_errors and not calls:
        os.rmdir(folder)
    elif not ignore_errors and calls.pop():
        raise OSError(errno.ENOTEMPTY, "Directory not empty", folder)

with patch.object(shutil, "rmtree", in_deletion):  # a file of it that another program reads is not gone yet
    remove_folder(Path("folder"))
assert not Path("folder").exists()

builder = building._Builder(building._Surroundings(0, ".", (), ""))
builder.kill()  # as one does that has waited long enough
builder._process.wait()
assert builder.build(Request()) == ""
builder.end()
"""


@on_windows
@pytest.mark.thorough
def test_identify_reads_csv_with_crlf(host: str, tmp_path: Path) -> None:
    time = np.arange(0, 4, 2e-3)
    speed = 0.01 * (1 + time // 2) * np.where(time % 2 < 1, 1.0, -1.0)
    force = 5 * np.sign(speed) + 20 * speed + np.random.default_rng(1).normal(0, 0.05, len(time))
    position = np.concatenate([[0.0], np.cumsum(speed[:-1]) * 2e-3])
    rows = [f"{t:.4f};{x * 1e6:.3f};{f:.4f}" for t, x, f in zip(time, position, force, strict=True)]
    text = "\r\n".join(["Zeit [s];Position [µm];Kraft [N]", *rows, ""])
    (tmp_path / "log.csv").write_bytes(text.encode("cp1252"))
    roles = ("--map", 'position="Position"', "--map", 'force="Kraft"')
    document = json.loads(friso(host, tmp_path, "identify", "log.csv", "--as", "constant-speed", *roles, "--json"))
    assert document["estimates"]


@on_windows
@pytest.mark.thorough
def test_two_processes_share_an_empty_cache(host: str, axis: Path, tmp_path: Path) -> None:
    arguments = ("simulate", "axis.toml", "--json", "--out")
    folder = tmp_path / "für Kernel"
    both = [started(host, axis, *arguments, name, FRISO_CACHE_DIR=str(folder)) for name in ("one", "other")]
    documents = [json.loads(process.communicate()[0]) for process in both]
    written = [document.pop("files") for document in documents]
    assert [Path(name).name for name in written[0]] == [Path(name).name for name in written[1]] != []
    assert documents[0] == documents[1]
    assert any((folder / "kernels").iterdir())  # and not in a temporary folder
