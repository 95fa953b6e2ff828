"""What friso does on Windows and on macOS, as far as that can be seen without them (foreign_host/sitecustomize.py)."""

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

from friso.cli.drafts import DRAFTS

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

pytestmark = pytest.mark.parametrize("host", ["win32", "darwin"])


def started(host: str, folder: Path, *arguments: object, **variables: str) -> subprocess.Popen[str]:
    """`friso ARGUMENTS` in a folder, on the host."""
    paths = os.pathsep.join([str(PRELOAD), *(path for path in sys.path if path)])
    console = "cp1252" if host == "win32" else "utf-8"
    environ = {**os.environ, "PYTHONPATH": paths, "FRISO_FOREIGN_HOST": host, "PYTHONIOENCODING": console, **variables}
    command = [sys.executable, "-m", "friso.cli", *map(str, arguments)]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, cwd=folder, env=environ, stdout=pipe, stderr=pipe, text=True, encoding=console)


def friso(host: str, folder: Path, *arguments: object, **variables: str) -> str:
    """What it prints; it must succeed."""
    with started(host, folder, *arguments, **variables) as process:
        out, err = process.communicate()
    assert process.returncode == 0, err
    return out


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


def test_check_writes_its_page(host: str, axis: Path) -> None:
    document = json.loads(friso(host, axis, "check", "axis.toml", "--json", "--out", "Größe"))
    assert document["cases"]["given"]["verdict"] in ("hunts", "settles", "bistable", "transient")
    assert {path.name for path in (axis / "Größe").iterdir()} >= {"report.html", ".friso-output"}
    assert Page((axis / "Größe" / "report.html").read_text(encoding="utf-8")).text


def test_files_are_replaced(host: str, axis: Path) -> None:
    for _ in range(2):
        friso(host, axis, "simulate", "axis.toml", "--out", "run")
    assert not list(axis.rglob(f"{DRAFTS}*"))


def test_a_map_is_killed_resumed_and_drawn_again(host: str, axis: Path, whole: Path) -> None:
    process = started(host, axis, "map", "axis.toml", *SPAN, "--out", "killed.zarr", "--workers", "2")
    while not (axis / "killed.zarr").exists() and process.poll() is None:
        time.sleep(0.01)
    process.kill()
    process.communicate()
    friso(host, axis, "map", "axis.toml", *SPAN, "--out", "killed.zarr")
    with xr.open_zarr(whole) as one, xr.open_zarr(axis / "killed.zarr") as other:
        assert one.identical(other)


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


def test_two_processes_share_an_empty_cache(host: str, axis: Path, tmp_path: Path) -> None:
    arguments = ("simulate", "axis.toml", "--json")
    folder = str(tmp_path / "kernels")
    both = [started(host, axis, *arguments, FRISO_CACHE_DIR=folder) for _ in range(2)]
    documents = [json.loads(process.communicate()[0]) for process in both]
    assert documents[0] == documents[1]
