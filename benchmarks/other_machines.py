"""friso on an arm64 machine, emulated: `python -m benchmarks.other_machines STAGE.toml`.

Makes a Debian arm64 root (mmdebstrap), installs this checkout into it as a wheel, has a check and a map of 9 x 9 run
there and here, and compares: all verdicts equal, all numbers within `AGREEMENT`; status 1 where they are not. It is run
as root, on Debian with mmdebstrap, arch-test and qemu-user-static, with binfmt_misc mounted. An emulated processor
is slow: the check of a rigid stage took 162 s there and 6 s here.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from benchmarks.report import print_table

CHECKOUT = Path(__file__).parent.parent

AGREEMENT = 1e-3
"""Relative difference that numbers of different processors may have: fused products round differently, and a run over
20 s carries that on."""

OF_SWINGS = {"peak_to_peak", "period"}
"""What is compared where the stage swings: of what comes to rest, they are those of the solver's errors."""

OF_SOLVER = {"steps", "rejected"}
"""What may differ: steps of the solver, which are another number where rounding decides on one."""

DEBIAN, PYTHON, GLIBC = "bookworm", "3.11", 36
"""The release, its Python, and its C library (2.36), which says what wheels run there."""

FOLDER = "opt/friso"
"""Where friso and its packages are in the root."""

MAP = ("--x", "controller.crossover=2 Hz..16 Hz:9", "--y", "friction.viscous=5 N*s/m..40 N*s/m:9", "--verify", "0")


@dataclass(frozen=True)
class Answers:
    """What a machine says, and how long [s] it took."""

    check: dict[str, Any]
    runs: xr.Dataset
    seconds: tuple[float, float]


def make_root(root: Path) -> None:
    """Make a Debian arm64 root that has Python, unless one is there."""
    if not (root / "usr" / "bin" / "python3").exists():
        command = ["mmdebstrap", "--architectures=arm64", "--variant=minbase", "--include=python3", DEBIAN, str(root)]
        subprocess.run(command, check=True)


def install(root: Path) -> None:
    """Install this checkout with its dependencies as wheels for that machine."""
    shutil.rmtree(root / FOLDER, ignore_errors=True)
    platforms = ["manylinux2014_aarch64", *(f"manylinux_2_{minor}_aarch64" for minor in range(17, GLIBC + 1))]
    pip = [sys.executable, "-m", "pip"]
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([*pip, "wheel", "-q", "--no-deps", "-w", folder, str(CHECKOUT)], check=True)
        (wheel,) = Path(folder).glob("friso-*.whl")
        options = ["--only-binary=:all:", "--implementation=cp", f"--python-version={PYTHON}", "--target"]
        options += [str(root / FOLDER), *(f"--platform={platform}" for platform in platforms)]
        subprocess.run([*pip, "install", "-q", *options, str(wheel)], check=True)


def answers(command: list[str], folder: Path) -> Answers:
    """What `command` (friso) says in a folder in which there is stage.toml."""
    begin = time.perf_counter()
    checked = subprocess.run(
        [*command, "check", "stage.toml", "--json"], cwd=folder, stdout=subprocess.PIPE, check=True
    )
    between = time.perf_counter()
    subprocess.run([*command, "map", "stage.toml", *MAP, "--out", "runs.zarr"], cwd=folder, check=True)
    seconds = (between - begin, time.perf_counter() - between)
    return Answers(json.loads(checked.stdout), xr.open_zarr(folder / "runs.zarr").load(), seconds)


def differences(here: Answers, there: Answers) -> list[tuple[str, str]]:
    """What is compared, and by how much it differs: verdicts by their count, numbers relatively."""
    verdicts = [[case["verdict"] for case in machine.check["cases"].values()] for machine in (here, there)]
    rows = [("verdicts of the check", str(sum(a != b for a, b in zip(*verdicts, strict=True))))]
    swings = here.runs["outcome"].values == "swings"
    for name in sorted({str(name) for name in here.runs.data_vars} - OF_SOLVER):
        one, other = here.runs[name].values, there.runs[name].values
        if name in OF_SWINGS:
            one, other = one[swings], other[swings]
        if one.dtype.kind != "f":
            rows.append((f"map, {name}", str(int((one.astype(str) != other.astype(str)).sum()))))
        else:
            rows.append((f"map, {name}", f"{_relative(one, other):.1e}"))
    return rows


def _relative(one: np.ndarray, other: np.ndarray) -> float:
    """The largest relative difference; infinite where only one of them is a number."""
    if (np.isnan(one) != np.isnan(other)).any():
        return np.inf
    scale = np.maximum(np.abs(one), np.abs(other))
    return float(np.nanmax(np.abs(one - other) / np.where(scale > 0, scale, 1.0), initial=0.0))


def main() -> int:
    """Compare both machines; 1 where they differ."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.other_machines", description=__doc__)
    parser.add_argument("stage", type=Path, metavar="STAGE.toml")
    parser.add_argument("--root", type=Path, help="folder of the root, kept and used again")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        root = (options.root or Path(scratch) / "root").absolute()
        make_root(root)
        install(root)
        folders = [Path(scratch) / "here", root / "work"]
        for folder in folders:
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            shutil.copyfile(options.stage, folder / "stage.toml")
        friso = ["python3", "-m", "friso"]
        # with processes and a /proc of its own, whose mount ends with it
        there = ["unshare", "--fork", "--pid", f"--root={root}", "--mount-proc", "--wd=/work", "env", "-i"]
        there += ["PATH=/usr/bin:/bin", "HOME=/work", f"PYTHONPATH=/{FOLDER}", *friso]
        os.environ["PYTHONPATH"] = str(CHECKOUT)
        both = answers([sys.executable, *friso[1:]], folders[0]), answers(there, folders[1])
    rows = differences(*both)
    print_table(("compared", "difference"), rows)
    for words, machine in zip(("here", "arm64, emulated"), both, strict=True):
        print("{}: check {:.0f} s, map {:.0f} s".format(words, *machine.seconds))
    return int(any(float(difference) > AGREEMENT for _, difference in rows))


if __name__ == "__main__":
    sys.exit(main())
