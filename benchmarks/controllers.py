"""Measure what a controller costs: `python -m benchmarks.controllers`.

It compares the time of a step per state of a rigid stage with a cascade and four biquads to that with a PID, on one
core, side by side. Stages have random crossovers, so that lanes differ.
"""

from __future__ import annotations

from time import perf_counter

import numpy as np

from benchmarks.report import print_table
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import kernel
from friso.equations.structure import structure
from friso.stage import Stage, loads

RUNS, ROUNDS = 512, 7
"""Stages of a batch, and number of batches for each controller, in turns."""

LIMIT = 2.0
"""Largest ratio allowed."""

AXIS = """
[masses]
stage = "1.7 kg"
[friction]
model = "lugre"
static = "3 N"
coulomb = "1 N"
stribeck_velocity = "1.6 mm/s"
stribeck_exponent = 2
bristle_stiffness = "1e5 N/m"
bristle_damping = "316 N*s/m"
viscous = "0.5 N*s/m"
[motion]
kind = "release"
displacement = "2 mm"
duration = "4 s"
[controller]
"""

PID = 'kind = "pid"\nkp = "4667 N/m"\nki = "1e5 N/(m*s)"\nkd = "50 N*s/m"\nderivative_on = "measurement"\n'

BIQUAD = """
[[controller.filters]]
kind = "biquad"
zero_frequency = "{0} Hz"
zero_damping = 0.1
pole_frequency = "{0} Hz"
pole_damping = 0.7
"""

CASCADE = 'kind = "cascade"\nkv = "60 1/s"\nkp = "50 N*s/m"\nvelocity_integral_time = "30 ms"\n' + "".join(
    BIQUAD.format(frequency) for frequency in (200, 300, 400, 500)
)


def main() -> None:
    """Print times of a step per state, and their ratio."""
    stages = {"PID": loads(AXIS + PID), "cascade, four biquads": loads(AXIS + CASCADE)}
    times: dict[str, list[float]] = {name: [] for name in stages}
    for _ in range(ROUNDS):
        for name, stage in stages.items():
            times[name].append(_step_per_state(stage))
    best = {name: min(taken) for name, taken in times.items()}
    states = {name: len(kernel(structure(stage.flat())).states) for name, stage in stages.items()}
    print_table(
        ("controller", "states", "ns/step/state"),
        [[name, str(states[name]), f"{best[name] * 1e9:.2f}"] for name in stages],
    )
    first, second = best.values()
    print(f"ratio {second / first:.2f} (at most {LIMIT:g})")


def _step_per_state(stage: Stage) -> float:
    """Return the time [s] of an attempted step per state on one core."""
    flat = {**stage.flat(), "masses.stage": np.random.default_rng(1).uniform(1.5, 1.9, RUNS)}
    shape = kernel(structure(stage.flat()))
    start, steps = perf_counter(), 0.0
    for runs in run_chunks(shape, flat, RUNS, RunOptions(rtol=1e-6, threads=1)):
        steps += float(runs.statistic("attempted").sum())
    return (perf_counter() - start) / steps / len(shape.states)


if __name__ == "__main__":
    main()
