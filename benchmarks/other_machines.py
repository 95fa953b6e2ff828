"""Compare friso on an emulated arm64 machine with friso here.

Run by `python -m benchmarks.other_machines STAGE.toml`. It makes a Debian arm64 root (mmdebstrap), installs this
checkout there as a wheel, runs a check and a map of 9 x 9 on both machines, and compares. All verdicts must be equal,
and all numbers within `AGREEMENT`; otherwise the status is 1. It runs as root, on Debian with mmdebstrap, arch-test and
qemu-user-static, with binfmt_misc mounted. An emulated processor is slow: the check of a rigid stage took 162 s there
and 6 s here.
"""

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

import friso
from benchmarks.report import print_table

CHECKOUT = Path(__file__).parent.parent

AGREEMENT = 1e-3
"""Largest relative difference of numbers between processors: fused products round differently, and a run over 20 s
amplifies that."""

OF_SWINGS = {"peak_to_peak", "period"}
"""Numbers that are compared only if the stage swings. For a stage at rest they show errors of the solver."""

OF_SOLVER = {"steps", "rejected"}
"""Numbers that may differ: steps of the solver, where rounding decides on one."""

DEBIAN, PYTHON, GLIBC = "bookworm", "3.11", 36
"""Debian's release, its Python, and its C library (2.36), which decides on the wheels that run there."""

FOLDER = "opt/friso"
"""Folder of friso and its packages in the root."""

MAP = ("--x", "controller.crossover=2 Hz..16 Hz:9", "--y", "friction.viscous=5 N*s/m..40 N*s/m:9")


@dataclass(frozen=True)
class Answers:
    """Answers of a machine, and the time [s] they took."""

    check: dict[str, Any]
    runs: xr.Dataset
    seconds: tuple[float, float]


def make_root(root: Path) -> None:
    """Make a Debian arm64 root that has Python, unless one is there."""
    if not (root / "usr" / "bin" / "python3").exists():
        command = ["mmdebstrap", "--architectures=arm64", "--variant=minbase", "--include=python3", DEBIAN, str(root)]
        subprocess.run(command, check=True)


def install(root: Path) -> None:
    """Install this checkout and its dependencies as wheels for the emulated machine."""
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
    """Return the answers of `command` (friso) in a folder with stage.toml."""
    begin = time.perf_counter()
    checked = subprocess.run(
        [*command, "check", "stage.toml", "--json"], cwd=folder, stdout=subprocess.PIPE, check=True
    )
    between = time.perf_counter()
    subprocess.run([*command, "map", "stage.toml", *MAP, "--out", "runs.zarr"], cwd=folder, check=True)
    seconds = (between - begin, time.perf_counter() - between)
    return Answers(json.loads(checked.stdout), friso.read_store(folder / "runs.zarr").load(), seconds)


def differences(here: Answers, there: Answers) -> list[tuple[str, str]]:
    """Return the compared items with differences: counts for verdicts, relative for numbers."""
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
    """Return the largest relative difference; infinite if only one of them is a number."""
    if (np.isnan(one) != np.isnan(other)).any():
        return np.inf
    scale = np.maximum(np.abs(one), np.abs(other))
    return float(np.nanmax(np.abs(one - other) / np.where(scale > 0, scale, 1.0), initial=0.0))


def main() -> int:
    """Compare both machines; return 1 if they differ."""
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
        # in a process and mount namespace of its own, whose /proc ends with it
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
