"""Work through the steps from friction range and crossover limit to an isolator.

The machine is the thesis rig, whose edge of hunting is computed by the laws and by simulation, side by side. How far
above the crossover a joint's parasitic mode has to be follows from linear analysis.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.optimize import brentq

from friso.equations.controllers.pid import CROSSOVER, TUNED_MASS
from friso.frequency import bode
from friso.frequency.bode import Range, limits
from friso.hunting import Ensemble, find_margin
from friso.stage import Stage
from friso_thesis.studies.guideline.edges import ABOVE, BELOW, FLIP, find_edges
from friso_thesis.studies.guideline.groups import values_of
from friso_thesis.studies.guideline.laws import FittedLaw
from friso_thesis.studies.guideline.sweeps import LOCKED_BOX
from friso_thesis.studies.thesis.studies import thesis_rig

RIGID_GRID = np.geomspace(2.0, 60.0, 14)
FREE_GRID = np.geomspace(1.0, 20.0, 28)
"""Crossovers tried for the rig [Hz]. There are more than in the sweeps, because some cycles with a free joint cannot be
closed."""

RigChanges = Mapping[str, Any]
"""Keys that differ from those of the rig, with SI values."""


@dataclass(frozen=True)
class ThesisCase:
    """A stage like the rig: what is changed, and its edge [Hz] by the law and as computed.

    The computed edge is NaN if none was found; `kind`, one of `KINDS`, then gives the reason.
    """

    changes: RigChanges
    law: float
    computed: float
    kind: str = FLIP

    @property
    def ranked(self) -> float:
        """Return the computed edge [Hz] for comparisons.

        The result is 0 if the edge lies below the crossovers tried, infinite if above, and NaN if unknown.
        """
        return {BELOW: 0.0, ABOVE: np.inf}.get(self.kind, self.computed)


@dataclass(frozen=True)
class Laws:
    """The law of the edge for a locked joint, and the one for a free joint, which builds on it."""

    locked: FittedLaw
    free: FittedLaw

    def locked_edge(self, flat: Mapping[str, Any]) -> np.ndarray:
        """Return the edge [Hz] of stages with the joint locked, by the law.

        Stages are given by keys [SI] with numbers or arrays.
        """
        values, rate = _shaped(flat)
        return self.locked.edge(values) * rate

    def free_edge(self, flat: Mapping[str, Any]) -> np.ndarray:
        """Return the edge [Hz] of stages with the joint free, by both laws.

        Stages are given by keys [SI] with numbers or arrays.
        """
        values, rate = _shaped(flat)
        return self.free.edge(values, self.locked.edge(values)) * rate

    def rates(self, flat: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """Return all frequencies [Hz] that enter the two laws, by name.

        Stages are given by keys [SI] with numbers or arrays.
        """
        values, rate = _shaped(flat)
        return {
            quantity.name: np.exp(log) * rate
            for law in (self.locked, self.free)
            for quantity, log in zip(law.law.rates, law.log_rates(values), strict=True)
        }


def _shaped(flat: Mapping[str, Any]) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return the dimensionless groups of stages by name, and natural frequencies [Hz].

    The groups are arrays of one shape. Each frequency is that of cart and stage together on the bristle stiffness.
    """
    values = values_of(flat)
    rate = np.sqrt(flat["friction.bristle_stiffness"] / (flat["masses.cart"] + flat["masses.stage"])) / (2 * np.pi)
    arrays = np.broadcast_arrays(*(np.atleast_1d(value) for value in values.values()))
    return dict(zip(values, arrays, strict=True)), np.atleast_1d(rate)


def plain_rig(part: str = "") -> dict[str, Any]:
    """Return the rig's keys [SI] without its parasitic mode.

    The joint is left out too, unless `part` is "joint".
    """
    dropped = "parasitic." if part == "joint" else ("parasitic.", "joint.")
    return {key: value for key, value in thesis_rig().flat().items() if not key.startswith(dropped)}


def cases(laws: Laws, changes: Sequence[RigChanges], free: bool) -> list[ThesisCase]:
    """Return the edges of the rig with each of several changes, by the law and as computed.

    If `free`, the joint is free, otherwise the rig is one rigid mass.
    """
    mode = any("parasitic.frequency" in change for change in changes)
    base = thesis_rig().flat() if mode else plain_rig("joint" if free else "")
    keys = {key for change in changes for key in change}
    flat = base | {key: np.array([change.get(key, base[key]) for change in changes], float) for key in keys}

    def stages(which: np.ndarray, crossover: np.ndarray) -> Ensemble:
        subset = {key: value[which] if np.ndim(value) else value for key, value in flat.items()}
        return Ensemble.held(subset | {CROSSOVER: crossover}, len(which))

    grid = FREE_GRID if free else RIGID_GRID
    edges = find_edges(stages, np.broadcast_to(grid, (len(changes), len(grid))))
    with_joint = plain_rig("joint") | {key: value for key, value in flat.items() if not key.startswith("parasitic.")}
    law = np.broadcast_to(laws.free_edge(with_joint) if free else laws.locked_edge(with_joint), edges.kind.shape)
    columns = law.tolist(), edges.crossover.tolist(), edges.kind.astype(str).tolist()
    return [ThesisCase(*row) for row in zip(changes, *columns, strict=True)]


def direct(stage: Stage) -> float:
    """Return the edge [Hz] that `friso check` finds for a hunting stage; NaN without one."""
    edge = find_margin(stage, attracting=True)
    return edge.crossover if edge and edge.crossover else np.nan


PARASITIC_FREQUENCIES = (100.0, 200.0, 300.0, 600.0, 1000.0)
"""Frequencies of parasitic modes [Hz]."""

DAMPING_RATIOS = (0.01, 0.001)
"""Damping ratios of the mode: that of the rig's stage file, and that of bare leaf springs."""

DRIVE = {"drive.sample_time": "50 us", "drive.delay": "50 us"}
"""Sample time of the thesis's drive (Sec. 3.5), and a delay of one sample."""


@dataclass(frozen=True)
class ParasiticLimits:
    """Range of crossovers that a parasitic mode allows, with the joint locked and free.

    The mode has a frequency [Hz] and a damping ratio. Each range [Hz] contains the stage's own crossover. In it the
    modulus margin is at least 0.5 in the limit cases, and in all states stuck under a bias force. The range is None if
    the stage lacks this margin at its own crossover.
    """

    frequency: float
    damping_ratio: float
    locked: Range | None
    free: Range | None


def parasitic_limits(stage: Stage) -> list[ParasiticLimits]:
    """Return the crossovers that a stage may have with each of several parasitic modes.

    Each mode takes the place of the stage's own. The stage is sampled like the thesis's drive.
    """
    modes = []
    for damping in DAMPING_RATIOS:
        for frequency in PARASITIC_FREQUENCIES:
            mode = {"parasitic.frequency": f"{frequency!r} Hz", "parasitic.damping_ratio": damping, **DRIVE}
            flats = [stage.replace({**mode, "joint.locked": held}).flat() for held in (True, False)]
            locked, free = (holding(limits(flat).comfortable, flat[CROSSOVER]) for flat in flats)
            modes.append(ParasiticLimits(frequency, damping, locked, free))
    return modes


def margin_with(stage: Stage, changes: Mapping[str, Any]) -> float:
    """Return the least modulus margin of a stage in its settled states.

    Settled states are the limit cases, and all states stuck under a bias force. `changes` are keys that are changed
    first, in SI. The stage is sampled like the thesis's drive. The margin is 0 if a state is not stable.
    """
    return bode.settled_margin(stage.replace(DRIVE).flat() | dict(changes))


def holding(ranges: Sequence[Range], crossover: float) -> Range | None:
    """Return the range [Hz] that contains a crossover [Hz]; None if none does."""
    return next((window for window in ranges if window[0] <= crossover <= window[1]), None)


STATIC_FRICTIONS = (1.0, 1.5, 2.0, 2.5)
"""Static friction of the rig [N]: the range that the thesis measured (Fig. 20). Table 2 has 3 N."""

FRICTION_GAPS = (0.15, 0.3, 0.5, 0.7, 0.85)
"""Friction gaps tried, over the range of the law, because dynamic friction could not be measured."""

BANDWIDTH_LIMITS = (8.0, 48.0)
"""Bandwidth limits [Hz]: the crossover at which the thesis evaluates its isolator (Sec. 3.4.2), and the highest stable
crossover of its rig (Sec. 4.3.1)."""

AMPLE_STROKE = 1.0
"""Stroke [m] that exceeds every cycle."""

CLAIMED_AT = 8.0
"""Crossover [Hz] of the thesis's studies (Sec. 3.4.2)."""


STUDIED: Mapping[str, Callable[[Mapping[str, Any]], float]] = {
    "gap": lambda changes: changes["friction.static"] - changes["friction.coulomb"],
    "mass": lambda changes: changes["masses.cart"] + changes["masses.stage"],
    "share": lambda changes: changes["masses.stage"] / (changes["masses.cart"] + changes["masses.stage"]),
    "stiffness": lambda changes: changes["joint.stiffness"],
    "stroke": lambda changes: changes["joint.stroke"],
    "parasitic": lambda changes: changes["parasitic.frequency"],
}
"""Functions that return the value [SI] that each study varies, from the changes of a case."""


@dataclass(frozen=True)
class WorkedMachine:
    """A machine like the rig, by name: its edge [Hz] by the law and by `friso check`."""

    name: str
    law: float
    computed: float


@dataclass(frozen=True)
class WorkedDesign:
    """An isolator for a crossover limit [Hz].

    The law designs it for the edge `aim` [Hz]. The isolator has a stiffness [N/m], the stroke that it needs [m], and
    the `force` at full stroke [N]. `cases` are its edges over the friction range.

    `margin` is the least modulus margin at the limit, in the limit cases and in all states stuck under a bias force.
    The margin holds for the rig's own friction and parasitic mode.
    """

    limit: float
    aim: float
    stiffness: float
    stroke: float
    cases: tuple[ThesisCase, ...]
    margin: float

    @property
    def force(self) -> float:
        return self.stiffness * self.stroke

    @property
    def worst(self) -> float:
        """Return the highest known edge [Hz], or the least tried crossover if all lie below."""
        return float(np.nanmax([FREE_GRID[0], *(case.ranked for case in self.cases)]))

    @property
    def unknown(self) -> int:
        """Return the number of pairs of friction forces whose edge could not be computed."""
        return int(np.isnan([case.ranked for case in self.cases]).sum())

    @property
    def does(self) -> bool:
        """Tell whether the isolator works: no cycle attracts at the limit over the friction range."""
        return self.worst <= self.limit and not self.unknown


@dataclass(frozen=True)
class IsolatorNeed:
    """Whether a machine with a crossover limit [Hz] needs an isolator.

    An isolator is needed if the limit is below `edge` [Hz]. This is the highest edge by the law of the locked joint
    over the friction range, times a safety factor.
    """

    limit: float
    edge: float

    @property
    def needed(self) -> bool:
        return self.limit < self.edge


@dataclass(frozen=True)
class Worked:
    """The rig as a worked example of the guideline.

    - `rates`: frequencies [Hz] that enter the laws, by name; `machines`: edges by law and by computation.
    - `friction`: edges of the rigid rig over the friction range.
    - `bound` [Hz]: highest edge by the law over all friction forces, with the rig's bristles and masses and the gaps
      swept.
    - `safe`: factor on the locked law.
    - `needs`: by crossover limit; `designs`: isolators, by the law and then corrected until the computation agrees.
    - `studies`: studies of claims of the thesis, by name.
    """

    rates: Mapping[str, float]
    machines: tuple[WorkedMachine, ...]
    friction: tuple[ThesisCase, ...]
    bound: float
    safe: float
    needs: tuple[IsolatorNeed, ...]
    designs: tuple[tuple[WorkedDesign, ...], ...]
    studies: Mapping[str, tuple[ThesisCase, ...]]

    @property
    def worst(self) -> ThesisCase:
        """Return the case of the friction range with the highest computed edge.

        If an edge is unknown, a case with an unknown edge is returned.
        """
        return max(self.friction, key=lambda case: case.ranked if case.ranked == case.ranked else np.inf)


def friction_range(gaps: Sequence[float] = FRICTION_GAPS) -> list[dict[str, float]]:
    """Return the pairs of static and Coulomb friction [N] that the rig may have, as keys.

    Each static friction is combined with each of the `gaps`, fractions of it.
    """
    return [
        {"friction.static": force, "friction.coulomb": force * (1 - gap)}
        for force, gap in product(STATIC_FRICTIONS, gaps)
    ]


def worked(laws: Laws, safe_locked: float, safe_free: float) -> Worked:
    """Work through the steps from a crossover limit to an isolator, with the laws given.

    Crossovers are kept above the laws' edges by the safety factors `safe_locked` and `safe_free`.
    """
    friction = cases(laws, friction_range(), free=False)
    highest_law = safe_locked * max(case.law for case in friction)
    needs = tuple(IsolatorNeed(limit, highest_law) for limit in BANDWIDTH_LIMITS)
    return Worked(
        {name: float(rate[0]) for name, rate in laws.rates(plain_rig("joint")).items()},
        machines(laws),
        tuple(friction),
        highest(laws),
        safe_locked,
        needs,
        tuple(designed(laws, need.limit, safe_free) for need in needs if need.needed),
        {name: tuple(cases(laws, changes, free)) for name, (changes, free) in _studies().items()},
    )


def machines(laws: Laws) -> tuple[WorkedMachine, ...]:
    """Return the machines of the worked example: the rig as one rigid mass, locked and free."""
    flat = plain_rig("joint")
    locked, free = (float(edge(flat)[0]) for edge in (laws.locked_edge, laws.free_edge))
    stage = thesis_rig()
    rigid = stage.model_copy(update={"joint": None, "parasitic": None})
    mode = f"parasitic mode at {stage.flat()['parasitic.frequency']:g} Hz"
    return (
        WorkedMachine(f"one rigid mass of {flat['masses.cart'] + flat['masses.stage']:g} kg", locked, direct(rigid)),
        WorkedMachine(f"joint locked by its fixtures, {mode}", locked, direct(stage.replace({"joint.locked": True}))),
        WorkedMachine(f"joint free, {mode}", free, direct(stage.replace({CROSSOVER: "5 Hz"}))),
    )


def highest(laws: Laws) -> float:
    """Return the highest edge [Hz] of the rig by the law, over all friction forces.

    The friction gap, over static friction, stays in the range of the sweeps. Masses and bristles are unchanged: the
    edge is proportional to sqrt(sigma_0/m).
    """
    static, gap = np.meshgrid(np.geomspace(0.05, 500.0, 400), np.linspace(*LOCKED_BOX["gap"], 50))
    flat = plain_rig() | {"friction.static": static.ravel(), "friction.coulomb": (static * (1 - gap)).ravel()}
    return float(laws.locked_edge(flat).max())


def designed(laws: Laws, limit: float, safe: float) -> tuple[WorkedDesign, ...]:
    """Design isolators until their computed edges are below the limit, at most `MOST_DESIGNS`.

    The first is designed by the law, with its edge a safety factor below the limit. As long as computed edges are above
    the limit, another isolator follows. Its aim is lower by the ratio of limit to edge, and by `BLIND_AIM_FACTOR` or
    more if an edge is unknown. A factor `AIM_FACTOR` lowers it further.
    """
    designs = [_design(laws, limit, limit / safe)]
    while not designs[-1].does and len(designs) < MOST_DESIGNS:
        share = min(limit / designs[-1].worst, BLIND_AIM_FACTOR if designs[-1].unknown else 1.0)
        designs.append(_design(laws, limit, AIM_FACTOR * designs[-1].aim * share))
    return tuple(designs)


def _design(laws: Laws, limit: float, aim: float) -> WorkedDesign:
    """Design a joint whose edge by the law stays below `aim` [Hz], over the friction range.

    Its stiffness is nine tenths of the largest possible one, and its stroke the smallest possible. `limit` [Hz] is the
    machine's highest crossover.
    """
    forces = friction_range(DESIGN_GAPS)
    base: dict[str, Any] = plain_rig("joint")
    base |= {key: np.array([pair[key] for pair in forces]) for key in forces[0]}

    def over(stiffness: float, stroke: float) -> float:
        edges = laws.free_edge(base | {"joint.stiffness": stiffness, "joint.stroke": stroke})
        return float(np.log(edges.max() / aim))

    stiffness = CHOSEN_STIFFNESS * _root(lambda log: over(np.exp(log), AMPLE_STROKE), np.log(1.0), np.log(1e7))
    stroke = _root(lambda log: over(stiffness, np.exp(log)), np.log(1e-7), np.log(AMPLE_STROKE))
    changes = [pair | {"joint.stiffness": stiffness, "joint.stroke": stroke} for pair in forces]
    joint = {"joint.stiffness": stiffness, "joint.stroke": stroke}
    margin = margin_with(thesis_rig(), joint | {CROSSOVER: limit})
    return WorkedDesign(limit, aim, stiffness, stroke, tuple(cases(laws, changes, free=True)), margin)


DESIGN_GAPS = (0.3, 0.6, 0.85)
"""Friction gaps over which a design is computed."""

MOST_DESIGNS, AIM_FACTOR = 5, 0.98
"""Largest number of designs, including the first by the law, and safety factor on each new aim."""

BLIND_AIM_FACTOR = 0.85
"""Factor on the new aim if an edge is unknown."""

CHOSEN_STIFFNESS = 0.9
"""Chosen stiffness of the joint over the stiffest allowed, which would need an infinite stroke."""


def _root(function: Any, low: float, high: float) -> float:
    return float(np.exp(brentq(function, low, high)))  # type: ignore[arg-type]


def _studies() -> dict[str, tuple[Sequence[Mapping[str, float]], bool]]:
    """Return the changes of the rig for each study, and whether its joint is free."""
    flat = plain_rig("joint")
    mass, static = flat["masses.cart"] + flat["masses.stage"], flat["friction.static"]
    forces = [
        {"friction.static": force, "friction.coulomb": force * (1 - gap)}
        for force in (2.0, static, 4.0)
        for gap in np.linspace(0.1, 0.85, 11)
    ]
    shares = [
        {"masses.cart": mass * (1 - share), "masses.stage": mass * share} for share in (0.15, 0.3, 0.45, 0.6, 0.8)
    ]
    heavier = [
        {"masses.cart": n * flat["masses.cart"], "masses.stage": n * flat["masses.stage"], TUNED_MASS: n * mass}
        for n in (0.5, 1.0, 1.5, 2.0, 3.0)
    ]
    return {
        "gap": (forces, False),
        "mass": (heavier, False),
        "share": (shares, True),
        "stiffness": ([{"joint.stiffness": k} for k in (500.0, 1000.0, 2400.0, 5000.0, 10000.0)], True),
        "stroke": ([{"joint.stroke": s * 1e-3} for s in (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 2.0)], True),
        "parasitic": ([{"parasitic.frequency": f} for f in (30.0, 60.0, 100.0, 300.0, 1000.0)], True),
    }
