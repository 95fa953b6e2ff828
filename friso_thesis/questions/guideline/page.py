"""Write the guideline as a page with its charts, and its edges as a table."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from friso.evidence import findings_on_file, value
from friso.frequency.bode import COMFORTABLE_MARGIN
from friso.quantities import percent
from friso.shown.blocks import Content, pictures
from friso.shown.pages import environment
from friso.version import VERSION
from friso_thesis.questions.guideline.figures import guideline_figures
from friso_thesis.questions.guideline.words import formulas, log_error, number, parasitic_edges, parasitic_sentences
from friso_thesis.studies.guideline.claims import judged_claims
from friso_thesis.studies.guideline.compute import ABOVE_EDGE, BELOW_EDGE, MOVES_PER_SAMPLE, PERIODS_BESIDE, Guideline
from friso_thesis.studies.guideline.edges import CROSSOVER_STEP, EDGE_BISECTIONS, KINDS, START_DISTANCES
from friso_thesis.studies.guideline.groups import GROUPS, LIMITER_OVER_BRISTLES, values_of
from friso_thesis.studies.guideline.laws import LEAST_GAIN, VALIDATION_PARTS, Errors
from friso_thesis.studies.guideline.sweeps import FREE_GRID, JOINT_BOX, LOCKED_BOX, LOCKED_GRID, Sweep
from friso_thesis.studies.guideline.worked import (
    CHOSEN_STIFFNESS,
    CLAIMED_AT,
    DRIVE,
    FRICTION_GAPS,
    STATIC_FRICTIONS,
    STUDIED,
    ThesisCase,
    plain_rig,
)

PAGE, TABLE = "guideline.md", "guideline_edges.csv"


FAR_OFF_RATIO = 1.5
"""Ratio of computed edge to law from which the edge counts as far off."""

RESOLVED = max(float(grid[1] / grid[0]) ** 0.5**EDGE_BISECTIONS - 1 for grid in (LOCKED_GRID, FREE_GRID))
"""Relative width of the last step of a bisection."""

CONSTANTS: Mapping[str, Any] = {
    "below": BELOW_EDGE,
    "above": ABOVE_EDGE,
    "distances": len(START_DISTANCES),
    "moves": MOVES_PER_SAMPLE,
    "periods": PERIODS_BESIDE,
    "folds": VALIDATION_PARTS,
    "gain": LEAST_GAIN,
    "limiter": LIMITER_OVER_BRISTLES,
    "static": STATIC_FRICTIONS,
    "gaps": FRICTION_GAPS,
    "margin": CHOSEN_STIFFNESS,
    "at": CLAIMED_AT,
    "step": f"{percent(CROSSOVER_STEP - 1)}",
    "apart": f"{percent(START_DISTANCES[1] / START_DISTANCES[0] - 1)}",
    "resolved": f"{percent(RESOLVED, 1)}",
    "largest_gap": LOCKED_BOX["gap"][1],
    "far": FAR_OFF_RATIO,
    "comfortable": COMFORTABLE_MARGIN,
}
"""Settings of the computation that the page states."""


def guideline_files(guideline: Guideline) -> dict[str, Content]:
    """Return the page, the table of edges, and the charts."""
    charts = pictures(guideline_figures(guideline), ("png",))
    return {PAGE: guideline_page(guideline), TABLE: edges_table(guideline), **charts}


def guideline_page(guideline: Guideline) -> str:
    """Return the page in Markdown; its charts and the table stand beside it."""
    template = environment("friso_thesis.shown").overlay(autoescape=False).get_template("guideline.md.j2")
    return template.render(
        guideline=guideline,
        locked=guideline.locked,
        free=guideline.free,
        steps=guideline.worked,
        formulas=formulas(guideline),
        groups=group_rows(guideline),
        figures={figure.name: figure for figure in guideline_figures(guideline)},
        claims=judged_claims(guideline.worked),
        parasitic=guideline.parasitic,
        parasitic_words=parasitic_sentences(guideline.parasitic),
        parasitic_edges=parasitic_edges(guideline.worked.studies["parasitic"]),
        rough_minutes=value("guideline.minutes", "rough"),
        rough_day=findings_on_file()["guideline.minutes"].day,
        drive=DRIVE,
        kinds=KINDS,
        errors_of=_errors(guideline),
        number=number,
        span=_span_text,
        log_error=log_error,
        studied=STUDIED,
        rows=_rows,
        worst=_worst(guideline),
        finite=math.isfinite,
        minutes=guideline.seconds / 60,
        constants=CONSTANTS,
        grids={"locked": LOCKED_GRID, "free": FREE_GRID},
        version=VERSION,
    )


ONE_WINDOW = "with one window (a diagnosis)"
"""Name of the table rows for samples whose cycle attracts up to the edge without a gap."""


def _errors(guideline: Guideline) -> list[tuple[str, Errors]]:
    """Return the errors of both laws on sets of held-out samples, by the name of the set."""
    rows = [
        ("joint locked", guideline.locked.on_test),
        (f"of these {ONE_WINDOW}", guideline.held_out(False, _one_window)),
        *(
            (f"omega_slip/omega_drop {_between(part.low, part.high)}", part.errors)
            for part in guideline.held_out_by_rates()
        ),
        ("joint free, all by law", guideline.free.on_test),
        (f"of these {ONE_WINDOW}", guideline.held_out(True, _one_window)),
        ("joint free, locked edge as computed", guideline.free.on_computed_edge),
    ]
    return [(name, errors) for name, errors in rows if errors is not None]


def _one_window(sweep: Sweep) -> np.ndarray:
    return sweep.edges.windows == 1


def _worst(guideline: Guideline) -> dict[str, Any] | None:
    """Summarise the samples whose locked edge is far from the law, fitted and held out.

    Returns their number, how many there are of each kind of edge, and the ranges of their dimensionless groups `gap`
    and `stribeck`. Returns None if there are none.
    """
    used = guideline.locked.sweep.usable
    off = np.abs(np.log(used.edge / guideline.locked.law.edge(used.values)))
    far = used.take(off > np.log(FAR_OFF_RATIO))
    if not len(far.edge):
        return None
    kinds = Counter(far.edges.kind.astype(str))
    ends = {name: _span(far.values[name]) for name in ("gap", "stribeck")}
    words = ", ".join(f"{kind} ({count})" for kind, count in kinds.most_common())
    return {"count": len(far.edge), "of": len(used.edge), "factor": FAR_OFF_RATIO, "kinds": words, **ends}


def _between(low: float, high: float) -> str:
    return f"below {high:g}" if low == 0 else f"above {low:g}" if math.isinf(high) else f"{low:g} to {high:g}"


def group_rows(guideline: Guideline) -> list[dict[str, Any]]:
    """Return one row for each dimensionless group.

    A row has the group's formula, its meaning, its range in the sweeps, and its value for the thesis's rig.
    """
    ranges = dict(LOCKED_BOX) | {name: ends for name, ends in JOINT_BOX.items() if name in GROUPS}
    used = guideline.free.sweep.usable
    ranges["joint"] = _span(used.values["joint"])
    edges = (guideline.locked.sweep.usable.edge, used.edge)
    ranges["crossover"] = _span(np.concatenate(edges))
    thesis_values = values_of(plain_rig("joint"))
    return [
        {
            "name": name,
            "written": group.written,
            "meaning": group.meaning,
            "part": group.part,
            "range": ranges.get(name),
            "thesis": thesis_values.get(name),
        }
        for name, group in GROUPS.items()
    ]


def _span(x: np.ndarray) -> tuple[float, float]:
    return float(x.min()), float(x.max())


def _span_text(ends: tuple[float, float]) -> str:
    """Return the two ends of a range in words, or a single number."""
    low, high = (number(end) for end in ends)
    return low if low == high else f"{low} to {high}"


def _rows(name: str, cases: tuple[ThesisCase, ...]) -> list[tuple[float, float, float]]:
    """Return rows of a study's varied value, the edge [Hz] by the law, and the computed edge."""
    return [(STUDIED[name](case.changes), case.law, case.computed) for case in cases]


def edges_table(guideline: Guideline) -> str:
    """Return all samples with their dimensionless groups and edges, as CSV.

    Numbers have four digits, more than the accuracy of an edge.
    """
    sweeps = {
        ("locked", "fit"): guideline.locked.fit,
        ("locked", "held out"): guideline.locked.test,
        ("free", "fit"): guideline.free.fit,
        ("free", "held out"): guideline.free.test,
    }
    names = [name for name in GROUPS if name in guideline.free.fit.values]
    after = ["locked edge", "edge", "law", "kind", "multiplier inside", "outside", "windows"]
    lines = [",".join(["joint state", "half", *names, *after])]
    for (state, half), sweep in sweeps.items():
        law = guideline.locked.law.edge(sweep.values)
        law = guideline.free.law.edge(sweep.values, law) if state == "free" else law
        lines += [",".join([state, half, *row]) for row in _cells(sweep, law, names)]
    return "\n".join(lines) + "\n"


def _cells(sweep: Sweep, law: np.ndarray, names: list[str]) -> list[list[str]]:
    count = len(sweep.edge)
    empty = np.full(count, np.nan)
    edges = sweep.edges
    numbers = [sweep.values.get(name, empty) for name in names] + [sweep.locked, sweep.edge, law]
    texts = [[_cell(value) for value in column] for column in numbers]
    after = [[_cell(value) for value in column] for column in (edges.inside, edges.outside, edges.windows)]
    return [list(row) for row in zip(*texts, edges.kind.astype(str).tolist(), *after, strict=True)]


def _cell(value: float) -> str:
    return f"{value:.4g}" if np.isfinite(value) else ""
