"""Time leaf springs and the design method: `python -m benchmarks.design`.

It times the closed forms for one geometry and for a million at once, and the beam model for one geometry. Then a whole
design run with its verification is timed, step by step, once its kernels are compiled.
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import friso
from benchmarks.report import Goal, clock, print_goals, print_table, spread
from friso.design_method.method import design
from friso.design_method.spec import load_spec
from friso.leaf_springs import closed_forms
from friso.leaf_springs.beams import beams
from friso.leaf_springs.closed_forms import first_interfering
from friso.leaf_springs.mechanism import Mechanism

EXAMPLES = Path(__file__).parent.parent / "examples"
MANY = 1_000_000
CHUNK = 20_000
STROKE = 1e-3


def many(mechanism: Mechanism, count: int) -> Mechanism:
    """Return mechanisms with lengths, widths and thicknesses drawn around one mechanism."""
    draw = np.random.default_rng(0).uniform(0.5, 1.5, (3, count))
    sizes = {
        name: getattr(mechanism, name) * factor
        for name, factor in zip(("length", "width", "thickness"), draw, strict=True)
    }
    centre = (sizes["length"], 0.0, 0.0)
    return replace(mechanism, **sizes, body=replace(mechanism.body, centre=centre), actuation=centre, sensor=centre)


def all_figures(mechanism: Mechanism) -> None:
    """Compute all numbers that a search uses."""
    for form in (closed_forms.drive_stiffness, closed_forms.buckling_load):
        form(mechanism)
    for deflected in (closed_forms.max_stress, closed_forms.support_x, closed_forms.support_y):
        deflected(mechanism, STROKE)
    first_interfering(mechanism)


def steps() -> tuple[list[tuple[str, float]], float]:
    """Return the steps of a design run with their times [s], and the total time."""
    stage, spec = friso.load(EXAMPLES / "thesis_rig.toml"), load_spec(EXAMPLES / "specs" / "thesis.toml")
    reported: list[tuple[str, float]] = []
    start = time.perf_counter()

    def progress(done: int, total: int, what: str) -> None:
        if not reported or reported[-1][0] != what:
            reported.append((what, time.perf_counter()))

    design(stage, spec, progress)
    end = time.perf_counter()
    starts = [at for _, at in reported]
    return [(what, b - a) for (what, a), b in zip(reported, [*starts[1:], end], strict=True)], end - start


def run(repetitions: int) -> list[Goal]:
    single_mechanism = Mechanism.of(friso.load(EXAMPLES / "thesis_leaves.toml").flat())
    parts = [many(single_mechanism, CHUNK) for _ in range(MANY // CHUNK)]
    single = [clock(lambda: all_figures(single_mechanism)) for _ in range(20 * repetitions)]
    batches = [clock(lambda: [all_figures(part) for part in parts]) for _ in range(repetitions)]
    beam = [clock(lambda: beams(single_mechanism, STROKE)) for _ in range(20 * repetitions)]
    print_table(
        ("leaf springs", "min / median [s]"),
        [
            ["closed forms, one geometry", spread(single, digits=5)],
            [f"closed forms, {MANY:.0e} geometries", spread(batches, digits=2)],
            ["beams, one geometry", spread(beam, digits=4)],
        ],
    )
    steps()  # compiles
    runs = [steps() for _ in range(repetitions)]
    best = min(runs, key=lambda timed: timed[1])
    print_table(("design run", "[s]"), [[what, f"{seconds:.1f}"] for what, seconds in best[0]])
    total = best[1]
    return [
        Goal(
            "one geometry by closed forms, of many at once",
            "< 1 ms",
            f"{min(batches) / MANY * 1e3:.4f} ms",
            min(batches) / MANY < 1e-3,
        ),
        Goal(f"{MANY:.0e} geometries", "a few seconds", f"{min(batches):.1f} s", min(batches) < 10),
        Goal("one geometry by beams", "< 10 ms", f"{min(beam) * 1e3:.1f} ms", min(beam) < 10e-3),
        Goal(
            "beams against closed forms, one by one of many",
            "",
            f"{min(beam) / (min(batches) / MANY):.0f} times as long",
            None,
        ),
        Goal("design run with verification", "< 60 s", f"{total:.1f} s", total < 60),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repetitions", type=int, default=3)
    print_goals(run(parser.parse_args().repetitions), "Goals")


if __name__ == "__main__":
    main()
