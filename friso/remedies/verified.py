"""Verify remedies by limit cycles, and on machines that the optimiser did not see.

A tuned stage must not hunt at its own bandwidth, nor at nearby ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from friso.engine.allowance import Exhausted, allowance
from friso.engine.kernel import kernels
from friso.equations.bandwidth import faster
from friso.equations.continuous import slow_gains
from friso.equations.settings import gain_states
from friso.equations.structure import structure
from friso.frequency.bode import loop_bandwidth, settled_margin
from friso.frequency.system import in_series
from friso.hunting import (
    Case,
    Hunting,
    LoopState,
    check_given,
    find_attractors,
    hunting,
    judge_many,
    kernels_to_judge,
    unstable,
)
from friso.intervals import DOUBT_PROBABILITY, Share, quantile_interval, share
from friso.remedies.catalogue import BANDWIDTH, Remedy, linear_flat
from friso.remedies.machines import Fleet, Goal, MoveRange
from friso.remedies.search import (
    Attraction,
    Moves,
    TriedPoints,
    attraction,
    modulus_margins,
    moves_of_points,
    quantile,
    timing,
)
from friso.remedies.settings import settings
from friso.stage import Stage


@dataclass(frozen=True)
class Confirmation:
    """Result of searching for hunting at a stage's own bandwidth and at nearby ones.

    `hunting` are the limit cycles of the `stage` itself, searched as thoroughly as `friso check` does. `word` is the
    verdict on the stage's own motion from fewer starts; None if that takes too much work. `factors` are the other
    bandwidths, as multiples of the stage's own; `quiet` is true at those at which the stage certainly does not hunt.
    `unstable` are the states in which the loop of the stage is unstable.
    """

    stage: Stage
    hunting: Hunting
    word: str | None
    factors: np.ndarray
    quiet: np.ndarray
    unstable: tuple[LoopState, ...]

    @property
    def certain(self) -> bool:
        """Tell whether the verdict on hunting at the stage's own bandwidth is certain."""
        return self.hunting.certain

    @property
    def verdict(self) -> str:
        """Return the verdict at the stage's own bandwidth; "failed" if it was not computed."""
        own = self.word or "failed"
        return own if self.hunting.target is None or own != "settles" else "bistable"

    @property
    def doubts(self) -> tuple[str, ...]:
        """Return why the stage may still hunt, as names of `DOUBTS`; empty if it surely does not.

        `DOUBTS` are in `friso.questions.tune.present_words`. The reasons are the verdict, its certainty, and hunting at
        lower or higher bandwidths, or that the work was given up.
        """
        if self.word is None:
            return ("given up",)
        parts = {
            "verdict": self.verdict != "settles",
            "certain": not self.certain,
            "distance": not self.quiet[self.factors < 1].all(),
            "window": not self.quiet[self.factors > 1].all(),
        }
        return tuple(name for name, holds in parts.items() if holds)


BANDWIDTHS_BESIDE = 2
"""Bandwidths on either side at which a tuned stage is judged, from the required distance below to as far above.
With two they are 1.095 apart, closer than the steps of a search for an edge. Fewer may miss a window; each costs as
much as the stage's own."""

MOVE_RTOL = 1e-6
"""Tolerance of reported moves. Their settling times are then accurate to three digits."""


@np.errstate(all="ignore")
def confirmed(stage: Stage, goal: Goal) -> Confirmation:
    """Judge a stage at its own bandwidth, and at others within the goal's distance.

    The bandwidths lie closer together than those at which `friso check` looks for an edge of hunting, and each is
    searched from more starts.
    """
    kernels(kernels_to_judge(structure(stage.flat())))
    steps = BANDWIDTHS_BESIDE
    factors = np.delete(goal.distance ** (np.arange(-steps, steps + 1) / steps), steps)
    flat, count = stage.flat(), len(factors)
    word, quiet = None, np.zeros(count, bool)
    attracting = hunting(stage, work=settings.confirming_work)
    with allowance(settings.confirming_work) as allowed:
        try:
            near = find_attractors(faster(flat, factors), count)
            quiet = near.certain & ~near.attracts
            word = str(judge_many(flat, 1, MOVE_RTOL)[0])
        except Exhausted:
            if allowed.around is not None and allowed.around.left <= 0:
                raise
    return Confirmation(stage, attracting, word, factors, quiet, unstable(stage))


NO_VARIABLES = np.zeros((1, 0))
"""Coordinates of the only point of a remedy without variables."""

Certainty = Literal["works", "unsure", "given up", "does not work"]


SURVEY_PARTS = 4
"""Parts of the fresh machines, of which the first is surveyed before the others. It reveals most failing settings
at a quarter of the cost."""


@dataclass(frozen=True)
class Performance:
    """Performance of a stage's settings on machines that were drawn around it.

    `moves`, `margin` (modulus margins) and `attraction` (which machines hunt) have one row, with a column per machine.
    Until `is_surveyed` is true, it is unknown which machines hunt.

    `own_margin` is the least modulus margin of the stage itself in all settled states. `stiffness` [N/m] is its
    stiffness against a load. For `further` machines, shape (n,), only whether they meet the whole goal is stored.
    `sizes` [m] are the moves of all machines, the further ones last; they were drawn from `moves_drawn`.
    """

    moves: Moves
    margin: np.ndarray
    attraction: Attraction
    own_margin: float
    stiffness: float
    further: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    sizes: np.ndarray = field(default_factory=lambda: np.zeros(0))
    moves_drawn: MoveRange | None = None
    is_surveyed: bool = False

    @property
    def count(self) -> int:
        """Return the number of machines."""
        return self.margin.size + self.further.size

    def slowest(self, goal: Goal) -> float:
        """Return the time [s] in which enough machines settle, the fraction `goal.share`.

        The time is infinite if too few machines settle.
        """
        return float(self.moves.slowest(goal.share)[0])

    def slowest_interval(self, goal: Goal) -> tuple[float, float]:
        """Return the 95 % interval of the time [s] in which enough machines settle (`goal.share`).

        The interval is wider, the fewer machines were drawn.
        """
        low, high = quantile_interval(self.moves.settling[0], goal.share)
        return max(low, 0.0), high

    @property
    def median(self) -> float:
        """Return the median settling time [s]; infinite if more than half do not settle."""
        return float(np.median(self.moves.settling))

    def force(self, goal: Goal) -> float:
        """Return the force [N] that the fraction `goal.share` of the machines does not exceed."""
        return float(quantile(self.moves.force, goal.share)[0])

    def least_margin(self, goal: Goal) -> float:
        """Return the modulus margin that the fraction `goal.share` of the machines keeps."""
        return float(-quantile(-self.margin, goal.share)[0])

    def meets(self, goal: Goal) -> Mapping[str, np.ndarray]:
        """Return for each part of the goal, by name, which machines meet it, shape (count,)."""
        late = np.inf if goal.settle is None else goal.settle
        most = np.inf if goal.force_limit is None else goal.force_limit
        return {
            "hunting": self.attraction.surely_clear[0],
            "settling": np.isfinite(self.moves.settling[0]) & (self.moves.settling[0] <= late),
            "margin": self.margin[0] >= goal.margin,
            "force": self.moves.force[0] <= most,
        }

    def share(self, goal: Goal) -> Share:
        """Return the probability that a machine meets the whole goal, with its interval.

        Without a survey, machines that meet all other parts may still hunt: the probability is NaN and only its upper
        limit is known.
        """
        meets = self._all_meeting(goal)
        whole = share(meets, np.ones(meets.shape, bool))
        return whole if self.is_surveyed else Share(np.nan, 0.0, whole.high)

    def held_moves(self, goal: Goal) -> tuple[float, float] | None:
        """Return the smallest and largest move [m] between which the goal holds, or None.

        Counted inwards from either end of this range, at least the required fraction of the moves meets the goal,
        however many are counted. The result is None if there is no such range, if the moves are unknown, or if machines
        were not surveyed for hunting.
        """
        order = np.argsort(self.sizes, kind="stable")
        if self.moves_drawn is None or not order.size or not self.is_surveyed:
            return None
        held = longest_run(self._all_meeting(goal)[order], goal.share)
        if held is None:
            return None
        first, last = held
        low = self.moves_drawn.smallest if first == 0 else self.sizes[order[first]]
        high = self.moves_drawn.largest if last == order.size - 1 else self.sizes[order[last]]
        return float(low), float(high)

    def holds_for_all_moves(self, goal: Goal) -> bool:
        """Tell whether the goal holds over a range with the required fraction of the moves drawn.

        The few moves beyond its ends may miss the goal by chance. The result is also true if it is not known from which
        range the moves were drawn.
        """
        if self.moves_drawn is None:
            return True
        held = self.held_moves(goal)
        return held is not None and bool(np.mean((self.sizes >= held[0]) & (self.sizes <= held[1])) >= goal.share)

    def _all_meeting(self, goal: Goal) -> np.ndarray:
        """Return which machines meet the whole goal, the further ones last, shape (machines,)."""
        return np.append(self._meets_all(goal), self.further)

    def _meets_all(self, goal: Goal) -> np.ndarray:
        return np.all([*self.meets(goal).values()], axis=0)

    def decides(self, goal: Goal) -> bool | None:
        """Tell whether enough machines meet the goal; None if the interval leaves that open."""
        meeting = self.share(goal)
        return True if meeting.low >= goal.share else False if meeting.high < goal.share else None

    def surveyed(self, stage: Stage, machines: Fleet, goal: Goal) -> Performance:
        """Survey machines for hunting, and return the performance with the results.

        Only machines that meet all other parts of the goal are surveyed, some of them first. If so many of these hunt
        that too few machines can meet the goal, the survey ends: the result then has the first machines only.
        """
        first, others = np.split(np.arange(machines.count), [machines.count // SURVEY_PARTS])
        measured = replace(self, is_surveyed=True)._surveyed(stage, machines, first, goal)
        if np.count_nonzero(self._meets_all(goal) & ~measured._meets_all(goal)) > (1 - goal.share) * machines.count:
            return measured._first(first.size)
        return measured._surveyed(stage, machines, others, goal, at_once=True)

    def _surveyed(
        self, stage: Stage, machines: Fleet, numbers: np.ndarray, goal: Goal, at_once: bool = False
    ) -> Performance:
        """Survey the machines with indices `numbers` for hunting, if they meet all else.

        With `at_once`, all bandwidths are simulated together. Returns the performance with the results.
        """
        some = numbers[self._meets_all(goal)[numbers]]
        if not some.size:
            return self
        surveyed = attraction(Remedy.settled_on("", stage), NO_VARIABLES, machines.take(some), goal, at_once=at_once)
        return replace(self, attraction=self.attraction.of_some(surveyed, some))

    def _first(self, count: int) -> Performance:
        """Return the performance of the first `count` machines only."""
        some = np.s_[:, :count]
        moves, attracted = self.moves.take(some), self.attraction.take(some)
        return replace(self, moves=moves, margin=self.margin[some], attraction=attracted, sizes=self.sizes[:count])

    def with_further(self, stage: Stage, machines: Fleet, goal: Goal, drive: Stage) -> Performance:
        """Return the performance with `further` machines added.

        Of these, only whether they meet the goal is kept.
        """
        moved = replace(self, **_measured(stage, machines, goal, drive))
        meets = moved._surveyed(stage, machines, np.arange(machines.count), goal, at_once=True)._meets_all(goal)
        sizes = np.append(self.sizes, machines.sizes)
        return replace(self, further=np.append(self.further, meets), sizes=sizes)


def longest_run(meets: np.ndarray, share: float) -> tuple[int, int] | None:
    """Return the first and last index of the stretch of moves that best meets the goal.

    `meets` is true where a move meets the goal, in ascending order of moves. Counted inwards from either end of the
    stretch, at least the fraction `share` meets it, however many moves are counted. The stretch reaches to the first or
    last move if as many misses as lie beyond its end are not unlikely (5 %). Returns None if no stretch is long enough
    to show that.
    """
    from scipy.special import bdtrc

    if meets.all():
        return 0, len(meets) - 1
    sums = np.cumsum(np.append(0.0, np.where(meets, 1 - share, -share)))
    gains = np.where(np.tri(len(meets), dtype=bool).T, sums[1:] - sums[:-1, None], -np.inf)
    first, last = np.unravel_index(int(gains.argmax()), gains.shape)
    in_places, fewest = gains[first, last] / (1 - share), 1 / (1 - share)
    if round(in_places) < round(fewest):
        return None

    def by_chance(beyond: np.ndarray) -> bool:
        """Tell whether so many misses are no surprise, if the goal is met by the fraction `share`."""
        misses = int(np.count_nonzero(~beyond))
        return not misses or bdtrc(misses - 1, len(beyond), 1 - share) >= DOUBT_PROBABILITY * (1 - 1e-9)

    low, high = 0 if by_chance(meets[:first]) else int(first), len(meets) - 1 if by_chance(meets[last + 1 :]) else last
    return low, int(high)


@dataclass(frozen=True)
class RemedyOutcome:
    """Outcome of a remedy: its best `stage`, how machines perform with it, and whether it works.

    `stage` is None if no settings were good enough. `doubts` are the reasons why the remedy is not sure to work;
    without any, it works. `confirmation` is the search for hunting of the stage itself; None if too many machines miss
    the goal.

    `points` are all settings tried; `attracted` counts the settings dropped because machines hunted. `shares` are the
    coordinates of the stage in the remedy's ranges. `cut` is true if the search took too much work, and `untried` if
    other remedies had taken all of it.
    """

    remedy: Remedy
    stage: Stage | None
    measured: Performance | None
    confirmation: Confirmation | None
    doubts: tuple[str, ...]
    points: TriedPoints | None = None
    attracted: int = 0
    interrupted: bool = False
    shares: np.ndarray = field(default_factory=lambda: np.zeros(0))
    cut: bool = False
    untried: bool = False

    @property
    def certainty(self) -> Certainty:
        """Return whether the remedy works: surely, not surely, or not at all.

        The result is "given up" if a search without result ran out of work.
        """
        if self.interrupted:
            return "unsure"
        if self.stage is None:
            return "given up" if self.cut or self.points is None else "does not work"
        return "unsure" if self.doubts else "works"

    @property
    def factor(self) -> float:
        """Return how many times as fast the whole controller is by a remedy that varies its bandwidth; 1 otherwise."""
        names = [variable.name for variable in self.remedy.variables]
        if BANDWIDTH not in names or not self.shares.size:
            return 1.0
        number = names.index(BANDWIDTH)
        return float(self.remedy.variables[number].at(self.shares[number]))

    def least_cost(self, goal: Goal) -> float:
        """Return the least cost of the points tried (see `TriedPoints.cost`); infinite without any."""
        return np.inf if self.points is None else float(self.points.cost(goal).min())


@np.errstate(all="ignore")
def moving(stage: Stage, machines: Fleet, goal: Goal, drive: Stage) -> Performance:
    """Measure a stage's moves and margins on machines, without looking for hunting."""
    flat = stage.flat()
    return Performance(
        **_measured(stage, machines, goal, drive),
        own_margin=min(settled_margin(linear_flat(drive, state)) for state in gain_states({**flat, **timing(drive)})),
        stiffness=_stiffness(flat),
        sizes=machines.sizes,
        moves_drawn=machines.moves,
    )


def _measured(stage: Stage, machines: Fleet, goal: Goal, drive: Stage) -> dict[str, Any]:
    """Measure moves and margins on machines, without looking for hunting.

    The results have the names of fields of `Performance`.
    """
    remedy = Remedy.settled_on("", stage)
    return {
        "moves": moves_of_points(remedy, NO_VARIABLES, machines, goal, rtol=MOVE_RTOL),
        "margin": modulus_margins(remedy, NO_VARIABLES, machines, drive),
        "attraction": Attraction.none(machines.count),
    }


def _stiffness(flat: Mapping[str, Any]) -> float:
    """Return the loop's stiffness [N/m] against a load on the stage, before the integral acts.

    Gains are those at standstill. A joint does not reduce the stiffness, because actuator and sensor are on the stage.
    A transmission does, if the position is measured at the motor.
    """
    proportional, _ = slow_gains(gain_states(flat)[-1])
    if flat.get("encoder.position") == "motor":
        return float(in_series(proportional, flat["transmission.stiffness"]))
    return proportional


PRESENT_CHECK_WORK = 3e8
"""Work to check the present stage, about 4 s on one core. With less, more stages have no edge located."""


def checked(stage: Stage) -> Case:
    """Check a stage as `friso check` does, with less work.

    The edge of hunting is included if it is located soon.
    """
    try:
        with allowance(PRESENT_CHECK_WORK):
            return check_given(stage)
    except Exhausted:  # raised by a part that must not be left out
        return check_given(stage)


ROUNDED_SHARE = 2e-3
"""Largest relative error of margin and bandwidth by rounding of tuned numbers."""


def unsettled_parts(confirmation: Confirmation, measured: Performance, goal: Goal) -> tuple[str, ...]:
    """Return why the stage itself is not sure to work: verdict, bandwidth, margin.

    The reasons are names of `friso.questions.tune.present_words.DOUBTS`.
    """
    rounded = 1 + ROUNDED_SHARE
    listed = [*confirmation.doubts]
    if goal.bandwidth_limit is not None and not loop_bandwidth(confirmation.stage) <= goal.bandwidth_limit * rounded:
        listed.append("bandwidth")
    if confirmation.unstable or measured.own_margin < goal.margin * (2 - rounded):
        listed.append("own margin")
    return tuple(listed)


def missed_parts(measured: Performance, goal: Goal) -> tuple[str, ...]:
    """Return the parts of the goal, by name, that too many machines miss.

    If enough machines meet each part, but too few meet all parts together, the only name is "together".
    """
    parts = measured.meets(goal)
    listed = [name for name, meets in parts.items() if np.mean(meets) < goal.share]
    if not listed and np.mean(np.all([*parts.values()], axis=0)) < goal.surely(measured.count):
        listed.append("together")
    return tuple(listed)
