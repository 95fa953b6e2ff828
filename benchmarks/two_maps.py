"""Time the two 41 x 41 maps of the prototype, for friso and the prototype in turns."""

from __future__ import annotations

import statistics
from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from benchmarks.report import Goal, clock, print_table, spread
from benchmarks.rigs import RTOLS, Rig
from friso.engine.batch import RunOptions, Runs, run_chunks
from friso.hunting.criteria import COUNTED_AFTER, distinct_peaks
from friso.hunting.measures import RESOLVED, measure_runs, measuring_options

STRICT = 1e-9
"""Relative tolerance whose verdicts serve as the reference."""

MOST_REJECTED = 0.15


@dataclass(frozen=True)
class Map:
    """A map: name, rig, equations, friso's flat form, the prototype's, wanted agreement."""

    name: str
    rig: Rig
    flat: Mapping[str, Any]
    prototype: list[dict[str, Any]]
    agreement: float


def both_maps(locked: Rig, free: Rig) -> list[Map]:
    """Return both maps.

    Locked: crossover 1 to 40 Hz over total mass 0.1 to 5.1 kg; free: crossover 1 to 16 Hz over stroke 1e-6 to 1e-3 m.
    """
    mass, crossover = (v.ravel() for v in np.meshgrid(np.linspace(0.1, 5.1, 41), np.linspace(1, 40, 41), indexing="ij"))
    by_mass = {
        **locked.flat,
        "controller.crossover": crossover,
        "controller.tuned_mass": mass,
        "masses.cart": 0.7 * mass,
        "masses.stage": 0.3 * mass,
        "parasitic.mass": 0.15 * mass,
    }
    cells = zip(crossover, mass, strict=True)
    rows = [{"crossover": w, "stage": 0.3 * m, "cart": 0.7 * m, "locked": True} for w, m in cells]
    first = Map("locked, crossover x mass", locked, by_mass, rows, 0.995)
    stroke, crossover = (
        v.ravel() for v in np.meshgrid(np.linspace(1e-6, 1e-3, 41), np.linspace(1, 16, 41), indexing="ij")
    )
    by_stroke = {**free.flat, "controller.crossover": crossover, "joint.stroke": stroke}
    rows = [{"crossover": w, "stroke": s} for w, s in zip(crossover, stroke, strict=True)]
    return [first, Map("free, crossover x stroke", free, by_stroke, rows, 0.97)]


def friso_map(case: Map, rtol: float) -> tuple[np.ndarray, float]:
    """Return peak counts of all cells, and the rejected fraction of steps: the prototype's work."""
    settings = RunOptions(rtol=rtol, record_from=0.8 * COUNTED_AFTER, least_swing=RESOLVED)
    chunks = list(run_chunks(case.rig.kernel, case.flat, len(case.prototype), settings))
    peaks = np.empty(len(case.prototype))
    for chunk in chunks:
        peaks[chunk.numbers] = _count(chunk)
    attempted, rejected = (sum(float(c.statistic(name).sum()) for c in chunks) for name in ("attempted", "rejected"))
    failed = sum(int((chunk.results.statuses != 1).sum()) for chunk in chunks)
    if failed:
        print(f"  {case.name}, rtol {rtol:g}: {failed} cells failed")
    return peaks, rejected / attempted


def _count(chunk: Runs) -> np.ndarray:
    results = chunk.results
    room = max(1, int(results.turn_counts.max(initial=0)))
    times, values = results.turn_times[:, :room], results.turn_values[:, :room]
    return distinct_peaks(times, values, results.turn_counts).sum(axis=1)


def _measured_map(case: Map, rtol: float) -> None:
    """Run a map with all measures that `friso.sweep` reports."""
    for chunk in run_chunks(case.rig.kernel, case.flat, len(case.prototype), measuring_options(rtol)):
        measure_runs(chunk.part(case.flat), chunk)


def run_maps(maps: list[Map], prototype: ModuleType | None, repetitions: int) -> list[Goal]:
    """Time both maps at both tolerances; print a table, return the goals."""
    goals: list[Goal] = []
    rows = []
    for case in maps:
        strict = friso_map(case, STRICT)[0] > 0
        lanes = [prototype.parameters(**row) for row in case.prototype] if prototype else []
        for rtol in RTOLS:
            times = _times(case, prototype, lanes, rtol, repetitions)
            peaks, rejected = friso_map(case, rtol)
            agreement = float(np.mean((peaks > 0) == strict))
            rows.append([f"{case.name}, {rtol:g}", spread(times["friso"], digits=3)])
            rows[-1].append(spread(times["measured"], digits=3))
            ratio, other = np.nan, ["absent"] * 3
            if prototype:
                ratio = min(times["friso"]) / min(times["prototype"])
                middle = statistics.median(times["friso"]) / statistics.median(times["prototype"])
                counts, steps = prototype.sweep(lanes, rtol=rtol)
                share = float(np.mean((counts > 0) == strict))
                other = [spread(times["prototype"], digits=3), f"{ratio:.2f} / {middle:.2f}"]
                other.append(f"{1 - steps[1] / steps[0]:.1%}, {share:.2%}")
                about = f"map {case.name}, rtol {rtol:g}: wall time over the prototype's"
                goals.append(Goal(about, "<= 1", f"{ratio:.2f} (min), {middle:.2f} (median)", ratio <= 1))
            rows[-1] += [*other, f"{rejected:.1%}", f"{agreement:.2%}"]
            about = f"map {case.name}, rtol {rtol:g}: "
            goals.append(Goal(about + "rejected steps", "< 15 %", f"{rejected:.1%}", rejected < MOST_REJECTED))
            target = f">= {case.agreement:.1%}"
            goals.append(Goal(about + "verdicts as at 1e-9", target, f"{agreement:.2%}", agreement >= case.agreement))
    print("\nMaps, 41 x 41 runs of 20 s, all threads, wall time min / median [s]")
    head = ("map, rtol", "friso", "with all measures", "prototype", "friso/prototype min / median")
    print_table((*head, "prototype rejected, agrees", "rejected", "agrees with 1e-9"), rows)
    return goals


def _times(
    case: Map, prototype: ModuleType | None, lanes: list[Any], rtol: float, repetitions: int
) -> dict[str, list[float]]:
    """Return wall times [s] of friso, friso with all measures, and the prototype."""
    jobs: dict[str, Any] = {
        "friso": lambda: friso_map(case, rtol),
        "measured": lambda: _measured_map(case, rtol),
    }
    if prototype:
        jobs["prototype"] = lambda: prototype.sweep(lanes, rtol=rtol)
    times: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(max(3, 2 * repetitions)):
        for name, job in jobs.items():
            times[name].append(clock(job))
    return times
