"""What the user waits for and needs: wall time of `friso check`, cold and warm, and the memory of a large sweep."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.report import Goal, clock, print_table, spread
from benchmarks.rigs import FILE

START = "from friso.cli import main; main()"
SWEPT = 100_000

_SWEEP = f"""
import re, resource, time
from pathlib import Path
import numpy as np
import friso
from benchmarks.rigs import rig
from friso.engine.batch import run_chunks
from friso.hunting.measures import measure_runs, measuring_options

rig = rig(locked=False)
n = {SWEPT}
flat = dict(rig.flat)
flat["controller.crossover"] = np.random.default_rng(1).uniform(1, 16, n)
flat["joint.stroke"] = np.random.default_rng(2).uniform(1e-6, 1e-3, n)

def high_water():  # ru_maxrss of a started process begins with that of the one that started it
    return int(re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())[1])

before = high_water()
start, hunting = time.perf_counter(), 0
for runs in run_chunks(rig.kernel, flat, n, measuring_options(1e-4)):
    hunting += int((measure_runs(runs.part(flat), runs).peaks > 0).sum())
peak = max(high_water(), resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
print(before / 1024, peak / 1024, time.perf_counter() - start, hunting)
"""


def _check(cache: Path, *options: str) -> tuple[float, str]:
    """Wall time [s] of one `friso check` and its standard error."""
    processes: list[subprocess.CompletedProcess[str]] = []
    command = [sys.executable, *options, "-c", START, "check", str(FILE)]
    environment = {**os.environ, "FRISO_CACHE_DIR": str(cache)}
    seconds = clock(
        lambda: processes.append(subprocess.run(command, env=environment, capture_output=True, text=True, cwd=cache))
    )
    if processes[0].returncode:
        raise RuntimeError(f"friso check ended with status {processes[0].returncode}: {processes[0].stderr[-500:]}")
    return seconds, processes[0].stderr


def _import_seconds(cache: Path) -> float:
    """Time spent in imports during one `friso check`, by -X importtime (which itself adds a little) [s]."""
    _, errors = _check(cache, "-X", "importtime")
    return sum(int(us) for us in re.findall(r"^import time:\s+(\d+) \|", errors, re.MULTILINE)) * 1e-6


def run_check(repetitions: int) -> list[Goal]:
    """Time `friso check examples/thesis_rig.toml`."""
    with tempfile.TemporaryDirectory(prefix="friso-bench-") as folder:
        cache = Path(folder)
        cold, _ = _check(cache)
        warm = [_check(cache)[0] for _ in range(max(3, 2 * repetitions))]
        imports = [_import_seconds(cache) for _ in range(3)]
    print("\nfriso check examples/thesis_rig.toml, wall time [s]")
    rows = [("cold (empty cache)", f"{cold:.2f}"), ("warm, min / median", spread(warm, digits=2))]
    print_table(("", "s"), [*rows, ("imports of it, min / median", spread(imports, digits=2))])
    return [
        Goal("friso check, warm", "< 3 s", f"{min(warm):.2f} s", min(warm) < 3),
        Goal("friso check, warm, imports", "< 1 s", f"{min(imports):.2f} s", min(imports) < 1),
        Goal("friso check, cold", "< 30 s", f"{cold:.1f} s", cold < 30),
    ]


def run_memory() -> list[Goal]:
    """Peak memory of a sweep of 1e5 runs without traces, in a process of its own."""
    root = Path(__file__).parents[1]
    with tempfile.TemporaryDirectory(prefix="friso-bench-") as cache:
        environment = {**os.environ, "FRISO_CACHE_DIR": cache}
        command = [sys.executable, "-c", _SWEEP]
        processes = [
            subprocess.run(command, env=environment, capture_output=True, text=True, cwd=root) for _ in range(2)
        ]
    for done in processes:
        if done.returncode:
            raise RuntimeError(done.stderr[-800:])
    (_, cold, *_), (before, peak, seconds, hunting) = (map(float, done.stdout.split()) for done in processes)
    print(f"\nSweep of {SWEPT} runs (free rig, crossover x stroke, rtol 1e-4): {seconds:.1f} s, {hunting:.0f} hunt,")
    print(f"  peak memory {peak:.0f} MB, {before:.0f} MB of it before the sweep; ", end="")
    print(f"{cold:.0f} MB, of this process or the compiling one, where the kernel is compiled first")
    about = f"memory of a sweep of {SWEPT} runs, "
    return [
        Goal(about + "kernel in the cache", "< 500 MB", f"{peak:.0f} MB", peak < 500),
        Goal(about + "kernel compiled first", "< 500 MB", f"{cold:.0f} MB", cold < 500),
    ]
