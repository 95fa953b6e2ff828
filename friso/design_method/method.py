"""Design an isolator from a specification: leaf springs, stroke, crossover and gains.

The method is that of the thesis, Sec. 3.4.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from friso.design_method.prepare import by_rules, prepared, with_leaves
from friso.design_method.requirements import (
    Candidate,
    ChosenLeaves,
    Confirmed,
    LeafTask,
    Relaxation,
    chosen,
    confirmed,
    front,
    relaxed_requirements,
)
from friso.design_method.settings import settings
from friso.design_method.spec import Spec
from friso.design_method.verification import (
    Corners,
    DesignedController,
    HuntingMap,
    Modal,
    Population,
    Verification,
    choose_controller,
    comfortable,
    comfortable_below,
    corners,
    dampings,
    edges_over,
    hunting_map,
    rigid,
    verification,
)
from friso.engine.side_by_side import both
from friso.equations.bandwidth import least_breakaway
from friso.equations.controllers.pid import CROSSOVER
from friso.frequency.bode import Range
from friso.progress import Progress, silent
from friso.quantities import percent
from friso.stage import Stage

PRESENT_SHARE = 1e-3
"""Relative difference of a limit from the present crossover up to which it is that crossover, rounded in a
template."""


@dataclass(frozen=True)
class Need:
    """Whether a machine needs an isolator, with the result that decides it.

    `without` are the edges of hunting without an isolator, at each corner of the specification. `present` is the
    crossover [Hz] of the stage as it is.
    """

    without: Corners
    spec: Spec
    present: float

    @property
    def isolator(self) -> bool:
        """Tell whether the machine hunts, without isolator, too close to its highest crossover.

        Its highest edge of hunting, times the factor of safety, then exceeds the machine's limit.
        """
        return self.spec.safety.hunting * self.without.highest > self.spec.limit

    @property
    def limit_is_present(self) -> bool:
        """Tell whether the limit is merely the present crossover, as a template fills it in."""
        return bool(np.isclose(self.spec.limit, self.present, rtol=PRESENT_SHARE))


class NoDesign(Exception):
    """Raised if no design meets the specification, with the reason and what to relax.

    `need` tells whether an isolator is needed at all; None means that this was not examined.
    """

    def __init__(self, reason: str, relaxed: tuple[Relaxation, ...] = (), need: Need | None = None) -> None:
        super().__init__(reason)
        self.reason, self.relaxed, self.need = reason, relaxed, need

    def of(self, need: Need) -> NoDesign:
        """Return this error, with the result on whether the machine needs an isolator."""
        return NoDesign(self.reason, self.relaxed, need)


@dataclass(frozen=True)
class LeavesAndCrossover:
    """Leaf springs and a crossover that fit each other.

    Fields are the task for which the leaves were chosen, the choice, and the stage with leaves and crossover.
    `comfortable` are the ranges of crossovers [Hz] with a modulus margin of at least 0.5.
    """

    task: LeafTask
    choice: ChosenLeaves
    stage: Stage
    comfortable: tuple[Range, ...]


SLOW_SHARE = 0.05
"""Fraction of the moves that may take longer than specified. Less would need ten times the moves."""


@dataclass(frozen=True)
class Design:
    """A design with the numbers of each step.

    `without` and `edges` are the edges of hunting without and with isolator, at each corner of the specification.
    `candidates` is the Pareto front of leaf springs, and `confirmed` a part of it by the beam model. `fitted` holds the
    leaf springs and crossover chosen. `controller` has the margins, `map` shows hunting over crossover and stroke, and
    `verification` the simulated moves. `stage` is the design as a stage.

    `damped` is the joint damping with which the crossover could be `faster` [Hz], if margins limit it.
    """

    spec: Spec
    original: Stage
    without: Corners
    candidates: tuple[Candidate, ...]
    confirmed: tuple[Confirmed, ...]
    fitted: LeavesAndCrossover
    edges: Corners
    controller: DesignedController
    map: HuntingMap
    verification: Verification
    damped: Relaxation | None
    faster: float

    @property
    def stage(self) -> Stage:
        """Return the stage with the chosen leaf springs, crossover and gains."""
        return self.fitted.stage

    @property
    def unmet(self) -> tuple[Relaxation, ...]:
        """Return what to relax if moves settle too late: the settling time, with the time needed.

        If more joint damping allows a higher crossover, it comes first. Moves that do not come to rest are reported by
        the verification itself.
        """
        limit, settling = self.spec.position.settling_time, self.verification.free.slower_than(SLOW_SHARE)
        if limit is None or settling <= limit or not np.isfinite(settling):
            return ()
        name = f"{percent(1 - SLOW_SHARE)} of the moves settle in time"
        later = Relaxation(name, "position.settling_time", float(limit), settling, "s")
        return (self.damped, later) if self.damped else (later,)

    @property
    def meets(self) -> bool:
        """Tell whether all moves come to rest, and settle in the time specified."""
        limit, free = self.spec.position.settling_time, self.verification.free
        return not free.missed and (limit is None or free.slower_than(SLOW_SHARE) <= limit)

    @property
    def need(self) -> Need:
        """Return the result that decides whether an isolator is needed."""
        return Need(self.without, self.spec, by_rules(self.original).flat()[CROSSOVER])

    @property
    def needed(self) -> bool:
        """Tell whether the machine hunts, without isolator, too close to its highest crossover."""
        return self.need.isolator


@dataclass(frozen=True)
class UnfinishedDesign:
    """A design without its later steps: leaf springs, stroke and crossover, not tried in moves.

    The work was interrupted, or stopped because no isolator is needed; `need` has the result on this. `edges` of
    hunting with the isolator are None if they were not located yet.
    """

    spec: Spec
    original: Stage
    need: Need
    fitted: LeavesAndCrossover
    edges: Corners | None
    interrupted: bool = True

    @property
    def stage(self) -> Stage:
        """Return the design so far as a stage."""
        return self.fitted.stage

    @property
    def meets(self) -> bool:
        """Return False, because it is not known whether the specification is met."""
        return False


class DesignInterrupted(KeyboardInterrupt):
    """Raised by Ctrl-C once leaf springs and a crossover are found; `so_far` is the design."""

    def __init__(self, so_far: UnfinishedDesign) -> None:
        super().__init__()
        self.so_far = so_far


class NotNeeded(Exception):
    """Raised by a design if the machine needs no isolator and none is wanted anyway.

    `so_far` is the design up to then.
    """

    def __init__(self, so_far: UnfinishedDesign) -> None:
        super().__init__()
        self.so_far = so_far


LOWEST_EDGE = 1 / 40
"""Lowest crossover of the search, over the machine's limit. Slower loops hunt with any joint."""

HIGHEST_EDGE = 3.0
"""Highest crossover of the search, over the machine's limit. Faster loops are unstable."""

ABOVE_CROSSOVER = 2.0
"""Factor on the chosen crossover above which an edge does not matter."""


def design(stage: Stage, spec: Spec, progress: Progress = silent, anyway: bool = True) -> Design:
    """Design leaf springs, stroke and controller of an isolator.

    Raises InputError for unusable input, NoDesign if nothing meets the specification, and DesignInterrupted at Ctrl-C.
    Raises NotNeeded if no isolator is needed, unless one is wanted `anyway`.
    """
    base = prepared(stage, spec)
    flat, population, limit = base.flat(), corners(spec, base.flat()), spec.limit
    friction = float(np.min(least_breakaway(population.over(flat))))
    if friction <= 0:
        raise NoDesign("the bias force on the cart exceeds the least static friction: no joint is soft enough")

    def over(there: dict[str, float], highest: float, above: float, label: str) -> Corners:
        """Return the edges of hunting at each corner, between fractions of the crossover `highest` [Hz]."""
        low, high = LOWEST_EDGE * highest, above * highest
        return edges_over(there, population, low, high, settings.edge_steps, progress, label)

    def fitted() -> tuple[LeavesAndCrossover, list[Candidate]] | NoDesign:
        try:
            task, candidates = leaves(spec, flat, friction)
            return fit_leaves(base, task, candidates, population), candidates
        except NoDesign as failure:
            return failure

    label = "hunting without isolator"
    without, outcome = both(partial(over, rigid(flat), limit, HIGHEST_EDGE, label), fitted)
    need = Need(without, spec, by_rules(stage).flat()[CROSSOVER])
    if isinstance(outcome, NoDesign):
        raise outcome.of(need)
    fit, candidates = outcome
    if not (anyway or need.isolator):
        raise NotNeeded(UnfinishedDesign(spec, stage, need, fit, None, interrupted=False))
    crossover = fit.stage.flat()[CROSSOVER]
    stiffest = fit.stage.flat()["joint.stiffness"] * (1 + spec.safety.stiffness_tolerance)
    worst = {**fit.stage.flat(), "joint.stiffness": stiffest}

    def examined() -> tuple[tuple[Confirmed, ...], DesignedController, HuntingMap]:
        control = choose_controller(fit.stage, fit.choice.beams, population)
        return tuple(confirmed(fit.task, candidates)), control, hunting_map(fit.stage, spec, population)

    label, edges = "hunting with isolator", None
    try:
        edges, (by_beams, control, edges_map) = both(partial(over, worst, crossover, ABOVE_CROSSOVER, label), examined)
        _does_not_hunt(fit, edges, need)
        softening = fit.task.load / fit.choice.beams.buckling
        tried, (damped, faster) = both(
            partial(verification, fit.stage, spec, softening, progress), partial(with_damping, fit)
        )
    except KeyboardInterrupt:
        raise DesignInterrupted(UnfinishedDesign(spec, stage, need, fit, edges)) from None
    results = (need.without, tuple(candidates), by_beams, fit, edges, control, edges_map, tried, damped, faster)
    return Design(spec, stage, *results)


ACCEPTED_CROSSOVER = 0.98
"""Fraction of the possible crossover that is enough; softer leaves are then preferred."""


def with_damping(fit: LeavesAndCrossover) -> tuple[Relaxation | None, float]:
    """Return the joint damping with which margins no longer limit the crossover.

    The second result is the crossover [Hz] that is then possible. The damping is None if the crossover is nearly that
    high already, or if no damping tried helps. The second result is then the highest crossover that specification and
    leaf springs allow.
    """
    flat, spec = fit.stage.flat(), fit.task.spec
    target = min(spec.limit, fit.choice.frequency / spec.safety.parasitic)
    if flat[CROSSOVER] >= ACCEPTED_CROSSOVER * target:
        return None, target
    for damping in dampings(flat)[1::2]:
        ranges = Modal.of({**flat, "joint.damping": damping}, fit.choice.beams).comfortable
        best = comfortable_below(ranges, target)
        if best is not None and best >= ACCEPTED_CROSSOVER * target:
            name = f"crossover of up to {best:.3g} Hz with a modulus margin of 0.5"
            return Relaxation(name, "joint.damping", flat["joint.damping"], float(damping), "N*s/m"), best
    return None, target


TRIED_STROKES = 4
"""Strokes tried over a range in the specification. Each takes a design."""


def leaves(spec: Spec, flat: Mapping[str, Any], friction: float) -> tuple[LeafTask, list[Candidate]]:
    """Return the front of leaf springs for the largest stroke that allows the machine's limit.

    The limit is one on the crossover. If no stroke allows it, the front that allows the highest crossover is returned.
    The task that the front solves comes first. `friction` [N] is the least static friction. Raises NoDesign if no leaf
    springs meet the requirements.
    """
    stroke, choices = spec.leaves.stroke, []
    several = stroke.high > stroke.low
    strokes = np.geomspace(stroke.high, stroke.low, TRIED_STROKES).tolist() if several else [stroke.high]
    for size in strokes:
        task = LeafTask(spec, size, spec.limit, friction, flat)
        if candidates := front(task):
            choices.append((task, candidates))
            if allowed_crossover(task, candidates) >= spec.limit:
                break
    if not choices:
        raise NoDesign(
            "no leaf springs meet the specification",
            relaxed_requirements(LeafTask(spec, strokes[-1], 0.0, friction, flat)),
        )
    return max(choices, key=lambda pair: min(allowed_crossover(*pair), spec.limit))


def allowed_crossover(task: LeafTask, candidates: list[Candidate]) -> float:
    """Return the highest crossover [Hz] that a front of leaf springs allows.

    On the front, the first mode that interferes with control has a highest frequency. The crossover is that frequency
    over a factor of safety.
    """
    return max(candidate.frequency for candidate in candidates) / task.spec.safety.parasitic


DESIGN_ROUNDS = 12
"""Most rounds of adapting leaves and crossover to each other."""

LOWER_CROSSOVER = 0.97
"""Factor by which the crossover is lowered in a round. Smaller steps need more rounds; larger ones waste crossover.
"""


def fit_leaves(base: Stage, task: LeafTask, candidates: list[Candidate], population: Population) -> LeavesAndCrossover:
    """Choose the softest leaves for the highest crossover that leaves and margins allow.

    The two are adapted to each other in rounds. Raises NoDesign if none of the `candidates` fits.
    """
    target = min(task.spec.limit, allowed_crossover(task, candidates))
    for _ in range(DESIGN_ROUNDS):
        task = replace(task, crossover=target)
        choice = chosen(task, candidates)
        if choice is None:
            target *= LOWER_CROSSOVER
            continue
        stage = with_leaves(base, choice.geometry, task.stroke)
        ranges = comfortable(stage, choice.beams, population)
        best = comfortable_below(ranges, target)
        if best is None:
            raise NoDesign(f"up to {target:.3g} Hz there is no crossover with a modulus margin of 0.5")
        if best >= ACCEPTED_CROSSOVER * target:
            return LeavesAndCrossover(task, choice, stage.replace({CROSSOVER: f"{_down(best):.6g} Hz"}), ranges)
        target = best
    raise NoDesign(
        f"none of the {len(candidates)} leaf springs on the front, in sizes rounded to tenths of a millimetre, is "
        f"confirmed by the beam model at a crossover of {target:.3g} Hz"
    )


def _down(crossover: float) -> float:
    """Round a crossover [Hz] down to three digits."""
    step = 10 ** (np.floor(np.log10(crossover)) - 2)
    return float(np.floor(crossover / step * (1 + 1e-9)) * step)


def _does_not_hunt(fit: LeavesAndCrossover, edges: Corners, need: Need) -> None:
    """Check that the crossover keeps its distance from the edge of hunting.

    Raises NoDesign if it does not.
    """
    spec, crossover = fit.task.spec, fit.stage.flat()[CROSSOVER]
    needed = spec.safety.hunting * edges.highest
    if not edges.hunts or needed <= crossover:
        return
    until = f"{edges.highest:.3g} Hz" if np.isfinite(needed) else f"beyond {edges.searched[1]:.3g} Hz"
    stiffness, stroke = fit.stage.flat()["joint.stiffness"], fit.task.stroke * 1e3
    reason = (
        f"with the softest leaf springs available, {stiffness:.4g} N/m and a stroke of {stroke:.3g} mm, the "
        f"stage hunts up to {until}; a crossover above that by the safety factor of {spec.safety.hunting:g} is not "
        f"possible, the highest is {crossover:.3g} Hz"
    )
    raise NoDesign(reason, tuple(_ways_out(fit, edges.highest, needed, crossover)), need)


def _ways_out(fit: LeavesAndCrossover, edge: float, needed: float, crossover: float) -> Iterator[Relaxation]:
    """Yield changes of the specification that bring the crossover far enough above an edge.

    The `edge` of hunting, the crossover `needed`, and the present `crossover` are in Hz.
    """
    spec, name = fit.task.spec, "crossover above the edge of hunting"
    above = [max(low, needed) for low, high in fit.comfortable if high > needed]
    allowed_ = fit.choice.frequency / spec.safety.parasitic
    if spec.limit < needed and above and min(above) <= allowed_:
        yield Relaxation(name, "machine.crossover_limit", spec.limit, min(above), "Hz")
    if edge < crossover:
        yield Relaxation(name, "safety.hunting", spec.safety.hunting, crossover / edge, "")
    damping = fit.stage.flat()["joint.damping"]
    for larger in dampings(fit.stage.flat())[1:]:
        damped = {**fit.stage.flat(), "joint.damping": larger}
        if any(low <= needed <= high for low, high in Modal.of(damped, fit.choice.beams).comfortable):
            yield Relaxation(name, "joint.damping", damping, float(larger), "N*s/m")
            return
