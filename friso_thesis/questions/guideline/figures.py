"""Draw the charts of the guideline.

They show the edge of hunting over the frequencies that determine it, edges by the laws over computed edges, and the
rig.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from friso.shown.drawing.figure import (
    BLUE,
    GREEN,
    GREY,
    INK,
    LIGHT,
    ORANGE,
    VERMILLION,
    Array,
    Axis,
    Category,
    Cloud,
    Figure,
    Markers,
    Panel,
    Series,
)
from friso_thesis.studies.guideline.compute import Fit, Guideline
from friso_thesis.studies.guideline.edges import FLIP, FOLD, JUMP, LOST
from friso_thesis.studies.guideline.sweeps import Sweep
from friso_thesis.studies.guideline.worked import STUDIED, Laws, ThesisCase, plain_rig

ENDS = {
    FLIP: Category("the cycle flips", BLUE),
    JUMP: Category("another cycle takes its place", GREEN),
    FOLD: Category("it folds", ORANGE),
    LOST: Category("just beyond, no orbit can be closed", VERMILLION),
}
HALVES = (Category("samples of the fit", LIGHT), Category("samples held out", BLUE))
FULL_STROKE_SHARE = 1.0
"""Joint force at full stroke, over static friction, from which the chart of the joint counts a stroke as ample."""


LARGEST_EFFECT_SHARE = 5.0
"""Upper end of the chart of the stroke, as a multiple of the joint's effect."""

FINER_POINTS = 10
"""Number of points of a drawn law per step between two computed edges."""


def guideline_figures(guideline: Guideline) -> tuple[Figure, ...]:
    """Return all charts, in the order of the page."""
    return (
        _edge_of_rigid_masses(guideline),
        _free(guideline),
        _stroke(guideline),
        _against(guideline),
        _thesis_rig(guideline),
    )


def _edge_of_rigid_masses(guideline: Guideline) -> Figure:
    """Draw the edge of rigid masses over the ratio of the two frequencies that determine it.

    The bearing slips at one of them; at the other, falling friction drives the mass away.
    """
    sweep = guideline.locked.test.usable
    slip, drop = np.exp(guideline.locked.law.log_rates(sweep.values))
    mean = np.sqrt(slip * drop)
    ratio = np.geomspace(*_ends(slip / drop), 200)
    law = Series(ratio, 1 / (np.sqrt(ratio) + 1 / np.sqrt(ratio)), "the law", INK)
    panel = Panel(
        "Joint locked: held-out samples",
        _log("omega_slip / omega_drop", slip / drop),
        _log("omega_edge / sqrt(omega_slip omega_drop)", np.append(sweep.edge / mean, 0.5)),
        (law,),
        clouds=(_by_end(slip / drop, sweep.edge / mean, sweep),),
    )
    caption = (
        "Above the points no cycle is known to attract. On the left slip limits hunting, on the right the drop in "
        "friction."
    )
    return Figure("guideline_locked", "Where hunting ends, joint locked", caption, (panel,))


def _free(guideline: Guideline) -> Figure:
    """Draw the edge with a free joint of ample stroke over the joint's frequency.

    Edge and frequency are relative to the edge with the joint locked.
    """
    sweep = _both(guideline.free, lambda values: values["stroke"] > FULL_STROKE_SHARE)
    joint = np.exp(guideline.free.law.log_rates(sweep.values)[0])
    x, y = joint / sweep.locked, sweep.edge / sweep.locked
    line = np.geomspace(*_ends(x), 200)
    panel = Panel(
        "Joint free, stroke ample (k_j S_j > F_s)",
        _log("omega_joint / omega_locked", x),
        _log("omega_edge / omega_locked", y),
        (Series(line, 1 / np.sqrt(1 + line**-2), "the law", INK),),
        clouds=(_by_end(x, y, sweep),),
    )
    caption = (
        "What the isolator gains: left of 1 the edge follows the joint; far to the right of 1 the joint is as good as "
        "locked."
    )
    return Figure("guideline_free", "Where hunting ends, joint free", caption, (panel,))


def _stroke(guideline: Guideline) -> Figure:
    """Draw which fraction of a joint's effect on the edge remains with a short stroke."""
    sweep = _both(guideline.free, lambda values: values["stroke"] > 0)
    joint, stroke = np.exp(guideline.free.law.log_rates(sweep.values))
    effect = (sweep.edge**-2 - sweep.locked**-2) * joint**2
    felt = joint < sweep.locked  # a small effect would make the fraction uncertain
    x = (joint / stroke) ** 2
    line = np.geomspace(*_ends(x[felt]), 200)
    y = effect[felt]
    visible = (float(min(0.0, *(1.05 * y))), float(max(1.6, *(1.05 * y))))
    visible = max(visible[0], -LARGEST_EFFECT_SHARE), min(visible[1], LARGEST_EFFECT_SHARE)
    out = int(np.count_nonzero((y < visible[0]) | (y > visible[1])))
    panel = Panel(
        "Joints slower than the locked edge",
        _log("(omega_joint / omega_stroke)^2, about k_j S_j / F_s", x[felt]),
        Axis("share of the joint's effect", "", visible),
        (Series(line, np.minimum(1.0, line), "the law", INK),),
        clouds=(_by_end(x[felt], y, sweep.take(felt)),),
    )
    caption = "The effect is that on 1/omega_edge^2; a stroke beyond 1 adds nothing."
    caption += f" {out} of {len(y)} points lie outside the chart." if out else ""
    return Figure("guideline_stroke", "How much stroke the joint needs", caption, (panel,))


def _against(guideline: Guideline) -> Figure:
    """Draw edges of hunting by the laws over computed ones, for fitted and held-out samples."""
    locked, free = guideline.locked, guideline.free
    predicted = [
        free.law.edge(sweep.values, locked.law.edge(sweep.values)) for sweep in (free.fit.usable, free.test.usable)
    ]
    rigid = [locked.law.edge(sweep.values) for sweep in (locked.fit.usable, locked.test.usable)]
    panels = (
        _scatter("Joint locked", rigid, [locked.fit.usable.edge, locked.test.usable.edge]),
        _scatter("Joint free, locked edge by its law", predicted, [free.fit.usable.edge, free.test.usable.edge]),
    )
    caption = "Edges in units of sqrt(sigma_0/m); dotted: 20 % off."
    return Figure("guideline_errors", "Laws against computed edges", caption, panels, 2)


def _scatter(title: str, law: Sequence[Array], computed: Sequence[Array]) -> Panel:
    x, y = np.concatenate(list(law)), np.concatenate(list(computed))
    codes = np.repeat([0.0, 1.0], [len(values) for values in law])
    line = np.array(_ends(np.concatenate([x, y])))
    off = [Series(line, factor * line, "20 % off" if factor > 1 else "", GREY, "dotted") for factor in (1 / 1.2, 1.2)]
    return Panel(
        title,
        _log("edge by the law", line),
        _log("edge computed", line),
        (Series(line, line, "equal", INK, width=1.0), *off),
        clouds=(Cloud(x, y, np.full(len(x), np.nan), "samples", "", categories=HALVES, codes=codes),),
    )


def _thesis_rig(guideline: Guideline) -> Figure:
    """Draw the edges of the thesis's rig with one thing changed at a time."""
    laws = Laws(guideline.locked.law, guideline.free.law)
    panels = tuple(_studied(title, x, guideline.worked.studies[name], laws) for name, (title, x) in PANELS.items())
    flat = plain_rig("joint")
    mass, stiffness, stroke = (
        flat["masses.cart"] + flat["masses.stage"],
        flat["joint.stiffness"] / 1e3,
        flat["joint.stroke"] * 1e3,
    )
    caption = f"Lines: the laws. Points: computed edges. The rig has {mass:g} kg, {stiffness:g} N/mm, {stroke:g} mm."
    return Figure("guideline_thesis_rig", "The thesis rig", caption, panels, 2)


PANELS: Mapping[str, tuple[str, Axis]] = {
    "mass": ("Joint locked: mass, the controller tuned for it", Axis("Mass", "kg")),
    "stiffness": ("Joint free: stiffness at 1 mm", Axis("Stiffness", "N/m", (450.0, 1.1e4), log=True)),
    "stroke": ("Joint free: stroke at 2.4 N/mm", Axis("Stroke", "m", (4.5e-5, 2.2e-3), log=True)),
    "share": ("Joint free: stage over total mass", Axis("M_stage / m", "")),
}


def _studied(title: str, x: Axis, cases: Sequence[ThesisCase], laws: Laws) -> Panel:
    name = next(name for name, (heading, _) in PANELS.items() if heading == title)
    at, computed = np.array([(STUDIED[name](case.changes), case.computed) for case in cases]).T
    places = np.linspace(0, len(cases) - 1, FINER_POINTS * (len(cases) - 1) + 1)
    changes = {
        key: np.interp(places, np.arange(len(cases)), [case.changes[key] for case in cases]) for key in cases[0].changes
    }
    finer = plain_rig("joint") | changes
    law = laws.locked_edge(finer) if name == "mass" else laws.free_edge(finer)
    top = 1.15 * float(np.nanmax([*law, *computed]))
    return Panel(
        title,
        x,
        Axis("Edge", "Hz", (0.0, top)),
        (Series(np.asarray(STUDIED[name](changes)), law, "law", INK),),
        (Markers(at, computed, "computed", VERMILLION),),
    )


def _by_end(x: Array, y: Array, sweep: Sweep) -> Cloud:
    """Return points, one for each sample, coloured by how the hunting cycle ends at its edge."""
    words = list(ENDS)
    codes = np.array([float(words.index(kind)) for kind in sweep.edges.kind.astype(str)])
    present = tuple(ENDS.values())
    return Cloud(x, y, np.full(len(x), np.nan), "samples", "", categories=present, codes=codes)


def _both(fit: Fit, which: object) -> Sweep:
    """Return the samples, fitted and held-out, that have an edge and are selected by `which`.

    `which` is a function from the dimensionless groups, arrays of shape (count,), to booleans of this shape.
    """
    return fit.sweep.usable.take(which(fit.sweep.usable.values))  # type: ignore[operator]


def _log(quantity: str, x: Array) -> Axis:
    return Axis(quantity, "", _ends(x), log=True)


def _ends(x: Array) -> tuple[float, float]:
    return float(0.9 * np.min(x)), float(1.1 * np.max(x))
