"""Find the limit cycles of one stage, or the reason why there are none.

Name the reasons why an answer about hunting is not certain (docs/hunting.md lists their causes).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.engine.allowance import allowance, checked_rtol
from friso.engine.batch import output_variables, time_axis
from friso.engine.kernel import KernelRequest, kernels
from friso.equations.roles import Role
from friso.equations.structure import Structure, structure
from friso.hunting.attractors import Attractors, Target, attractors
from friso.hunting.attractors.rounds import TIGHT_SURVEY_RTOL
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.find import CYCLE_RTOL, GUESS_RTOL, Cycles, returns_of, slopes, time_constant
from friso.hunting.cycle.guess import ReturnMap, return_map
from friso.hunting.loop import LowerGains, far_beyond_a_limit, surely_calm, unstable
from friso.hunting.path import MORE_WORK
from friso.stage import Stage
from friso.stage.controllers import dead_band

if TYPE_CHECKING:
    import xarray as xr


class HuntingDoubt(StrEnum):
    """Reason why it is not certain what attracts a stage, or how its motion ends: a code, and its sentence."""

    WORK = f"deciding takes {MORE_WORK}"
    RUNS = "runs that had to decide were stopped, or contradict each other or orbits followed from other bandwidths"
    MOTION = "this motion was not seen to end at rest or in a swing that was found to attract"
    EDGE = "its own bandwidth lies between the ends of an edge of hunting"
    BEYOND = "swings smaller or larger than those searched may last"
    GROWTH = "without anti-windup swings may grow or die out beyond the force limit: a size is where a run was stopped"
    LOOP = "its loop is unstable, or its controller pushes ever harder at standstill as an integral does"
    LOAD = "friction grows with the drive's force, and no proof about its loop covers that"
    SWITCHES = "its controller switches the force by windows that remember, which feeds swings without an integral too"


DITHERS = "dither keeps the stage moving, so no cycle is searched for: only runs show whether it hunts"
"""Reason why a stage with dither is not searched for cycles, although it may hunt."""

RESOLVED_BRISTLES = 10 * TIGHT_SURVEY_RTOL
"""Smallest deflection of bristles, in deflections of the loop, that runs resolve at the tightest tolerance of a survey.
At 9e-10 runs find no attractor where the exact map of a stage has a cycle; from 1e-8 on they do
(`benchmarks.oracles`, always)."""


@dataclass(frozen=True)
class Cycle:
    """A limit cycle of a stage.

    - `symmetric`: it is its own mirror image after half a period, to which its multipliers then refer.
    - `amplitude` [m], half of peak to peak, `middle` [m] between the peaks, `period` [s], and `swings` to either side
      in a period.
    - `multipliers`, shape (states - 1,): Floquet multipliers, the largest first, without the trivial one along the
      cycle.
    - `slope`: slope of the return map over 1 % of the amplitude (NaN if stages started there do not come back).
    - `multiplier`: the number that decides stability: the slope with a stroke limiter, which may chatter, else the
      largest Floquet multiplier (its modulus if complex).
    - `growth`: the multiplier measured by an independent simulation beside the cycle (NaN if it leaves too fast).
    - `residual`: gap at which the orbit closes, relative to the magnitudes of its states.
    - `signals`: one period in time, from the instant at which the stage sticks.
    """

    symmetric: bool
    amplitude: float
    middle: float
    period: float
    multiplier: float
    multipliers: np.ndarray
    slope: float
    growth: float
    residual: float
    signals: Mapping[str, Any]
    swings: int = 2

    @property
    def extremes(self) -> tuple[float, float]:
        """Return the lowest and the highest deviation of the cycle from its reference [m]."""
        return self.middle - self.amplitude, self.middle + self.amplitude

    @cached_property
    def trace(self) -> xr.Dataset:
        """Return the signals as a dataset over the time [s]."""
        import xarray as xr

        return xr.Dataset(dict(self.signals))

    @property
    def attracts(self) -> bool:
        """Tell whether the cycle is stable: motions near it approach it."""
        return abs(self.multiplier) < 1

    @property
    def time_constant(self) -> float:
        """Return the time [s] in which a small deviation from the cycle changes by the factor e."""
        returned = self.period / 2 if self.symmetric else self.period
        return float(time_constant(np.array(returned), np.array(self.multiplier)))


@dataclass(frozen=True)
class Swing:
    """A lasting swing seen in a long simulation, without a closed stable orbit.

    `amplitude` [m] is half of peak to peak, about the `middle` [m]. `period` [s] is approximate unless the swing is
    `regular`. `swings` counts swings to either side in a period.
    """

    amplitude: float
    period: float
    regular: bool
    swings: int
    middle: float = 0.0

    @property
    def extremes(self) -> tuple[float, float]:
        """Return the lowest and the highest deviation of the swing from its reference [m]."""
        return self.middle - self.amplitude, self.middle + self.amplitude


@dataclass(frozen=True)
class Hunting:
    """Limit cycles and other attractors of a stage.

    - `cycles`: limit cycles, the stable ones first.
    - `reason`: why there are none, or why the answer is not `certain`.
    - `certain`: no simulation left open what attracts the stage, and nothing can attract it beyond the range searched.
    - `returns`: return map of the stage sticking on the positive side (None: the stage cannot hunt).
    - `observed`: attracting swings that are none of the cycles.
    - `target`: how far and how late a run must swing to count as hunting (None: nothing attracts).
    - `surveyed`: the survey of the stage (None: it cannot hunt).
    - `lower_gains`: stability of the loop far beyond a force limit without anti-windup (None: no such limit). Unless it
      is "stable", large motions may diverge. With such a limit any observed swing may be `passing`.
    """

    cycles: tuple[Cycle, ...]
    reason: str
    certain: bool
    returns: ReturnMap | None
    observed: tuple[Swing, ...] = ()
    target: Target | None = None
    surveyed: Attractors | None = None
    lower_gains: LowerGains | None = None

    @property
    def attracting(self) -> tuple[Cycle, ...]:
        """Return the stable cycles."""
        return tuple(cycle for cycle in self.cycles if cycle.attracts)

    @property
    def passing(self) -> bool:
        """Tell whether an observed swing may be transient, growing or slowly decaying.

        The result is true for any observed swing with a force limit without anti-windup. The size of the swing is then
        only the size at which the run was stopped.
        """
        return self.lower_gains is not None and bool(self.observed)

    @property
    def possible(self) -> bool:
        """Tell whether the stage was searched: it has friction or a backlash, and an integral.

        The result is false for a stage with dither, and for one whose reference never stands still.
        """
        return self.returns is not None


def cannot_hunt(stage: Stage) -> str:
    """Return why a stage cannot hunt, or why it is not searched; "" if it may hunt.

    With dither (`DITHERS`) no cycle is searched for.
    """
    return why_not(structure(stage.flat()))


def why_not(form: Structure) -> str:
    """Return why stages of this structure cannot hunt, or are not searched; "" if they may hunt."""
    drive = form.transmission
    if form.friction == "none" and (drive is None or (drive.friction == "none" and not drive.backlash)):
        return "there is no friction to stick to"
    if form.controller is None or not form.controller.integral:
        return "the controller has no integral action that could wind up"
    return DITHERS if "dither_amplitude" in form.controller.settings else ""


@np.errstate(all="ignore")  # runs that fail on the way leave infinities behind
def hunting(stage: Stage, rtol: float = CYCLE_RTOL, work: float = np.inf, side: float = 1.0) -> Hunting:
    """Find the limit cycles and other attractors of a stage, whatever its own motion.

    Cycles are closed to the relative tolerance `rtol`. The search may use so much `work` (see
    `friso.engine.allowance`); anything open by then is not certain. Of an asymmetric swing of a symmetric stage
    and its mirror image, the one with its middle on the `side` of that sign is returned. Raises InputError for a
    tolerance that is not usable.
    """
    checked_rtol(rtol)
    if reason := cannot_hunt(stage):
        held = Ensemble.held(stage.flat(), 1)
        calm = bool(surely_calm(held)[0])
        if not calm and reason != DITHERS:
            form = held.structure.controller
            switches = form is not None and form.settings.swings_alone and not unstable(stage)
            follows = held.structure.follows_drive and not unstable(stage)
            reason = HuntingDoubt.SWITCHES if switches else HuntingDoubt.LOAD if follows else HuntingDoubt.LOOP
        return Hunting((), reason, calm, None)
    flat = stage.flat()
    kernels([KernelRequest(structure(flat).standing, variational) for variational in (False, True)])
    stages = Ensemble.held(flat, 1)
    with allowance(work) as search:
        survey = attractors(stages, thorough=True, rtol=rtol)
    closed = [m.cycles.take(np.array([m.number])) for m in survey.motions if m.cycles is not None]
    repelling = [family for family in survey.families if family.closed[0] and not family.attracting[0]]
    (beyond,) = beyond_the_survey(stages, survey)
    certain = bool(survey.decided[0]) and not beyond
    doubt = beyond or (HuntingDoubt.WORK if search.exhausted and not survey.flips[0] else HuntingDoubt.RUNS)
    far = far_beyond_a_limit(stages)
    reason = survey.families[0].reasons[0] if certain else doubt
    return Hunting(
        cycles=tuple(_cycle(stages, _on_side(stages, cycle, side), rtol) for cycle in (*closed, *repelling)),
        reason="" if certain and (survey.motions or repelling) else reason,
        certain=certain,
        returns=return_map(stages, GUESS_RTOL),
        observed=tuple(
            Swing(m.amplitude, m.period, bool(m.time == m.time), m.swings, _middle(stages, m.middle, side))
            for m in survey.motions
            if not m.cycles
        ),
        target=survey.target.take(0) if survey.motions else None,
        surveyed=survey,
        lower_gains=None if far is None else far[0],
    )


def surely_surveyed(stages: Ensemble, survey: Attractors | None) -> np.ndarray:
    """Return for which stages it is certain what attracts them, shape (count,).

    For a stage this is certain if the survey decided, and nothing can attract beyond the survey's reach. Stages that
    cannot hunt are not surveyed (None), and are certain if no other swing lasts.
    """
    if survey is None:
        return surely_calm(stages) if why_not(stages.structure) else np.ones(stages.count, bool)
    return np.asarray(survey.decided & (beyond_the_survey(stages, survey) == ""))


def surely_told(stages: Ensemble, survey: Attractors) -> np.ndarray:
    """Return of which stages it is certain whether they hunt, (count,): one found attractor tells it."""
    return survey.decided & (survey.attracts | surely_surveyed(stages, survey))


def beyond_the_survey(stages: Ensemble, survey: Attractors) -> np.ndarray:
    """Return why something may attract stages beyond the reach of a survey, texts (count,).

    A text is "" if nothing can.
    """
    why = np.full(stages.count, "", dtype=object)
    far, farther = far_beyond_a_limit(stages), np.zeros(stages.count, bool)
    if far is not None:
        farther = (far != "stable") & ~survey.runs_away
        for motion in survey.motions:
            if motion.cycles is None:
                why[motion.stage] = HuntingDoubt.GROWTH
    if (free := np.flatnonzero(~survey.attracts)).size:
        why[free[_may_be_missed(stages.take(free)) | farther[free]]] = HuntingDoubt.BEYOND
    return why


LEAST_CERTAIN_SWING = 0.001  # [deflections at break-away]
"""Smallest swing that counts as resolved. Runs resolve smaller cycles badly and may miss them."""

WIDE_DEAD_ZONE = 2.0  # [deflections at break-away]
"""Width of a dead zone beyond which most starts of a survey lie within it, where nothing winds up."""


def _may_be_missed(stages: Ensemble) -> np.ndarray:
    """Return which stages may have an attractor that is too small for a survey, or lies beyond its starts, (count,)."""
    if stages.outer_integrals:
        missed = np.ones(stages.count, bool)
    else:
        narrow = (stages.backlash > 0) & (stages.backlash < LEAST_CERTAIN_SWING * stages.length)
        missed = small_cycles_possible(stages) | narrow
    if bristles := stages.kernel.having(Role.BRISTLE):
        missed = missed | (stages.scales[:, bristles].min(axis=1) < RESOLVED_BRISTLES * stages.length)
    wide = dead_band(stages.flat) >= WIDE_DEAD_ZONE * stages.length
    return np.asarray(missed | (wide & (stages.length > 0)))


FRICTION_STAGES_AT_ONCE = 64
"""Stages whose friction curves are examined at once. More take too much memory."""


def small_cycles_possible(stages: Ensemble) -> np.ndarray:
    """Return which stages may have cycles smaller than the survey covers, shape (count,).

    A cycle is fed by the fall of friction over its speeds. The ratio of this fall, in break-away forces, to the
    amplitude, in deflections at break-away, must lie in `feeding_ratio_range`. A stage may have small cycles in two
    cases. In the first, the ratio falls as small swings grow, and takes values in that range. In the second, friction
    falls too little for the survey to find all cycles, but steeply enough to feed one.
    """
    possible, rub = np.zeros(stages.count, bool), np.flatnonzero(stages.number("breakaway") > 0)
    for first in range(0, len(rub), FRICTION_STAGES_AT_ONCE):
        part = rub[first : first + FRICTION_STAGES_AT_ONCE]
        possible[part] = _small_cycles_possible(stages.take(part))
    return possible


FASTEST_FRICTION_SPEED = 1e7  # [speeds of small swings]
"""Highest speed at which friction curves are examined. At higher speeds friction no longer falls."""

FRICTION_SPEEDS = 300
"""Speeds at which friction curves are examined: thirty per decade, narrower than any fall of friction."""

LEAST_FEEDING_RATIO = 0.05
"""Smallest ratio of the fall of friction to amplitude that can feed a cycle. The least found was forty times
larger."""

NO_FRICTION_FALL = 1e-9  # [of break-away]
"""Fall of friction that is only rounding of the friction curve."""

LEAST_FRICTION_FALL = 0.002  # [of break-away]
"""Smallest fall of friction with speed for which the search covers all cycles."""

FEEDING_RATIO_RANGE = (2.0, 6.0)
"""Least and largest ratio of the fall of friction over the speeds of a cycle to its amplitude."""


def _small_cycles_possible(stages: Ensemble) -> np.ndarray:
    """Return which stages may have cycles smaller than the survey covers, shape (count,).

    All stages must have friction. The result is true for all of them if the law has no steady force.
    """
    breakaway = stages.number("breakaway")[:, None]
    sizes = np.geomspace(1e-3 * LEAST_CERTAIN_SWING, LEAST_CERTAIN_SWING, 60)
    small = np.outer(stages.length * stages.number("rate"), sizes)
    speeds = np.hstack(
        [
            small,
            np.geomspace(small[:, -1], FASTEST_FRICTION_SPEED * small[:, -1], FRICTION_SPEEDS, axis=1),
        ]
    )
    numbers = np.repeat(np.arange(stages.count), 2 * speeds.shape[1])
    friction = stages.take(numbers).steady_friction(np.hstack([speeds, -speeds]).ravel())
    if friction is None:
        return np.ones(stages.count, bool)
    force = np.abs(friction).reshape(stages.count, 2, -1)  # forward and backward
    # laws without bristles creep before they slide
    slowest, sticks = force[:, :, :1], bool(stages.kernel.having(Role.BRISTLE))
    mean = slowest.mean(axis=1, keepdims=True)
    at_rest = stages.friction_at_rest[:, None, None] * slowest / mean if sticks else 0.0
    falls = (np.maximum.accumulate(np.maximum(force, at_rest), axis=2) - force) / breakaway[:, None]
    deepest, fed = falls.max(axis=2), falls[:, :, : sizes.size] / sizes
    last, most = fed[:, :, -1], fed.max(axis=2)
    feeds = (falls / (speeds / (stages.length * stages.number("rate"))[:, None])[:, None]).max(
        axis=2
    ) > LEAST_FEEDING_RATIO
    little = (deepest > NO_FRICTION_FALL) & (deepest < LEAST_FRICTION_FALL) & feeds
    fades = (last < FEEDING_RATIO_RANGE[1]) & (most > np.maximum(FEEDING_RATIO_RANGE[0], 1.2 * last))
    return np.any(little | fades, axis=1)


def _middle(stages: Ensemble, middle: float, side: float) -> float:
    """Return the middle [m] of a swing of a stage, or of its mirror image if that is a swing on the `side`."""
    return -middle if stages.symmetric[0] and middle * side < 0 else middle


def _on_side(stages: Ensemble, cycles: Cycles, side: float) -> Cycles:
    """Return one cycle of a stage, or its mirror image if that is a cycle on the `side`."""
    if _middle(stages, middle := float(cycles.middle[0]), side) == middle:
        return cycles
    mirrored = {name: -getattr(cycles, name) for name in ("states", "middle", "direction")}
    return replace(cycles, **mirrored)


def _cycle(stages: Ensemble, cycles: Cycles, rtol: float) -> Cycle:
    """Make one cycle of a stage ready for display, with signals over one period."""
    slope = cycles.slope if stages.chatters else slopes(stages, cycles.orbits, cycles.direction, rtol)
    return Cycle(
        symmetric=cycles.sign < 0,
        amplitude=float(cycles.amplitude[0]),
        middle=float(cycles.middle[0]),
        period=float(cycles.period[0]),
        multiplier=float(cycles.multiplier[0]),
        multipliers=cycles.local[0],
        slope=float(slope[0]),
        growth=_growth(stages, cycles),
        residual=float(cycles.gap[0]),
        signals=_signals(stages, cycles),
        swings=cycles.swings * (2 if cycles.sign < 0 else 1),
    )


BESIDE_CYCLE_SHARE = 2e-3  # [of the distance]
"""Start of a simulation beside a cycle. Closer to it, rounding decides where the run goes."""

BESIDE_CYCLE_RETURNS = 8  # [returns]
"""Returns over which deviations are seen to grow or shrink. More leave the linear range."""

LINEAR_DEVIATION_SHARE = 0.02  # [of the distance]
"""Largest deviation that grows as the multiplier says."""


def _growth(stages: Ensemble, cycles: Cycles) -> float:
    """Return by what factor a small deviation from a cycle grows per return, from a simulation.

    The result is NaN if too few deviations stay small.
    """
    away = np.array([[0.0, BESIDE_CYCLE_SHARE, -BESIDE_CYCLE_SHARE]])
    heights = returns_of(stages, cycles.orbits, cycles.direction, away, BESIDE_CYCLE_RETURNS, GUESS_RTOL / 100)[0]
    deviations = (heights[1:] - heights[0]) / cycles.amplitude[0]
    before, after = deviations[:, :-1].ravel(), deviations[:, 1:].ravel()
    small = (np.abs(before) < LINEAR_DEVIATION_SHARE) & (
        np.abs(after) < LINEAR_DEVIATION_SHARE
    )  # NaN counts as not small
    if np.count_nonzero(small) < 2:
        return np.nan
    return float(before[small] @ after[small] / (before[small] @ before[small]))


TRACE_SAMPLES = 2000
"""Samples of a drawn period. With fewer, curves have corners where a stage breaks away."""


def _signals(stages: Ensemble, cycles: Cycles) -> dict[str, Any]:
    """Return the signals of one period of a cycle, by name."""
    period = float(cycles.period[0])
    results = stages.run(cycles.states, cycles.period, GUESS_RTOL / 100, interval=period / TRACE_SAMPLES)
    time = np.arange(results.samples.shape[1]) * (period / TRACE_SAMPLES)
    flat = {**stages.flat, "motion.displacement": float(stages.length[0]), "motion.duration": period}
    return {**output_variables(stages.kernel, flat, results.samples[0].T, time), **time_axis(time)}
