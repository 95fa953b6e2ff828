"""Test settings of `friso tune` on fresh machines by independent equations.

`python -m benchmarks.eight_machines FILE` tunes eight kinds of machine. Each setting that works is tried on machines
for which nothing was tuned, by the equations and the integrator of `benchmarks.by_hand`. A row for each
machine and move goes to FILE as one line of JSON, so that a run may be continued; the table by size of move is printed
at the end. `--only NAME ...` chooses machines, `--machines N` sets how many are tried.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from benchmarks.by_hand import by_hand
from benchmarks.report import print_table
from friso.questions.tune.words import changes
from friso.remedies.machines import Goal, draw_fleet
from friso.remedies.method import tune
from friso.stage import Stage, load
from friso.stage.correlations import Correlations

ROOT = Path(__file__).parents[1]

FRESH_SEED, MOST, LIMIT = 9001, 100, 25.0
"""Seed and number of the fresh machines, and the limit of the bandwidth [Hz] for machines without another limit."""

SIZES = (0.0, 1e-4, 1e-3, np.inf)
"""Edges of the classes of moves [m, rad]."""


def machines() -> Iterator[tuple[str, Stage, Goal]]:
    """Yield the eight machines by name, each with its goal."""
    rig = load(ROOT / "examples" / "thesis_rig.toml")
    locked = rig.replace({"joint.locked": True})
    goal = Goal(bandwidth_limit=LIMIT)
    yield "PID", locked, goal
    cascade = load(ROOT / "examples" / "twincat_cascade.toml").replace({"joint.locked": True})
    yield "cascade", cascade, Goal(bandwidth_limit=40.0)
    yield "ADRC", locked.replace({"controller": {"kind": "adrc", "bandwidth": "3 Hz"}}), goal
    yield "ball screw", load(ROOT / "examples" / "ball_screw_axis.toml"), Goal(bandwidth_limit=40.0)
    yield "rotary", Stage(**ROTARY), Goal(within=1e-5, bandwidth_limit=LIMIT)
    yield "vertical", locked.replace({"bias": {"stage": "-5 N"}}), goal
    gms = load(ROOT / "examples" / "thesis_rig_gms.toml").replace({"joint.locked": True})
    yield "GMS", gms, goal
    yield "force limit", locked.replace({"controller.force_limit": "60 N", "motion.acceleration": "25 m/s^2"}), goal


ROTARY: dict[str, Any] = {
    "axis": {"kind": "rotary"},
    "masses": {"stage": "0.02 kg*m^2"},
    "friction": {
        "model": "lugre",
        "static": "0.6 N*m",
        "coulomb": "0.3 N*m",
        "stribeck_velocity": "0.01 rad/s",
        "stribeck_exponent": 2,
        "bristle_stiffness": "2000 N*m/rad",
        "bristle_damping": "5 N*m*s/rad",
        "viscous": "0.02 N*m*s/rad",
    },
    "controller": {"kind": "pid", "crossover": "8 Hz", "alpha": 0.1, "beta": 2},
    "motion": {
        "kind": "there_and_back",
        "acceleration": "50 rad/s^2",
        "acceleration_time": "0.1 s",
        "return_at": "3 s",
        "duration": "10 s",
    },
}


def tried(name: str, stage: Stage, goal: Goal, count: int, file: Path) -> None:
    """Tune a machine, try working settings on fresh machines, and append lines to the file."""
    rows = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    if not any(row["machine"] == name and {"told", "none_works"} & row.keys() for row in rows):
        begun = process_time()
        advice = tune(stage, goal)
        seconds = process_time() - begun
        with file.open("a") as written:
            for outcome in advice.outcomes:
                unknown = outcome.certainty not in ("works", "unsure") or outcome.measured is None
                if unknown or outcome.remedy.makes or outcome.stage is None:
                    continue
                assert outcome.measured is not None
                share = outcome.measured.share(advice.goal)
                fleet = draw_fleet(outcome.stage, Correlations(), MOST, FRESH_SEED, advice.goal.moves)
                row = {
                    "machine": name,
                    "setting": outcome.remedy.name,
                    "certainty": outcome.certainty,
                    "changes": str(changes(advice.stage, outcome.stage)),
                    "told": [share.probability, share.low, share.high],
                    "slowest": [outcome.measured.slowest(advice.goal), *outcome.measured.slowest_interval(advice.goal)],
                    "within": advice.goal.within,
                    "seconds": seconds,
                    "flat": {
                        k: v.tolist() if np.ndim(v) else v for k, v in fleet.laid_over(outcome.stage, {}, 1).items()
                    },
                    "sizes": fleet.sizes.tolist(),
                }
                print(name, outcome.remedy.name, row["told"], row["slowest"], f"{seconds:.0f} s", flush=True)
                written.write(json.dumps(row, default=float) + "\n")
            if not any(outcome.certainty == "works" for outcome in advice.outcomes):
                written.write(json.dumps({"machine": name, "none_works": True, "seconds": seconds}) + "\n")
    rows = [json.loads(line) for line in file.read_text().splitlines()]
    done = {(row["setting"], row["number"]) for row in rows if row["machine"] == name and "number" in row}
    for row in (row for row in rows if row["machine"] == name and row.get("told")):
        for number in range(count):
            if (row["setting"], number) in done:
                continue
            flat = {
                key: value[number] if isinstance(value, list) else value
                for key, value in row["flat"].items()
                if not key.startswith("drive.")
            }
            result = {"machine": name, "setting": row["setting"], "number": number, "size": row["sizes"][number]}
            settling = by_hand(flat).settling(row["within"], flat["motion.duration"])
            with file.open("a") as written:
                written.write(json.dumps(result | {"settling": settling}) + "\n")


def table(file: Path) -> None:
    """Print the settings with two fractions: by friso's statement, and by these equations.

    The latter is printed for each class of moves.
    """
    rows = [json.loads(line) for line in file.read_text().splitlines()]
    listed = []
    for row in (row for row in rows if row.get("told")):
        runs = [one for one in rows if "number" in one and all(one[k] == row[k] for k in ("machine", "setting"))]
        times, sizes = (np.array([one[k] for one in runs]) for k in ("settling", "size"))
        if not runs:
            continue
        settled = np.isfinite(times)
        by_size = []
        for low, high in pairwise(SIZES):
            some = (sizes >= low) & (sizes < high)
            by_size.append(f"{settled[some].sum()} of {some.sum()}")
        in_time = f"{np.count_nonzero(settled & (times <= row['slowest'][2]))} of {len(runs)}"
        shares = "{:.1%} ({:.1%} to {:.1%})".format(*row["told"])
        slowest = "{:.3g} s ({:.3g} to {:.3g} s)".format(*row["slowest"])
        slowest = slowest if np.isfinite(row["slowest"][2]) else slowest.replace("inf s", "never")
        parts = (row["machine"], row["setting"], row["certainty"], shares, f"{settled.sum()} of {len(runs)}", *by_size)
        listed.append((*parts, slowest, in_time, f"{row['seconds']:.0f} s"))
    edges = ["up to 0.1 mm", "to 1 mm", "larger"]
    print_table(
        ("machine", "setting", "", "told", "own", *edges, "95 % within, told", "own within its upper end", "CPU"),
        listed,
    )


def main() -> None:
    """Tune the machines, try the settings on fresh machines, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--only", nargs="*")
    parser.add_argument("--machines", type=int, default=MOST)
    options = parser.parse_args()
    for name, stage, goal in machines():
        if options.only is None or name in options.only:
            tried(name, stage, goal, options.machines, options.file)
    table(options.file)


if __name__ == "__main__":
    main()
