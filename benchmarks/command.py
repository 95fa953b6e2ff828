"""Measure what a user waits for: ``python -m benchmarks.command``.

It prints the times of the README's commands, each in a fresh process. `benchmarks.engine` uses it for `friso check` and
the memory of a large sweep.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from benchmarks.report import Goal, clock, machine, print_table, spread
from benchmarks.rigs import FILE

START = "from friso.cli import main; main()"
ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "speed.md"
PATIENCE = 60.0
"""Time [s] after which a command is not repeated any more."""

LOCKED = "--set joint.locked=true"
CROSSOVER = '--x controller.crossover="1 Hz..40 Hz"'
THESIS_MAP = '--x controller.crossover="1 Hz..16 Hz:{n}" --y joint.stroke="1 um..1 mm:{n}"'
MAKES_LOG = 'simulate {servo} --sample-time "1 ms" --out response'
"""The command that makes `{log}`, a log to identify."""

DRAWN = '--set friction.static="3 N +/- 0.3 N" --set masses.cart="1.2 kg +/- 0.1 kg"'
COMMANDS: dict[str, float | None] = {
    "--help": 0.2,
    "check {rig}": 1.2,
    "check {rig} --out report": None,
    f"check {{rig}} {DRAWN} --draws 1000": 20.0,
    MAKES_LOG: None,
    f"boundary {{rig}} {LOCKED} {CROSSOVER} --out boundary": None,
    f'boundary {{rig}} {LOCKED} {CROSSOVER} --y masses.cart="0.6 kg..2.4 kg" --out boundary': 15.0,
    'bode {rig} --set drive.sample_time="50 us" --set drive.delay="100 us" --out bode': 3.0,
    f"map {{rig}} {THESIS_MAP.format(n=41)} --out map": 2.5,
    f"map {{rig}} {THESIS_MAP.format(n=21)} --metric verdict --out map": None,
    "design {rig} {specification} --anyway --out design": 20.0,
    f'tune {{rig}} {LOCKED} --bandwidth-limit "25 Hz" --out tuned': None,
    "compare {drive} --machines 200 --out compare": 60.0,
    "flexure {leaves} --out leaves": None,
    "rig hunting {drive} --out hunting": 20.0,
    "logs {log}": None,
    "identify {log} --stage {servo} --out identified": None,
}
"""The README's commands and others with a goal, each with the wanted wall time, warm [s] (None: no goal)."""

PLACES = {
    "rig": "examples/thesis_rig.toml",
    "drive": "examples/thesis_drive.toml",
    "specification": "examples/specs/thesis.toml",
    "servo": "examples/emps_axis.toml",
    "leaves": "examples/thesis_leaves.toml",
}
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


@dataclass(frozen=True)
class Timed:
    """A command as typed, with wall and CPU times [s]: with an empty cache, then warm."""

    command: str
    wanted: float | None
    cold: float
    wall: list[float]
    cpu: list[float]

    @property
    def row(self) -> tuple[str, ...]:
        """Return a row of the table."""
        wanted = "" if self.wanted is None else f"{self.wanted:g}"
        times = [f"{time:.1f}" for time in (min(self.wall), statistics.median(self.wall), statistics.median(self.cpu))]
        return (f"`friso {self.command}`", f"{self.cold:.1f}", *times, str(len(self.wall)), wanted)


HEAD = ("command", "cold", "warm, least", "median", "CPU, median", "runs", "wanted")


def time_command(command: str, wanted: float | None, repetitions: int) -> Timed:
    """Run a command with an empty cache, and then repeatedly, in a folder of its own."""
    with tempfile.TemporaryDirectory(prefix="friso-bench-") as folder:
        places = {name: str(ROOT / place) for name, place in PLACES.items()}
        if "{log}" in command:
            _timed(MAKES_LOG.format(**places), Path(folder, "cache"), Path(folder))
            (log,) = Path(folder, "response").glob("*.csv")
            places["log"] = str(log)
        walls: list[float] = []
        cpus: list[float] = []
        while len(walls) < 2 or (len(walls) <= repetitions and sum(walls) < PATIENCE):
            run_in = Path(folder, str(len(walls)))  # output of an earlier run would be continued
            run_in.mkdir()
            wall, cpu = _timed(command.format(**places), Path(folder, "cache"), run_in)
            walls.append(wall)
            cpus.append(cpu)
    return Timed(command.format(**PLACES, log="log.csv"), wanted, walls[0], walls[1:], cpus[1:])


def _timed(command: str, cache: Path, folder: Path) -> tuple[float, float]:
    """Return wall and CPU time [s] of a command that is run in a folder."""
    environment = {**os.environ, "FRISO_CACHE_DIR": str(cache), "PYTHONPATH": str(ROOT)}
    arguments = [sys.executable, "-c", START, *shlex.split(command)]
    before, start = os.times(), time.perf_counter()
    done = subprocess.run(arguments, env=environment, capture_output=True, text=True, cwd=folder)
    wall, after = time.perf_counter() - start, os.times()
    if done.returncode:
        raise RuntimeError(f"friso {command} ended with status {done.returncode}: {done.stderr[-500:]}")
    return wall, after[2] + after[3] - before[2] - before[3]


def page(timed: list[Timed], machine: str) -> str:
    """Return the text of docs/speed.md."""
    rows = "\n".join(f"| {' | '.join(item.row)} |" for item in timed)
    return f"""# Speed

What a person waits for: times [s] of whole commands, each in a fresh process. Cold is with an empty cache, where the
equations are compiled first; warm every time after that. CPU time is that of all cores together.

| {" | ".join(HEAD)} |
|{"---|" * len(HEAD)}
{rows}

The table is made by `python -m benchmarks.command --write`, last on {time.strftime("%d %B %Y")}
({machine}).

What a step of the simulation costs is told in [engine.md](engine.md), what
large studies cost in [scaling.md](scaling.md).
"""


def main() -> None:
    """Time the commands and print the table, or write the page."""
    import friso

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5, help="warm runs of each command that takes no longer than that")
    parser.add_argument("--only", default="", help="commands that contain this text")
    parser.add_argument("--write", action="store_true", help="write docs/speed.md")
    chosen = parser.parse_args()
    wanted = {command: goal for command, goal in COMMANDS.items() if chosen.only in command}
    timed, measured_on = [], machine([friso])
    for command, goal in wanted.items():
        timed.append(time_command(command, goal, chosen.runs))
        print_table(HEAD, [timed[-1].row])
        if chosen.write:  # with the commands measured so far, in case of an interruption
            PAGE.write_text(page(timed, measured_on), encoding="utf-8")


def _check(cache: Path, *options: str) -> tuple[float, str]:
    """Return the wall time [s] of one `friso check` and its standard error."""
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
    """Return the time [s] spent in imports during one `friso check`, by -X importtime.

    That option itself adds a little.
    """
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
    """Measure the peak memory of a sweep of 1e5 runs without traces, in a process of its own."""
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


if __name__ == "__main__":
    main()
