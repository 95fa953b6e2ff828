"""Time the real drive against the continuous loop, on the same stage.

Run by ``python -m benchmarks.rig``. It measures the time of one core per run in a sweep of examples/thesis_drive.toml
with all its parts (delay, current loop, rail, cable, noise). Each run has its own rail; the joint is locked and free.
Runs are made and logged as in the experiments of ``friso rig``.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.report import Goal, clock, print_goals, print_table, spread
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import kernel
from friso.equations.structure import structure
from friso.stage import Stage, load
from friso.studies.rig.moves_on_rails import LONGEST_INTERVAL, move, with_joint
from friso.virtual_rig.run import run
from friso.virtual_rig.settings import RigSettings

FILE = Path(__file__).parents[1] / "examples" / "thesis_drive.toml"
RUNS = 32
WANTED = 60.0
"""Wanted time per run of 400 000 samples [ms]."""


def sampled(stage: Stage) -> Callable[[], object]:
    """Return a function that runs the move of the stage with its drive on many rails."""
    rails = {"rail.seed": np.arange(1.0, RUNS + 1)}
    return lambda: list(run(stage, move(stage), range(RUNS), LONGEST_INTERVAL, rails, threads=1))


def continuous(stage: Stage) -> Callable[[], object]:
    """Return a function that runs the stage's own motion as often without a drive."""
    shape, options = (
        kernel(structure(stage.flat())),
        RunOptions(rtol=RigSettings.current().rig_rtol, interval=LONGEST_INTERVAL, threads=1),
    )
    return lambda: list(run_chunks(shape, stage.flat(), RUNS, options))


def run_rigs(repetitions: int) -> list[Goal]:
    """Measure milliseconds per run, side by side."""
    rows, goals = [], []
    for name, locked in (("locked", True), ("free", False)):
        stage = with_joint(load(FILE), locked)
        jobs = {"continuous": continuous(stage), "as built": sampled(stage)}
        for job in jobs.values():
            job()  # compiled
        turns = [{about: clock(job) for about, job in jobs.items()} for _ in range(repetitions)]
        seconds = {about: [turn[about] for turn in turns] for about in jobs}
        least = min(seconds["continuous"])
        rows += [
            [f"{name}, {about}", spread(times, 1e3 / RUNS), f"{min(times) / least:.1f}"]
            for about, times in seconds.items()
        ]
        taken = min(seconds["as built"]) * 1e3 / RUNS
        goals.append(Goal(f"a run of the drive, {name}", f"< {WANTED:g} ms", f"{taken:.1f} ms", taken < WANTED))
    print("\nOne run of the thesis rig, one core, min / median [ms], and its ratio to the continuous loop")
    print_table(("rig", "ms", "ratio"), rows)
    return goals


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rig", description=__doc__)
    parser.add_argument("--repetitions", type=int, default=5)
    options = parser.parse_args()
    print_goals(run_rigs(options.repetitions), "Goal of the sampled engine")


if __name__ == "__main__":
    main()
