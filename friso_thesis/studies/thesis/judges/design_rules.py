"""Judge the rules of design (Sec. 4.3.3 and 6)."""

from __future__ import annotations

from functools import cache, lru_cache

import numpy as np

from friso.equations.controllers.pid import CROSSOVER
from friso.frequency.bode import COMFORTABLE_MARGIN, settled_margin
from friso.hunting import find_margin
from friso.quantities import percent
from friso.stage import Stage, loads
from friso_thesis.studies.thesis.claims import Evidence, Finding, Part, beside, judges, number_text
from friso_thesis.studies.thesis.judges.path_and_system import smallest_gap
from friso_thesis.studies.thesis.maps import begins, ends, sizes, trend, trend_text, verdict_table
from friso_thesis.studies.thesis.reading import about, words
from friso_thesis.studies.thesis.studies import LOCKED, masses, thesis_rig

LEAST_STROKE, FRICTION_GAP, PARASITIC_RATIO = 0.3e-3, 1.0, 10.0
"""Least stroke [m], friction gap [N], and parasitic frequency over crossover."""

ISOLATED_WORKS, LOCKED_WORKS = (5.0, 5.5), 15.0
"""Crossovers [Hz] above which the isolated rig works (Sec. 6, and Sec. 4.3.3), and the locked rig."""

_MOVING_MASS, WEIGHED_MASS = 2.5, 1.7
"""Moving mass [kg] of the rig to which the abstract ties the crossovers, and the weighed mass of the simulations."""

EXPERIMENT_CROSSOVER = 14.3
"""Crossover [Hz] at which the locked rig did not hunt (Sec. 4.3.2)."""

HIGHEST_STABLE = 48.0
"""Crossover [Hz] up to which the thesis's rig was stable (Sec. 4.3.1, 4.3.3)."""

PARASITIC_RATIOS = np.geomspace(2.0, 80.0, 16)
"""Parasitic frequencies tried, relative to the crossover."""


@judges("D1", figure="14A, 16A, 12A, 11B", needs=("isolator-stiffness", "isolator-crossover", "friction", "system"))
def rules_of_design(evidence: Evidence) -> Finding:
    """Judge the design rules by maps of parameters, and the one on parasitic modes by margins."""
    rig = evidence.rig
    strokes = _stroke(evidence), _softer_needs_less_stroke(evidence)
    return Finding.of(_soft(evidence), _far(rig), *strokes, _gap(evidence), *_crossovers(evidence), _up_to(rig))


def _soft(evidence: Evidence) -> Part:
    """Judge whether a joint softer than one that works also works."""
    runs, axes = evidence.maps["isolator-stiffness"], ("joint.stiffness", "joint.stroke")
    stiffness, stroke, moving, _ = verdict_table(runs, *axes)
    enough = stroke >= LEAST_STROKE
    softest = ~moving[0, enough]
    limit = begins(stiffness, moving, sizes(runs, *axes))[enough]
    return Part(
        f"at 8 Hz, at every stroke of {LEAST_STROKE * 1e3:g} mm and more, the softest joint of the range comes to "
        "rest, "
        f"and at most of these strokes, more than {percent(words.half)}, the stage keeps moving with a stiffer one",
        bool(softest.all() and np.mean(limit < stiffness[-1]) > words.half),
        f"softest comes to rest at {softest.sum()} of {softest.size} strokes; the stage keeps moving from "
        f"{limit.min():.0f} to {limit.max():.0f} N/m on",
    )


@lru_cache(maxsize=256)
def _needed_ratio(stage_file: str) -> float:
    """Return the least ratio of parasitic frequency to crossover for a modulus margin of 0.5.

    The limit cases must have this margin, and the rig stuck under any bias force. The result is NaN if it never does.
    """
    flat = {**loads(stage_file).flat(), "joint.locked": False}
    crossover = flat[CROSSOVER]
    enough = np.nan
    for ratio in map(float, PARASITIC_RATIOS[::-1]):
        if settled_margin({**flat, "parasitic.frequency": ratio * crossover}) < COMFORTABLE_MARGIN:
            break
        enough = ratio
    return enough


@lru_cache(maxsize=256)
def _margins_at_the_top(stage_file: str) -> dict[str, float]:
    """Return the least modulus margin at the highest crossover of the thesis, locked and free.

    Margins in the limit cases count, and those of all states stuck under a bias force. The margin is 0 if one of them
    is unstable.
    """
    flat = {**loads(stage_file).flat(), CROSSOVER: HIGHEST_STABLE}
    return {name: settled_margin({**flat, "joint.locked": name == "locked"}) for name in ("locked", "free")}


def _up_to(rig: Stage) -> Part:
    margins = _margins_at_the_top(rig.to_toml())
    return Part(
        f"the crossover may be up to {HIGHEST_STABLE:g} Hz: there all settled states are stable, locked and free, "
        "without "
        "sampling and delay",
        all(margin > 0 for margin in margins.values()),
        ", ".join(f"modulus margin {margin:.2g} {name}" for name, margin in margins.items()),
    )


def _far(rig: Stage) -> Part:
    ratio = _needed_ratio(rig.to_toml())
    return Part(
        f"the parasitic mode must be about {PARASITIC_RATIO:g} times the crossover (within a factor of "
        f"{words.about:g}) for a "
        f"modulus margin of {COMFORTABLE_MARGIN:g} in all settled states, the joint free, 8 Hz",
        about(ratio, PARASITIC_RATIO),
        f"{ratio:.3g} times" if np.isfinite(ratio) else f"more than {PARASITIC_RATIOS[-1]:g} times, the highest tried",
        why="The mass and the damping ratio of the mode, which the thesis leaves open, determine how far away it must "
        "be.",
    )


def _strokes_needed(evidence: Evidence) -> tuple[np.ndarray, np.ndarray]:
    """Return the stiffnesses of the map [N/m], and the stroke [m] needed at 8 Hz with each.

    Beyond that stroke nothing keeps moving.
    """
    runs, axes = evidence.maps["isolator-stiffness"], ("joint.stroke", "joint.stiffness")
    stroke, stiffness, moving, _ = verdict_table(runs, *axes)
    return stiffness, ends(stroke, moving, sizes(runs, *axes))


def _stroke(evidence: Evidence) -> Part:
    """Judge whether the thesis's stroke is enough for rest at 8 Hz with the joint as built."""
    stiffness, by_stiffness = _strokes_needed(evidence)
    nearest = int(np.abs(stiffness - 2.4e3).argmin())
    needed = float(by_stiffness[nearest])
    return Part(
        f"with {stiffness[nearest]:.0f} N/m at 8 Hz, nothing keeps moving from a stroke of {LEAST_STROKE * 1e3:g} mm "
        "on",
        needed <= LEAST_STROKE,
        f"{needed * 1e3:.3g} mm needed",
        why="The stroke needed depends on the limiter's damping, which is open.",
    )


def _softer_needs_less_stroke(evidence: Evidence) -> Part:
    """Judge whether a softer joint needs less stroke for rest at 8 Hz."""
    stiffness, needed = _strokes_needed(evidence)
    rises = trend(stiffness, needed)
    return Part(
        f"at 8 Hz a softer joint needs less stroke (rank correlation with the stiffness at least {words.trend:g})",
        rises >= words.trend,
        f"rank correlation {trend_text(rises)}: {needed[0] * 1e3:.2g} mm needed with {stiffness[0]:.0f} N/m, "
        f"{needed[-1] * 1e3:.2g} mm with {stiffness[-1]:.0f} N/m",
    )


def _gap(evidence: Evidence) -> Part:
    smallest, error = smallest_gap(evidence)
    return Part(
        f"the smallest gap F_s - F_c at which the stage keeps moving at 8 Hz is about {FRICTION_GAP:g} N (within a "
        "factor of "
        f"{words.about:g})",
        about(smallest, FRICTION_GAP),
        number_text(smallest, ".2g", "N") if np.isfinite(smallest) else "no cell keeps moving",
        undecided=beside(smallest, (FRICTION_GAP / words.about, FRICTION_GAP * words.about), error),
    )


@cache
def _locked_edge() -> str:
    """Say up to which crossover a cycle of the locked rig attracts, with the abstract's mass.

    The search is that of `friso check`; if it locates no edge, the text says so.
    """
    edge = find_margin(thesis_rig().replace({**masses(_MOVING_MASS), **LOCKED}), attracting=True)
    rig = f"With the friction of Table 2 and {_MOVING_MASS:g} kg"
    if edge is None or edge.crossover is None:
        return f"{rig} no edge of hunting was found."
    return f"{rig} a cycle attracts up to {edge.crossover:.2g} Hz; peaks counted above that are those of transients."


def _crossovers(evidence: Evidence) -> tuple[Part, Part]:
    """Judge from which crossover the isolated rig, and from which the locked rig, comes to rest."""
    runs = evidence.maps["isolator-crossover"]
    crossover, stroke, moving, _ = verdict_table(runs, CROSSOVER, "joint.stroke")
    free = float(np.mean(ends(crossover, moving, sizes(runs, CROSSOVER, "joint.stroke"))[stroke >= LEAST_STROKE]))
    locked, weighed = (locked_limit(evidence, mass) for mass in (_MOVING_MASS, WEIGHED_MASS))
    return (
        Part(
            f"with the isolator, at strokes of {LEAST_STROKE * 1e3:g} mm and more, nothing keeps moving from about "
            f"{ISOLATED_WORKS[0]:g} Hz (Sec. 6), and about {ISOLATED_WORKS[1]:g} Hz (Sec. 4.3.3), on (within a factor "
            f"of {words.about:g} of both)",
            all(about(free, works) for works in ISOLATED_WORKS),
            f"{free:.3g} Hz on average",
            printed=ISOLATED_WORKS[1],
            read=free,
        ),
        Part(
            f"locked, with the {_MOVING_MASS:g} kg that the abstract gives, nothing keeps moving from about "
            f"{LOCKED_WORKS:g} Hz on (within a factor of {words.about:g})",
            about(locked, LOCKED_WORKS),
            f"{locked:.3g} Hz; {weighed:.3g} Hz with the {WEIGHED_MASS:g} kg weighed",
            why=_locked_edge(),
            printed=LOCKED_WORKS,
            read=locked,
        ),
    )


def locked_limit(evidence: Evidence, mass: float) -> float:
    """Return the crossover [Hz] above which the rig with locked joint comes to rest.

    The limit is interpolated linearly in the mass [kg], between the masses of the map "system".
    """
    runs = evidence.maps["system"]
    crossover, masses, moving, _ = verdict_table(runs, CROSSOVER, "mass")
    return float(np.interp(mass, masses, ends(crossover, moving, sizes(runs, CROSSOVER, "mass"))))


@judges("F25P", figure="25", needs=("system",))
def experiment_needs_more_crossover(evidence: Evidence) -> Finding:
    """Judge whether the experiment needs more crossover than the parameter study at its mass."""
    weighed, moving = (locked_limit(evidence, mass) for mass in (WEIGHED_MASS, _MOVING_MASS))
    return Finding.of(
        Part(
            f"over the map of Fig. 11B, with the {WEIGHED_MASS:g} kg weighed, nothing keeps moving from "
            f"{EXPERIMENT_CROSSOVER:g} Hz on",
            weighed < EXPERIMENT_CROSSOVER,
            f"limit {weighed:.3g} Hz; {moving:.3g} Hz with the {_MOVING_MASS:g} kg identified",
            why="Hunting ends no lower in the parameter study: Sec. 4.1 itself says at about 20 Hz.",
        )
    )
