"""The kernels on disk: private, rebuilt when damaged, and safe from each other's processes.

A stand-in of a few lines takes a kernel's place, so that compiling it takes a fraction of a second.
"""

import os
import shutil
import stat
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from friso.engine import building, cache
from friso.engine.cache import DAY, KEPT_FOR

BUILDER = """
import os

from friso.engine.cache import keep
from friso.engine.kinds import ArrayKind
from friso.engine.machine_code import object_code
from friso.engine.scalar_code import written

def build(folder, task):
    assert task == b"task"
    print("a plug-in may say something")
    source = "def run(x):\\n    x[0] = 2.0 * x[0]" + os.environ.get("STAND_IN_ENDS_WITH", "") + "\\n"
    return keep(folder, source, lambda module: object_code(written(module.run, [ArrayKind("float64", 1)])))
"""

SCRIPT = """
import sys
import numpy as np
from friso.engine.building import entries
from friso.engine.cache import CODE, CodeRequest
from friso.engine.kinds import ArrayKind
from friso.engine.machine_code import Loops, load

(entry,) = entries([CodeRequest(sys.argv[1], "a stand-in", "stand_in_builder", b"task")])
run = Loops(load((entry / CODE).read_bytes(), ["run"])["run"], [ArrayKind("float64", 1)])
x = np.array([21.0])
run(x)
assert x[0] == 42.0
assert "friso.engine.scalar_code" not in sys.modules
"""

COMPILING = "compiling, once on this machine, 1 of 1: a stand-in"


@pytest.fixture(scope="module", autouse=True)
def builder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """A builder that makes the stand-in, where the processes find it."""
    folder = tmp_path_factory.mktemp("builder")
    (folder / "stand_in_builder.py").write_text(BUILDER)
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("PYTHONPATH", str(folder), prepend=os.pathsep)
        yield


@pytest.fixture(scope="module")
def whole(builder: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one built entry; tests damage copies of it."""
    folder = tmp_path_factory.mktemp("whole")
    assert built(folder)
    return folder


@pytest.fixture
def copied(whole: Path, tmp_path: Path) -> Path:
    """A copy of the folder with one built entry, which is found in it."""
    return Path(shutil.copytree(whole, tmp_path / "copied"))


def start(folder: Path, name: str = "stand-in", **more: str) -> subprocess.Popen[str]:
    environment = os.environ | {"FRISO_CACHE_DIR": str(folder)} | more
    command = [sys.executable, "-c", SCRIPT, name]
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def finished(process: subprocess.Popen[str]) -> tuple[bool, str]:
    """Whether the process had the entry built (what runs is loaded from it in any case), and what it logged."""
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    assert out == ""
    return COMPILING in err, err


def built(folder: Path, name: str = "stand-in", **more: str) -> bool:
    return finished(start(folder, name, **more))[0]


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def entries(folder: Path) -> list[Path]:
    return [path for path in (folder / "kernels").iterdir() if path.is_dir()]


def entry(folder: Path) -> Path:
    (only,) = entries(folder)
    return only


def test_the_folder_is_private_and_the_second_process_does_not_compile(tmp_path: Path) -> None:
    first, log = finished(start(tmp_path / "cache"))
    assert first
    assert COMPILING in log
    assert mode(tmp_path / "cache" / "kernels") == 0o700
    assert mode(entry(tmp_path / "cache")) == 0o700
    second, log = finished(start(tmp_path / "cache"))
    assert not second
    assert log == ""


def test_permissions_are_mended(tmp_path: Path) -> None:
    assert built(tmp_path)
    (tmp_path / "kernels").chmod(0o755)
    assert not built(tmp_path)
    assert mode(tmp_path / "kernels") == 0o700


@pytest.mark.parametrize("damage", ["truncate", "alter", "remove"])
@pytest.mark.parametrize("pattern", ["kernel.py", "manifest.json", "code.o"])
def test_a_damaged_entry_is_rebuilt(copied: Path, pattern: str, damage: str) -> None:
    (file,) = entry(copied).glob(pattern)
    content = file.read_bytes()
    middle = len(content) // 2
    if damage == "remove":
        file.unlink()
    elif damage == "truncate":
        file.write_bytes(content[:middle])
    else:
        file.write_bytes(content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :])
    assert built(copied)
    assert not built(copied)


def test_a_copied_folder_is_as_good(copied: Path) -> None:
    assert not built(copied)


def test_an_interrupted_build_is_built_again(copied: Path) -> None:
    """Without a manifest, which is written last."""
    (entry(copied) / "manifest.json").unlink()
    assert built(copied)


def test_processes_at_the_same_time_build_once(tmp_path: Path) -> None:
    processes = [start(tmp_path) for _ in range(4)]
    assert sorted(finished(process)[0] for process in processes) == [False, False, False, True]
    assert not built(tmp_path)


def test_different_kernels_do_not_mix(tmp_path: Path) -> None:
    processes = [start(tmp_path, name, STAND_IN_ENDS_WITH=end) for name, end in (("one", ""), ("two", " + 0.0"))]
    assert [finished(process)[0] for process in processes] == [True, True]
    assert len(entries(tmp_path)) == 2


def test_a_comment_compiles_nothing(whole: Path, copied: Path) -> None:
    """Another request, of which the same code is made, takes the machine code that is there."""
    (before,) = entries(copied)
    assert built(copied, "another", STAND_IN_ENDS_WITH="  # in words")
    assert entries(copied) == [before]
    assert (before / "manifest.json").stat().st_mtime == (entry(whole) / "manifest.json").stat().st_mtime
    assert not built(copied, "another")


@pytest.mark.parametrize("name", [b"", b"../../elsewhere", b"\xff", b"0" * 24])
def test_a_damaged_request_is_made_again(copied: Path, name: bytes) -> None:
    (request,) = (copied / "kernels").glob("*.request")
    request.write_bytes(name)
    assert built(copied)
    assert not built(copied)


def test_what_has_not_been_used_for_long_is_deleted(copied: Path) -> None:
    """When something else is built; and requests for it with it."""
    (old,) = entries(copied)
    (request,) = (copied / "kernels").glob("*.request")
    aged(KEPT_FOR + DAY, old / "manifest.json", request)
    assert built(copied, "another", STAND_IN_ENDS_WITH=" + 0.0")
    assert not old.exists()
    assert not request.exists()
    assert len(entries(copied)) == 1
    assert built(copied)


def test_what_is_used_is_kept(copied: Path) -> None:
    """Also where it was built long ago: its use is noted."""
    (old,) = entries(copied)
    aged(KEPT_FOR + DAY, old / "manifest.json", *(copied / "kernels").glob("*.request"))
    assert not built(copied)
    assert built(copied, "another", STAND_IN_ENDS_WITH=" + 0.0")
    assert not built(copied)


def test_there_is_an_end_to_what_is_kept(copied: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was used longest ago goes first; what was used today stays."""
    first, folder = entry(copied), copied / "kernels"
    others = [Path(shutil.copytree(first, first.with_name(f"{i}" * 24))) for i in range(1, 4)]
    size = sum(file.stat().st_size for file in first.rglob("*") if file.is_file())
    for i, other in enumerate(others, 1):
        aged(i * 2 * DAY, other / "manifest.json")
    monkeypatch.setattr(cache, "KEPT_IN_ALL", 2.5 * size)
    cache.prune(folder)
    assert set(entries(copied)) == {first, others[0]}
    monkeypatch.setattr(cache, "KEPT_IN_ALL", 0)
    cache.prune(folder)
    assert entries(copied) == [first]


def test_an_entry_that_is_being_written_is_left_alone(copied: Path) -> None:
    old = entry(copied)
    aged(KEPT_FOR + DAY, old / "manifest.json")
    with cache._entry_lock(old):
        cache.prune(copied / "kernels")
        assert old.exists()
    cache.prune(copied / "kernels")
    assert not old.exists()


def aged(seconds: float, *files: Path) -> None:
    """Let files look as if they were last used so long ago."""
    then = time.time() - seconds
    for file in files:
        os.utime(file, (then, then))


@pytest.mark.parametrize("crash", ["raise ValueError('no such stage')", "import os; os._exit(3)"])
def test_a_builder_that_fails_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, crash: str) -> None:
    (tmp_path / "failing_builder.py").write_text(f"def build(folder, task):\n    {crash}\n")
    monkeypatch.syspath_prepend(tmp_path)
    request = cache.CodeRequest("failing", "what fails", "failing_builder")
    with pytest.raises(RuntimeError, match="could not be compiled") as raised:
        building.entries([request, request])
    assert ("no such stage" in str(raised.value)) == ("no such stage" in crash)


def test_without_a_folder_kernels_are_compiled_and_not_kept(tmp_path: Path) -> None:
    file = tmp_path / "no folder"
    file.write_text("")
    made, log = finished(start(file))
    assert made
    assert "temporary folder" in log
