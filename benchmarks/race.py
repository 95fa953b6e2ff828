"""Race friso, the prototype and the peers on one run of each rig, at equal tolerances."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from types import ModuleType
from typing import Any

import numpy as np

from benchmarks.compiled import Compiled
from benchmarks.metrics import Cycle, Distance, cycle, distance, maxima, sampled_maxima
from benchmarks.peers import NAMED, piecewise, race
from benchmarks.prototype import run as run_prototype
from benchmarks.report import Goal, clock, print_table, spread
from benchmarks.rigs import RTOLS, SAMPLE, Rig
from friso.engine.batch import RunOptions, run_chunks
from friso.hunting import measures
from friso.platform.system import usable_cores

RUNS = 512
REFERENCE_RTOL = 1e-11
WANTED = {1e-4: 2000.0, 1e-6: 1000.0}
"""Wanted ratio of the fastest peer's time to friso's, by rtol (issue 2)."""

CORES = usable_cores()


@dataclass
class Entry:
    """One method on one rig: times per run and core [s], steps, cycle, errors, remarks."""

    name: str
    seconds: list[float]
    steps: str = ""
    cycle: Cycle | None = None
    distance: Distance | None = None
    remark: str = ""


@dataclass
class Field:
    """Inputs of a race: rig, equations for the peers, peers, prototype, reference trace."""

    rig: Rig
    equations: Compiled
    peers: dict[str, Any]
    prototype: ModuleType | None
    reference: np.ndarray
    repetitions: int
    entries: dict[tuple[float, str], Entry] = field(default_factory=dict)


def reference_trace(rig: Rig, equations: Compiled, radau: Any) -> np.ndarray:
    """Return positions [m] on the grid by SciPy Radau at rtol 1e-11, piece by piece.

    They do not depend on friso's engine.
    """
    states, _ = piecewise(radau, rig, equations, REFERENCE_RTOL, True)
    return states[:, rig.kernel.states.index("position")]


def friso_trace(rig: Rig, rtol: float) -> tuple[np.ndarray, Any]:
    """Return friso's positions on the grid [m] and its results, for a single run."""
    (runs,) = run_chunks(rig.kernel, rig.flat, 1, RunOptions(rtol=rtol, interval=SAMPLE, budget=10_000_000))
    return runs.results.samples[0][:, rig.kernel.states.index("position")], runs


def friso_seconds(rig: Rig, rtol: float, runs: int, threads: int, spread_share: float = 0.0) -> float:
    """Return wall time [s] times threads over runs, for a batch.

    `spread_share` is the relative spread of the crossovers.
    """
    flat = dict(rig.flat)
    if spread_share:
        flat["controller.crossover"] = flat["controller.crossover"] * np.linspace(
            1 - spread_share, 1 + spread_share, runs
        )
    options = measures.measuring_options(rtol, threads)  # as in a sweep
    return clock(lambda: list(run_chunks(rig.kernel, flat, runs, options))) * threads / runs


def run_race(place: Field) -> list[Goal]:
    """Race on one rig at both tolerances; print the tables, return the goals."""
    goals: list[Goal] = []
    for rtol in RTOLS:
        entries = [*_lanes(place, rtol), *_peers(place, rtol)]
        place.entries |= {(rtol, entry.name): entry for entry in entries}
        _print(place, rtol, entries)
        goals += _goals(place, rtol)
    return goals


def _lanes(place: Field, rtol: float) -> list[Entry]:
    """Return friso and the prototype, timed in turns."""
    rig, module = place.rig, place.prototype
    times: dict[str, list[float]] = {}
    jobs: dict[str, Callable[[], float]] = {}
    answer = None
    for n in sorted({1, CORES}):
        jobs[f"friso, {n} thread{'s' * (n > 1)}"] = partial(friso_seconds, rig, rtol, RUNS, n)
    jobs["friso, crossovers +-5 %"] = partial(friso_seconds, rig, rtol, RUNS, 1, 0.05)
    if module is not None:
        rows = np.array([module.parameters(crossover=8.0, locked=rig.name == "locked")] * RUNS)
        answer = run_prototype(module, rows[:1], rtol)
        for n in sorted({1, CORES}):
            jobs[f"prototype, {n} thread{'s' * (n > 1)}"] = partial(_prototype_seconds, module, rows, rtol, n)
    for _ in range(max(5, 2 * place.repetitions)):
        for name, job in jobs.items():
            times.setdefault(name, []).append(job())
    entries = [Entry(name, seconds) for name, seconds in times.items()]
    position, runs = friso_trace(rig, rtol)
    count = int(runs.results.turn_counts[0])
    turns = runs.results.turn_times[0, :count], runs.results.turn_values[0, :count]
    rejected = runs.statistic("rejected")[0] / runs.statistic("attempted")[0]
    for entry in entries:
        if entry.name.startswith("prototype") and answer is not None:
            (attempted, accepted), peaks = answer
            entry.cycle = cycle(maxima(*peaks))
            entry.steps = f"{attempted} ({1 - accepted / attempted:.0%} rej.)"
            entry.remark = "own absolute tolerances"
        elif "+-" not in entry.name:
            entry.cycle, entry.distance = cycle(maxima(*turns)), distance(rig.grid, position, place.reference)
            entry.steps = f"{runs.statistic('attempted')[0]:.0f} ({rejected:.0%} rej.)"
    return entries


def _prototype_seconds(module: ModuleType, rows: np.ndarray, rtol: float, threads: int) -> float:
    import numba

    numba.set_num_threads(threads)
    try:
        return clock(lambda: run_prototype(module, rows, rtol)) * threads / len(rows)
    finally:
        numba.set_num_threads(CORES)


def _peers(place: Field, rtol: float) -> list[Entry]:
    entries = []
    for name, solve in place.peers.items():
        run = race(solve, place.rig, place.equations, rtol, place.repetitions)
        entry = Entry(name, run.seconds, remark=run.note or run.form)
        if np.isfinite(run.unsampled):
            entry.remark += f"; unsampled {run.unsampled:.3f} s"
        if run.position is not None:
            entry.steps = str(run.steps) if run.steps > 0 else ""
            entry.cycle = cycle(sampled_maxima(place.rig.grid, run.position))
            entry.distance = distance(place.rig.grid, run.position, place.reference)
        entries.append(entry)
    return entries


def _print(place: Field, rtol: float, entries: list[Entry]) -> None:
    truth = cycle(sampled_maxima(place.rig.grid, place.reference))
    print(f"\nRig {place.rig.name}, 8 Hz, 20 s, rtol {rtol:g}; reference: {truth.peaks} peaks", end="")
    print(f", amplitude {truth.amplitude * 1e3:.6f} mm, period {truth.period:.6f} s" if truth.peaks else "")
    base = min(place.entries[rtol, "friso, 1 thread"].seconds)
    head = ("method", "us/run/core min / median", "x friso", "steps", "peaks", "amplitude err", "period err")
    rows = []
    for e in entries:
        row = [e.name, spread(e.seconds, 1e6), f"{min(e.seconds) / base:.3g}", e.steps]
        c = e.cycle
        if c is None:
            row += ["", "", ""]
        else:
            row += [
                c.peaks,
                *(_relative(a, b) for a, b in ((c.amplitude, truth.amplitude), (c.period, truth.period))),
            ]
        d = e.distance
        row += [f"{v:.1e}" for v in (d.early, d.largest, d.rms, d.late)] if d else [""] * 4
        rows.append([*row, e.remark])
    print_table((*head, "max 0.1 s [m]", "max all [m]", "rms all [m]", "rms > 10 s [m]", "remark"), rows)


def _relative(value: float, truth: float) -> str:
    return f"{abs(value / truth - 1):.1e}" if np.isfinite(value) and np.isfinite(truth) else ""


def _goals(place: Field, rtol: float) -> list[Goal]:
    base = min(place.entries[rtol, "friso, 1 thread"].seconds)
    goals = []
    named = [name for name in place.peers if name in NAMED]
    for names, about in ((named, "the peers named"), (list(place.peers), "all peers, tuned too")):
        best = min(names, key=lambda name: min(place.entries[rtol, name].seconds))
        ratio = min(place.entries[rtol, best].seconds) / base
        goals.append(
            Goal(
                f"{place.rig.name}, rtol {rtol:g}: faster than the fastest of {about}",
                f">= {WANTED[rtol]:.0f} x",
                f"{ratio:.0f} x ({best})",
                ratio >= WANTED[rtol],
            )
        )
    return goals
