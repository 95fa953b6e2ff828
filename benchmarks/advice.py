"""Read the advice of `friso tune` on eight machines, and try it by independent equations.

`python -m benchmarks.advice [--copies N] [--only NAME ...]` tunes the machines of `advice.toml`. For each it prints the
answer, and a row: CPU time until the first verified answer and until the end, as multiples of a check of the same
stage; the settling time told and the one of copies drawn anew, at the worse end of their moves, by
`benchmarks.by_hand`; and bandwidth and force of the answer over those of the least speed of the controller
that meets the goal. That speed is found by brute search, in steps of `STEP`. Kernels are to be in the cache: run it
twice.
"""

import argparse
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage
from typing import Any

import numpy as np

import friso
from benchmarks.by_hand import by_hand
from benchmarks.report import print_table
from friso.axis import speaking_of
from friso.equations.bandwidth import sped_up
from friso.frequency.bode import loop_bandwidth
from friso.questions.tune.words import answer
from friso.remedies.catalogue import speed_cap
from friso.remedies.machines import Fleet, Goal, draw_fleet
from friso.remedies.method import Advice, tune
from friso.remedies.verified import Performance, confirmed, missed_parts, moving, unsettled_parts
from friso.stage import Stage
from friso.stage.correlations import Correlations

STEP, FRESH_SEED, COPIES = 1.02, 9001, 50
"""Ratio of speeds of the brute search, seed of the copies, and their number."""

ALLOWED = 1.3
"""Largest bandwidth and force of the first answer, over those of the least speed."""

HEAD = (
    *("machine", "first answer", "CPU: first", "CPU: whole", "told, 95 %", "own equations: settled", "slowest"),
    *("within told", "bandwidth", "force"),
)


def machines() -> Iterator[tuple[str, Stage]]:
    """Yield the eight machines by name."""
    tables = tomllib.loads((Path(__file__).parent / "advice.toml").read_text())
    yield from ((name, Stage(**table)) for name, table in tables.items())


def cpu() -> float:
    """Return the CPU time [s] of this process and of those that it has started."""
    uses = [getrusage(who) for who in (RUSAGE_SELF, RUSAGE_CHILDREN)]
    return sum(use.ru_utime + use.ru_stime for use in uses)


def timed(stage: Stage, goal: Goal) -> tuple[Advice, float, float]:
    """Tune a stage; return the advice, and CPU times of its first answer and of all, over that of a check."""
    friso.check(stage)
    begun = cpu()
    friso.check(stage)
    check, begun, first = cpu() - begun, cpu(), []
    advice = tune(stage, goal, answered=lambda outcome: first.append(cpu() - begun))
    return advice, (first or [np.inf])[0] / check, (cpu() - begun) / check


def least_speed(advice: Advice, fleet: Fleet) -> tuple[Stage, Performance] | None:
    """Return the stage with the least speed of its controller that meets the goal, and how machines perform with it."""
    stage, goal, flat = advice.stage, advice.goal, advice.stage.flat()
    most = speed_cap(stage, goal).factor
    for factor in STEP ** np.arange(1, np.log(most) / np.log(STEP)):
        quick = stage.with_numbers(sped_up(flat, factor))
        measured = moving(quick, fleet, goal, stage)
        if missed_parts(measured, goal) or unsettled_parts(confirmed(quick, goal), measured, goal):
            continue
        measured = measured.surveyed(quick, fleet, goal)
        if not missed_parts(measured, goal):
            return quick, measured
    return None


def row(name: str, stage: Stage, copies: int) -> list[str]:
    """Tune one machine, print the answer, and return its row of the table."""
    advice, first, whole = timed(stage, Goal())
    with speaking_of(stage.axis_kind):
        print(f"\n{name}", *answer(advice), sep="\n", flush=True)
    outcome, goal = advice.least, advice.goal
    if outcome is None or outcome.stage is None or outcome.measured is None:
        return [name, "none", f"{first:.1f}", f"{whole:.1f}", *["–"] * 6]
    drawn = draw_fleet(outcome.stage, Correlations(), copies, FRESH_SEED, goal.moves)
    flat = drawn.laid_over(outcome.stage, {}, 1)
    one_by_one = [{key: value[k] if np.ndim(value) else value for key, value in flat.items()} for k in range(copies)]
    times = np.array([_settling(one, goal.within) for one in one_by_one])
    low, high = outcome.measured.slowest_interval(goal)
    least = least_speed(advice, draw_fleet(stage, Correlations(), advice.machines.count, FRESH_SEED + 1, goal.moves))
    ratios = ["no speed works", "–"]
    if least is not None:
        least_stage, measured = least
        ratios = [
            f"{loop_bandwidth(outcome.stage) / loop_bandwidth(least_stage):.2f}",
            f"{outcome.measured.force(goal) / measured.force(goal):.2f}",
        ]
    cells = [
        *(name, outcome.remedy.name, f"{first:.1f}", f"{whole:.1f}"),
        f"{outcome.measured.slowest(goal):.3g} s ({low:.3g} to {high:.3g})",
        f"{np.count_nonzero(np.isfinite(times))} of {copies}",
        f"{np.nanmax(times):.3g} s",
        f"{np.count_nonzero(times <= high)} of {copies}",
        *ratios,
    ]
    print(cells, flush=True)
    return cells


def _settling(flat: Mapping[str, Any], within: float) -> float:
    """Return the longer settling time [s] of a move by hand, of the place that the controller is given."""
    moved = by_hand({key: value for key, value in flat.items() if not key.startswith("drive.")})
    return moved.settling(within, flat["motion.duration"], moved.measured)


def main() -> None:
    """Print the answers and the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--copies", type=int, default=COPIES)
    parser.add_argument("--only", nargs="*")
    chosen = parser.parse_args()
    rows = [row(name, one, chosen.copies) for name, one in machines() if not chosen.only or name in chosen.only]
    print_table(HEAD, rows)
    print(f"Bandwidth and force of the answer over those of the least speed that works; at most {ALLOWED} is allowed.")


if __name__ == "__main__":
    main()
