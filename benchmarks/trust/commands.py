"""Commands that write, killed, interrupted, short of disk, and two at a time."""

from __future__ import annotations

import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from benchmarks.trust.readers import RIG

FRISO = [sys.executable, "-m", "friso.cli"]
MAP = ["map", str(RIG), "--x", "controller.crossover=2 Hz..16 Hz:24", "--y", "joint.stroke=0.1 mm..1 mm:24",
       "--rtol", "1e-8", "--out", "a.zarr"]  # fmt: skip
WRITING = {
    "bode": ["bode", str(RIG), "--out", "out"],
    "simulate": ["simulate", str(RIG), "--out", "out"],
    "init": ["init", "stage.toml"],
    "map": MAP,
}
"""Commands that write, by name."""

LONGEST = 8.0
"""How long [s] after its start a command is killed or interrupted, at most."""


def killed(rng: random.Random, folder: Path) -> None:
    """A map killed up to three times and resumed holds what one does that never was: bytes of figure, page and numbers,
    and nothing else is left."""
    for _ in range(rng.randrange(1, 4)):
        with _started(folder, MAP) as process:
            time.sleep(rng.uniform(0.2, LONGEST))
            process.kill()
    done = _finished(folder, MAP)
    assert done.returncode == 0, done.stderr
    expected = _undisturbed()
    names = {path.name for path in folder.iterdir()}
    assert names == {path.name for path in expected.iterdir()}, f"left behind or lost: {names}"
    different = [name for name, content in _tree(expected).items() if _tree(folder).get(name) != content]
    assert not different, f"other than undisturbed: {different}"


def interrupted(rng: random.Random, folder: Path) -> None:
    """Ctrl-C or a termination: the status that shells know and one line (or two, where a study can be resumed), and the
    files whole or not at all."""
    name = rng.choice([*WRITING])
    number = rng.choice([signal.SIGINT, signal.SIGTERM])
    with _started(folder, WRITING[name]) as process:
        time.sleep(rng.uniform(0.5, LONGEST))
        process.send_signal(number)
        err = process.communicate(timeout=120)[1]
    assert process.returncode in (0, 128 + number), f"{name}: status {process.returncode}: {err[-300:]}"
    assert "Traceback" not in err, f"{name}: {err[-300:]}"
    _whole_or_nothing(name, folder, process.returncode == 0)


def short_of_disk(rng: random.Random, folder: Path) -> None:
    """No file may become larger than some size: one message, status 1, and the files whole or not at all."""
    name = rng.choice([*WRITING])
    most = int(10 ** rng.uniform(1, 6.5))

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))

    done = subprocess.run([*FRISO, *WRITING[name]], cwd=folder, capture_output=True, text=True, preexec_fn=limit)
    assert done.returncode in (0, 1, 2), f"{name}, {most} bytes: status {done.returncode}: {done.stderr[-300:]}"
    assert "Traceback" not in done.stderr, f"{name}, {most} bytes: {done.stderr[-600:]}"
    _whole_or_nothing(name, folder, done.returncode == 0)


def two_at_once(rng: random.Random, folder: Path) -> None:
    """Two maps on one store and one cache that is empty: one of them runs, the other is refused or finds all done."""
    environ = {**os.environ, "FRISO_CACHE_DIR": str(folder / "cache")}
    first = _started(folder, MAP, environ)
    time.sleep(rng.uniform(0.0, 3.0))
    with first, _started(folder, MAP, environ) as second:
        said = [process.communicate(timeout=300)[1] for process in (first, second)]
    codes = sorted(process.returncode for process in (first, second))
    assert codes in ([0, 0], [0, 2]), f"{codes}: {said}"
    assert "Traceback" not in "".join(said), said
    shutil.rmtree(folder / "cache")
    different = [name for name, content in _tree(_undisturbed()).items() if _tree(folder).get(name) != content]
    assert not different, f"other than alone: {different}"


def damaged_store(rng: random.Random, folder: Path) -> None:
    """A store some bytes of which are others is mended by the next run, or refused: never are other numbers shown."""
    shutil.copytree(_undisturbed() / "a.zarr", folder / "a.zarr")
    files = sorted(path for path in (folder / "a.zarr").rglob("*") if path.is_file() and path.stat().st_size)
    file = rng.choice(files)
    content = bytearray(file.read_bytes())
    for _ in range(rng.choice((1, 1, 3))):
        content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
    file.write_bytes(content[: rng.choice((len(content), len(content), rng.randrange(len(content))))])
    done = _finished(folder, ["map", "a.zarr", "--json"])
    assert done.returncode in (0, 2), f"{file.name}: {done.returncode}: {done.stderr[-300:]}"
    assert "Traceback" not in done.stderr, done.stderr[-600:]
    if done.returncode == 0:
        for form in ("svg", "png"):
            same = (folder / f"a.{form}").read_bytes() == (_undisturbed() / f"a.{form}").read_bytes()
            assert same, f"another figure after damage to {file}"


COMMANDS = {
    "damaged-stores": damaged_store,
    "killed": killed,
    "interrupted": interrupted,
    "short-of-disk": short_of_disk,
    "two-at-once": two_at_once,
}
"""The campaigns by name."""


def _started(folder: Path, arguments: list[str], environ: dict[str, str] | None = None) -> subprocess.Popen[str]:
    pipe = subprocess.PIPE
    return subprocess.Popen([*FRISO, *arguments], cwd=folder, stdout=pipe, stderr=pipe, text=True, env=environ)


def _finished(folder: Path, arguments: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*FRISO, *arguments], cwd=folder, capture_output=True, text=True)


@cache
def _undisturbed() -> Path:
    """A folder with the map that nothing happened to."""
    folder = Path(mkdtemp(prefix="friso-trust-map-"))
    done = _finished(folder, MAP)
    assert done.returncode == 0, done.stderr
    return folder


def _tree(folder: Path) -> dict[str, bytes]:
    """What is in the files of a folder, but for locks."""
    files = (path for path in folder.rglob("*") if path.is_file() and not path.name.endswith(".lock"))
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def _whole_or_nothing(name: str, folder: Path, done: bool) -> None:
    """Raises AssertionError where files of a command are there in part. A map keeps its store."""
    left = [path.name for path in folder.rglob("*") if path.name.startswith(".friso-draft")]
    assert not left, f"{name} left {left}"
    if name == "map":
        views = sorted(path.suffix for path in folder.iterdir() if path.is_file())
        assert len(views) in ((0,) if not views else (4,)), f"map wrote {views} alone"
    elif name != "init":
        marker = (folder / "out" / ".friso-output").exists()
        written = [path for path in folder.rglob("*") if path.is_file()]
        assert marker or not written, f"{name} wrote {written} alone"
        assert marker or not done, f"{name} is done without its files"
