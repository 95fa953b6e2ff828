"""The drive as built against the continuous loop, on the same stage, by ``python -m benchmarks.rig``.

Time per run of one core in a sweep: joint locked and free, all parts of the drive in, by every method.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np

from benchmarks.report import Goal, clock, print_goals, print_table, spread
from benchmarks.rigs import FILE
from friso.engine.arrays import Tables
from friso.engine.batch import Options, prepare, run_batch, run_chunks, settings_of
from friso.engine.kernel import empty_results, kernel
from friso.engine.tableaus import TABLEAUS
from friso.equations.as_built import NEUTRAL, AsBuilt
from friso.equations.structure import structure
from friso.stage import Stage, load

RUNS = 16
DRIVE = {"sample_time": 50e-6, "late": 0.0, "encoder_noise": 1e-9, "encoder_resolution": 1e-9}
INTERVAL = 1e-3
WANTED = 60.0
"""Milliseconds per run of 400 000 samples."""


def surroundings(duration: float) -> Tables:
    """A rail and a motor with a period of 20 mm in points 1 mm apart, and a floor at 10 points per second."""
    place, time = np.arange(-100, 301) * 1e-3, np.arange(0, duration + 0.2, 0.1)
    wave = 1 + 0.05 * np.sin(2 * np.pi * place / 20e-3 + np.arange(3)[:, None])
    shake = np.stack([np.zeros_like(time), 1e-3 * np.sin(3 * time)])
    return Tables(wave[None], np.array([[-0.1, 1e3]]), shake[None], np.array([10.0]))


def sampled(stage: Stage, method: str, rtol: float) -> Callable[[], None]:
    """The runs of a stage with its drive, differing in their noise, ready to go."""
    drive = {f"drive.{name}": value for name, value in DRIVE.items()}
    flat = {**NEUTRAL, **drive, "drive.seed": 1.0, **stage.flat()}
    shape = kernel(AsBuilt.of(flat), method=method)
    options = Options(rtol=rtol, interval=INTERVAL, budget=10**8)
    flat |= {"drive.seed": np.arange(RUNS) + 1.0}
    batch = prepare(shape, flat, RUNS, options)._replace(tables=surroundings(flat["motion.duration"]))
    samples = round(flat["motion.duration"] / INTERVAL) + 1
    results = empty_results(RUNS, 1, samples, len(shape.kept))
    return lambda: run_batch(shape, batch, settings_of(options), results, 1)


def continuous(stage: Stage, rtol: float) -> Callable[[], None]:
    """The same runs without a drive."""
    shape, options = kernel(structure(stage.flat())), Options(rtol=rtol, interval=INTERVAL, threads=1)
    return lambda: [*run_chunks(shape, stage.flat(), RUNS, options)].clear()


def run_rigs(repetitions: int, rtol: float) -> list[Goal]:
    """Milliseconds per run, side by side."""
    rows, goals = [], []
    for name, locked in (("locked", True), ("free", False)):
        stage = load(FILE).replace({"joint.locked": locked, "controller.crossover": "8 Hz"})
        stage = stage.replace({"controller.force_limit": "200 N"})
        jobs = {"continuous": continuous(stage, rtol)}
        jobs |= {f"sampled, {method}": sampled(stage, method, rtol) for method in TABLEAUS}
        seconds = {about: [clock(job) for _ in range(repetitions)] for about, job in jobs.items()}
        least = min(seconds["continuous"])
        for about, each in seconds.items():
            rows.append([f"{name}, {about}", spread(each, 1e3 / RUNS), f"{min(each) / least:.1f}"])
            if about == "sampled, Rodas4":
                taken = min(each) * 1e3 / RUNS
                goals.append(Goal(f"a run of the drive, {name}", f"< {WANTED:g} ms", f"{taken:.1f} ms", taken < WANTED))
    print("\nOne run of the thesis rig, one core, min / median [ms], and its ratio to the continuous loop")
    print_table(("rig", "ms", "ratio"), rows)
    return goals


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rig", description=__doc__)
    parser.add_argument("--repetitions", type=int, default=3)
    parser.add_argument("--rtol", type=float, default=1e-5)
    options = parser.parse_args()
    print_goals(run_rigs(options.repetitions, options.rtol), "Goal of the sampled engine")


if __name__ == "__main__":
    main()
