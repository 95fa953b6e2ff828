"""Run the peers: SciPy's stiff solvers and SUNDIALS CVODE, with compiled functions.

Right-hand side and Jacobian are compiled. Each peer is tried in two ways, over the whole run at once and piece by piece
between the corners of the reference; the faster one counts. Each is also run without sampling, which shows its own
steps. Issue 2 names some peers, with their default options (`NAMED`). Further peers are what an expert would try:
ODEPACK's LSODA with its loop in compiled code (`odeint`), and BDF of order 2 at most, since higher orders crawl on
lightly damped contact modes.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import odeint, solve_ivp

from benchmarks.compiled import Compiled
from benchmarks.rigs import Rig

TIME_OUT = 120.0
"""Wall time [s] after which a peer's run is abandoned."""

LONG = 5.0
"""Duration [s] beyond which a run is neither repeated nor run unsampled."""

MANY = 10_000_000


@dataclass(frozen=True)
class Task:
    """A stretch to integrate: rig, equations, rtol, reference, times [s] to report, start."""

    rig: Rig
    equations: Compiled
    rtol: float
    rows: np.ndarray
    times: np.ndarray
    start: np.ndarray


Solve = Callable[[Task], tuple[np.ndarray, int]]
"""Function that returns states (times, states) at the times of the task, the first included, and steps (-1: unknown).
With two times, it returns the states at the solver's own steps if it can."""


def _solve_ivp(method: str) -> Solve:
    def solve(task: Task) -> tuple[np.ndarray, int]:
        f, j, rows = task.equations.rate, task.equations.jacobian, task.rows
        solution = solve_ivp(
            lambda t, x: f(t, x, rows),
            (task.times[0], task.times[-1]),
            task.start,
            method,
            t_eval=task.times if len(task.times) > 2 else None,
            rtol=task.rtol,
            atol=task.rtol * task.rig.scales,
            jac=lambda t, x: j(t, x, rows),
        )
        if not solution.success:
            raise RuntimeError(solution.message)
        return solution.y.T, len(solution.t) - 1 if len(task.times) <= 2 else -1

    return solve


def _odeint(order: int) -> Solve:
    """Return LSODA with its loop in compiled code, with BDF up to the given order."""

    def solve(task: Task) -> tuple[np.ndarray, int]:
        f, j, rows = task.equations.rate, task.equations.jacobian, task.rows
        states, info = odeint(
            lambda t, x: f(t, x, rows),
            task.start,
            task.times,
            Dfun=lambda t, x: j(t, x, rows),
            rtol=task.rtol,
            atol=task.rtol * task.rig.scales,
            mxstep=MANY,
            mxords=order,
            tfirst=True,
            full_output=True,
        )
        if info["message"] != "Integration successful.":
            raise RuntimeError(info["message"])
        return states, int(info["nst"][-1])

    return solve


def _cvode(order: int) -> Solve:
    """Return CVODE's BDF up to the given order."""
    from sksundae.cvode import CVODE  # pyright: ignore[reportMissingImports]  # of the extra "bench"

    def solve(task: Task) -> tuple[np.ndarray, int]:
        f, j, rows = task.equations.fill_rate, task.equations.fill_jacobian, task.rows
        solver = CVODE(
            lambda t, x, out: f(t, x, rows, out),
            jacfn=lambda t, x, rate, out: j(t, x, rows, out),
            rtol=task.rtol,
            atol=task.rtol * task.rig.scales,
            max_order=order,
            max_num_steps=MANY,
        )
        solution = solver.solve(task.times, task.start)
        if not solution.success:
            raise RuntimeError(solution.message)
        return solution.y, len(solution.t) - 1 if len(task.times) <= 2 else -1

    return solve


NAMED = ("SciPy Radau", "SciPy BDF", "SciPy LSODA", "SUNDIALS CVODE")
"""The peers that issue 2 names, with their default options."""


def peers() -> dict[str, Solve]:
    """Return all peers by name, without SUNDIALS if scikit-sundae is not installed."""
    solvers = {
        "SciPy Radau": _solve_ivp("Radau"),
        "SciPy BDF": _solve_ivp("BDF"),
        "SciPy LSODA": _solve_ivp("LSODA"),
        "odeint (LSODA)": _odeint(5),
        "odeint, order <= 2": _odeint(2),
    }
    try:
        return solvers | {"SUNDIALS CVODE": _cvode(5), "CVODE, order <= 2": _cvode(2)}
    except ImportError:
        print("  skipped: SUNDIALS CVODE (pip install scikit-sundae)")
        return solvers


def at_once(solve: Solve, rig: Rig, equations: Compiled, rtol: float, sampled: bool) -> tuple[np.ndarray, int]:
    """Return states over the whole run in one call, and steps."""
    times = rig.grid if sampled else rig.grid[[0, -1]]
    return solve(Task(rig, equations, rtol, rig.pieces, times, np.zeros(len(rig.scales))))


def piecewise(solve: Solve, rig: Rig, equations: Compiled, rtol: float, sampled: bool) -> tuple[np.ndarray, int]:
    """Return states over the run, with each piece of the reference solved separately, and steps."""
    start = np.zeros(len(rig.scales))
    ends = np.append(rig.pieces[1:, 0], rig.duration)
    parts, steps, grid = [start[None, :]], 0, rig.grid
    for row, end in zip(rig.pieces, ends, strict=True):
        inner = grid[(grid > row[0]) & (grid < end)] if sampled else np.empty(0)
        times = np.array([row[0], *inner, end])
        states, taken = solve(Task(rig, equations, rtol, row[None, :], times, start))
        start = states[-1].copy()
        parts.append(states[1:])
        steps += taken
    return np.concatenate(parts), steps


@dataclass
class Run:
    """Result of a peer: its better way, times [s], positions, steps, unsampled time [s]."""

    form: str
    seconds: list[float]
    position: np.ndarray | None
    steps: int
    unsampled: float
    note: str = ""


FORMS: dict[str, Any] = {"whole": at_once, "pieces": piecewise}


def race(solve: Solve, rig: Rig, equations: Compiled, rtol: float, repetitions: int) -> Run:
    """Time a peer both ways, and repeat the faster one.

    A run beyond the time-out counts as that long.
    """
    runs = [_try(form, solve, rig, equations, rtol) for form in FORMS]
    best = min(runs, key=lambda run: run.seconds[0])
    if best.position is None:
        return best
    if best.seconds[0] > LONG:
        return best
    for _ in range(repetitions - 1):
        best.seconds.append(_timed(best.form, solve, rig, equations, rtol, True)[0])
    best.unsampled, (_, steps) = _timed(best.form, solve, rig, equations, rtol, False)
    best.steps = steps
    return best


def _try(form: str, solve: Solve, rig: Rig, equations: Compiled, rtol: float) -> Run:
    try:
        with time_out(TIME_OUT):
            seconds, (states, steps) = _timed(form, solve, rig, equations, rtol, True)
    except TimeoutError:
        return Run(form, [TIME_OUT], None, -1, np.nan, f"stopped after {TIME_OUT:g} s")
    except RuntimeError as error:
        return Run(form, [np.inf], None, -1, np.nan, f"failed: {error}")
    return Run(form, [seconds], states[:, rig.kernel.states.index("position")], steps, np.nan)


def _timed(form: str, *arguments: Any) -> tuple[float, Any]:
    start = time.perf_counter()
    result = FORMS[form](*arguments)
    return time.perf_counter() - start, result


@contextmanager
def time_out(seconds: float) -> Iterator[None]:
    """Raise TimeoutError in the block after some seconds, where Python code is called back."""

    def stop(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
