"""Time hunting cycles, verdicts and boundaries: `python -m benchmarks.cycle`.

`--only verdict|curve|map|accuracy` chooses a part. Parts are the verdict on the thesis rig with its cycle, starts of
hunting, continued curves, maps of the multiplier, and equal numbers at two tolerances.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from benchmarks.report import Goal, clock, print_goals, print_table, spread
from friso.hunting import (
    Ensemble,
    Plane,
    displacements_that_hunt,
    find_cycles,
    find_margin,
    hunting,
    moves_that_hunt,
    pushes_that_hunt,
)
from friso.stage import Stage
from friso.studies.boundary import boundary
from friso.studies.sweep import sweep
from friso_thesis.studies.thesis.studies import thesis_rig

LOCKED = {"joint.locked": True}
CASES = {"locked": LOCKED, "free": {}, "free, 5 Hz": {"controller.crossover": "5 Hz"}}

MAPS = {
    "locked: crossover x cart": (LOCKED, {"controller.crossover": "1 Hz..40 Hz:41", "masses.cart": "0.1 kg..5 kg:41"}),
    "free: crossover x stroke": ({}, {"controller.crossover": "1 Hz..16 Hz:41", "joint.stroke": "25 um..1 mm:41"}),
}
CURVES = {
    "locked: crossover x cart": (LOCKED, {"controller.crossover": "1 Hz..40 Hz", "masses.cart": "0.1 kg..5 kg"}),
    "locked: static x Coulomb": (LOCKED, {"friction.static": "0.5 N..6 N", "friction.coulomb": "0.1 N..3 N"}),
    "free: crossover x stroke": ({}, {"controller.crossover": "1 Hz..16 Hz", "joint.stroke": "25 um..1 mm"}),
}


def stage_of(changes: dict[str, Any]) -> Stage:
    return thesis_rig().replace(changes)


def run_verdict(repetitions: int) -> list[Goal]:
    """Time cycle, multipliers and return map of a stage, and the starts of hunting.

    Starts are timed if the cycle attracts.
    """
    rows, cycles, rests = [], [], []
    for name, changes in CASES.items():
        stage = stage_of(changes)
        verdict = hunting(stage)
        once = [clock(lambda: hunting(stage)) for _ in range(repetitions)]  # noqa: B023
        rest = [clock(lambda: _what_starts(stage)) for _ in range(repetitions)]  # noqa: B023
        cycles.append(min(once))
        rests.append(min(rest))
        rows.append([name, len(verdict.cycles), spread(once, digits=3), spread(rest, digits=3)])
    print("\nVerdict, kernels warm: cycle with multipliers and return map; kicks, moves and margin")
    print_table(("stage", "cycles", "cycle min / median [s]", "the rest min / median [s]"), rows)
    both = cycles[0] + cycles[1]  # a check judges the rig locked and free
    return [
        Goal("thesis rig, locked and free: cycle, multiplier, return map", "< 0.5 s", f"{both:.2f} s", both < 0.5),
        Goal("kicks and share of moves, locked and free", "< 2 s", f"{rests[0] + rests[1]:.2f} s", sum(rests[:2]) < 2),
    ]


def _what_starts(stage: Stage) -> None:
    verdict = hunting(stage)
    if verdict.target:
        for starts in (displacements_that_hunt, pushes_that_hunt, moves_that_hunt):
            starts(stage, verdict.target)
    find_margin(stage, verdict.target is not None)


def run_curve(repetitions: int) -> list[Goal]:
    """Time all curves in a plane, and 50 points of them."""
    rows, goals = [], []
    for name, (changes, axes) in CURVES.items():
        stage = stage_of(changes)
        boundary(stage, axes)
        seconds = []
        for _ in range(repetitions):
            seconds.append(clock(lambda: _keep(boundary(stage, axes))))  # noqa: B023
        curves = _planes[-1].curves
        points = sum(len(curve.spots) for curve in curves)
        fifty = 50 * min(seconds) / points
        rows.append([name, len(curves), points, spread(seconds), f"{fifty:.1f}"])
        goals.append(Goal(f"50 points of a curve, {name}", "< 20 s", f"{fifty:.1f} s", fifty < 20))
    print("\nBoundaries: the search for curves, all curves, and their errors")
    print_table(("plane", "curves", "points", "min / median [s]", "50 points [s]"), rows)
    return goals


_planes: list[Plane] = []


def _keep(plane: Any) -> None:
    _planes.append(plane)


def run_map(repetitions: int) -> list[Goal]:
    """Time maps of the multiplier, 41 x 41."""
    rows, goals = [], []
    for name, (changes, axes) in MAPS.items():
        stage, metrics = stage_of(changes), ["multiplier", "amplitude", "cycle_period"]
        seconds = [clock(lambda: sweep(stage, axes, metrics=metrics)) for _ in range(repetitions)]  # noqa: B023
        rows.append([name, spread(seconds), f"{min(seconds) / 1681 * 1e3:.1f}"])
        goals.append(Goal(f"41 x 41 multipliers, {name}", "< 60 s", f"{min(seconds):.1f} s", min(seconds) < 60))
    print("\nMaps of the multiplier, 41 x 41")
    print_table(("map", "min / median [s]", "per cell [ms]"), rows)
    return goals


def run_accuracy() -> list[Goal]:
    """Compare period, amplitude and multiplier at the usual tolerance and at a hundredth."""
    rows, goals = [], []
    for name, changes in {**CASES, "locked, 4 Hz": {**LOCKED, "controller.crossover": "4 Hz"}}.items():
        stages = Ensemble.held(stage_of(changes).flat(), 1)
        plain, tight = (find_cycles(stages, rtol) for rtol in (1e-9, 1e-11))
        if not plain.closed[0]:
            continue
        off = [
            abs(getattr(plain, what)[0] / getattr(tight, what)[0] - 1) for what in ("period", "amplitude", "multiplier")
        ]
        rows.append([name, *(f"{error:.1e}" for error in off)])
        reached = off[0] < 1e-6 and off[1] < 1e-6 and off[2] < 1e-4
        goals.append(Goal(f"accuracy, {name}", "1e-6, 1e-6, 1e-4", ", ".join(f"{error:.0e}" for error in off), reached))
    print("\nRelative difference between rtol 1e-9 and 1e-11")
    print_table(("stage", "period", "amplitude", "multiplier"), rows)
    return goals


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=("verdict", "curve", "map", "accuracy"))
    parser.add_argument("--repetitions", type=int, default=3)
    options = parser.parse_args()
    np.seterr(all="ignore")
    sections: dict[str, Any] = {
        "verdict": lambda: run_verdict(options.repetitions),
        "curve": lambda: run_curve(1),
        "map": lambda: run_map(1),
        "accuracy": run_accuracy,
    }
    goals = [goal for name, run in sections.items() if options.only in (None, name) for goal in run()]
    print_goals(goals, "Goals of issue 4, section 4")


if __name__ == "__main__":
    main()
