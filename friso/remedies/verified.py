"""What became of a remedy: its stage, verified by cycles and on machines that the optimiser did not see."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from friso.equations.continuous import slow_gains
from friso.equations.settings import gain_states
from friso.frequency.bandwidth import loop_bandwidth
from friso.frequency.crossover import settled_margin
from friso.frequency.stiffness import in_series
from friso.hunting import Case, CheckPart, check_given
from friso.remedies.catalogue import Remedy
from friso.remedies.goal import Goal
from friso.remedies.machines import Fleet
from friso.remedies.search import TriedPoints
from friso.remedies.settings import RemedySettings
from friso.remedies.trials import Attraction, Moves, attraction, modulus_margins, moves_of_points, quantile, timing
from friso.remedies.window import VariableWindow
from friso.shares import Share, share
from friso.stage import Stage
from friso.studies.compare.options import linear_flat
from friso.studies.compare.statistics import quantile_interval

ONE = np.zeros((1, 0))
"""The shares of the one point of a remedy without variables."""

Certainty = Literal["works", "unsure", "given up", "does not work"]


@dataclass(frozen=True)
class Performance:
    """A stage on machines: its `moves`, modulus margins and what attracts, in rows of one; and of the stage itself the
    least modulus margin in all settled states, `own_margin`, and the `stiffness` [N/m] against a load. `further`
    machines are only known to meet all of the goal, or not, (n,)."""

    moves: Moves
    margin: np.ndarray
    attraction: Attraction
    own_margin: float
    stiffness: float
    further: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))

    @property
    def count(self) -> int:
        return self.margin.size + self.further.size

    def slowest(self, goal: Goal) -> float:
        """The settling time [s] of the slowest twentieth of machines and moves; infinite where that is never."""
        return float(self.moves.slowest(goal.share)[0])

    def slowest_interval(self, goal: Goal) -> tuple[float, float]:
        """The 95 % interval of that time, these machines being some of all there may be."""
        low, high = quantile_interval(self.moves.settling[0], goal.share)
        return max(low, 0.0), high

    @property
    def median(self) -> float:
        return float(np.median(self.moves.settling))

    def force(self, goal: Goal) -> float:
        """The largest force [N] of all but a twentieth of the machines."""
        return float(quantile(self.moves.force, goal.share)[0])

    def least_margin(self, goal: Goal) -> float:
        """The modulus margin that all but a twentieth of the machines have at least."""
        return float(-quantile(-self.margin, goal.share)[0])

    def meets(self, goal: Goal) -> Mapping[str, np.ndarray]:
        """Which machines meet each part of the goal, by its name."""
        late = np.inf if goal.settle is None else goal.settle
        most = np.inf if goal.force_limit is None else goal.force_limit
        return {
            "hunting": self.attraction.surely_clear[0],
            "settling": np.isfinite(self.moves.settling[0]) & (self.moves.settling[0] <= late),
            "margin": self.margin[0] >= goal.margin,
            "force": self.moves.force[0] <= most,
        }

    def share(self, goal: Goal) -> Share:
        """The probability that a machine meets all of the goal, with its interval."""
        meets = np.append(self._meets_all(goal), self.further)
        return share(meets, np.ones(meets.shape, bool))

    def _meets_all(self, goal: Goal) -> np.ndarray:
        return np.all([*self.meets(goal).values()], axis=0)

    def decides(self, goal: Goal) -> bool | None:
        """Whether enough of all machines meet the goal; None where the interval leaves that open."""
        meeting = self.share(goal)
        return True if meeting.low >= goal.share else False if meeting.high < goal.share else None

    def with_further(self, stage: Stage, machines: Fleet, goal: Goal, drive: Stage) -> Performance:
        """The same of a stage that was measured on further machines too."""
        meets = performance_of(stage, machines, goal, drive)._meets_all(goal)
        return replace(self, further=np.append(self.further, meets))


@dataclass(frozen=True)
class RemedyOutcome:
    """A remedy's best `stage` (None: none was found), measured, and checked by its cycles unless machines miss the goal
    as it is; the reasons why that is not sure to work, or does not (empty: it works); the `windows` of its numbers; and
    all points that were tried, of which `attracted` were given up because something attracted machines with them.
    `shares` are where in the remedy's ranges it lies. The search may have been `cut`, since it took too much work.
    """

    remedy: Remedy
    stage: Stage | None
    measured: Performance | None
    case: Case | None
    doubts: tuple[str, ...]
    windows: tuple[VariableWindow, ...] = ()
    points: TriedPoints | None = None
    attracted: int = 0
    interrupted: bool = False
    shares: np.ndarray = field(default_factory=lambda: np.zeros(0))
    cut: bool = False

    @property
    def certainty(self) -> Certainty:
        """Whether it works: all was verified, or not; or nothing that works was found, in a whole search or one that
        was given up."""
        if self.interrupted:
            return "unsure"
        if self.stage is None:
            return "given up" if self.cut or self.points is None else "does not work"
        return "unsure" if self.doubts else "works"

    def least_cost(self, goal: Goal) -> float:
        """What the best of the points that were tried costs (see `TriedPoints.cost`); infinite without any."""
        return np.inf if self.points is None else float(self.points.cost(goal).min())


@np.errstate(all="ignore")
def performance_of(stage: Stage, machines: Fleet, goal: Goal, drive: Stage) -> Performance:
    """A stage on machines, with the sampling and delay of the stage `drive` for its margins. What attracts them is
    surveyed only of those that meet the rest of the goal: of others nothing is said to."""
    settings = RemedySettings.current()
    remedy = Remedy.settled_on("", stage)
    flat = stage.flat()
    measured = Performance(
        moves_of_points(remedy, ONE, machines, goal, rtol=settings.move_rtol),
        modulus_margins(remedy, ONE, machines, drive),
        Attraction.none(machines.count),
        min(settled_margin(linear_flat(drive, state)) for state in gain_states({**flat, **timing(drive)})),
        _stiffness(flat),
    )
    some = np.flatnonzero(measured._meets_all(goal))
    if not some.size:
        return measured
    surveyed = attraction(remedy, ONE, machines.take(some), goal)
    return replace(measured, attraction=measured.attraction.of_some(surveyed, some))


def _stiffness(flat: Mapping[str, Any]) -> float:
    """The stiffness [N/m] of the loop against a load on the stage, before the integral acts, with the gains that it has
    at standstill. A joint takes nothing of it, as actuator and sensor are on the stage; the transmission does, where
    the position is that of the motor."""
    proportional, _ = slow_gains(gain_states(flat)[-1])
    if flat.get("encoder.position") == "motor":
        return float(in_series(proportional, flat["transmission.stiffness"]))
    return proportional


def verified(stage: Stage) -> Case:
    """The verdict of `friso check` on the stage as it is, by its cycles."""
    return check_given(stage)


def unmet_goals(case: Case, measured: Performance, goal: Goal) -> tuple[str, ...]:
    """What of the goal a stage does not meet, or not surely: names of `friso.questions.tune.words.DOUBTS`."""
    return (*unsettled_parts(case, measured, goal), *missed_parts(measured, goal))


def unsettled_parts(case: Case, measured: Performance, goal: Goal) -> tuple[str, ...]:
    """What the verdict on the stage itself, its bandwidth and its margin leave open."""
    settings = RemedySettings.current()
    judgement, edge = case.judgement, case.judgement.margin
    listed: list[str] = []
    if judgement.verdict != "settles":
        listed.append("verdict")
    elif not judgement.hunting.certain:
        listed.append("certain")
    if CheckPart.BANDWIDTHS in judgement.given_up:
        listed.append("given up")
    if edge is not None and edge.quiet * goal.distance > 1 and edge.factor < 1:
        listed.append("distance")
    if goal.bandwidth_limit is not None and not loop_bandwidth(case.stage) <= goal.bandwidth_limit * (
        1 + settings.rounded_share
    ):
        listed.append("bandwidth")
    if any(_near(window.low, window.high, goal.distance) for window in judgement.windows if not window.narrow):
        listed.append("window")
    if case.unstable or measured.own_margin < goal.margin * (1 - settings.rounded_share):
        listed.append("own margin")
    return tuple(listed)


def missed_parts(measured: Performance, goal: Goal) -> tuple[str, ...]:
    """The parts of the goal that too many machines miss."""
    parts = measured.meets(goal)
    listed = [name for name, meets in parts.items() if np.mean(meets) < goal.share]
    if not listed and np.mean(np.all([*parts.values()], axis=0)) < goal.surely(measured.count):
        listed.append("together")
    return tuple(listed)


def _near(low: object, high: object, distance: float) -> bool:
    """Whether a window of bandwidths, its ends factors (None: as far as the search goes), comes within the distance."""
    first = getattr(low, "outside", 0.0) if low is not None else 0.0
    last = getattr(high, "outside", np.inf) if high is not None else np.inf
    return bool(first < distance and last > 1 / distance)
