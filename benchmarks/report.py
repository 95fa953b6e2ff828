"""Print tables of text, and the goals with what was measured."""

import argparse
import json
import os
import statistics
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from friso.platform.system import usable_cores

Task = tuple[str | int, ...]
"""What a result is of: a machine by its number, for one."""


@dataclass(frozen=True)
class Goal:
    """A goal: subject, target, measured value, and whether it is reached (None: no goal)."""

    about: str
    target: str
    measured: str
    reached: bool | None


def print_table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Print aligned columns, the first to the left."""
    cells = [list(head), *([str(cell) for cell in row] for row in rows)]
    widths = [max(len(row[i]) for row in cells) for i in range(len(head))]
    for k, row in enumerate(cells):
        first = row[0].ljust(widths[0])
        print("  " + "  ".join([first, *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))]).rstrip())
        if k == 0:
            print("  " + "  ".join("-" * w for w in widths))


def print_goals(goals: Sequence[Goal], title: str) -> None:
    """Print all goals, reached or not."""
    words = {True: "yes", False: "NO", None: "-"}
    print(f"\n{title}")
    print_table(
        ("goal", "wanted", "measured", "reached?"),
        [(g.about, g.target, g.measured, words[g.reached]) for g in goals],
    )


def each(tasks: Iterable[Task], job: Callable[[Task], Any], file: Path | None = None) -> Iterator[tuple[Task, Any]]:
    """Yield tasks with their results, which are data.

    A file keeps them, a line of JSON each: those in it are not computed again, so that a run continues where one was
    stopped.
    """
    lines = file.read_text("utf-8").splitlines() if file and file.exists() else []
    there = {tuple(task): result for task, result in map(json.loads, lines)}
    for task in tasks:
        if task not in there:
            there[task] = job(task)
            if file:
                file.parent.mkdir(parents=True, exist_ok=True)
                with file.open("a", encoding="utf-8") as stream:
                    stream.write(json.dumps([task, there[task]], default=float) + "\n")
        yield task, there[task]


def numbered(document: str | None, machines: int) -> argparse.ArgumentParser:
    """Return a parser of the options of a benchmark on drawn machines: how many, the first, and a file of results."""
    parser = argparse.ArgumentParser(description=document, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--machines", type=int, default=machines)
    parser.add_argument("--first", type=int, default=0, help="number of the first machine")
    parser.add_argument("--kept", type=Path, help="file of results, which a run in pieces adds to")
    return parser


def clock(job: Callable[[], Any]) -> float:
    """Return the wall time of a job [s]."""
    start = time.perf_counter()
    job()
    return time.perf_counter() - start


def spread(seconds: Sequence[float], scale: float = 1.0, digits: int = 1) -> str:
    """Return least and median of some times, multiplied by `scale`, as text."""
    return f"{min(seconds) * scale:.{digits}f} / {statistics.median(seconds) * scale:.{digits}f}"


def machine(libraries: Sequence[ModuleType]) -> str:
    """Describe the machine: libraries, processor, usable cores, and the last minute's load."""
    versions = [f"{library.__name__} {library.__version__}" for library in libraries]
    file = Path("/proc/cpuinfo")
    lines = file.read_text().splitlines() if file.exists() else []
    names = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    processor = names[0] if names else "unknown processor"
    return ", ".join(
        [*versions, processor, f"{usable_cores()} cores, load average {os.getloadavg()[0]:.1f} beforehand"]
    )
