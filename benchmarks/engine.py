"""Benchmark the engine (issue 2, section 6): ``python -m benchmarks.engine``.

``--help`` lists the options. Sections: race (friso, prototype and peers on one rig), precision (work against
precision), maps, check, memory.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from benchmarks.race import Field
    from benchmarks.rigs import Rig

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read when NumPy is loaded; 9 x 9 systems gain nothing from threads

SECTIONS = ("race", "precision", "maps", "check", "memory")


def main() -> None:
    """Run the benchmarks and print what was measured, then the goals."""
    from benchmarks import command, prototype, two_maps
    from benchmarks.precision import work_precision
    from benchmarks.race import run_race
    from benchmarks.report import Goal, machine, print_goals
    from benchmarks.rigs import rig

    arguments = _arguments()
    chosen = (arguments.only,) if arguments.only else SECTIONS
    repetitions = 1 if arguments.quick else 3
    print(machine(_libraries()))
    start = time.perf_counter()
    goals: list[Goal] = []
    rigs = [rig(locked=True), rig(locked=False)]
    lanes = prototype.load() if {"race", "maps"} & set(chosen) else None
    if {"race", "precision"} & set(chosen):
        places = _places(rigs, lanes, repetitions, arguments.quick)
        if "race" in chosen:
            goals += [goal for place in places for goal in run_race(place)]
        if "precision" in chosen:
            work_precision(places, arguments.out, arguments.quick)
    if "maps" in chosen:
        goals += two_maps.run_maps(two_maps.both_maps(*rigs), lanes, repetitions)
    if "check" in chosen:
        goals += command.run_check(repetitions)
    if "memory" in chosen:
        goals += command.run_memory()
    print_goals(goals, "Goals of issue 2, section 6")
    print(f"\n  measured in {time.perf_counter() - start:.0f} s; load of the machine now {os.getloadavg()[0]:.1f}")


def _places(rigs: list[Rig], lanes: ModuleType | None, repetitions: int, quick: bool) -> list[Field]:
    """Return the two races with their reference traces."""
    import numpy as np

    from benchmarks.compiled import compile_equations
    from benchmarks.metrics import distance
    from benchmarks.peers import peers
    from benchmarks.race import REFERENCE_RTOL, Field, friso_trace, reference_trace

    places = []
    solvers = peers()
    for rig in rigs:
        equations = compile_equations(rig)
        state = np.zeros(len(rig.scales))
        equations.rate(0.0, state, rig.pieces)
        equations.jacobian(0.0, state, rig.pieces)
        by_friso = friso_trace(rig, REFERENCE_RTOL)[0]
        if quick:
            reference = friso_trace(rig, REFERENCE_RTOL / 10)[0]
        else:
            reference = reference_trace(rig, equations, solvers["SciPy Radau"])
        apart = distance(rig.grid, by_friso, reference)
        print(
            f"  {rig.name}: reference by {'friso at 1e-12 (--quick)' if quick else 'SciPy Radau at 1e-11'}; ",
            end="",
        )
        print(f"friso at 1e-11 is off by {apart.early:.1e} m in 0.1 s, {apart.largest:.1e} m at most, ", end="")
        print(f"{apart.rms:.1e} m rms, {apart.late:.1e} m rms after 10 s")
        places.append(Field(rig, equations, solvers, lanes, reference, repetitions))
    return places


def _libraries() -> list[ModuleType]:
    import numba
    import numpy
    import scipy

    import friso

    return [friso, numba, numpy, scipy]


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.engine", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer repetitions, friso's own reference trace")
    parser.add_argument("--only", choices=SECTIONS, help="one section alone")
    parser.add_argument("--out", type=Path, default=Path("benchmark_results"), help="folder for the plot")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
