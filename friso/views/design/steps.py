"""A design step by step: what was decided, with which numbers, and why."""

from __future__ import annotations

import math

from friso.design.edges import Corners
from friso.design.method import Design
from friso.views.design.control import controller_step, moves_step
from friso.views.design.leaves import leaves_step
from friso.views.design.words import Step, brings, corner, edge, gaps, hertz, plain, size
from friso.views.flexure.table import newtons_per

GAP = 1.0
"""Static less Coulomb friction [N] that hunting needs at least, as the thesis found (Sec. 4.3.1)."""


def steps(found: Design) -> tuple[Step, ...]:
    """All steps of the method, in order."""
    return isolator_step(found), joint_step(found), leaves_step(found), controller_step(found), moves_step(found)


def isolator_step(found: Design) -> Step:
    """Whether an isolator is needed."""
    corners, flat = found.without, found.given.flat()
    said = [f"Without isolator the machine {edge(corners)}.", *_worst(corners, found), *_gap(found)]
    if not found.needed:
        said.append(brings(found))
    facts = [
        ("Corners of friction and masses", str(corners.population.count)),
        ("Edge of hunting without isolator", _edge(corners)),
        ("The same with the safety factor", _edge(corners, found.spec.safety.hunting)),
        ("Machine's limit", hertz(found.spec.limit)),
        ("Crossovers searched", " to ".join(map(hertz, corners.searched))),
    ]
    known = gaps(corners, flat)
    facts += [] if known is None else [("Static less Coulomb friction", f"{known.min():.3g} to {known.max():.3g} N")]
    answer = "yes" if found.needed else "no"
    return Step(f"Is an isolator needed: {answer}", tuple(said), tuple(facts), ())


def joint_step(found: Design) -> Step:
    """How soft, and with which stroke."""
    task, it, safety = found.fitted.task, found.fitted.choice.beams, found.spec.safety
    allowed = task.friction / safety.breakaway / (1 + safety.stiffness_tolerance)
    stiffness, force = newtons_per(it.drive[0], "mm"), plain(it.forces[-1], "N")
    held = (
        f"At full stroke the joint pushes with {force}. The cart breaks away at {plain(task.friction, 'N')} at the "
        f"least; with the safety factor of {safety.breakaway:g} and a stiffness off by "
        f"{safety.stiffness_tolerance:.0%} that allows {allowed:.3g} N, so that it stays stuck inside the stroke."
    )
    said = [held, _stroke(found), f"With this joint the machine {edge(found.edges)}.", *_worst(found.edges, found)]
    joint = found.stage.flat()
    facts = (
        ("Drive stiffness", stiffness),
        ("Stroke to each side", f"{size(task.stroke)} mm"),
        ("Departure from linear over the stroke", f"{100 * it.nonlinearity:.2g} %"),
        ("Force at full stroke", force),
        ("Least static friction", plain(task.friction, "N")),
        (
            "Limiter, beside the joint when touched",
            f"{plain(joint['joint.limiter_stiffness'], 'N/m')}, "
            f"{plain(joint['joint.limiter_damping'], 'N*s/m')} (as given)",
        ),
        ("Edge of hunting with isolator", _edge(found.edges)),
    )
    return Step(f"Joint: {stiffness}, stroke {size(task.stroke)} mm", tuple(said), facts, ("design_map",))


def _edge(corners: Corners, factor: float = 1.0) -> str:
    """An edge of hunting, times a factor, as a number."""
    if not corners.hunts:
        return "none found"
    beyond = f"beyond {hertz(corners.searched[1])}"
    return hertz(factor * corners.highest) if math.isfinite(corners.highest) else beyond


def _stroke(found: Design) -> str:
    stroke, allowed = found.fitted.task.stroke, found.spec.leaves.stroke
    if allowed.low == allowed.high:
        return f"The stroke of {size(stroke)} mm is the one specified."
    if stroke == allowed.high:
        return f"The stroke is the largest specified, {size(stroke)} mm: the larger, the less the limiter is touched."
    return (
        f"The stroke is {size(stroke)} mm, of {size(allowed.low)} to {size(allowed.high)} mm: with a larger one the "
        "leaves would have to be so soft that they allow a lower crossover only, or none would do."
    )


def _worst(corners: Corners, found: Design) -> list[str]:
    """The corner that decides, and those of which nothing is known."""
    said = []
    if corners.hunts:
        count = corners.population.count
        said.append(f"Worst of {count} corners: {corner(corners, found.stage.flat())}.")
    if corners.unknown:
        said.append(
            f"In {corners.unknown} corners a run that had to decide failed at some crossover: there it counts as "
            "hunting."
        )
    return said


def _gap(found: Design) -> list[str]:
    """The friction that is lost in sliding, against what the thesis says of it."""
    known = gaps(found.without, found.given.flat())
    if known is None:
        return []
    small = found.without.edges[known < GAP]
    said = f"Breaking away, the cart loses {known.min():.3g} to {known.max():.3g} N of its friction."
    if not small.size:
        return [f"{said} That is more than the {GAP:g} N that hunting needs by the thesis."]
    hunting = small[small > 0]
    if not hunting.size:
        return [f"{said} Corners with less than {GAP:g} N do not hunt, as the thesis found."]
    top = hunting.max()
    reach = f"up to {hertz(float(top))}" if top < found.without.searched[1] else "at all crossovers searched"
    return [f"{said} By the thesis hunting needs about {GAP:g} N; here corners with less hunt too, {reach}."]
