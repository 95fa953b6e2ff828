"""Compare `friso simulate` with SciPy: positions of drawn stages over their whole motion.

SciPy solves the equations written by hand.
"""

import time
from typing import Any

import numpy as np

import friso
from benchmarks.by_hand import ByHand, by_hand
from benchmarks.report import Goal, print_goals, print_table
from benchmarks.truth.draws import draw
from friso.engine.batch import SIMULATION_RTOL
from friso.stage import Stage

WITHIN = 1e-2
"""Largest difference of positions, over the deflection of the loop by the break-away force."""

FINER, FINEST = 1e-10, 1e-11
SAMPLES = 4000


@np.errstate(all="ignore")
def compared(seed: int, number: int, series: str = "stages") -> dict[str, Any]:
    """Return how far friso's default run of a drawn stage (rtol 1e-9) is from SciPy at 1e-9.

    Distances are in deflections of the loop by the break-away force. If they are too large, both methods are also
    compared with themselves at finer tolerances, and with each other there.
    """
    stage = draw(seed, number, series)
    equations = by_hand(stage.flat())
    unit = equations.length
    begin = time.process_time()
    times, theirs = _scipy(stage, equations, SIMULATION_RTOL)
    seconds = time.process_time() - begin
    status, ours = _friso(stage, SIMULATION_RTOL, len(times))
    off = float(np.max(np.abs(ours - theirs)) / unit)
    record = {"number": number, "kind": stage.motion.kind, "status": status, "off": off, "scipy_cpu": seconds}
    if not off < WITHIN:
        fine, finest = _friso(stage, FINER, len(times))[1], _scipy(stage, equations, FINEST)[1]
        record |= {
            name: float(np.max(np.abs(a - b)) / unit)
            for name, a, b in (("friso", ours, fine), ("scipy", theirs, finest), ("fine", fine, finest))
        }
        record["first"] = float(times[np.argmax(~(np.abs(ours - theirs) < WITHIN * unit))])
    return record


def _scipy(stage: Stage, equations: ByHand, rtol: float) -> tuple[np.ndarray, np.ndarray]:
    flat = stage.flat()
    times = np.arange(SAMPLES + 1) * (flat["motion.duration"] / SAMPLES)
    displaced = flat["motion.displacement"] if flat["motion.kind"] == "release" else 0.0
    return times, equations.run(equations.start(displaced), times, rtol)[:, equations.measured]


def _friso(stage: Stage, rtol: float, count: int) -> tuple[str, np.ndarray]:
    response = friso.simulate(stage, rtol, sample_time=stage.flat()["motion.duration"] / SAMPLES)
    return response.attrs["status"], response["position"].values[:count]


def summary(records: list[dict[str, Any]]) -> None:
    """Print how many stages agree, and list the others."""
    far = [record for record in records if not record["off"] < WITHIN]
    if far:
        print("\nToo far: largest difference / deflection by the break-away force; first time [s] it is too large")
        columns = ("off", "friso", "scipy", "fine", "first")
        head = (
            "stage",
            "motion",
            "friso : SciPy",
            "friso 1e-9 : 1e-10",
            "SciPy 1e-9 : 1e-11",
            "both fine",
            "from [s]",
            "",
        )
        rows = [
            [record["number"], record["kind"], *(f"{record[column]:.2g}" for column in columns), record["status"]]
            for record in far
        ]
        print_table(head, rows)
    offs = sorted(record["off"] for record in records)
    median = offs[len(offs) // 2]
    about = f"{len(records)} simulated stages within {WITHIN:g} of the deflection by the break-away force"
    print_goals(
        [Goal(about, "all", f"{len(records) - len(far)}, median {median:.1e}", not far)], "Simulation against SciPy"
    )
