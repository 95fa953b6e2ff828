"""Verify a design on machines drawn from its tolerances, and choose its controller.

The machines are the corners of the specification's ranges, and machines drawn at random.

The edge of hunting is the highest crossover at which a stage hunts. Only the corner where it is highest decides, so it
is located there, to 1 or 2 %. The design then simulates all its moves.

The loop that decides on the controller, and on whether more joint damping would help, has all modes of the leaf springs
that actuator and sensor both see. The equations of motion contain only one of them.

In the simulated moves the joint is free, and locked for comparison. A map over crossover and stroke shows how many
corners of the specification do not come to rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.stats import qmc

from friso.design_method.settings import settings
from friso.design_method.spec import Spec
from friso.engine.arrays import ArrayColumns
from friso.engine.batch import FIRST_TURNING_POINTS, RunOptions, run_chunks
from friso.engine.kernel import kernel
from friso.equations.bandwidth import bandwidth, faster
from friso.equations.controllers.pid import ALPHA, BETA, CROSSOVER, TUNED_MASS
from friso.equations.motion import last_corner
from friso.equations.structure import shared_structure
from friso.errors import InputError
from friso.frequency.bode import (
    COMFORTABLE_MARGIN,
    SEARCH_DENSITY,
    Range,
    ranges_below,
    searched_crossovers,
    settled_members,
    shared,
)
from friso.frequency.margins import (
    Tuning,
    controller_response,
    distance_to_lines,
    frequency_grid,
    plants,
    stability_by_poles,
    tuning,
)
from friso.frequency.settings import settings as frequency_settings
from friso.frequency.system import DriveTiming, Members
from friso.hunting import find_attractors
from friso.hunting.criteria import CREEPS, FAILED, RESTS, SWINGS, outcomes, settling_of_runs
from friso.hunting.measures import run_ends, turns_of
from friso.intervals import Interval, share_interval
from friso.leaf_springs.mechanism import Evaluation
from friso.progress import Progress, silent
from friso.stage import Stage


@dataclass(frozen=True)
class Population:
    """Machines as arrays of shape (count,) by key [SI], for keys that differ from the stage."""

    keys: Mapping[str, np.ndarray]
    count: int

    def over(self, flat: Mapping[str, Any]) -> dict[str, Any]:
        """Return the stage's keys, with each machine's values where machines differ from it.

        The controller stays unchanged.
        """
        return {**flat, **self.keys}

    def of(self, number: int) -> dict[str, float]:
        """Return the values [SI] of one machine, by its number, for keys that differ from the stage."""
        return {key: float(values[number]) for key, values in self.keys.items()}


def corners(spec: Spec, flat: Mapping[str, Any]) -> Population:
    """Return the corners of a specification: the ends of all ranges of friction and masses.

    For static friction and gap, the middles are included too. Static friction and gap are combined with each other, and
    with masses that are all light or all heavy. All other friction is at its ends together, but viscous friction at the
    opposite end, because it damps. Raises InputError if friction never falls.
    """
    friction, masses = _friction(spec, flat), _masses(spec)
    main = [name for name in ("static", "coulomb", "gap") if name in friction]
    rest = [name for name in friction if name not in main]
    groups = [dict.fromkeys(masses, share) for share in (0.0, 1.0)] if masses else [{}]
    turned = (
        [{name: 1 - share if name == "viscous" else share for name in rest} for share in (0.0, 1.0)] if rest else [{}]
    )
    ranges = friction | masses
    levels = product(*(settings.corner_levels if ranges[name].high > ranges[name].low else (0.0,) for name in main))
    rows = [
        {**dict(zip(main, level, strict=True)), **side, **mass} for level, side, mass in product(levels, turned, groups)
    ]
    shares = {name: np.array([row[name] for row in rows]) for name in ranges}
    population = _population(ranges, shares, flat, len(rows))
    _falls(population, flat)
    return population


def _falls(population: Population, flat: Mapping[str, Any]) -> None:
    """Raise InputError if sliding friction is nowhere below static friction.

    Nothing is checked for a law without both kinds of friction.
    """
    static, coulomb = (population.keys.get(f"friction.{name}") for name in ("static", "coulomb"))
    if static is not None and coulomb is not None and np.all(coulomb >= static):
        text = f"static friction up to {static.max():g} N with Coulomb friction from {coulomb.min():g} N on"
        expected = "static friction above Coulomb friction (that of the stage file where the specification gives none)"
        raise InputError("friction.static", text, expected, 'static = "1 N .. 3 N", gap = "0.3 .. 0.85"')


POPULATION_SEED = 6
"""Seed of the machines. A fixed one draws equal machines for equal specifications."""


def random_machines(spec: Spec, flat: Mapping[str, Any], count: int, softening: float) -> Population:
    """Draw machines and moves at random (Sobol) from the ranges of the specification.

    Friction, masses and stiffness are uniform; travel and acceleration are uniform in the logarithm. Stiffness varies
    by its tolerance; its low end is also reduced by `softening`, the fraction that the load may take away.
    """
    ranges = _friction(spec, flat) | _masses(spec)
    names = [*ranges, "stiffness", "travel", "acceleration"]
    sequence = qmc.Sobol(len(names), rng=POPULATION_SEED).random_base2(int(np.ceil(np.log2(count))))[:count]
    shares = dict(zip(names, sequence.T, strict=True))
    population = _population(ranges, {name: shares[name] for name in ranges}, flat, count)
    moves = _moves(spec, shares["travel"], shares["acceleration"])
    tolerance = spec.safety.stiffness_tolerance
    factors = Interval((1 - tolerance) * (1 - softening), 1 + tolerance, "").at(shares["stiffness"])
    stiffness = {"joint.stiffness": flat["joint.stiffness"] * factors}
    return Population({**population.keys, **moves, **stiffness}, count)


def typical_move(spec: Spec) -> dict[str, Any]:
    """Return the keys of a move in the middle of the ranges of travel and acceleration."""
    keys = _moves(spec, np.array(0.5), np.array(0.5))
    return {"motion.kind": "there_and_back", **{key: float(value) for key, value in keys.items()}}


RETURN_AFTER = 5.0  # [s]
"""Time of the return, as in the thesis's path."""


def _moves(spec: Spec, travel: np.ndarray, acceleration: np.ndarray) -> dict[str, np.ndarray]:
    """Return keys of moves there and back, at fractions from 0 to 1 of the ranges specified.

    `travel` and `acceleration` are these fractions, on a logarithmic scale.
    """
    distance, rate = (
        interval.low * (interval.high / interval.low) ** share
        for interval, share in ((spec.moves.travel, travel), (spec.moves.acceleration, acceleration))
    )
    time = np.sqrt(distance / rate)
    back = np.maximum(RETURN_AFTER, 2 * time + RETURN_AFTER / 2)
    return {"motion.acceleration": rate, "motion.acceleration_time": time, "motion.return_at": back}


def _friction(spec: Spec, flat: Mapping[str, Any]) -> dict[str, Interval]:
    """Return the ranges of friction by key.

    Raises InputError for a key that the friction law lacks.
    """
    values = {name: getattr(spec.friction, name) for name in type(spec.friction).model_fields}
    ranges = {name: interval for name, interval in values.items() if interval is not None}
    for name in ranges:
        key = f"friction.{'coulomb' if name == 'gap' else name}"
        if key not in flat:
            law = flat["friction.model"]
            expected = "a range of a key that the friction law of the stage has"
            raise InputError(f"friction.{name}", f"a range, but the stage has {law} friction", expected)
    return ranges


def _masses(spec: Spec) -> dict[str, Interval]:
    masses = {name: getattr(spec.masses, name) for name in ("cart", "stage")}
    return {name: interval for name, interval in masses.items() if interval is not None}


def _population(
    ranges: Mapping[str, Interval], shares: Mapping[str, np.ndarray], flat: Mapping[str, Any], count: int
) -> Population:
    """Return machines whose keys lie at fractions `shares`, from 0 to 1, of their ranges.

    Sliding friction is limited to the static friction. Machines with both equal are included, although they cannot
    hunt.
    """
    values = {name: interval.at(shares[name]) for name, interval in ranges.items()}
    keys = {f"masses.{name}": values.pop(name) for name in ("cart", "stage") if name in values}
    if "friction.static" not in flat:
        return Population(keys | {f"friction.{name}": value for name, value in values.items()}, count)
    static = np.broadcast_to(values.get("static", flat["friction.static"]), (count,)).astype(float)
    if "gap" in values:
        values["coulomb"] = static * (1 - values.pop("gap"))
    else:
        values["coulomb"] = np.minimum(values.get("coulomb", flat["friction.coulomb"]), static)
    values["static"] = static
    return Population(keys | {f"friction.{name}": value for name, value in values.items()}, count)


@dataclass(frozen=True)
class Corners:
    """Extremes of friction and masses (corners), and the edge of hunting at each.

    `edges` [Hz], shape (n,), is the highest crossover at which the stage hunts: to 1 or 2 % in the worst corner, in the
    others to half a step of the search. It is 0 if the stage does not hunt from `searched[0]` on, and infinite if it
    still hunts at `searched[1]`. `unknown` counts the corners whose edge is not certain. Either simulations below it
    failed or did not settle, which counts as hunting. Or something above it may attract that no simulation reached.
    """

    population: Population
    edges: np.ndarray
    searched: tuple[float, float]
    unknown: int = 0

    @property
    def worst(self) -> int:
        """Return the index of the corner that hunts up to the highest crossover."""
        return int(self.edges.argmax())

    @property
    def highest(self) -> float:
        """Return the highest crossover [Hz] at which any corner hunts.

        If none hunts, the result is the lowest crossover searched.
        """
        return float(max(self.searched[0], self.edges.max()))

    @property
    def hunts(self) -> bool:
        """Tell whether any corner hunts in the range searched."""
        return bool(np.any(self.edges > 0))


def edges_over(
    flat: Mapping[str, Any],
    population: Population,
    low: float,
    high: float,
    steps: int,
    progress: Progress = silent,
    label: str = "",
) -> Corners:
    """Find the edge of hunting of a stage by van Dijk's rules, for each machine of a population.

    The search goes down from `high` to `low` [Hz] on a grid of `steps`, until the stage hunts. It then halves the step
    above that point, for the machines that may have the highest edge of all. `label` names the search to the progress.
    """
    corners = population.over({**flat, CROSSOVER: np.nan, "motion.kind": "release"})  # whatever the stage's motion
    grid, count = np.log(np.geomspace(low, high, steps)), population.count
    inside, outside, unsure = np.full(count, -np.inf), np.full(count, np.inf), np.zeros((2, count), bool)

    def survey(which: np.ndarray, crossover: np.ndarray) -> None:
        attract, certain = _attract(corners, which, crossover)
        outside[which[~attract]], inside[which[attract]] = crossover[~attract], crossover[attract]
        unsure[attract.astype(int), which] = ~certain

    for k, point in enumerate(grid[::-1]):
        progress(k, steps + settings.edge_bisections, label)
        if (left := np.flatnonzero(np.isneginf(inside))).size:
            survey(left, np.full(left.size, point))
    for k in range(settings.edge_bisections):
        progress(steps + k, steps + settings.edge_bisections, label)
        highest = np.flatnonzero(np.isfinite(inside) & np.isfinite(outside) & (outside > inside.max()))
        if highest.size:
            survey(highest, (inside[highest] + outside[highest]) / 2)
    edges = np.where(np.isneginf(inside), 0.0, np.exp((inside + outside) / 2))
    return Corners(population, edges, (low, high), int(unsure.any(axis=0).sum()))


ORBIT_RTOL = 1e-7
"""Tolerance of orbits. Multipliers are needed to a percent."""


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def _attract(corners: Mapping[str, Any], which: np.ndarray, crossover: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tell which corners hunt or may hunt at certain crossovers, and whether that is certain.

    `which` are indices of corners, and `crossover` the logarithm of a crossover for each.
    """
    some = {key: value[which] if np.ndim(value) else value for key, value in corners.items()}
    attracted = find_attractors({**some, CROSSOVER: np.exp(crossover)}, len(which), ORBIT_RTOL)
    return attracted.attracts | ~attracted.decided, attracted.certain


def rigid(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return the stage without isolator: cart and stage become one mass, as if locked."""
    return {key: value for key, value in flat.items() if not key.startswith(("joint.", "flexure.", "parasitic."))}


AROUND_A_MODE = np.sinh(np.linspace(-7.0, 7.0, 71))
"""Frequencies around a mode at which the loop is evaluated, in units of its half width."""


@dataclass(frozen=True)
class Modal:
    """A stage in its settled states, with its plants over `omega` [rad/s].

    Settled states are the limit cases, and all states stuck under a bias force. `bare` are the plants without parasitic
    mode, and `with_modes` the plants with the modes of the leaf springs. Both have shape (states, frequencies) [m/N]
    and include the drive. Modes are added to the motion of the stage as a rigid mass, because they lie far above the
    frequencies at which the cart matters.
    """

    flat: Mapping[str, Any]
    members: Members
    omega: np.ndarray
    bare: np.ndarray
    with_modes: np.ndarray

    @classmethod
    def of(cls, flat: Mapping[str, Any], leaves: Evaluation) -> Modal:
        """Build the settled states of a stage, from its keys in SI, with its leaf springs' modes."""
        rigid = {key: value for key, value in flat.items() if not key.startswith("parasitic.")}
        members, drive = settled_members(rigid), DriveTiming.of(rigid)
        omega = _frequencies(rigid, leaves, drive)
        bare = plants(rigid, members, omega) * drive.transfer(omega)
        return cls(rigid, members, omega, bare, bare + compliance(leaves, omega) * drive.transfer(omega))

    def margin(self, crossover: np.ndarray) -> np.ndarray:
        """Return the least modulus margin of all states at each crossover [Hz], shape (n,).

        The margin is 0 at a crossover at which a state is unstable.
        """
        factors = np.atleast_1d(crossover) / bandwidth(self.flat)
        keys = faster(self.flat, np.repeat(factors, len(self.members)))
        settled = stability_by_poles(keys, self.members.repeated(len(factors))).abscissa.reshape(len(factors), -1) < 0
        stable = np.asarray(settled.all(axis=1))
        return np.array([self._margin(factors[k]) if stable[k] else 0.0 for k in range(len(factors))])

    def _margin(self, factor: np.ndarray) -> float:
        """Return the least modulus margin of all states, with the bandwidth scaled by `factor`.

        The states must be stable without the modes; it is 0 if the modes make one of them unstable.
        """
        shape = controller_response(faster(self.flat, factor), self.omega)
        bare, loop = self.bare * shape, self.with_modes * shape
        ratio = (1 + loop) / (1 + bare)
        turns = np.angle(ratio[..., 1:] / ratio[..., :-1]).sum(axis=-1) / (2 * np.pi)  # around 0 in the complex plane
        stable = np.abs(turns) < 0.5
        return float(distance_to_lines(loop).min()) if stable.all() else 0.0

    @property
    def comfortable(self) -> tuple[Range, ...]:
        """Return the crossovers [Hz] with a modulus margin of at least 0.5."""
        return ranges_below(
            np.geomspace(*searched_crossovers(self.flat), frequency_settings.crossover_steps),
            lambda at: COMFORTABLE_MARGIN - self.margin(at),
        )


def compliance(leaves: Evaluation, omega: np.ndarray) -> np.ndarray:
    """Return what the leaf springs' modes add to the plant [m/N], shape (frequencies,).

    The first mode, the motion in the drive direction, is left out. `omega` are frequencies [rad/s].
    """
    zeta = float(leaves.mechanism.damping_ratio)
    parts = [
        mode.actuator
        * mode.sensor
        / ((2 * np.pi * mode.frequency) ** 2 - omega**2 + 2j * zeta * 2 * np.pi * mode.frequency * omega)
        for mode in leaves.modes[1:]
    ]
    return np.sum(parts, axis=0)


def _frequencies(flat: Mapping[str, Any], leaves: Evaluation, drive: DriveTiming) -> np.ndarray:
    """Return angular frequencies that show the loop at all crossovers, and every mode."""
    ends = [
        frequency_grid(faster(flat, np.array(end / bandwidth(flat))), SEARCH_DENSITY)
        for end in searched_crossovers(flat)
    ]
    zeta = float(leaves.mechanism.damping_ratio)
    about = [2 * np.pi * mode.frequency * (1 + zeta * AROUND_A_MODE) for mode in leaves.modes[1:]]
    frequencies = np.unique(np.concatenate([*ends, *about]))
    return frequencies[(frequencies > 0) & (frequencies < drive.highest)]


DAMPING_RATIOS = np.geomspace(0.02, 0.7, 9)
"""Joint dampings that are tried, as damping ratios of the stage on the joint."""


ENOUGH_MARGIN = 0.95
"""Fraction of the best modulus margin beyond which more damping is not worth its trouble."""


@dataclass(frozen=True)
class Damping:
    """Joint dampings that were tried [N s/m], and each one's least modulus margin.

    The margin is 0 for an unstable loop. The stage's own damping comes first.
    """

    tried: np.ndarray
    margins: np.ndarray

    @property
    def worth(self) -> int:
        """Return the index of the smallest damping that gives nearly all of the possible margin.

        Index 0 is the stage's own damping.
        """
        return int(np.flatnonzero(self.margins >= ENOUGH_MARGIN * self.margins.max())[0])


@dataclass(frozen=True)
class DesignedController:
    """Gains by van Dijk's rules at the chosen `crossover` [Hz].

    `margin` is the least modulus margin as designed, over the limit cases and all states stuck under a bias force.
    `corners` has the least margin at each corner of friction and masses, shape (n,). `damping` shows what more damping
    of the joint would add.
    """

    crossover: float
    gains: Tuning
    margin: float
    corners: np.ndarray
    damping: Damping


def comfortable_below(ranges: Sequence[Range], highest: float) -> float | None:
    """Return the highest crossover [Hz] in the `ranges` up to `highest`; None if all lie above."""
    below = [min(high, highest) for low, high in ranges if low < highest]
    return max(below) if below else None


def comfortable(stage: Stage, leaves: Evaluation, population: Population) -> tuple[Range, ...]:
    """Return the ranges of crossovers [Hz] in which the least modulus margin is at least 0.5.

    The margin counts in the limit cases and all states stuck under a bias force, for the stage's own masses and all
    masses in the population.
    """
    flat = stage.flat()
    ranges = Modal.of(flat, leaves).comfortable
    masses = {
        tuple((key, value) for key, value in population.of(k).items() if key.startswith("masses."))
        for k in range(population.count)
    }
    for group in sorted(masses):
        if group:
            ranges = shared(ranges, Modal.of({**flat, **dict(group)}, leaves).comfortable)
    return ranges


def choose_controller(stage: Stage, leaves: Evaluation, population: Population) -> DesignedController:
    """Return the gains and margins of a stage with leaf springs, at its chosen crossover."""
    flat = stage.flat()
    gains = tuning(*(flat[key] for key in (CROSSOVER, ALPHA, BETA, TUNED_MASS)))
    corners = np.array([_margin({**flat, **population.of(k)}, leaves) for k in range(population.count)])
    tried = dampings(flat)
    damping = Damping(tried, np.array([_margin({**flat, "joint.damping": trial}, leaves) for trial in tried]))
    return DesignedController(flat[CROSSOVER], gains, _margin(flat, leaves), corners, damping)


def _margin(flat: Mapping[str, Any], leaves: Evaluation) -> float:
    return float(Modal.of(flat, leaves).margin(flat[CROSSOVER])[0])


def dampings(flat: Mapping[str, Any]) -> np.ndarray:
    """Return the joint dampings to try [N s/m]: the stage's own, then larger ones, ascending."""
    tried = DAMPING_RATIOS * 2 * np.sqrt(flat["joint.stiffness"] * flat["masses.stage"])
    return np.append(flat["joint.damping"], tried[tried > flat["joint.damping"]])


RETURN = "motion.return_at"
"""Key of the time [s] at which a move there and back returns."""

THERE_AND_BACK = {
    "kind": "there_and_back",
    "acceleration": "1 m/s^2",
    "acceleration_time": "0 s",
    "return_at": "5 s",
    "duration": "20 s",
}
"""A motion with placeholder numbers, which each machine replaces."""


LAST_SHARE = 0.25
"""Final part of the run in which a stage must stay in its window, longer than the slowest period of hunting seen.
"""

FOLLOWED_TIME = 15.0  # [s]
"""Time for which a move is followed, as in the thesis's path."""

LONGER_FACTOR = 10.0
"""Factor on that time for machines not in position by then: they creep or hunt."""


@dataclass(frozen=True)
class MachineOutcomes(ArrayColumns):
    """Outcomes of machines after their moves, as arrays of shape (count,).

    `words` say what the run does until its end (`friso.hunting.criteria.run_outcome`), with the position window as
    band. A machine rests if it stays in the window for the last quarter of the run. All other machines are simulated
    ten times as long, and their words are those of the longer run. `settling` [s] is the time after a corner of the
    reference from which the stage stays in the window, at the worse end of its move; NaN if it does not rest. `swing`
    [m] is the peak-to-peak motion in the last quarter.
    """

    words: np.ndarray
    settling: np.ndarray
    swing: np.ndarray

    @property
    def completed(self) -> np.ndarray:
        """Tell which runs were simulated to their end, shape (count,)."""
        return self.words != FAILED

    @property
    def restless(self) -> np.ndarray:
        """Tell which machines swing or creep at the end, shape (count,)."""
        return np.isin(self.words, (SWINGS, CREEPS))

    @property
    def tried(self) -> int:
        """Return the number of moves simulated to their end."""
        return int(self.completed.sum())

    @property
    def missed(self) -> int:
        """Return the number of moves after which the stage does not come to rest in the window."""
        return int(self.restless.sum())

    @property
    def swinging(self) -> int:
        """Return the number of moves after which the stage keeps swinging."""
        return int(np.count_nonzero(self.words == SWINGS))

    @property
    def interval(self) -> tuple[float, float]:
        """Return the 95 % interval of the probability of not coming to rest (Clopper and Pearson)."""
        return share_interval(self.missed, self.tried)

    def slower_than(self, share: float) -> float:
        """Return the settling time [s] that the fraction `share` of the moves exceeds.

        The result is infinite if more moves than that do not settle.
        """
        times = np.where(np.isnan(self.settling), np.inf, self.settling)[self.completed]
        return float(np.quantile(times, 1 - share, method="higher")) if times.size else np.inf

    def followed(self, number: int) -> float:
        """Return for how long [s] the machine with this number was simulated after its move."""
        soon = self.settling[number] <= (1 - LAST_SHARE) * FOLLOWED_TIME
        return FOLLOWED_TIME if soon else LONGER_FACTOR * FOLLOWED_TIME

    @property
    def worst(self) -> int:
        """Return the index of the worst move.

        The worst is the move that swings or creeps over the largest distance. If all come to rest, it is the move that
        settles last.
        """
        rank = np.where(self.restless, self.swing + 1e9, np.nan_to_num(self.settling, nan=-1.0))
        return int(np.where(self.completed, rank, -np.inf).argmax())


@dataclass(frozen=True)
class Verification:
    """The machines and moves drawn, with their outcomes for the joint `free` and, of the first ones, `locked`.

    `compared` has the outcomes with a free joint of those that were also moved with a locked one. `worst` is the worst
    machine with a free joint, as a stage.
    """

    population: Population
    free: MachineOutcomes
    locked: MachineOutcomes
    worst: Stage

    @property
    def compared(self) -> MachineOutcomes:
        return self.free.take(slice(len(self.locked.words)))


COMPARED_MOVES = 1000
"""Number of these moves that are also made with the joint locked, which shows a fraction to three percent of all.
Where the joint is needed many of them swing, and are followed ten times as long."""


def verification(stage: Stage, spec: Spec, softening: float, progress: Progress) -> Verification:
    """Try the design in machines and moves drawn from the specification; the first ones with a locked joint, too.

    The load reduces the drive stiffness by up to the fraction `softening`.
    """
    flat = stage.flat()
    machines = random_machines(spec, flat, settings.verified_moves, softening)
    window = float(spec.position.window)

    def moved(count: int, name: str, held: bool) -> MachineOutcomes:
        drawn = {key: values[:count] for key, values in machines.keys.items()}
        keys = {**flat, **drawn, "joint.locked": held, "motion.kind": "there_and_back"}
        return move_machines(keys, count, window, progress, f"moves, {name}")

    free = moved(machines.count, "joint free", False)
    locked = moved(min(COMPARED_MOVES, machines.count), "joint locked", True)
    return Verification(machines, free, locked, _worst_stage(stage, machines.of(free.worst), free.followed(free.worst)))


def move_machines(
    flat: dict[str, Any],
    count: int,
    window: float,
    progress: Progress = silent,
    label: str = "moves",
    patient: bool = True,
) -> MachineOutcomes:
    """Simulate the moves of `count` stages, given by keys with arrays of shape (count,).

    If `patient`, stages stand at the far end as long as at the near one, so that both ends decide, and machines that
    are not in position are simulated again for longer. `window` is the position window [m].
    """
    first = _followed_moves(flat, count, window, FOLLOWED_TIME, progress, label, patient)
    again = np.flatnonzero(first.restless & patient)
    if again.size:
        keys = {key: value[again] if np.ndim(value) else value for key, value in flat.items()}
        longer = _followed_moves(
            keys,
            again.size,
            window,
            LONGER_FACTOR * FOLLOWED_TIME,
            progress,
            f"{label}, those not at rest for longer",
        )
        better = np.flatnonzero(longer.completed)  # if the long run fails, the word of the short one stays
        for name in ("words", "settling", "swing"):
            getattr(first, name)[again[better]] = getattr(longer, name)[better]
    return first


VERIFIED_RTOL = 1e-5
"""Tolerance of the moves, which gives settling times to a few percent."""

RUNS_PER_REPORT = 512
"""Runs between progress reports, about a second."""


def _followed_moves(
    flat: dict[str, Any],
    count: int,
    window: float,
    time: float,
    progress: Progress,
    label: str,
    both_ends: bool = True,
) -> MachineOutcomes:
    """Simulate the moves of `count` stages, each followed for a time [s] after its last corner.

    With `both_ends`, the stage stands as long at the far end, and settles as late as at the worse end. `window` is the
    position window [m]; `label` names the work to the progress.
    """
    if both_ends:
        flat = {**flat, RETURN: last_corner(flat) - flat[RETURN] + time}
    corner = np.broadcast_to(np.asarray(last_corner(flat), float), (count,))
    keys = {**flat, "motion.duration": corner + time}
    options = RunOptions(
        rtol=VERIFIED_RTOL,
        bands=(window, 10 * window),
        window=1 - LAST_SHARE,
        record_from=np.inf,
        least_swing=window / 4,
        room=round(FIRST_TURNING_POINTS * time / FOLLOWED_TIME),
        chunk=RUNS_PER_REPORT,
    )
    outcome = MachineOutcomes(np.full(count, FAILED, dtype=object), np.full(count, np.nan), np.full(count, np.nan))
    done = 0
    for runs in run_chunks(kernel(shared_structure(keys)), keys, count, options):
        numbers = runs.numbers
        end = run_ends(runs, turns_of(runs, corner[numbers]), "inner")
        words = outcomes(end, window, hold=LAST_SHARE * end.ended)
        settling = np.maximum(end.outside - corner[numbers], 0.0)
        if both_ends:
            settling = settling_of_runs(runs.part(keys), runs, "inner")
            words = np.where((words == RESTS) & ~np.isfinite(settling), CREEPS, words)
        outcome.words[numbers] = words
        outcome.settling[numbers] = np.where(words == RESTS, settling, np.nan)
        outcome.swing[numbers] = end.swing
        done += len(numbers)
        progress(done, count, label)
    return outcome


def _worst_stage(stage: Stage, keys: dict[str, float], time: float) -> Stage:
    """Return a machine as a stage, with its move and a time [s] after it.

    `keys` are those of the machine. The joint has plain numbers instead of leaf springs, since no single size of the
    leaves explains its stiffness.
    """
    flat = stage.flat()
    follow = ("joint.stiffness", "parasitic.frequency", "parasitic.mass", "parasitic.damping_ratio")
    joint = {key: float(flat[key]) for key in (*follow, TUNED_MASS)}
    moved = stage.replace({"motion": THERE_AND_BACK})
    corner = float(last_corner({**flat, **moved.flat(), **keys}))
    numbers = joint | keys | {"motion.duration": corner + time}
    return moved.with_numbers(numbers, without=["flexure"])


@dataclass(frozen=True)
class HuntingMap:
    """The fraction of corners in which the stage is not in position, over crossover and stroke.

    Corners are the extremes of friction and masses. Crossovers [Hz] have shape (n,), strokes [m] (m,), and fractions
    (m, n). A corner counts if the stage is not in position a quarter of a minute after a typical move. The fraction is
    NaN if a run failed.
    """

    crossovers: np.ndarray
    strokes: np.ndarray
    share: np.ndarray


MAP_REACH = ((1 / 30, 2.0), (1 / 30, 3.0))
"""Range of the map relative to the design. It shows both edges of hunting of the thesis's rig."""


def hunting_map(stage: Stage, spec: Spec, population: Population) -> HuntingMap:
    """Compute the map of corners not in position, over crossover and stroke, around a design.

    The drive stiffness is the design's own.
    """
    flat = stage.flat()
    crossovers, strokes = (
        np.geomspace(low * flat[key], high * flat[key], count)
        for key, (low, high), count in zip(
            (CROSSOVER, "joint.stroke"),
            MAP_REACH,
            (settings.map_crossovers, settings.map_strokes),
            strict=True,
        )
    )
    shape = (settings.map_strokes, settings.map_crossovers, population.count)
    stroke, crossover, number = (
        axis.ravel() for axis in np.meshgrid(strokes, crossovers, np.arange(population.count), indexing="ij")
    )
    machines = {key: value[number] for key, value in population.keys.items()}
    runs = {**flat, **machines, **typical_move(spec), CROSSOVER: crossover, "joint.stroke": stroke}
    outcome = move_machines(runs, len(number), float(spec.position.window), patient=False)
    share = np.where(outcome.completed, outcome.restless, np.nan).reshape(shape).mean(axis=2)
    return HuntingMap(crossovers, strokes, share)
