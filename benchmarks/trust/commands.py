"""Test commands that write, as processes.

They are killed, interrupted, short of disk, run two at once, or lose their workers.
"""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

import psutil

from benchmarks.trust.inputs import ANSWERS, AXIS, DRIVE, LEAVES, RIG, SPEC, STICK_SLIP, folder_until_the_end
from friso.interface.output_folder import DRAFTS, write

FRISO = [sys.executable, "-m", "friso"]
SMALL = ["--x", "controller.crossover=2 Hz..16 Hz:24", "--y", "joint.stroke=0.1 mm..1 mm:24", "--rtol", "1e-8"]
MAP = ["map", RIG, *SMALL, "--out", "a.zarr"]
OUT = ["--out", "out"]

QUICK: dict[str, list[str]] = {
    "bode": ["bode", RIG, *OUT],
    "simulate": ["simulate", RIG, *OUT],
    "flexure": ["flexure", LEAVES, *OUT],
    "export": ["export", STICK_SLIP, "--to", "linuxcnc", "--set", "machine_unit=mm",
               "--set", "force_per_output=20 N", *OUT],
    "logs": ["logs", "log.csv", *OUT],
    "init": ["init", "stage.toml"],
    "specification": ["init", "stage.toml", "--spec", RIG],
    "parameters": ["init", "stage.toml", "--from", AXIS, *(f"--set={answer}" for answer in ANSWERS)],
    "example": ["example", "thesis_rig", "stage.toml"],
    "map": MAP,
}  # fmt: skip
"""Commands that write and end within seconds, by the name of the case."""

WRITING: dict[str, list[str]] = {
    **QUICK,
    "check": ["check", RIG, *OUT],
    "boundary": ["boundary", RIG, "--x", "controller.crossover=4 Hz..8 Hz", *OUT],
    "design": ["design", RIG, SPEC, *OUT],
    "identify": ["identify", "log.csv", "--map", "position=position", *OUT],
    "rig": ["rig", "stiffness", DRIVE, *OUT],
    "compare": ["compare", DRIVE, "--machines", "20", *OUT],
    "tune": ["tune", RIG, "--only", "controller", *OUT],
    "reproduce": ["reproduce", "--points", "3", "--draws", "0", *OUT],
    "guideline": ["guideline", "--samples", "64", *OUT],
}
"""All commands that write."""


LONGEST = 8.0
"""Longest time [s] after its start at which a command is killed or interrupted."""

PATIENCE = 120
"""Time [s] that a command may take to end on a busy machine, once it has to."""


class LeftOut(Exception):
    """Error: a case cannot be run here, with the reason."""


def killed(rng: random.Random, folder: Path) -> None:
    """Kill a command up to three times.

    No file may be partial, and the next command that writes there removes leftovers. A command that ends quickly, run
    again, must leave what it leaves undisturbed: the same bytes, and nothing else.
    """
    name = rng.choice([*WRITING, "map"])
    _prepare(name, folder)
    for _ in range(rng.randrange(1, 4)):
        with _started(folder, WRITING[name]) as process:
            _moment(rng, folder, process)
            process.kill()
    if name in QUICK:
        done = _finished(folder, [*WRITING[name], "--overwrite"])
        assert done.returncode == 0, f"{name}: {done.stderr[-300:]}"
        _assert_as(_undisturbed(name), folder, name)
    else:
        files = {folder / "out" / "next.txt": "", folder / "next.txt": ""}
        write(files, overwrite=True)
        _whole_or_nothing(name, folder, False)


def interrupted(rng: random.Random, folder: Path) -> None:
    """Send Ctrl-C or a termination.

    The status must be the one that shells know, with one line (or two, if a study can be resumed), and files must be
    complete or absent.
    """
    name = rng.choice([*WRITING])
    number = rng.choice([signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
    _prepare(name, folder)
    with _started(folder, WRITING[name]) as process:
        while process.poll() is None and not _takes_signals(process.pid):
            time.sleep(0.01)  # Python itself starts, and ends in its own way
        _moment(rng, folder, process)
        process.send_signal(number)
        err = process.communicate(timeout=PATIENCE)[1]
    assert process.returncode in (0, 128 + number), f"{name}: status {process.returncode}: {err[-300:]}"
    assert "Traceback" not in err, f"{name}: {err[-300:]}"
    assert "Warning" not in err, f"{name}: {err[-300:]}"
    words = "interrupted" if number == signal.SIGINT else "terminated"
    assert process.returncode == 0 or err.rstrip().endswith(f"friso: {words}"), f"{name}: {err[-300:]}"
    _whole_or_nothing(name, folder, process.returncode == 0)


def short_of_disk(rng: random.Random, folder: Path) -> None:
    """Limit the size of files.

    There must be one message, status 1, and files that are complete or absent.
    """
    name = rng.choice([*QUICK])
    import resource  # Windows has none

    most = int(10 ** rng.uniform(1, 6.5))
    _prepare(name, folder)

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))

    done = subprocess.run([*FRISO, *WRITING[name]], cwd=folder, capture_output=True, text=True, preexec_fn=limit)
    _assert_told(f"{name}, {most} bytes", done)
    _whole_or_nothing(name, folder, done.returncode == 0)


def small_disk(rng: random.Random, folder: Path) -> None:
    """Run out of space on a small disk.

    There must be one message, status 1, and files that are complete or absent. The case is left out if this user may
    mount no disk.
    """
    name, size = rng.choice([*QUICK]), rng.choice((16, 64, 256, 1024, 4096))
    disk = folder / "disk"
    disk.mkdir()
    if "log.csv" in WRITING[name]:  # which is there before
        size += 8 + (_undisturbed("simulate") / "out" / "log.csv").stat().st_size // 1024
    mount = ["mount", "-t", "tmpfs", "-o", f"size={size}k", "tmpfs", str(disk)]
    if shutil.which("mount") is None or subprocess.run(mount, capture_output=True).returncode:
        raise LeftOut("no disk can be mounted")
    try:
        _prepare(name, disk)
        done = _finished(disk, WRITING[name])
        _assert_told(f"{name} on {size} kB", done)
        _whole_or_nothing(name, disk, done.returncode == 0)
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def read_only(rng: random.Random, folder: Path) -> None:
    """Write into a read-only folder.

    The status must be 2 before anything is computed, and nothing may be written.
    """
    name, below = rng.choice([*WRITING]), rng.random() < 0.5
    closed = folder / "closed"
    closed.mkdir()
    _prepare(name, closed)
    line = [word.replace("out", "there/out") if below and word == "out" else word for word in WRITING[name]]
    before = _tree(closed)
    closed.chmod(0o555)
    try:
        done = subprocess.run([*_without_root_s_rights(), *FRISO, *line], cwd=closed, capture_output=True, text=True)
    finally:
        closed.chmod(0o755)
    assert done.returncode == 2, f"{name}: status {done.returncode}: {done.stderr[-300:]}"
    assert "expected:" in done.stderr, f"{name}: {done.stderr[-300:]}"
    assert "Traceback" not in done.stderr, f"{name}: {done.stderr[-600:]}"
    assert _tree(closed) == before, f"{name}: wrote {sorted(_tree(closed).keys() - before.keys())}"


def _without_root_s_rights() -> list[str]:
    """Return what to put before a command so that permissions apply.

    Root may write everywhere.
    """
    rights = "-dac_override,-dac_read_search,-fowner"
    return ["setpriv", f"--bounding-set={rights}", f"--inh-caps={rights}"] if os.geteuid() == 0 else []


def two_at_once(rng: random.Random, folder: Path) -> None:
    """Run two maps on one store with an empty cache: one runs, the other is refused or done.

    The other may find all cells done.
    """
    environ = {**os.environ, "FRISO_CACHE_DIR": str(folder / "cache")}
    first = _started(folder, MAP, environ)
    time.sleep(rng.uniform(0.0, 3.0))
    with first, _started(folder, MAP, environ) as second:
        said = [process.communicate(timeout=300)[1] for process in (first, second)]
    codes = sorted(process.returncode for process in (first, second))
    assert codes in ([0, 0], [0, 1], [0, 2]), f"{codes}: {said}"  # 1: figures that the other had written
    assert "Traceback" not in "".join(said), said
    shutil.rmtree(folder / "cache")
    _assert_as(_undisturbed("map"), folder, "map")


def without_workers(rng: random.Random, folder: Path) -> None:
    """Kill a worker: the map must end at once in one sentence, and continue where it was."""
    with _started(folder, [*MAP, "--workers", str(min(2, os.cpu_count() or 1))]) as process:
        while process.poll() is None and not any(folder.glob("a.zarr/.friso/[0-9]*")):  # none of the study is done
            time.sleep(0.01)
        time.sleep(rng.uniform(0.0, 0.5))
        if process.poll() is not None:
            raise LeftOut("the map was done")
        rng.choice([p for p in psutil.Process(process.pid).children() if "spawn_main" in str(p.cmdline())]).kill()
        err = process.communicate(timeout=PATIENCE)[1]
    assert process.returncode in (0, 1), f"{process.returncode}: {err[-300:]}"
    assert "Traceback" not in err, err[-600:]
    _assert_goes_on(folder)


def without_scheduler(rng: random.Random, folder: Path) -> None:
    """End the scheduler while a map runs: one sentence is due, and a run that resumes."""
    place = folder / "scheduler.json"
    with subprocess.Popen([sys.executable, "-c", SCHEDULER, str(place)], stderr=subprocess.DEVNULL) as scheduler:
        while not place.exists() and scheduler.poll() is None:
            time.sleep(0.1)
        address = place.read_text()
        with _started(folder, [*MAP, "--scheduler", address]) as process:
            time.sleep(rng.uniform(1.0, LONGEST))
            _kill_all(scheduler.pid)
            err = process.communicate(timeout=PATIENCE)[1]
    place.unlink()
    assert process.returncode in (0, 1, 2), f"{process.returncode}: {err[-300:]}"
    assert "Traceback" not in err, err[-600:]
    _assert_goes_on(folder)


SCHEDULER = """
import os, sys, time
from distributed import LocalCluster

if __name__ == "__main__":
    with LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as cluster:
        with open(sys.argv[1] + ".new", "w") as file:
            file.write(cluster.scheduler_address)
        os.replace(sys.argv[1] + ".new", sys.argv[1])
        time.sleep(600)
"""

COMMANDS: dict[str, Callable[[random.Random, Path], None]] = {
    "killed": killed,
    "interrupted": interrupted,
    "short-of-disk": short_of_disk,
    "small-disk": small_disk,
    "read-only": read_only,
    "two-at-once": two_at_once,
    "without-workers": without_workers,
    "without-scheduler": without_scheduler,
}
"""Campaigns by name."""


def _started(folder: Path, arguments: list[str], environ: dict[str, str] | None = None) -> subprocess.Popen[str]:
    pipe = subprocess.PIPE
    return subprocess.Popen([*FRISO, *arguments], cwd=folder, stdout=pipe, stderr=pipe, text=True, env=environ)


def _finished(folder: Path, arguments: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*FRISO, *arguments], cwd=folder, capture_output=True, text=True)


def _takes_signals(number: int) -> bool:
    """Tell whether friso's own code runs in a process, and handles the signals that end it."""
    status = Path(f"/proc/{number}/status").read_text()
    caught = int(next(line.split()[1] for line in status.splitlines() if line.startswith("SigCgt")), 16)
    return bool(caught & 1 << (signal.SIGTERM - 1))


def _moment(rng: random.Random, folder: Path, process: subprocess.Popen[str]) -> None:
    """Wait for a random moment, or until something is written."""
    at_writing = rng.random() < 0.5
    end, after = time.monotonic() + (LONGEST if at_writing else rng.uniform(0.0, LONGEST)), rng.expovariate(5.0)
    while time.monotonic() < end and process.poll() is None:
        if at_writing and any(folder.glob(f"**/{DRAFTS}*")):
            time.sleep(after)
            return
        time.sleep(0.01)


def _prepare(name: str, folder: Path) -> None:
    """Put the input of a command into its folder."""
    if "log.csv" in WRITING[name]:
        shutil.copyfile(_undisturbed("simulate") / "out" / "log.csv", folder / "log.csv")


@cache
def _undisturbed(name: str) -> Path:
    """Return a folder with what a command writes if nothing disturbs it."""
    folder = folder_until_the_end(name)
    _prepare(name, folder)
    done = _finished(folder, WRITING[name])
    assert done.returncode == 0, done.stderr
    if name == "simulate":
        (log,) = (folder / "out").glob("*.csv")
        log.rename(folder / "out" / "log.csv")
    return folder


def _assert_as(expected: Path, folder: Path, name: str) -> None:
    """Check that a folder holds the expected files.

    Raises AssertionError for other files, or other contents.
    """
    there, here = _tree(expected), _tree(folder)
    if name == "simulate":
        there = {key: value for key, value in there.items() if not key.endswith(".csv")}
        here = {key: value for key, value in here.items() if not key.endswith(".csv")}
    assert {*there} == {*here}, f"{name}: left behind or lost: {sorted({*there} ^ {*here})}"
    different = [key for key, content in there.items() if here[key] != content]
    assert not different, f"{name}: other than undisturbed: {different}"


def _assert_goes_on(folder: Path) -> None:
    done = _finished(folder, [*MAP, "--overwrite"])
    assert done.returncode == 0, done.stderr[-300:]
    _assert_as(_undisturbed("map"), folder, "map")


def _assert_told(what: str, done: subprocess.CompletedProcess[str]) -> None:
    assert done.returncode in (0, 1, 2), f"{what}: status {done.returncode}: {done.stderr[-300:]}"
    assert "Traceback" not in done.stderr, f"{what}: {done.stderr[-600:]}"


def _kill_all(number: int) -> None:
    """Kill a process and the processes that it started."""
    parent = psutil.Process(number)
    for process in (*parent.children(recursive=True), parent):
        with suppress(psutil.NoSuchProcess):
            process.kill()


def _tree(folder: Path) -> dict[str, bytes]:
    """Return the contents of the files of a folder, without locks."""
    files = (path for path in folder.rglob("*") if path.is_file() and not path.name.endswith(".lock"))
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def _whole_or_nothing(name: str, folder: Path, done: bool) -> None:
    """Check that each file of a command is complete or not there, and that all are there if it is `done`.

    Raises AssertionError for partial files. A map keeps its store, and finished parts of long work are kept in a folder
    of their own.
    """
    left = [path.name for path in folder.rglob("*") if path.name.startswith(DRAFTS)]
    assert not left, f"{name} left {left}"
    if name not in QUICK:
        return
    there, here = _tree(_undisturbed(name)), _tree(folder)
    files = {
        key for key in there if not key.startswith("a.zarr/") and not (name == "simulate" and key.endswith(".csv"))
    }
    lost = {key for key in files if key not in here}
    assert not (done and lost), f"{name} is done without {sorted(lost)}"
    partial = [key for key in files - lost if here[key] != there[key]]
    assert not partial, f"{name} wrote parts of {partial}"
