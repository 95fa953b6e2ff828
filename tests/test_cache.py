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
from patience import LIMIT
from systems import posix

from friso.engine import building, cache
from friso.engine import cache as prune
from friso.engine.cache import KEPT_TIME, SECONDS_OF_A_DAY
from friso.engine.settings import BuildSettings
from friso.platform import files
from friso.platform.files import PARTIAL

BUILDER = """
import os

from friso.engine.cache import keep
from friso.engine.machine_code import ArrayKind
from friso.engine.machine_code import object_code
from friso.engine.scalar_code import scalar_llvm

def build(folder, task):
    assert task == b"task"
    print("a plug-in may say something")
    source = "def run(x):\\n    x[0] = 2.0 * x[0]" + os.environ.get("STAND_IN_ENDS_WITH", "") + "\\n"
    return keep(folder, source, lambda module: object_code(scalar_llvm(module.run, [ArrayKind("float64", 1)])))
"""

SCRIPT = """
import sys
import numpy as np
from friso.engine.building import built_entries
from friso.engine.cache import CodeRequest
from friso.engine.machine_code import ArrayKind
from friso.engine.machine_code import Loops, load_object

(entry,) = built_entries([CodeRequest(sys.argv[1], "a stand-in", "stand_in_builder", b"task")])
run = Loops(load_object(entry.code, ["run"])["run"], [ArrayKind("float64", 1)])
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
    """Return whether the process built the entry (code always runs from the cache), and what it logged."""
    out, err = process.communicate(timeout=LIMIT)
    assert process.returncode == 0, err
    assert out == ""
    return COMPILING in err, err


def built(folder: Path, name: str = "stand-in", **more: str) -> bool:
    return finished(start(folder, name, **more))[0]


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def entries(folder: Path) -> list[Path]:
    return [*(folder / "kernels").glob("*.kernel")]


def entry(folder: Path) -> Path:
    (only,) = entries(folder)
    return only


@pytest.mark.slow
@posix
def test_the_folder_is_private_and_the_second_process_does_not_compile(tmp_path: Path) -> None:
    kernels = tmp_path / "cache" / "kernels"
    first, log = finished(start(kernels.parent))
    assert first
    assert COMPILING in log
    assert mode(kernels) == 0o700
    assert {mode(file) for file in kernels.iterdir()} == {0o600}
    kernels.chmod(0o755)
    second, log = finished(start(kernels.parent))
    assert not second
    assert log == ""
    assert mode(kernels) == 0o700  # mended


@pytest.mark.slow
@pytest.mark.parametrize("damage", ["truncate", "alter", "name"])
@pytest.mark.parametrize("pattern", ["*.kernel", "*.request"])
def test_a_damaged_file_is_made_again(copied: Path, pattern: str, damage: str) -> None:
    (file,) = (copied / "kernels").glob(pattern)
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    damaged = {"truncate": content[: len(content) // 2], "alter": content, "name": b"../../elsewhere"}
    file.write_bytes(damaged[damage])
    assert built(copied)
    assert not built(copied)


@pytest.mark.slow
def test_processes_at_the_same_time_build_once(tmp_path: Path) -> None:
    processes = [start(tmp_path) for _ in range(4)]
    assert sorted(finished(process)[0] for process in processes) == [False, False, False, True]
    assert not built(tmp_path)


@pytest.mark.slow
def test_a_comment_compiles_nothing(whole: Path, copied: Path) -> None:
    """Another request, of which the same code is made, takes the machine code that is there."""
    (before,) = entries(copied)
    assert built(copied, "another", STAND_IN_ENDS_WITH="  # in words")
    assert entries(copied) == [before]
    assert before.stat().st_mtime == entry(whole).stat().st_mtime
    assert not built(copied, "another")


@pytest.mark.slow
def test_what_has_not_been_used_for_long_is_deleted_when_something_is_built(copied: Path) -> None:
    """And requests for it with it; an entry that was built long ago and is in use stays."""
    (old,) = entries(copied)
    (request,) = (copied / "kernels").glob("*.request")
    aged(KEPT_TIME + SECONDS_OF_A_DAY, old, request)
    assert not built(copied)  # its use is recorded
    assert built(copied, "another", STAND_IN_ENDS_WITH=" + 0.0")
    assert not built(copied)
    aged(KEPT_TIME + SECONDS_OF_A_DAY, old, request)
    assert built(copied, "third", STAND_IN_ENDS_WITH=" + 1.0 - 1.0")
    assert not old.exists()
    assert not request.exists()
    assert len(entries(copied)) == 2


def test_what_is_kept_has_an_end(copied: Path) -> None:
    """Entries unused for longest go first, and halves that killed processes left; entries in use and of today stay."""
    first, folder = entry(copied), copied / "kernels"
    others = [Path(shutil.copy(first, first.with_name(f"{i}" * 24 + ".kernel"))) for i in range(1, 4)]
    drafts = [folder / f"{name}.kernel.x{PARTIAL}" for name in ("old", "new")]
    for draft in drafts:
        draft.write_bytes(b"half")
    size = first.stat().st_size
    aged(2 * SECONDS_OF_A_DAY, drafts[0])
    for i, other in enumerate(others, 1):
        aged(i * 2 * SECONDS_OF_A_DAY, other)
    with BuildSettings(kept_size=int(2.5 * size)).in_use():
        prune.prune(folder)
    assert {*entries(copied)} == {first, others[0]}
    assert [draft.exists() for draft in drafts] == [False, True]
    with BuildSettings(kept_size=0).in_use():
        with cache.entry_lock(others[0]):
            prune.prune(folder)
        assert others[0].exists()
        prune.prune(folder)
    assert entries(copied) == [first]


def aged(seconds: float, *files: Path) -> None:
    """Let files look as if they were last used so long ago."""
    then = time.time() - seconds
    for file in files:
        os.utime(file, (then, then))


@pytest.mark.parametrize("crash", ["raise ValueError('no such stage: µ −')", "import os; os._exit(3)"])
def test_a_builder_that_fails_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, crash: str) -> None:
    (tmp_path / "failing_builder.py").write_text(f"def build(folder, task):\n    {crash}\n", encoding="utf-8")
    monkeypatch.setenv("PYTHONIOENCODING", "cp1252")  # as on Windows
    monkeypatch.syspath_prepend(tmp_path)
    request = cache.CodeRequest("failing", "what fails", "failing_builder")
    with pytest.raises(RuntimeError, match="could not be compiled") as raised:
        building.built_entries([request, request])
    assert ("no such stage: µ −" in str(raised.value)) == ("no such stage" in crash)


FULL = """
from friso.engine.cache import is_passing, keep

def build(folder, task):
    if not is_passing(folder) or task:
        raise OSError(28, "No space left", str(folder))
    return keep(folder, "NUMBER = 3", lambda module: b"")
"""


@pytest.fixture
def full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    (tmp_path / "full_builder.py").write_text(FULL)
    monkeypatch.syspath_prepend(tmp_path)
    yield
    cache._UNWRITABLE.clear()
    cache.cache_folder.cache_clear()


@pytest.mark.usefixtures("full_disk")
def test_where_the_disk_is_full_kernels_are_compiled_and_not_kept(caplog: pytest.LogCaptureFixture) -> None:
    for name in ("one", "two"):
        (entry,) = building.built_entries([cache.CodeRequest(name, "what needs room", "full_builder")])
        assert entry.module().NUMBER == 3
    assert caplog.text.count("temporary folder and not kept: No space left") == 1
    with pytest.raises(OSError, match="No space left"):  # all disks are full
        building.built_entries([cache.CodeRequest("full", "what needs room", "full_builder", b"always")])


def test_the_folder_is_one_as_users_write_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A ~ stands for the user's own folder; the reason why a file is no folder is told in words."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    monkeypatch.setenv(cache.FOLDER_VARIABLE, os.path.join("~", "kept"))
    folder = cache.cache_folder.__wrapped__()
    assert folder == tmp_path / "kept" / "kernels"
    (folder / "trial-left").mkdir(mode=0o700)  # by a process that was killed
    assert [*cache.cache_folder.__wrapped__().iterdir()] == []
    (tmp_path / "kept" / "file").touch()
    monkeypatch.setenv(cache.FOLDER_VARIABLE, os.path.join("~", "kept", "file"))
    cache.remove_if_passing(cache.cache_folder.__wrapped__())
    (warning,) = caplog.messages
    assert "Errno" not in warning
    assert str(tmp_path / "kept" / "file") in warning


# nobody else


def belongs_to_another(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Give a file away; where this user cannot, be another."""
    if os.geteuid() == 0:
        os.chown(path, 12345, -1)
    else:
        me = os.geteuid()
        monkeypatch.setattr(os, "geteuid", lambda: me + 1)


@posix
@pytest.mark.slow
@pytest.mark.parametrize("way", ["open", "link", "link below", "no folder"])
def test_what_is_no_folder_of_its_user_alone_is_left_alone(copied: Path, tmp_path: Path, way: str) -> None:
    """friso may not close it: the kernel is compiled elsewhere, and nothing is loaded from the folder."""
    folder = tmp_path / way
    if way == "open":
        folder = copied
        folder.chmod(0o777)
    elif way == "link":
        folder.symlink_to(copied)
    elif way == "link below":
        folder.mkdir()
        (folder / "kernels").symlink_to(copied / "kernels")
    else:
        folder.write_text("")
    made, log = finished(start(folder))
    assert made
    assert log.count("temporary folder") == 1
    assert ("is a symbolic link" in log) == ("link" in way)
    assert way != "open" or mode(folder) == 0o777


@posix
def test_what_belongs_to_others_or_is_open_to_them_is_not_read(
    copied: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = os.umask(0)
    try:
        files.make_private(tmp_path / "a" / "b")
    finally:
        os.umask(before)
    assert mode(tmp_path / "a") == mode(tmp_path / "a" / "b") == 0o700
    file, link, pipe = tmp_path / "file", tmp_path / "link", tmp_path / "pipe"
    files.write_private(file, b"content")
    link.symlink_to(file)
    os.mkfifo(pipe)
    assert files.read_private(file) == b"content"
    for path in (link, pipe):
        with pytest.raises(OSError, match=r"link|no file|levels"):
            files.read_private(path)
    file.chmod(0o620)
    with pytest.raises(PermissionError):
        files.read_private(file)
    folder = copied / "kernels"
    folder.chmod(0o755)
    for path, use in ((entry(copied), files.read_private), (folder, files.make_private)):
        with monkeypatch.context() as patch:
            belongs_to_another(path, patch)
            with pytest.raises(PermissionError, match="belongs to another user"):
                use(path)
    assert mode(folder) == 0o755


@posix
@pytest.mark.parametrize("name", [".", "kernels"])
def test_nothing_is_loaded_once_a_folder_on_the_way_is_open_to_others(copied: Path, name: str) -> None:
    """Owner and mode are checked at every load; the folder of code itself is closed again."""
    (request,) = (copied / "kernels").glob("*.request")
    assert cache._read(request) is not None
    (copied / name).chmod(0o777)
    assert (cache._read(request) is None) == (name == ".")
    assert mode(copied / "kernels") == 0o700
