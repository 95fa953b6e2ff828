"""Test settings of `friso tune` on fresh machines by independent equations.

`python -m benchmarks.eight_machines FILE` tunes eight kinds of machine. Each setting that works is tried on machines
for which nothing was tuned, by the equations and the integrator of `benchmarks.by_hand`. A row for each
machine and move goes to FILE as one line of JSON, so that a run may be continued; the table by size of move is printed
at the end. `--only NAME ...` chooses machines, `--machines N` sets how many are tried.
"""

import argparse
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from benchmarks.by_hand import by_hand
from benchmarks.report import each, print_table
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
    yield "rotary", load(Path(__file__).with_suffix(".toml")), Goal(within=1e-5, bandwidth_limit=LIMIT)
    yield "vertical", locked.replace({"bias": {"stage": "-5 N"}}), goal
    gms = load(ROOT / "examples" / "thesis_rig_gms.toml").replace({"joint.locked": True})
    yield "GMS", gms, goal
    yield "force limit", locked.replace({"controller.force_limit": "60 N", "motion.acceleration": "25 m/s^2"}), goal


def tuned(stage: Stage, goal: Goal) -> list[dict[str, Any]]:
    """Tune a machine; return the settings that may work, each with what is told of it and with fresh machines."""
    begun = process_time()
    advice = tune(stage, goal)
    rows = []
    for outcome in advice.outcomes:
        unknown = outcome.certainty not in ("works", "unsure") or outcome.measured is None
        if unknown or outcome.remedy.makes or outcome.stage is None:
            continue
        assert outcome.measured is not None
        share = outcome.measured.share(advice.goal)
        fleet = draw_fleet(outcome.stage, Correlations(), MOST, FRESH_SEED, advice.goal.moves)
        flat = fleet.laid_over(outcome.stage, {}, 1)
        rows.append({
            "setting": outcome.remedy.name,
            "certainty": outcome.certainty,
            "changes": str(changes(advice.stage, outcome.stage)),
            "told": [share.probability, share.low, share.high],
            "slowest": [outcome.measured.slowest(advice.goal), *outcome.measured.slowest_interval(advice.goal)],
            "within": advice.goal.within,
            "seconds": process_time() - begun,
            "flat": {key: value.tolist() if np.ndim(value) else value for key, value in flat.items()},
            "sizes": fleet.sizes.tolist(),
        })  # fmt: skip
    return rows


def settling(row: Mapping[str, Any], number: int) -> float:
    """Return the settling time [s] of a fresh machine with a setting, by hand."""
    flat = {key: value[number] if isinstance(value, list) else value for key, value in row["flat"].items()}
    moved = by_hand({key: value for key, value in flat.items() if not key.startswith("drive.")})
    return moved.settling(row["within"], flat["motion.duration"])


def cells(name: str, row: Mapping[str, Any], times: np.ndarray) -> list[str]:
    """Return a row of the table: fractions by friso's statement and by these equations, for each class of moves."""
    settled, sizes = np.isfinite(times), np.array(row["sizes"][: len(times)])
    of_size = [(sizes >= low) & (sizes < high) for low, high in pairwise(SIZES)]
    slowest = "{:.3g} s ({:.3g} to {:.3g} s)".format(*row["slowest"])
    return [
        *(name, row["setting"], row["certainty"], "{:.1%} ({:.1%} to {:.1%})".format(*row["told"])),
        f"{settled.sum()} of {len(times)}",
        *(f"{settled[some].sum()} of {some.sum()}" for some in of_size),
        slowest if np.isfinite(row["slowest"][2]) else slowest.replace("inf s", "never"),
        f"{np.count_nonzero(settled & (times <= row['slowest'][2]))} of {len(times)}",
        f"{row['seconds']:.0f} s",
    ]


HEAD = (
    *("machine", "setting", "", "told", "own", "up to 0.1 mm", "to 1 mm", "larger"),
    *("95 % within, told", "own within its upper end", "CPU"),
)


def main() -> None:
    """Tune the machines, try the settings on fresh machines, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--only", nargs="*")
    parser.add_argument("--machines", type=int, default=MOST)
    options = parser.parse_args()
    listed = []
    for name, stage, goal in machines():
        if options.only is not None and name not in options.only:
            continue
        ((_, rows),) = each([(name,)], lambda _: tuned(stage, goal), options.file)  # noqa: B023
        for row in rows:
            tasks = [(name, row["setting"], number) for number in range(options.machines)]
            runs = each(tasks, lambda task: settling(row, int(task[2])), options.file)  # noqa: B023
            listed.append(cells(name, row, np.array([time for _, time in runs])))
            print(*listed[-1], sep=" | ", flush=True)
    print_table(HEAD, listed)


if __name__ == "__main__":
    main()
