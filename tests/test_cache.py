"""The kernels on disk: private, rebuilt when damaged, and safe from each other's processes.

A stand-in of a few lines takes a kernel's place, so that compiling it takes a fraction of a second.
"""

import os
import shutil
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

BUILDER = """
import os
import sys
from pathlib import Path

from numba import types

from friso.engine.cache import keep

sys.stdin.buffer.read()
source = "from numba import njit\\n\\n@njit(cache=True)\\ndef run(x):\\n    return 2.0 * x"
source += os.environ.get("STAND_IN_ENDS_WITH", "") + "\\n"
print(keep(Path(sys.argv[1]), source, lambda module: module.run.compile((types.float64,))), end="")
"""

SCRIPT = """
import sys
from friso.engine import cache
from numba import types

module = cache.load_or_build(sys.argv[1], "stand_in_builder", b"task", lambda m: m.run.compile((types.float64,)))
assert module.run(21.0) == 42.0
stats = module.run.stats
print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))
"""

COMPILING = "compiling; the next run"


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
    """Whether the process built the entry (what runs is loaded from it in any case), and what it logged."""
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    assert out.split() == ["1", "0"]  # Numba's cache: a hit, no miss
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
    assert "next run finds it compiled" in log
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
@pytest.mark.parametrize("pattern", ["kernel.py", "manifest.json", "**/*.nbi", "**/*.nbc"])
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


def test_a_file_that_does_not_belong_is_not_run(copied: Path) -> None:
    """One more file of machine code beside the others is an altered entry too."""
    (file,) = entry(copied).glob("**/*.nbc")
    file.with_name("other.nbc").write_bytes(b"anything")
    assert built(copied)


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


def test_numba_may_have_a_folder_of_its_own(tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    assert built(tmp_path / "cache", NUMBA_CACHE_DIR=str(elsewhere))
    assert list(elsewhere.iterdir()) == []
    assert not built(tmp_path / "cache")


def test_without_a_folder_kernels_are_compiled_and_not_kept(tmp_path: Path) -> None:
    file = tmp_path / "no folder"
    file.write_text("")
    made, log = finished(start(file))
    assert made
    assert "temporary folder" in log
