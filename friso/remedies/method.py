"""Run the method of `friso tune`: optimise each remedy, and verify its best points.

Of what works, the smallest change of the bandwidth that meets the goal is found. The size of a change counts parts
bought, keys changed, and the factor of change.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Any, Literal

import numpy as np

from friso.axis import LINEAR
from friso.design_method.prepare import leaves_for_joint
from friso.engine.allowance import Allowance, Exhausted, allowance
from friso.engine.kernel import KernelRequest, kernels
from friso.equations.bandwidth import bandwidth
from friso.equations.motion import last_corner
from friso.equations.structure import structure
from friso.errors import InputError, StageError
from friso.frequency.bode import Limits, limits, loop_bandwidth
from friso.hunting import Case
from friso.hunting.criteria import ATTRACTED
from friso.platform.installed import missing
from friso.progress import Progress, silent
from friso.remedies.catalogue import (
    BANDWIDTH,
    LARGEST_SPEED_FACTOR,
    Remedy,
    SpeedCap,
    linear_flat,
    remedies,
    speed_cap,
    with_bandwidth,
)
from friso.remedies.machines import Fleet, Goal, MoveRange, draw_fleet
from friso.remedies.search import ALTERNATIVES_SHARE, NEAR_RANGES, SURVEY_BATCH, Budget, Search, modulus_margins
from friso.remedies.verified import (
    Performance,
    RemedyOutcome,
    checked,
    confirmed,
    missed_parts,
    moving,
    unsettled_parts,
)
from friso.stage import Stage
from friso.stage.controllers import CONTROLLER
from friso.stage.correlations import Correlations
from friso.stage.rig import AS_BUILT, is_as_built, motion_of
from friso.virtual_rig.cures import Cure, cures, is_quiet, judged
from friso.virtual_rig.verdict import Built

PARTS = ("joint.", "flexure.")
"""Prefixes of keys that describe parts to be bought."""


@dataclass(frozen=True, order=True)
class ChangeSize:
    """The size of a change, which orders changes from small to large.

    Changes are compared first by whether a part is `bought`, then by the number of `keys` of the controller that
    change. Last comes the `factor`, the product of the factors by which numbers change. `scaled` is how many numbers
    change by a factor; it is not compared.
    """

    bought: bool
    keys: int
    factor: float
    scaled: int = field(default=0, compare=False)

    @property
    def mean(self) -> float:
        """Return the geometric mean of the factors by which numbers change."""
        return float(self.factor ** (1 / max(1, self.scaled)))


def change_size(before: Stage, after: Stage) -> ChangeSize:
    """Measure how large the change from one stage to another is: parts bought, keys, factors."""
    old, new = before.flat(), after.flat()
    bought = any(_differ(old.get(key), new.get(key)) for key in {*old, *new} if key.startswith(PARTS))
    keys = [key for key in {*old, *new} if key.startswith(f"{CONTROLLER}.") and _differ(old.get(key), new.get(key))]
    octaves = [octave for key in sorted(keys) if (octave := _octaves(old, new, key))]
    return ChangeSize(bought, len(keys), float(np.exp(sum(octaves))), len(octaves))


def _octaves(old: Mapping[str, Any], new: Mapping[str, Any], key: str) -> float:
    """Return the size of a number's change, as the natural logarithm of its factor.

    Upward and downward changes count alike. The result is 0 for words, and for a number that was or becomes 0 or
    changes its sign.
    """
    before, after = old.get(key), new.get(key)
    if isinstance(before, str) or isinstance(after, str) or not before or not after or before * after <= 0:
        return 0.0
    return abs(float(np.log(after / before)))


UNCHANGED_SHARE = 1e-6
"""Largest relative difference between numbers that is rounding, not a change."""


def _differ(before: Any, after: Any) -> bool:
    """Tell whether two values of a key differ by more than rounding."""
    if before is None or after is None or isinstance(before, str) or isinstance(after, str):
        return bool(before != after)
    return abs(after - before) > UNCHANGED_SHARE * max(abs(before), abs(after))


FACTORS_TRIED = 24
"""Factors on the bandwidth tried either way. Fewer overshoot the smallest change; each costs a move of all
machines."""


def least_factors(search: Search) -> Iterator[np.ndarray]:
    """Yield factors on the bandwidth that work, the smallest change first, each of shape (1,).

    The remedy searched varies the bandwidth alone. With these factors no constraint is broken, all fresh machines meet
    the goal by moves and margins, and enough surveyed machines do not hunt (`Search.clear`).
    """
    (variable,) = search.remedy.variables
    home, steps = variable.share(variable.present), np.arange(1, FACTORS_TRIED + 1)
    shares = np.concatenate([home + steps * ((end - home) / FACTORS_TRIED) for end in (1.0, 0.0)])
    sizes = np.abs(np.log(variable.at(shares) / variable.present))
    order = np.argsort(sizes, kind="stable")
    for few in search.tries(shares[order[sizes[order] > 0], None]):
        robust = few[search.share(few) == 1] if len(few) else few
        for some in np.array_split(robust, -(-len(robust) // SURVEY_BATCH)) if len(robust) else ():
            yield from some[search.clear(some)]


Unmade = Literal["rotary", "mode", "extra", "none"]
"""Reason why no leaf springs make a joint: the axis turns; the machine already has a parasitic mode, so there is no
room for a second one from leaf springs; an extra package is missing; or no usual size bears the stroke."""


DESCRIBED_REMEDIES = 2
"""Remedies that are described in full, the cheapest first. More are a catalogue; the table has all."""


@dataclass(frozen=True)
class Advice:
    """Results of all remedies for a stage, in the order of the catalogue.

    `case` is the check of the stage, and `present` the performance of the stage as it is on machines. `unmet` are the
    parts of the goal that it misses or may miss, by names of `friso.questions.tune.present_words.DOUBTS`. `limits`
    gives the bandwidths with enough margin. `interrupted` is true if the search was ended early.

    The tables `as_built` are used to verify what works, not in the search; they and the `correlations` are added to
    stage files that are written. `cap` is how much faster the controller could become. `built` is the verdict on the
    stage as built (None: its file describes no drive), and `cures` are changes of its drive that stop its hunting.
    `unmade` gives the reason why no leaf springs make the joint of a remedy.
    """

    stage: Stage
    goal: Goal
    case: Case
    present: Performance
    limits: Limits
    outcomes: tuple[RemedyOutcome, ...]
    machines: Fleet
    seed: int
    interrupted: bool = False
    as_built: Mapping[str, Any] = field(default_factory=dict)
    correlations: Correlations = field(default_factory=Correlations)
    unmade: Mapping[str, Unmade] = field(default_factory=dict)
    unmet: tuple[str, ...] = ()
    cap: SpeedCap = field(default_factory=lambda: SpeedCap(LARGEST_SPEED_FACTOR, "stated"))
    built: Built | None = None
    cures: tuple[Cure, ...] = ()

    @property
    def needed(self) -> bool:
        """Tell whether the stage as it is misses the goal, or may miss it."""
        return bool(self.unmet)

    @property
    def least(self) -> RemedyOutcome | None:
        """Return the remedy that works and costs the machine least (see `working`); None if none does."""
        return next(iter(self.working), None)

    def complete(self, tuned: Stage) -> Stage:
        """Return a tuned stage with the tables that describe the real machine.

        Tables that belong to another controller are left out.
        """
        return _complete(tuned, self.as_built)

    def size(self, outcome: RemedyOutcome) -> ChangeSize:
        """Return how large the change by a remedy is, for an outcome that has settings."""
        assert outcome.stage is not None
        return change_size(self.stage, outcome.stage)

    @property
    def working(self) -> tuple[RemedyOutcome, ...]:
        """Return the remedies that work: those for all moves first, and of these the cheapest for the machine first.

        Leaf springs that make the joint of a remedy are no remedies of their own.
        """
        return _working(self.outcomes, self.stage, self.goal)

    def for_all_moves(self, outcome: RemedyOutcome) -> bool:
        """Tell whether the goal holds with a remedy for all moves that were drawn."""
        return outcome.measured is not None and outcome.measured.holds_for_all_moves(self.goal)

    @property
    def recommended(self) -> tuple[RemedyOutcome, ...]:
        """Return the remedies that are described in full: the two that cost the machine least."""
        return self.working[:DESCRIBED_REMEDIES]

    def made_of_leaves(self, outcome: RemedyOutcome) -> RemedyOutcome | None:
        """Return the outcome of a remedy's joint when made of leaf springs, or None."""
        return next((other for other in self.outcomes if other.remedy.makes == outcome.remedy.name), None)


def _complete(tuned: Stage, as_built: Mapping[str, Any]) -> Stage:
    """Return a tuned stage with the tables `as_built`; without them if they belong to another controller."""
    try:
        return tuned.replace(as_built)
    except StageError:
        return tuned


def _as_built(stage: Stage) -> dict[str, Any]:
    """Return the tables of a stage that describe the real machine."""
    return {name: table for name, table in stage.as_written().items() if name in AS_BUILT}


def slowest(outcome: RemedyOutcome, goal: Goal) -> float:
    """Return the time [s] in which enough machines and moves settle with a remedy.

    Enough is the fraction `goal.share`. The time is infinite if they never do, or if the remedy was not measured.
    """
    return np.inf if outcome.measured is None else outcome.measured.slowest(goal)


def _working(outcomes: Iterable[RemedyOutcome], stage: Stage, goal: Goal) -> tuple[RemedyOutcome, ...]:
    """Return the remedies of a stage that work: those for all moves first, of these the cheapest for the machine.

    Parts to be bought cost most. The speed of the controller, one knob of every controller, comes before other changes.
    Others follow by what they cost the machine, force times bandwidth over margin, and only then by how many knobs they
    turn and how far, however many keys spell these. Leaf springs that make the joint of another remedy are left out.
    """
    own = loop_bandwidth(stage)

    def rank(outcome: RemedyOutcome) -> tuple[bool, bool, bool, float, int, float]:
        assert outcome.measured is not None
        assert outcome.stage is not None
        size, ratio = change_size(stage, outcome.stage), loop_bandwidth(outcome.stage) / own
        ratio = max(1.0, ratio) if np.isfinite(ratio) else np.inf
        cost = outcome.measured.force(goal) * ratio / outcome.measured.least_margin(goal)
        remedy, some = outcome.remedy, not outcome.measured.holds_for_all_moves(goal)
        return some, size.bought, remedy.name != BANDWIDTH, cost, len(remedy.variables), size.factor

    works = (outcome for outcome in outcomes if outcome.certainty == "works" and not outcome.remedy.makes)
    return tuple(sorted(works, key=rank))


SETTING_PAIRS = 2
"""Settings against friction that are combined with the bandwidth. More take minutes."""

PROGRESS_STEPS = 20
"""Progress steps of a verification, which takes as long as this many generations."""

FRESH_SEED = 1000
"""Seed of the fresh machines on which the best points are chosen."""

UNSEEN_SEED = 2000
"""Seed of the unseen machines on which the chosen settings are measured."""

FURTHER_SEED = 4000
"""Seed of machines that are added if the first are too few to decide."""

TUNING_WORK = 1.5e9
"""Work for all remedies of the controller but the first, about 18 s on one core, and as much for remedies that buy
a joint. Remedies left then are not tried, and the answer says so."""


def tune(
    stage: Stage,
    goal: Goal | None = None,
    seed: int = 1,
    correlations: Correlations | None = None,
    budget: Budget | None = None,
    chosen: Collection[str] | None = None,
    progress: Progress = silent,
    begins: Callable[[], None] = lambda: None,
    answered: Callable[[RemedyOutcome], None] = lambda outcome: None,
) -> Advice:
    """Optimise and verify every remedy that the goal allows, or the remedies named in `chosen`.

    Machines are drawn with the `seed` and the `correlations` of uncertain keys. `budget` sets the size of the searches.
    `begins` is called before the work starts. `answered` is called with the first outcome that works, as soon as it is
    verified. Raises InputError for a motion after which nothing has to settle.
    """
    goal, budget, correlations = goal or Goal(), budget or Budget(), correlations or Correlations()
    _check_motion(stage)
    moves = goal.moves_of(stage)
    moves.check(stage)
    goal, cap = replace(goal, moves=moves), speed_cap(stage, goal)
    begins()
    ideal = stage.replace({table: None for table in AS_BUILT if getattr(stage, table)})
    listed = [remedy for remedy in remedies(ideal, goal, stage) if chosen is None or remedy.name in chosen]
    later = SETTING_PAIRS * (_generations(budget) + 4 + PROGRESS_STEPS)
    report = _Report(progress, sum(_steps(remedy, budget) for remedy in listed) + later)
    progress(0, 0, "compiling")
    kernels({KernelRequest(structure(remedy.stage.flat())) for remedy in [Remedy.settled_on("", ideal), *listed]})
    of_ideal = correlations.among(ideal.uncertain())
    fresh, unseen = (
        _not_seen(ideal, of_ideal, budget.fresh, seed + added, moves) for added in (FRESH_SEED, UNSEEN_SEED)
    )
    further = _not_seen(ideal, of_ideal, budget.further, seed + FURTHER_SEED, moves)
    machines = machines_of_search(ideal, of_ideal, budget, seed, goal, stage)
    progress(0, 0, "the stage as it is")
    present, case = moving(ideal, unseen, goal, stage), None
    session = _Session(ideal, stage, goal, machines, fresh, unseen, further, budget, report, answered)
    work = TUNING_WORK
    interrupted, unmet = False, missed_parts(present, goal) or ("certain",)
    built, cured = None, tuple[Cure, ...]()
    try:
        if missed_parts(present, goal) and listed and listed[0].name == BANDWIDTH:
            session.tries(listed.pop(0))
            first = session.outcomes[0]
            if first.certainty == "works":
                cap = cap.above(first.factor)
                if cap.reason != "stated":
                    session.budget, work = budget.shortened(), ALTERNATIVES_SHARE * work
                listed = [remedy.up_to(cap) for remedy in listed]
        report("the stage as it is", 0)
        case, present = checked(ideal), present.surveyed(ideal, unseen, goal)
        unmet = missed_parts(present, goal) or unsettled_parts(confirmed(ideal, goal), present, goal)
        if not unmet and case.verdict in ATTRACTED:
            unmet = ("verdict",)
        built = judged(stage) if is_as_built(stage) else None
        hunts_as_built = built is not None and built.verdict in ATTRACTED
        unmet = (*unmet, *["as built"] * hunts_as_built)
        if not unmet:
            listed = []  # nothing has to change
        for joint in (False, True):
            with allowance(work) as session.allowed:
                several = [remedy for remedy in listed if remedy.buys_joint == joint]
                session.tries_all(several, pairs if chosen is None and not joint else lambda outcomes, goal: [])
        session.makes_leaves()
        if hunts_as_built and chosen is None:
            report("the drive of the stage as it is")
            cured = tuple(cures(stage))
    except KeyboardInterrupt:
        interrupted = True
        session.interrupted()
    return Advice(
        stage=ideal,
        goal=goal,
        case=case or checked(ideal),
        present=present,
        limits=limits(linear_flat(stage, stage.flat())),
        outcomes=tuple(session.outcomes),
        machines=fresh,
        seed=seed,
        interrupted=interrupted,
        as_built=_as_built(stage),
        correlations=correlations,
        unmade=session.unmade,
        unmet=unmet,
        cap=cap,
        built=built,
        cures=cured,
    )


def _not_seen(stage: Stage, correlations: Correlations, count: int, seed: int, moves: MoveRange | None = None) -> Fleet:
    """Draw machines around a stage, of which none is the stage file's own."""
    return draw_fleet(stage, correlations, count + 1, seed, moves).take(np.arange(1, count + 1))


MACHINE_FACTOR = 2
"""Factor on the number of machines drawn for searches, so that others stand in for those that are left out."""

USUAL_MACHINES = 200
"""Machines that show the usual modulus margin. Fewer leave its second digit uncertain."""

USUAL_SEED = 3000
"""Seed of machines that show the usual robustness."""

FAR_MARGIN_SHARE = 0.5
"""Fraction of the usual margin below which a machine is left out of the few on which settings are tried."""

FEW_SHARE = 0.2
"""Fraction, of the machines that may miss the goal, whose margins lie below what is usual."""


def machines_of_search(
    stage: Stage, correlations: Correlations, budget: Budget, seed: int, goal: Goal, drive: Stage
) -> Fleet:
    """Return the machines on which searches try settings.

    In so small a sample, a machine far less robust than nearly all others would weigh too much. It is left out, and
    another one stands in for it. If too few are left, some count twice. Sampling and delay come from the stage `drive`.
    """
    machines = draw_fleet(stage, correlations, MACHINE_FACTOR * budget.machines, seed, goal.moves)
    many = draw_fleet(stage, correlations, USUAL_MACHINES, seed + USUAL_SEED)
    own, flat = Remedy.settled_on("", stage), drive.flat()
    robust = limits(linear_flat(drive, flat)).highest_comfortable
    slower = max(1.0, (bandwidth(flat) or 1.0) / robust) if robust else 1.0
    seen, usual = (modulus_margins(own, np.zeros((1, 0)), fleet, drive, slower)[0] for fleet in (machines, many))
    common = np.flatnonzero(seen >= FAR_MARGIN_SHARE * np.quantile(usual, FEW_SHARE * (1 - goal.share)))
    return machines.take(np.resize(common if common.size else np.arange(machines.count), budget.machines))


MOST_LOOKS = 12
"""Points inspected on fresh machines. More take minutes and have not led to better ones."""

MOST_TRIES = 3
"""Best points of a remedy that are verified. If all fail on fresh machines, it does not work."""

VERIFYING_WORK = 1.2e9
"""Work to verify a remedy, about 15 s on one core. Once it is exceeded, no other point is verified."""

FURTHER_PARTS = (1 / 12, 1 / 3)
"""Fractions of the further machines after which the interval is examined. With more examinations, more settings
pass by chance: with these two, one in forty of the settings with exactly the required fraction; with two more, one
in thirty."""


@dataclass
class _Session:
    """Search for remedies of one stage: what was tried, how it ended, and what is next.

    `outcomes` are the results so far, and `searching` is the current search. `allowed` limits the work of all remedies
    together. Settings are searched on `machines`, and verified on `unseen` ones, then on `further` ones if the result
    is unclear.
    """

    stage: Stage
    drive: Stage
    goal: Goal
    machines: Fleet
    fresh: Fleet
    unseen: Fleet
    further: Fleet
    budget: Budget
    report: _Report
    answered: Callable[[RemedyOutcome], None] = lambda outcome: None
    outcomes: list[RemedyOutcome] = field(default_factory=list)
    searching: Search | None = None
    allowed: Allowance | None = None
    unmade: dict[str, Unmade] = field(default_factory=dict)

    @property
    def works(self) -> bool:
        """Tell whether any remedy works so far."""
        return any(outcome.certainty == "works" for outcome in self.outcomes)

    def tries_all(
        self, listed: Sequence[Remedy], further: Callable[[Sequence[RemedyOutcome], Goal], list[Remedy]]
    ) -> None:
        """Try remedies, smaller changes first; then `further` remedies.

        `further` chooses remedies from the outcomes so far. Settings against friction with more knobs than a working
        remedy are left out, and so are combinations of remedies that work alone. Remedies that cannot be verified come
        last, and only if nothing works.
        """
        verifiable = [remedy for remedy in listed if remedy.verifiable]
        for own in (True, False):
            for remedy in verifiable:
                knobs = (len(one.remedy.variables) for one in self.outcomes if one.certainty == "works")
                small = not remedy.of_setting or len(remedy.variables) <= min(knobs, default=np.inf)
                if small and (remedy.stage is self.stage) == own and not self._combines(remedy):
                    self.tries(remedy)
        for remedy in further(self.outcomes, self.goal):
            self.tries(remedy)
        for remedy in listed:
            if not remedy.verifiable and not self.works:
                self.tries(remedy)

    def _combines(self, remedy: Remedy) -> bool:
        """Tell whether a remedy only combines other remedies that work alone.

        Then its variables are those of at least two other remedies together.
        """
        names = {variable.name for variable in remedy.variables}
        working = (outcome.remedy for outcome in self.outcomes if outcome.certainty == "works")
        alone = [varied for one in working if (varied := {variable.name for variable in one.variables}) < names]
        return set().union(*alone) == names

    def tries(self, remedy: Remedy) -> None:
        """Search a remedy for the settings that settle soonest, unless all allowed work is used up.

        Of the bandwidth, the smallest factor that works is searched first.
        """
        if self.allowed is not None and self.allowed.left <= 0:
            self.outcomes.append(RemedyOutcome(remedy, None, None, None, (), cut=True, untried=True))
            return
        search = self._begun(remedy)
        if remedy.name == BANDWIDTH:
            self._ended(search, _factors(search))
            return
        search.optimise()
        self._ended(search, search.surveyed())

    def _made_of_leaves(self, outcome: RemedyOutcome) -> None:
        """Verify leaf springs for the joint of a remedy, under the same conditions as the remedy."""
        assert outcome.stage is not None
        remedy = outcome.remedy
        if outcome.stage.axis_kind != LINEAR:
            self.unmade[remedy.name] = "rotary"
        elif self.stage.parasitic and not self.stage.joint:
            self.unmade[remedy.name] = "mode"
        elif missing("design"):
            self.unmade[remedy.name] = "extra"
        elif (stage := leaves_for_joint(outcome.stage, self.stage)) is None:
            self.unmade[remedy.name] = "none"
        else:
            made = Remedy(f"{remedy.name}, of leaf springs", stage, (), True, remedy.name)
            self.tries(made)

    def interrupted(self) -> None:
        """Record the best settings so far of the current remedy, which are not verified."""
        if self.searching is not None and self.outcomes[-1].interrupted:
            self.outcomes[-1] = _so_far(self.searching, self.outcomes[-1])

    def _begun(self, remedy: Remedy) -> Search:
        """Start the search for a remedy."""
        self.report.begins(_steps(remedy, self.budget))
        search = Search(remedy, self.goal, self.machines, self.fresh, self.drive, self.budget, self.report)
        # replaced when the search ends
        self.outcomes.append(RemedyOutcome(remedy, None, None, None, (), interrupted=True))
        self.searching = search
        return search

    def _ended(self, search: Search, points: Iterator[np.ndarray]) -> None:
        """Verify settings that a search offers, in turn until some work, and record the outcome.

        If no settings work, the first outcome is recorded, which is not sure to work. Few settings are tried, and the
        work is limited.
        """
        unsure: RemedyOutcome | None = None
        tries, worked = 0, 0.0
        looks = MOST_LOOKS if search.remedy.verifiable else 1
        for shares in islice(search.looked_at(points), looks):
            try:
                with allowance() as spent:
                    outcome = self._verified(search, shares)
            except Exhausted:
                search.cut = True
                break
            tries, worked = tries + (outcome.confirmation is not None), worked + spent.used
            if outcome.certainty == "works":
                unsure = outcome
                break
            unsure = unsure or outcome
            self.outcomes[-1] = unsure
            # after so much computing, other points would take as much
            if tries == MOST_TRIES or worked > VERIFYING_WORK or "given up" in outcome.doubts:
                break
        tried = search.points if search.tried else None
        none = RemedyOutcome(search.remedy, None, None, None, (), tried, search.attracted, cut=search.cut)
        worked_before = self.works
        self.outcomes[-1] = unsure or none
        if self.works and not worked_before:
            self.answered(self.outcomes[-1])

    def makes_leaves(self) -> None:
        """Size and verify leaf springs for the joints of remedies that are described in full.

        The work allowed for searches does not limit this.
        """
        for one in _working(self.outcomes, self.stage, self.goal)[:DESCRIBED_REMEDIES]:
            if one.remedy.buys_joint:
                self._made_of_leaves(one)

    def _verified(self, search: Search, shares: np.ndarray) -> RemedyOutcome:
        """Measure settings on fresh machines; verify them by limit cycles if enough meet the goal.

        `shares` are the coordinates of the settings. The interval of the fraction of machines that meet the goal must
        lie at the required fraction or above. While the interval leaves that open, further machines are measured.
        """
        remedy, goal = search.remedy, search.goal
        tuned = remedy.tuned(shares)
        self.report(f"{remedy.name}: verified on machines not tuned for")
        measured, confirmation = moving(tuned, self.unseen, goal, self.drive), None
        doubted = missed_parts(measured, goal)
        if not doubted:
            self.report(f"{remedy.name}: verified by its hunting cycles")
            confirmation = confirmed(tuned, goal)
            doubted = unsettled_parts(confirmation, measured, goal)
        if not doubted:
            measured = measured.surveyed(tuned, self.unseen, goal)
            doubted = missed_parts(measured, goal)
        if not doubted:
            self.report(f"{remedy.name}: verified on more machines", PROGRESS_STEPS)
            ends = [round(part * self.further.count) for part in FURTHER_PARTS]
            for part in np.split(np.arange(self.further.count), ends):
                if measured.decides(goal) is None:
                    measured = measured.with_further(tuned, self.further.take(part), goal, self.drive)
            doubted = () if measured.decides(goal) else ("together",)
        if not doubted and is_as_built(complete := _complete(tuned, _as_built(self.drive))):
            self.report(f"{remedy.name}: verified as built")
            doubted = () if is_quiet(judged(complete)) else ("as built",)
        parts = remedy, tuned, measured, confirmation, doubted, search.points, search.attracted
        return RemedyOutcome(*parts, shares=shares)


def _factors(search: Search) -> Iterator[np.ndarray]:
    """Yield factors on the bandwidth to verify: the smallest that work, then those that settle soonest."""
    yield from least_factors(search)
    search.optimise()
    yield from search.surveyed()


def pairs(outcomes: Sequence[RemedyOutcome], goal: Goal) -> list[Remedy]:
    """Return the settings against friction closest to the goal, each with a varied bandwidth.

    These remedies are tried only if no change of the controller alone works.
    """
    if any(outcome.certainty == "works" and not outcome.remedy.buys_joint for outcome in outcomes):
        return []
    several = (outcome for outcome in outcomes if outcome.remedy.of_setting and outcome.remedy.verifiable)
    tried = [outcome for outcome in several if outcome.points]
    closest = sorted(tried, key=lambda outcome: outcome.least_cost(goal))
    return [with_bandwidth(outcome.remedy) for outcome in closest[:SETTING_PAIRS]]


def _so_far(search: Search, outcome: RemedyOutcome) -> RemedyOutcome:
    """Return the outcome of an interrupted search: its best settings so far, not verified."""
    points = search.points
    if not points.meets(search.goal).any():
        return outcome
    shares = points.shares[points.cost(search.goal).argmin()]
    return replace(outcome, stage=search.remedy.tuned(shares), points=points, shares=shares)


def _check_motion(stage: Stage) -> None:
    """Check the motion. Raises InputError if nothing has to settle after it."""
    flat = stage.flat()
    kind = flat["motion.kind"]
    corner, duration = float(last_corner(flat)), flat["motion.duration"]
    if not motion_of(flat).stretched(flat, 1.0) or corner >= duration:
        example = '[motion] kind = "step", size = "1 mm", duration = "20 s"'
        raise InputError("motion.kind", f'"{kind}"', "a move whose reference stands in the end", example)


def _steps(remedy: Remedy, budget: Budget) -> int:
    """Estimate the number of progress steps of a remedy."""
    return (2 if len(remedy.variables) < 2 else _generations(budget)) + 4 + PROGRESS_STEPS


def _generations(budget: Budget) -> int:
    """Return the largest number of generations of a search."""
    return budget.generations + len(NEAR_RANGES) * budget.refined


class _Report:
    """Report progress over all remedies, in steps.

    A remedy that takes more steps than planned stays at the last of them.
    """

    def __init__(self, progress: Progress, total: int) -> None:
        self.progress, self.total, self.done, self.end = progress, total, 0, 0

    def begins(self, steps: int) -> None:
        """Start a remedy that takes `steps` progress steps."""
        self.done, self.end = self.end, min(self.end + steps, self.total)

    def __call__(self, label: str, steps: int = 1) -> None:
        self.done = min(self.done + steps, self.end)
        self.progress(self.done, self.total, label)
