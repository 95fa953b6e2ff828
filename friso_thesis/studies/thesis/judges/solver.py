"""Compare the solver of the thesis (Sec. 3.2.3) with friso's, on equal runs."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import Any

from friso.equations.controllers.pid import CROSSOVER
from friso.evidence import findings_on_file
from friso.hunting.criteria import SWINGS
from friso.quantities import percent
from friso.stage import Stage
from friso.studies.sweep import sweep
from friso_thesis.studies.thesis.claims import Evidence, Finding, FindingTable, Part, judges
from friso_thesis.studies.thesis.reading import words
from friso_thesis.studies.thesis.studies import thesis_rig

EVIDENCE = "thesis.solver"
"""Name of the finding on ode23s (`benchmarks/ode23s.py`), which takes 200 000 steps a run."""

RUN_CROSSOVERS = (4.0, 8.0, 12.0, 16.0, 20.0)
"""Crossovers [Hz] of runs with the joint locked and free: evenly spread up to where Fig. 11 sees no hunting."""

LIMITER_STROKES, LIMITER_DAMPINGS = (30, 100, 300), (1, 100, 10_000)
"""Strokes [um] and limiter dampings [N s/m] of further runs with the joint free, which hit the limiter: over Fig.
14B."""

AT_REST = 1e-9
"""Swing [m] below which a run counts as at rest."""

THESIS_RTOL, TIGHT_RTOL = 1e-4, 1e-8
"""The thesis's relative tolerance, and a tight one."""


def _cases() -> dict[str, dict[str, Any]]:
    both = {
        f"{'locked' if locked else 'free'}_{crossover:g}_hz": {"joint.locked": locked, CROSSOVER: f"{crossover:g} Hz"}
        for locked in (True, False)
        for crossover in RUN_CROSSOVERS
    }
    hit = {
        f"stroke_{stroke}_um_damping_{damping}": {
            "joint.stroke": f"{stroke} um",
            "joint.limiter_damping": f"{damping} N*s/m",
        }
        for stroke in LIMITER_STROKES
        for damping in LIMITER_DAMPINGS
    }
    return both | hit


CASES: Mapping[str, Mapping[str, Any]] = MappingProxyType(_cases())
"""Runs by name, with their changes of the rig."""


@judges("S323", figure="Sec. 3.2.3, solver")
def solver_and_largest_step(evidence: Evidence) -> Finding:
    """Judge whether runs by the thesis's solver and by friso hunt alike, as often and as far."""
    kept = findings_on_file()[EVIDENCE].values
    return judged_runs({name: _kept(kept, name) for name in CASES}, own_runs(TIGHT_RTOL), own_runs(THESIS_RTOL))


Counted = tuple[int, float, float]
"""Counted peaks, swing over the last quarter of the run [m], and number of steps."""


def _kept(values: Mapping[str, float], name: str) -> Counted:
    return int(values[f"{name}_peaks"]), values[f"{name}_swing_m"], values[f"{name}_steps"]


@cache
def own_runs(rtol: float) -> Mapping[str, Counted]:
    """Run friso at a relative tolerance on the runs that are compared (`CASES`), by name.

    The swing is 0 for a stage that does not swing at the end.
    """
    return {name: _counted(thesis_rig().replace(dict(changes)), rtol) for name, changes in CASES.items()}


def _counted(stage: Stage, rtol: float) -> Counted:
    cell = sweep(stage, {"joint.locked": [stage.flat()["joint.locked"]]}, rtol=rtol).isel({"joint.locked": 0})
    swing = float(cell["peak_to_peak"]) if cell["outcome"].item() == SWINGS else 0.0
    return int(cell["peaks"]), swing, float(cell["steps"])


def judged_runs(theirs: Mapping[str, Counted], tight: Mapping[str, Counted], loose: Mapping[str, Counted]) -> Finding:
    """Judge whether ode23s and friso count equal peaks and swings in the same runs.

    All arguments have runs by name: `theirs` by ode23s, `tight` by friso at a tight tolerance, and `loose` by friso at
    the thesis's.
    """
    swinging = [name for name, (_, swing, _) in tight.items() if swing > 0]
    counts = [name for name in tight if theirs[name][0] != tight[name][0]]
    off = {name: abs(theirs[name][1] / tight[name][1] - 1) for name in swinging}
    own = [name for name in tight if loose[name][0] != tight[name][0]]
    steps = [int(count) for _, _, count in theirs.values()], [int(count) for _, _, count in loose.values()]
    rows = tuple((_title(name), *(_text(runs[name]) for runs in (theirs, tight, loose))) for name in tight)
    return Finding.of(
        Part(
            f"ode23s, relative tolerance {THESIS_RTOL:g}, steps of at most 1e-4 s, counts as many peaks as friso at "
            f"{TIGHT_RTOL:g} in each of {len(tight)} runs",
            not counts,
            f"in {len(tight) - len(counts)} of {len(tight)}"
            + (f"; not in {', '.join(map(_title, counts))}" if counts else ""),
            why="The tolerance decides where a run is near an edge of hunting, or bounces on the limiter.",
        ),
        Part(
            f"the swing at the end is the same (within {percent(words.same)}) in each run that swings at "
            f"{TIGHT_RTOL:g}",
            bool(off) and max(off.values()) <= words.same,
            f"off by at most {percent(max(off.values()), 2)} in {len(off)} runs" if off else "no run swings",
            why="The tolerance is too loose for these.",
        ),
        Part(
            f"friso at {THESIS_RTOL:g}, without a largest step but the two hundredth of the run, counts as many in "
            "each",
            not own,
            f"in {len(tight) - len(own)} of {len(tight)}; {min(steps[1])} to {max(steps[1])} steps a run, ode23s "
            f"{min(steps[0])} to {max(steps[0])}",
            self_test=True,
        ),
        table=FindingTable(("run", "ode23s", f"friso, {TIGHT_RTOL:g}", f"friso, {THESIS_RTOL:g}"), rows),
    )


OTHER_SOLVERS = "thesis.other-solvers"
"""Name of the finding on ode23s, ode15s and ode45 for equal runs (`benchmarks/ode23s.py`)."""


@judges("S323C", figure="Sec. 3.2.3, other solvers")
def other_solvers(evidence: Evidence) -> Finding:
    """Compare the solvers that the thesis considers, on the locked and on the free rig."""
    return judged_solvers(findings_on_file()[OTHER_SOLVERS].values)


def judged_solvers(values: Mapping[str, float]) -> Finding:
    """Judge the cost and the results of ode15s and ode45 against those of ode23s.

    `values` has steps, evaluations, peaks and swing of each run, named as in `benchmarks.ode23s.other_solvers`. The
    thesis's runs have a largest step; the other reading is a comparison without one.
    """
    cheaper, cheaper_held = (_least_cost("ode15s", values, ending) for ending in ("", HELD))
    dearer, dearer_held = (_least_cost("ode45", values, ending) for ending in ("", HELD))
    right, swing = _as_ode23s(values, "")
    right_held, swing_held = _as_ode23s(values, HELD)
    rows = tuple(
        (
            f"{name}, joint {joint}{', steps of at most 1e-4 s' if ending else ''}",
            f"{values[f'{joint}_{name}{ending}_steps']:.0f}",
            f"{values[f'{joint}_{name}{ending}_evaluations']:.0f}",
            f"{values[f'{joint}_{name}{ending}_peaks']:.0f}",
            f"{values[f'{joint}_{name}{ending}_swing_m'] * 1e3:.4g} mm",
        )
        for ending in ("", HELD)
        for name in _SOLVERS
        for joint in _JOINTS
        if f"{joint}_{name}{ending}_steps" in values
    )
    return Finding.of(
        Part(
            "with the thesis's steps of at most 1e-4 s ode23s evaluates the equations less often than ode15s",
            cheaper_held > 1,
            f"ode15s needs {cheaper_held:.2g} times as many, those of numerical Jacobians included, and "
            f"{_times_steps(values):.2g} times the steps, the joint locked (free, SciPy's gets stuck at rest); without "
            f"a largest step, the other reading, {cheaper:.2g} times as many evaluations and more. Assumed: SciPy's "
            "BDF and RK45 for ode15s and ode45",
            why="Steps of 1e-4 s leave ode23s no longer ones, and it computes a Jacobian in each.",
        ),
        Part(
            "ode45 becomes problematic in the thesis's runs, with steps of at most 1e-4 s: it needs more evaluations "
            f"than ode23s, or counts other peaks, or another swing (by more than {percent(words.same)})",
            dearer_held > 1 or not right_held or abs(swing_held - 1) > words.same,
            f"{dearer_held:.2g} times the evaluations and more, {'the same' if right_held else 'other'} peaks, "
            f"{swing_held:.4g} times the swing; without a largest step, the other reading, {dearer:.2g} times the "
            f"evaluations and more, {'the same' if right else 'other'} peaks, {swing:.3g} times the swing",
            why="Its control of the step keeps it stable, and steps of 1e-4 s leave ode23s no advantage: it also "
            "computes the Jacobian.",
        ),
        table=FindingTable(("solver", "steps", "evaluations", "counted peaks", "swing at the end"), rows),
    )


def _least_cost(name: str, values: Mapping[str, float], ending: str) -> float:
    """Return the evaluations of a solver over those of ode23s, the fewer of joint locked and free.

    `ending` tells runs with the largest step. A run that is not there, as it did not end, is left out.
    """
    key = f"{ending}_evaluations"
    ran = [joint for joint in _JOINTS if f"{joint}_{name}{key}" in values]
    return min(values[f"{joint}_{name}{key}"] / values[f"{joint}_ode23s{key}"] for joint in ran)


def _times_steps(values: Mapping[str, float]) -> float:
    """Return the steps of ode15s over those of ode23s, joint locked, with the largest step."""
    return values[f"locked_ode15s{HELD}_steps"] / values[f"locked_ode23s{HELD}_steps"]


def _as_ode23s(values: Mapping[str, float], ending: str) -> tuple[bool, float]:
    """Tell whether ode45 counts as many peaks as ode23s, and return its swing over that of ode23s, joint locked."""
    same = all(values[f"{joint}_ode45{ending}_peaks"] == values[f"{joint}_ode23s{ending}_peaks"] for joint in _JOINTS)
    return same, values[f"locked_ode45{ending}_swing_m"] / values[f"locked_ode23s{ending}_swing_m"]


HELD = "_held"
"""Ending of the names of runs with the thesis's largest step."""

_JOINTS = ("locked", "free")
_SOLVERS = ("ode23s", "ode15s", "ode45")


def _title(name: str) -> str:
    """Write the name of a run, such as "locked_8_hz", with blanks and units."""
    return name.replace("_", " ").replace(" hz", " Hz").replace(" um damping", " um, damping")


def _text(run: Counted) -> str:
    peaks, swing, steps = run
    swings = f", {1e3 * swing:.4g} mm" if swing > AT_REST else ""
    return f"{peaks} peaks{swings}, {steps:.0f} steps"
