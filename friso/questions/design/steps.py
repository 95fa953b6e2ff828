"""Explain a design step by step: what was decided, with which numbers, and why."""

from __future__ import annotations

import math

from friso.design_method.method import Design
from friso.design_method.population import Corners
from friso.quantities import percent
from friso.questions.design.control import controller_step, moves_step
from friso.questions.design.leaves import leaves_step
from friso.questions.design.words import DesignStep, brings, corner, edge, gaps, hertz, size, trimmed
from friso.questions.flexure.table import newtons_per

GAP = 1.0
"""Least difference [N] of static and Coulomb friction for hunting, as found in the thesis (Sec. 4.3.1)."""


def steps(design: Design) -> tuple[DesignStep, ...]:
    """Return all steps of the design method in order, each with its result and reasons."""
    return isolator_step(design), joint_step(design), leaves_step(design), controller_step(design), moves_step(design)


def isolator_step(design: Design) -> DesignStep:
    """Return the step that decides whether an isolator is needed."""
    corners, flat = design.without, design.original.flat()
    sentences = [f"Without an isolator the machine {edge(corners)}.", *_worst(corners, design), *_gap(design)]
    if not design.needed:
        sentences.append(brings(design))
    facts = [
        ("Corners of friction and masses", str(corners.population.count)),
        ("Edge of hunting without isolator", _edge(corners)),
        ("The same with the safety factor", _edge(corners, design.spec.safety.hunting)),
        ("Machine's limit", hertz(design.spec.limit)),
        ("Crossovers searched", " to ".join(map(hertz, corners.searched))),
    ]
    losses = gaps(corners, flat)
    facts += [] if losses is None else [("Static less Coulomb friction", f"{losses.min():.3g} to {losses.max():.3g} N")]
    answer = "yes" if design.needed else "no"
    return DesignStep(f"Is an isolator needed: {answer}", tuple(sentences), tuple(facts), ())


def joint_step(design: Design) -> DesignStep:
    """Return the step that chooses stiffness and stroke of the joint."""
    task, beams, safety = design.fitted.task, design.fitted.choice.beams, design.spec.safety
    allowed = task.friction / safety.breakaway / (1 + safety.stiffness_tolerance)
    stiffness, force = newtons_per(beams.drive[0], "mm"), trimmed(beams.forces[-1], "N")
    held = (
        f"At full stroke the joint exerts {force}. The cart breaks away at no less than "
        f"{trimmed(task.friction, 'N')}; with the safety factor of {safety.breakaway:g} and a stiffness error of "
        f"{percent(safety.stiffness_tolerance)} that allows {allowed:.3g} N, so that it stays stuck inside the stroke."
    )
    sentences = [
        held,
        _stroke(design),
        f"With this joint the machine {edge(design.edges)}.",
        *_worst(design.edges, design),
    ]
    joint = design.stage.flat()
    facts = (
        ("Drive stiffness", stiffness),
        ("Stroke to each side", f"{size(task.stroke)} mm"),
        ("Deviation from linear over the stroke", f"{percent(beams.nonlinearity)}"),
        ("Force at full stroke", force),
        ("Least static friction", trimmed(task.friction, "N")),
        (
            "Limiter, beside the joint when touched",
            f"{trimmed(joint['joint.limiter_stiffness'], 'N/m')}, "
            f"{trimmed(joint['joint.limiter_damping'], 'N*s/m')} (as given)",
        ),
        ("Edge of hunting with isolator", _edge(design.edges)),
    )
    return DesignStep(f"Joint: {stiffness}, stroke {size(task.stroke)} mm", tuple(sentences), facts, ("design_map",))


def _edge(corners: Corners, factor: float = 1.0) -> str:
    """Write the highest edge of hunting among the corners, times a factor, as a frequency [Hz].

    If some corner hunts at all crossovers searched, the text gives the end of the search. If none hunts, it is "none
    found".
    """
    if not corners.hunts:
        return "none found"
    beyond = f"beyond {hertz(corners.searched[1])}"
    return hertz(factor * corners.highest) if math.isfinite(corners.highest) else beyond


def _stroke(design: Design) -> str:
    """Say why the joint has this stroke: because of the specification or of the leaf springs."""
    stroke, allowed = design.fitted.task.stroke, design.spec.leaves.stroke
    if allowed.low == allowed.high:
        return f"The stroke of {size(stroke)} mm is as specified."
    if stroke == allowed.high:
        return (
            f"The stroke is the largest specified, {size(stroke)} mm: the larger it is, the less often the limiter is "
            "touched."
        )
    return (
        f"The stroke is {size(stroke)} mm, of {size(allowed.low)} to {size(allowed.high)} mm: with a larger one the "
        "leaves would have to be so soft that they allow only a lower crossover, or no leaves would do."
    )


def _worst(corners: Corners, design: Design) -> list[str]:
    """Name the worst corner of friction and masses, and how many corners have an uncertain edge."""
    sentences = []
    if corners.hunts:
        count = corners.population.count
        sentences.append(f"Worst of {count} corners: {corner(corners, design.stage.flat(), corners.worst)}.")
    if corners.unknown:
        sentences.append(
            f"In {corners.unknown} of {corners.population.count} corners the edge is not certain: simulations below it "
            "failed or had not settled when they were stopped, which counts as hunting, or something may attract above "
            "it that no simulation starts from."
        )
    return sentences


def _gap(design: Design) -> list[str]:
    """Compare the friction lost at break-away with what hunting needs according to the thesis.

    The list is empty for a friction law that has no static and Coulomb friction.
    """
    losses = gaps(design.without, design.original.flat())
    if losses is None:
        return []
    small = design.without.edges[losses < GAP]
    text = f"When it breaks away, the cart loses {losses.min():.3g} to {losses.max():.3g} N of its friction."
    if not small.size:
        return [f"{text} That is more than the {GAP:g} N that hunting needs according to the thesis."]
    hunting = small[small > 0]
    if not hunting.size:
        return [f"{text} Corners with less than {GAP:g} N do not hunt, as the thesis found."]
    top = hunting.max()
    about = "" if top == design.without.highest else "about "
    reach = f"up to {about}{hertz(float(top))}" if top < design.without.searched[1] else "at all crossovers searched"
    return [f"{text} According to the thesis hunting needs about {GAP:g} N; here corners with less also hunt, {reach}."]
