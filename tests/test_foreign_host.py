"""Test friso on Windows and on macOS, as far as possible without them (foreign_host/sitecustomize.py)."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from pages import Page

from friso.interface.output_folder import DRAFTS

pytestmark = pytest.mark.slow

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
SPAN = ("--x", "controller.crossover=10 Hz..30 Hz:9", "--y", "masses.stage=2 kg..4 kg:9")

on_both = pytest.mark.parametrize("host", ["win32", "darwin"])


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


@pytest.mark.thorough
@on_both
def test_commands_write_their_files(host: str, axis: Path) -> None:
    """Files are replaced unless another program holds them; names of devices are refused on Windows alone."""
    document = json.loads(friso(host, axis, "check", "axis.toml", "--json", "--out", "Größe"))
    assert document["cases"]["given"]["verdict"] in ("hunts", "settles", "bistable", "transient")
    assert "report.html" in {path.name for path in (axis / "Größe").iterdir()}
    assert Page((axis / "Größe" / "report.html").read_text(encoding="utf-8")).text
    export = ("export", "axis.toml", "--out", "run", "--overwrite")
    for _ in range(2):
        friso(host, axis, *export)
    assert not list(axis.rglob(f"{DRAFTS}*"))
    there = {path: path.read_bytes() for path in (axis / "run").iterdir()}
    friso(host, axis, "init", "con.toml", status=2 if host == "win32" else 0)
    assert (axis / "con.toml").exists() == (host == "darwin")
    if host == "win32":
        with next(path for path in there if path.suffix == ".html").open("rb") as held:
            message = " ".join(friso(host, axis, *export, status=1).split())
        assert Path(held.name).name in message
        assert "open in another program" in message
        assert there == {path: path.read_bytes() for path in (axis / "run").iterdir()}


def test_what_windows_alone_refuses_or_calls_otherwise(axis: Path) -> None:
    """Folders in which nothing can be made, names of devices, and paths that are too long are refused before anything
    is compiled. Neither a folder's mode nor os.access shows the first."""
    (axis / "read-only").mkdir()
    kernels = axis / "kernels"
    long = axis / ("a" * 120) / ("b" * 120)
    place = (*SPAN, "--out", "read-only/map.zarr")
    for command, words in (
        (("check", "axis.toml", "--out", "read-only/run"), "can be written (Permission denied)"),
        (("check", "axis.toml", "--out", "read-only"), "can be written (Permission denied)"),
        (("map", "axis.toml", *place), "can be written"),
        (("map", "axis.toml", *SPAN, "--out", "com1.zarr"), "com1.zarr is a device"),
        (("bode", "axis.toml", "--out", "Nul/report"), "Nul is a device"),
        (("simulate", "axis.toml", "--out", long), "long paths"),
    ):
        message = friso("win32", axis, *command, status=2, FRISO_CACHE_DIR=str(kernels))
        assert words in " ".join(message.split())
    assert {path.name for path in axis.iterdir()} == {"axis.toml", "read-only"}
    (axis / "words.py").write_text(WORDS)
    with started("win32", axis, command=("words.py",)) as process:
        _, err = process.communicate()
    assert process.returncode == 0, err


WORDS = r"""
import os
from pathlib import Path
from unittest.mock import patch

from friso.app.machine import plain_name
from friso.platform.files import content_of
from friso.platform.files import read_private
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
"""
