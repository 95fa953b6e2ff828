"""The guideline as a page with its charts, and its edges as a table."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from friso.evidence import value
from friso.hunting.edges import KINDS, STEP
from friso.hunting.persistence import DISTANCES
from friso.studies.guideline import Guideline
from friso.studies.guideline.checks import ABOVE, BELOW, MOVES, PERIODS
from friso.studies.guideline.claims import claims
from friso.studies.guideline.groups import GROUPS, LIMITER_OVER_BRISTLES, values_of
from friso.studies.guideline.laws import FOLDS, GAIN, Errors
from friso.studies.guideline.parasitic import DRIVE
from friso.studies.guideline.rig import RigCase, plain
from friso.studies.guideline.sweeps import FREE_GRID, JOINT_BOX, LOCKED_BOX, LOCKED_GRID, Sweep
from friso.studies.guideline.worked import CLAIMED_AT, GAPS, MARGIN, STATIC, STUDIED
from friso.version import VERSION
from friso.views.files import Content, pictures
from friso.views.guideline.figures import guideline_figures
from friso.views.guideline.words import formulas, number, parasitic_edges, parasitic_sentences, percent
from friso.views.pages import environment

PAGE, TABLE = "guideline.md", "guideline_edges.csv"


CONSTANTS: Mapping[str, Any] = {
    "below": BELOW,
    "above": ABOVE,
    "distances": len(DISTANCES),
    "moves": MOVES,
    "periods": PERIODS,
    "folds": FOLDS,
    "gain": GAIN,
    "limiter": LIMITER_OVER_BRISTLES,
    "static": STATIC,
    "gaps": GAPS,
    "margin": MARGIN,
    "at": CLAIMED_AT,
    "step": f"{100 * (STEP - 1):.0f} %",
}
"""Settings of the computation that the page tells."""


def guideline_files(found: Guideline) -> dict[str, Content]:
    """The page, the table of edges, and the charts."""
    charts = pictures(guideline_figures(found), ("png",))
    return {PAGE: guideline_page(found), TABLE: edges_table(found), **charts}


def guideline_page(found: Guideline) -> str:
    """The page in Markdown; its charts and the table stand beside it."""
    template = environment().overlay(autoescape=False).get_template("guideline.md.j2")
    return template.render(
        found=found,
        locked=found.locked,
        free=found.free,
        steps=found.worked,
        formulas=formulas(found),
        groups=group_rows(found),
        figures={figure.name: figure for figure in guideline_figures(found)},
        claims=claims(found.worked),
        parasitic=found.parasitic,
        parasitic_words=parasitic_sentences(found.parasitic),
        parasitic_edges=parasitic_edges(found.worked.studies["parasitic"]),
        rough_minutes=value("guideline.minutes", "rough"),
        drive=DRIVE,
        kinds=KINDS,
        errors_of=_errors(found),
        number=number,
        percent=percent,
        studied=STUDIED,
        rows=_rows,
        worst=_worst(found),
        finite=math.isfinite,
        minutes=found.seconds / 60,
        constants=CONSTANTS,
        grids={"locked": LOCKED_GRID, "free": FREE_GRID},
        version=VERSION,
    )


ONE_WINDOW = "with one window (a diagnosis)"
"""Name of the rows of samples in which a cycle attracts up to the edge without a break."""

FAR = 1.5
"""Factor from which an edge is told of as far off the law."""


def _errors(found: Guideline) -> list[tuple[str, Errors]]:
    """Errors on held-out samples, by which they are."""
    rows = [
        ("joint locked", found.locked.on_test),
        (f"of these {ONE_WINDOW}", found.held_out(False, _one_window)),
        *(
            (f"omega_slip/omega_drop {_between(each.low, each.high)}", each.errors)
            for each in found.held_out_by_rates()
        ),
        ("joint free, all by law", found.free.on_test),
        (f"of these {ONE_WINDOW}", found.held_out(True, _one_window)),
        ("joint free, locked edge as computed", found.free.given),
    ]
    return [(name, errors) for name, errors in rows if errors is not None]


def _one_window(sweep: Sweep) -> np.ndarray:
    return sweep.edges.windows == 1


def _worst(found: Guideline) -> dict[str, Any] | None:
    """Of the samples, fitted and held out, whose locked edge is off the law by more than a factor: how many, the ends
    of their gap and stribeck groups, and how many of which kind; None without any."""
    used = found.locked.whole.usable
    off = np.abs(np.log(used.edge / found.locked.law.edge(used.values)))
    far = used.take(off > np.log(FAR))
    if not len(far.edge):
        return None
    kinds = Counter(far.edges.kind.astype(str))
    ends = {name: _span(far.values[name]) for name in ("gap", "stribeck")}
    words = ", ".join(f"{kind} ({count})" for kind, count in kinds.most_common())
    return {"count": len(far.edge), "of": len(used.edge), "factor": FAR, "kinds": words, **ends}


def _between(low: float, high: float) -> str:
    return f"below {high:g}" if low == 0 else f"above {low:g}" if math.isinf(high) else f"{low:g} to {high:g}"


def group_rows(found: Guideline) -> list[dict[str, Any]]:
    """One row per group: how it is written, what it means, its range in the sweeps, and its value for the rig."""
    ranges = dict(LOCKED_BOX) | {name: ends for name, ends in JOINT_BOX.items() if name in GROUPS}
    used = found.free.whole.usable
    ranges["joint"] = _span(used.values["joint"])
    edges = (found.locked.whole.usable.edge, used.edge)
    ranges["crossover"] = _span(np.concatenate(edges))
    own = values_of(plain("joint"))
    return [
        {
            "name": name,
            "written": group.written,
            "meaning": group.meaning,
            "part": group.part,
            "range": ranges.get(name),
            "rig": own.get(name),
        }
        for name, group in GROUPS.items()
    ]


def _span(x: np.ndarray) -> tuple[float, float]:
    return float(x.min()), float(x.max())


def _rows(name: str, cases: tuple[RigCase, ...]) -> list[tuple[float, float, float]]:
    """What a study varies, the edge by the law, and that computed."""
    return [(STUDIED[name](case.changes), case.law, case.computed) for case in cases]


def edges_table(found: Guideline) -> str:
    """All samples with their groups and edges, as CSV; four digits, which is more than edges are known to."""
    sweeps = {
        ("locked", "fit"): found.locked.fit,
        ("locked", "held out"): found.locked.test,
        ("free", "fit"): found.free.fit,
        ("free", "held out"): found.free.test,
    }
    names = [name for name in GROUPS if name in found.free.fit.values]
    after = ["locked edge", "edge", "law", "kind", "multiplier inside", "outside", "windows"]
    lines = [",".join(["joint state", "half", *names, *after])]
    for (state, half), sweep in sweeps.items():
        law = found.locked.law.edge(sweep.values)
        law = found.free.law.edge(sweep.values, law) if state == "free" else law
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
