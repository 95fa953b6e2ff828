"""Time parameter studies at scale.

Run by `python -m benchmarks.maps [--only maps|large|growth|overhead]`. Parts are all of the thesis's maps; a study of
10^6 runs; the cost per run from 10^3 to 10^6 runs; and what a block costs besides its runs.
"""

import argparse
import re
import statistics
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.report import Goal, clock, print_goals, print_table, spread
from friso.platform.system import usable_cores
from friso.stage import Stage
from friso.studies.axes import Samples
from friso.studies.study import Request, Study
from friso.studies.sweep import local_crew, processes, run_in_memory, run_in_store
from friso_thesis.studies.thesis.studies import STUDIES, thesis_rig

RTOLS = (1e-4, 1e-6)
WANTED = {1e-4: 1.5, 1e-6: 5.0}
"""Wanted wall time of all maps [s], by tolerance."""

EIGHT = {
    "controller.crossover": "1 Hz..16 Hz",
    "controller.alpha": "0.1..0.3",
    "controller.beta": "1..3",
    "joint.stroke": "0.01 mm..1 mm",
    "joint.stiffness": "0.5 N/mm..15 N/mm",
    "friction.static": "1.5 N..4.9 N",
    "friction.coulomb": "0.1 N..1.5 N",
    "masses.cart": "0.5 kg..3 kg",
}
"""Ranges of the eight parameters of the large study, from the thesis's Table 3."""


def thesis_studies(rtol: float, points: int = 41) -> list[Study]:
    """Return all maps of the thesis."""
    return [Request(s.stage(), s.axes(points), links=s.links).study(rtol=rtol) for s in STUDIES.values()]


def large_study(count: int, rtol: float) -> Study:
    """Return a study of the free rig over a Sobol sample of eight parameters."""
    return Request(_untuned(thesis_rig()), {}, Samples(EIGHT, count)).study(rtol=rtol)


def _untuned(stage: Stage) -> Stage:
    """Return the stage with its controller tuned for the mass of cart and stage together."""
    return stage.replace({"controller.tuned_mass": None})


def run_maps(repetitions: int) -> list[Goal]:
    """Measure the wall time of all maps at once, with warm kernels."""
    rows, goals = [], []
    with local_crew() as crew:
        for rtol in RTOLS:
            studies = thesis_studies(rtol)
            runs = sum(study.cells for study in studies)
            run_in_memory(studies, crew)
            times = [clock(lambda: run_in_memory(studies, crew)) for _ in range(repetitions)]  # noqa: B023
            rows.append([f"{rtol:g}", runs, spread(times, digits=2), f"{min(times) / runs * 1e6:.0f}"])
            reached = min(times) < WANTED[rtol]
            goals.append(Goal(f"all ten maps, rtol {rtol:g}", f"< {WANTED[rtol]} s", f"{min(times):.2f} s", reached))
    print(f"\nAll maps of the thesis, 41 x 41 runs of 20 s each, {_processors()} threads")
    print_table(("rtol", "runs", "wall time min / median [s]", "per run [us]"), rows)
    return goals


def run_large(count: int, rtol: float) -> list[Goal]:
    """Run a large Sobol study into a store; measure time, rate and peak memory."""
    with tempfile.TemporaryDirectory(prefix="friso-bench-") as folder, local_crew() as crew:
        run_in_memory([large_study(64, rtol)], crew)
        store = Path(folder) / "large.zarr"
        seconds = clock(lambda: run_in_store(large_study(count, rtol), store, crew))
        size = sum(file.stat().st_size for file in store.rglob("*") if file.is_file())
    peak = int(re.search(r"VmHWM:\s+(\d+)", Path("/proc/self/status").read_text())[1]) / 1024  # type: ignore[index]
    print(f"\n{count} runs of the free rig, 8 parameters, rtol {rtol:g}, into a store: {seconds:.1f} s, ", end="")
    print(
        f"{count / seconds:.0f} runs/s on {_processors()} threads; peak memory {peak:.0f} MB, store {size / 1e6:.0f} MB"
    )
    return [
        Goal(f"{count} runs", "< 240 s", f"{seconds:.1f} s", seconds < 240),
        Goal(f"{count} runs, peak memory", "< 1000 MB", f"{peak:.0f} MB", peak < 1000),
    ]


def run_growth(largest: int, rtol: float, repetitions: int) -> list[Goal]:
    """Measure the cost per run of ever larger studies in memory; small ones are repeated."""
    rows, costs = [], []
    with local_crew() as crew:
        run_in_memory([large_study(64, rtol)], crew)
        for count in (1000, 10_000, 100_000, 1_000_000):
            if count > largest:
                break
            study = large_study(count, rtol)
            times = [clock(lambda: run_in_memory([study], crew)) for _ in range(_often(count, repetitions))]  # noqa: B023
            costs.append(statistics.median(times) / count)
            rows.append([count, spread(times, digits=2), f"{costs[-1] * 1e6:.1f}"])
    print(f"\nCost per run, the same eight parameters, rtol {rtol:g}")
    print_table(("runs", "wall time min / median [s]", "per run [us]"), rows)
    ratio = max(costs) / min(costs)
    return [Goal("cost per run, largest over smallest", "<= 1.1", f"{ratio:.2f}", ratio <= 1.1)]


def _processors() -> int:
    return usable_cores()


def _often(count: int, repetitions: int) -> int:
    return max(1, min(5 * repetitions, 100_000 // count))


def run_overhead(blocks: int) -> list[Goal]:
    """Measure the cost of a block besides its runs, with blocks of invalid cells."""
    rows = []
    axes = {"friction.coulomb": f"3.5 N..4 N:{blocks}", "controller.crossover": "1 Hz..16 Hz:1024"}
    study = Request(thesis_rig(), axes).study()
    with tempfile.TemporaryDirectory(prefix="friso-bench-") as folder:
        for name, crew_of in (("threads of this process", local_crew), ("2 processes", lambda: processes(2))):
            with crew_of() as crew:
                run_in_memory([study.at(np.arange(4096))], crew)
                memory = clock(lambda: run_in_memory([study], crew))
                stored = clock(lambda: run_in_store(study, Path(folder) / name, crew))  # noqa: B023
            blocks_in_memory = sum(1 for _ in crew.jobs([study]))
            rows.append([name, f"{memory / blocks_in_memory * 1e3:.1f}", f"{stored / blocks * 1e3:.1f}"])
    print(f"\nOverhead per block: {blocks} blocks of 1024 cells without runs (in memory blocks are larger)")
    print_table(("where", "in memory [ms]", "into a store [ms]"), rows)
    return []


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=("maps", "large", "growth", "overhead"))
    parser.add_argument("--runs", type=int, default=1_000_000, help="runs of the large study")
    parser.add_argument("--rtol", type=float, default=1e-4, help="tolerance of the large studies")
    parser.add_argument("--repetitions", type=int, default=5)
    options = parser.parse_args()
    sections: dict[str, Any] = {
        "maps": lambda: run_maps(options.repetitions),
        "large": lambda: run_large(options.runs, options.rtol),
        "growth": lambda: run_growth(options.runs, options.rtol, options.repetitions),
        "overhead": lambda: run_overhead(200),
    }
    goals = [goal for name, run in sections.items() if options.only in (None, name) for goal in run()]
    print_goals(goals, "Goals of issue 3, section 6")


if __name__ == "__main__":
    main()
