"""Measure what a user waits for: ``python -m benchmarks.command``.

It prints the times of the README's commands, each in a fresh process.
"""

import argparse
import os
import shlex
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from benchmarks.report import machine, print_table

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
    "compare {rig} --out compare": 60.0,
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

What large studies cost is told in [scaling.md](scaling.md).
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


if __name__ == "__main__":
    main()
