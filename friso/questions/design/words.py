"""Describe a design and its outcome in words that terminal, page and messages share.

Among them is the range of allowed crossovers, with the bounds that limit it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from friso.design_method.method import Design, LeavesAndCrossover, Need, NoDesign, UnfinishedDesign
from friso.design_method.requirements import Relaxation
from friso.design_method.spec import Geometry
from friso.design_method.verification import Corners, MachineOutcomes
from friso.equations.controllers.pid import CROSSOVER
from friso.frequency.bode import COMFORTABLE_MARGIN, Range, searched_crossovers
from friso.platform.system import shell_word
from friso.quantities import outwards, percent
from friso.questions.map.words import in_sentence
from friso.shown.drawing.figure import GREEN, ORANGE, VERMILLION
from friso.shown.text import choose, pretty, with_unit
from friso.stage.stage import numeric_keys


@dataclass(frozen=True)
class CrossoverBound:
    """A bound of the crossover [Hz] and its reason."""

    value: float
    reason: str


def comfortable(design: Design) -> Range:
    """Return the range of crossovers [Hz] around the chosen one with a modulus margin above 0.5."""
    below = [window for window in design.fitted.comfortable if window[0] <= 1.01 * design.controller.crossover]
    return below[-1]


def stiffest(design: Design) -> float:
    """Return the highest crossover [Hz] that leaf springs on the Pareto front allow.

    Leaf springs allow a fixed fraction of the frequency of their first mode that interferes with control. The highest
    such frequency on the front counts.
    """
    return max(candidate.frequency for candidate in design.candidates) / design.spec.safety.parasitic


def limit_name(design: Design) -> str:
    """Name the limit of the crossover: the machine's own, unless it is only the present crossover."""
    return "your crossover of now" if design.need.limit_is_present else "the machine's limit"


def upper(design: Design) -> list[CrossoverBound]:
    """Return the upper bounds of the crossover, the lowest first."""
    multiple = design.spec.safety.parasitic
    front = f"the highest first interfering frequency of the front over {multiple:g}"
    bounds = [
        CrossoverBound(design.spec.limit, limit_name(design)),
        CrossoverBound(stiffest(design), front),
        CrossoverBound(comfortable(design)[1], f"above it the modulus margin is below {COMFORTABLE_MARGIN:g}"),
    ]
    return sorted((bound for bound in bounds if np.isfinite(bound.value)), key=lambda bound: bound.value)


def lower(design: Design) -> list[CrossoverBound]:
    """Return the lower bounds of the crossover, the highest first."""
    factor, edges = design.spec.safety.hunting, design.edges
    low = comfortable(design)[0]
    bounds = (
        [CrossoverBound(low, f"below it the modulus margin is below {COMFORTABLE_MARGIN:g}")]
        if low > searched_crossovers(design.fitted.stage.flat())[0]
        else []
    )
    if edges.hunts:
        bounds.append(CrossoverBound(factor * edges.highest, f"{factor:g} times the edge of hunting"))
    return sorted(bounds, key=lambda bound: -bound.value)


def view(design: Design) -> Range:
    """Return the range of crossovers [Hz] that the figure of the window shows."""
    crossover = design.controller.crossover
    edges = np.concatenate([design.without.edges, design.edges.edges])
    edges = edges[np.isfinite(edges) & (edges > 0)]
    top = max(crossover, design.spec.limit, *edges.tolist())
    return float(min(crossover / 10, *edges.tolist(), crossover) / 1.3), float(3 * top)


MOST_RELAXATIONS = 5
"""Number of relaxations listed in a message."""


OTHER_LIMIT = '--crossover "20 Hz" states another limit'
"""Which option states the highest crossover of the machine."""


@dataclass(frozen=True)
class DesignStep:
    """A step of the method, with its result as title.

    Fields are the reasons in sentences, the numbers by name, and the names of the step's figures.
    """

    title: str
    sentences: tuple[str, ...]
    facts: tuple[tuple[str, str], ...]
    figures: tuple[str, ...]


def so_far(design: UnfinishedDesign) -> list[str]:
    """Say what is decided of a design that was not verified, and what is still open."""
    crossover = design.stage.flat()[CROSSOVER]
    if not design.interrupted:
        wanted = f"An isolator, not tried in moves (--anyway tries it): {isolator(design.fitted, crossover)}."
        return [need_words(design.need), wanted]
    hunts = (
        "whether the machine hunts with it is not known"
        if design.edges is None
        else f"with it the machine {edge(design.edges)}"
    )
    return [
        f"Interrupted: this is the answer so far. The isolator was not tried in moves, and {hunts}.",
        need_words(design.need),
        f"The isolator: {isolator(design.fitted, crossover)}.",
    ]


def isolator(fitted: LeavesAndCrossover, crossover: float) -> str:
    """Describe an isolator by its leaf springs, its stroke and its crossover [Hz]."""
    springs, stroke = leaf_words(fitted.choice.geometry), size(fitted.task.stroke)
    return f"{springs}; stroke {stroke} mm to each side, crossover {hertz(crossover)}"


def verdicts(design: Design) -> list[tuple[str, str]]:
    """Return the verdicts with their colours: is an isolator needed, which one, do moves settle."""
    return [
        (ORANGE if design.needed else GREEN, need_words(design.need)),
        (
            GREEN,
            f"The isolator{'' if design.needed else ', designed nevertheless'}: "
            f"{isolator(design.fitted, design.controller.crossover)}.",
        ),
        _verified(design),
    ]


def need_words(need: Need) -> str:
    """Say whether the machine needs an isolator, and why.

    A limit that is no more than the present crossover is not told as what the machine allows.
    """
    limit, factor, without = hertz(need.spec.limit), need.spec.safety.hunting, need.without
    if not without.hunts:
        return f"No isolator is needed: without one the machine {edge(without)}."
    corners = without.population.count > 1
    if not math.isfinite(without.highest):
        where = "in the worst corner of friction and masses, " if corners else ""
        return (
            f"An isolator is needed: without one the machine hunts, {where}even at {hertz(without.searched[1])}, the "
            "highest crossover tried."
        )
    where = " in the worst corner of friction and masses" if corners else ""
    above = f"{hertz(factor * without.highest)} or more, {factor:g} times the edge of hunting{where}"
    needs = f"{'an' if need.isolator else 'no'} isolator is needed: without one the crossover must be {above}"
    if need.limit_is_present:
        faster = f", so a machine that allows that needs none ({OTHER_LIMIT})" if need.isolator else ""
        return f"If {limit}, your crossover of now, is the limit, {needs}{faster}."
    return f"{needs[:1].upper()}{needs[1:]}{'; the' if need.isolator else ', and the'} machine allows {limit}."


def brings(design: Design) -> str:
    """Say what an isolator brings and costs where none is needed."""
    free, locked = design.verification.compared, design.verification.locked
    crossover, limit = design.controller.crossover, design.spec.limit
    costs = f" This costs bandwidth: a crossover of {hertz(crossover)} instead of {hertz(limit)}."
    slower = costs if crossover < 0.97 * limit else ""
    return (
        f"For comparison, with the isolator the machine {edge(design.edges)}. Moves settle in "
        f"{seconds(free.slower_than(0.5))} instead of {seconds(locked.slower_than(0.5))} (median), 95 % of them in "
        f"{seconds(free.slower_than(0.05))} instead of {seconds(locked.slower_than(0.05))}, at the same "
        f"crossover.{slower}"
    )


def leaves(design: Design) -> str:
    """Describe the leaf springs chosen: number, dimensions and material."""
    return leaf_words(design.fitted.choice.geometry)


def leaf_words(geometry: Geometry) -> str:
    """Describe leaf springs by number, dimensions and material."""
    edges = f"{size(geometry.length)} x {size(geometry.width)} x {size(geometry.sheet.thickness)}"
    return (
        f"{geometry.sheet.leaves:g} leaves of {edges} mm, {size(geometry.spacing)} mm apart, of "
        f"{geometry.sheet.material}"
    )


def _verified(design: Design) -> tuple[str, str]:
    """Say how many simulated moves come to rest, and how fast; return the text and the colour of the verdict."""
    free, locked, limit = design.verification.free, design.verification.locked, design.spec.position.settling_time
    met = limit is None or free.slower_than(0.05) <= limit
    says = _says_of_moves(design).format_map(
        {
            "tried": str(free.tried),
            "rest": restless(free),
            "settling": lower_first(settling(free)),
            "met": "" if limit is None else f" ({'as' if met else 'not as'} specified: {seconds(float(limit))})",
            "locked": restless(locked, among=True),
            "late": seconds(locked.slower_than(0.05)),
            "change": "" if met else _what_to_change(design),
        }
    )
    return (VERMILLION if free.missed or not met else GREEN), says


def _says_of_moves(design: Design) -> str:
    """Return the template on simulated moves, with what speaks most for the isolator.

    That is that moves do not end with the joint locked, that they end later, or the distance from the edge of hunting.
    """
    free, locked = design.verification.compared, design.verification.locked
    if locked.missed:
        return "Of {tried} simulated moves {rest}; {settling}{met}{change}; with the joint locked, {locked}."
    if locked.slower_than(0.05) > free.slower_than(0.05):
        return "Of {tried} simulated moves {rest}; {settling}{met}{change}; with the joint locked, 95 % in {late}."
    if design.needed:
        return (
            "Of {tried} simulated moves {rest}; {settling}{met}{change}; so they do with the joint locked, but closer "
            "to the edge of hunting than the safety factor allows."
        )
    return "Of {tried} simulated moves {rest}; {settling}{met}{change}."


def _what_to_change(design: Design) -> str:
    """Say which bound of the crossover to raise where moves settle too late, or which time to allow instead."""
    bound = upper(design)[0]
    held = f"the crossover of {hertz(design.controller.crossover)} ({bound.reason})"
    return f"; raise what bounds {held}, or allow {seconds(design.verification.free.slower_than(0.05))}"


def lower_first(text: str) -> str:
    """Return a text with a small first letter."""
    return f"{text[:1].lower()}{text[1:]}"


def restless(outcome: MachineOutcomes, among: bool = False) -> str:
    """Say how many moves do not come to rest in position, and how many swing; `among` says of how many."""
    if not outcome.missed:
        return "all come to rest in position"
    count, swinging = outcome.missed, outcome.swinging
    outcomes = f"{swinging} swing, {count - swinging} creep"
    many = f"{count} of {outcome.tried}" if among else f"{count}"
    return f"{many} {'does' if count == 1 else 'do'} not come to rest in position ({outcomes})"


def probability(outcome: MachineOutcomes) -> str:
    """Write the interval of the probability that a move does not come to rest in position."""
    low, high = outcome.interval
    within = f"below {percent(high)}" if not outcome.missed else f"{percent(low)} to {percent(high)}"
    return f"the probability that a move does not is {within} (with 95 % confidence)"


def settling(outcome: MachineOutcomes) -> str:
    """Say within which time half of the moves settle, and 95 % of them."""
    half, most = outcome.slower_than(0.5), outcome.slower_than(0.05)
    if not math.isfinite(half):
        return "Fewer than half of them settle"
    rest = f"95 % in {seconds(most)}" if math.isfinite(most) else "fewer than 95 % at all"
    return f"Half of them settle in {seconds(half)}, {rest}"


def edge(corners: Corners) -> str:
    """Say up to which crossover the machine hunts in its worst corner."""
    low, high = corners.searched
    if not corners.hunts:
        return f"hunts in no corner at any crossover from {hertz(low)} to {hertz(high)}"
    if not math.isfinite(corners.highest):
        return f"hunts, in its worst corner, up to {hertz(high)} and beyond"
    return f"hunts, in its worst corner, up to {hertz(corners.highest)}"


def corner(corners: Corners, flat: Mapping[str, Any], number: int) -> str:
    """Describe a corner, an extreme of all uncertain keys, by its friction and masses.

    `number` is the index of the corner, and `flat` has the keys of the stage.
    """
    keys = corners.population.of(number)
    units = {key: item.unit for key, item in numeric_keys(flat).items()}
    order = sorted(keys, key=lambda key: (not key.startswith("friction."), key != "friction.static"))
    return ", ".join(f"{in_sentence(key)} {trimmed(keys[key], units[key])}" for key in order)


def gaps(corners: Corners, flat: Mapping[str, Any]) -> np.ndarray | None:
    """Return static minus Coulomb friction [N] in each corner of the uncertain keys, shape (n,).

    Returns None for a friction law that does not have both.
    """
    if not {"friction.static", "friction.coulomb"} <= flat.keys():
        return None
    static, coulomb = (corners.population.over(flat)[f"friction.{name}"] for name in ("static", "coulomb"))
    return np.broadcast_to(static - coulomb, (corners.population.count,))


def refusal(failure: NoDesign) -> str:
    """Say why no design meets the specification, and what to relax.

    If no isolator is needed, that is said first.
    """
    if failure.need and not failure.need.isolator:
        return f"{need_words(failure.need)}\nNor is there a design of one that meets the specification: {_why(failure)}"
    return f"no design: {_why(failure)}"


def _why(failure: NoDesign) -> str:
    """Say why there is no design, and which single requirement to relax."""
    if not failure.relaxed:
        tail = "no single requirement was found whose relaxation alone is enough: relax several"
        return f"{failure.reason}\n  {tail}"
    later = any(change.geometry for change in failure.relaxed)
    tail = ["(each one alone; this concerns the leaf springs only, the later steps were not tried)"] if later else []
    return "\n  ".join([failure.reason, *map(relaxation, failure.relaxed[:MOST_RELAXATIONS]), *tail])


def shortfall(design: Design) -> str:
    """Say which requirements the design does not meet."""
    free = design.verification.free
    missed = [f"of {free.tried} moves {restless(free)}"] if free.missed else []
    return "; ".join([*missed, *map(relaxation, design.unmet)])


def relaxation(change: Relaxation) -> str:
    """Say how far to relax one requirement."""
    needed = outwards(change.needed, change.needed > change.value)
    values = f"{trimmed(change.value, change.unit)} to {trimmed(needed, change.unit)}"
    text = f"relax {change.key} from {values} ({change.requirement})"
    if change.geometry is None:
        return text
    return f"{text}: then {leaf_words(change.geometry)} do"


def trimmed(value: float, unit: str) -> str:
    """Write a value with its unit, without meaningless zeros: "70 mm", "0.3 N"."""
    if unit.startswith("N") and abs(value) < 1000:
        return f"{value:.4g} {pretty(unit)}"
    factor, text = choose(np.array([value]), unit)
    return f"{value * factor:.4g} {text if factor != 1 else pretty(unit)}".rstrip()


def size(length: float) -> str:
    """Write a length [m] in mm as it stands on a drawing."""
    return f"{1e3 * length:.{4 if length >= 0.1 else 3}g}"


def hertz(frequency: float) -> str:
    """Write a frequency [Hz]; "not found" if it is not finite."""
    return with_unit(frequency, "Hz") if math.isfinite(frequency) else "not found"


def seconds(time: float) -> str:
    """Write a settling time [s]; "never" if it is not finite."""
    return with_unit(time, "s") if math.isfinite(time) else "never"


def next_steps(design: Design | UnfinishedDesign, files: Sequence[Path]) -> list[str]:
    """Return the command that checks the design; empty if no file was written."""
    return [f"friso check {shell_word(str(files[0]))}"] if files else []
