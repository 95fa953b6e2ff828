"""Measure what lesser processors cost: `python -m benchmarks.processors`.

It runs two maps of the thesis rig, on one core, with code for each processor that this machine can imitate, in
turns. Times are ratios to this machine's own; the fraction of runs with equal outcome is printed as well.
"""

from __future__ import annotations

import argparse
import base64
import json
import os
import subprocess
import sys
import time

import numpy as np

import friso
from benchmarks.report import print_table
from friso.engine.machine_code import PROCESSOR_VARIABLE, processor
from friso.studies.study import Request, Study
from friso.studies.sweep import local_crew, run_in_memory

LEVELS = {"": "this machine", "x86-64-v4": "AVX-512", "x86-64-v3": "AVX2", "x86-64-v2": "SSE4.2", "x86-64": "SSE2"}
"""Processors by LLVM's name, most able first, and their usual names."""


def maps(rtol: float) -> dict[str, Study]:
    """Return two maps of the thesis rig over crossover: of the cart's mass, joint locked, and of stroke, joint free."""
    stage = friso.load(friso.example("thesis_rig"))
    locked = {"controller.crossover": "1 Hz..40 Hz:41", "masses.cart": "0.1 kg..5 kg:41"}
    free = {"controller.crossover": "1 Hz..16 Hz:41", "joint.stroke": "1 um..1 mm:41"}
    return {
        "locked, crossover x mass": Request(stage.replace({"joint.locked": True}), locked).study(rtol=rtol),
        "free, crossover x stroke": Request(stage, free).study(rtol=rtol),
    }


def measure(rtol: float, repetitions: int) -> dict[str, list[float | str]]:
    """Return the least time [s] of each map on one core, and which of its runs swing, packed.

    This runs in the present process.
    """
    result: dict[str, list[float | str]] = {}
    with local_crew(1) as crew:
        for name, study in maps(rtol).items():
            times, peaks = [], np.zeros(0)
            for _ in range(repetitions + 1):  # the first run warms up
                start = time.process_time()
                (data,) = run_in_memory([study], crew)
                peaks = np.asarray(data["peaks"]).ravel()
                times.append(time.process_time() - start)
            swings = np.packbits(peaks > 0).tobytes()
            result[name] = [min(times[1:]), base64.b64encode(swings).decode("ascii")]
    return result


def measured_on(name: str, rtol: float, repetitions: int) -> dict[str, tuple[float, np.ndarray]]:
    """Time the maps in a process of its own, with code for the named processor."""
    command = [sys.executable, "-m", "benchmarks.processors", "--child", str(rtol), str(repetitions)]
    done = subprocess.run(command, env={**os.environ, PROCESSOR_VARIABLE: name}, stdout=subprocess.PIPE, check=True)
    maps = json.loads(done.stdout)
    return {case: (seconds, _unpacked(bits)) for case, (seconds, bits) in maps.items()}


def _unpacked(bits: str) -> np.ndarray:
    return np.unpackbits(np.frombuffer(base64.b64decode(bits), np.uint8))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rtol", type=float, default=1e-6)
    parser.add_argument("--repetitions", type=int, default=3)
    parser.add_argument("--child", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        print(json.dumps(measure(float(options.child[0]), int(options.child[1]))))
        return
    measured = {name: measured_on(name, options.rtol, options.repetitions) for name in LEVELS}
    own = measured[""]
    rows = []
    for name, known_for in LEVELS.items():
        for case, (seconds, swings) in measured[name].items():
            ratio, agreement = seconds / own[case][0], np.mean(swings == own[case][1])
            called = f"{known_for} ({name or processor().name})"
            rows.append([called, case, f"{seconds:.2f}", f"{ratio:.2f}", f"{100 * agreement:.2f} %"])
    print(f"\n41 x 41 runs of 20 s, one core, rtol {options.rtol:g}")
    print_table(("processor", "map", "CPU time [s]", "ratio", "same outcome"), rows)


if __name__ == "__main__":
    main()
