"""Check a stage: judge it as given and, if it has a joint, with the joint locked and free."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from friso.engine.allowance import Exhausted, allowance, checked_rtol
from friso.engine.arrays import Status
from friso.engine.batch import SIMULATION_RTOL, Runs, run_chunks, sampled_outputs, simulate
from friso.engine.kernel import KernelRequest, kernel, kernels
from friso.engine.side_by_side import side_by_side
from friso.equations.motion import size, stands
from friso.equations.structure import structure
from friso.hunting.attractors.rounds import RUN_TURNING_POINTS
from friso.hunting.criteria import Verdict
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.hunting import HuntingDoubt
from friso.hunting.feeding import Feeding, feeding
from friso.hunting.loop import LoopState, unstable
from friso.hunting.many_stages import kernels_to_judge
from friso.hunting.margin import unstable_bandwidths
from friso.hunting.measures import bands_of, measure_runs, measuring_options
from friso.hunting.motions import keeps_moving
from friso.hunting.path import BandwidthWindow
from friso.hunting.stage_margins import BandwidthAdvice, ParameterMargin, advised, friction_margin
from friso.hunting.tracking import Dwell, StickSlipSpeeds, Tracking, dwells, is_moved_evenly, stick_slip, tracking
from friso.hunting.verdict import CHECK_WORK, PARTS, CheckPart, Judgement, judge
from friso.progress import Progress, Tally, silent
from friso.stage import Stage
from friso.stage.controllers import FORCE_LIMIT
from friso.stage.tables import leading_friction

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Solver:
    """What the solver reports on a run: status in words, steps tried and rejected, tolerance."""

    status: str
    steps: int
    rejected: int
    rtol: float

    @property
    def done(self) -> bool:
        """Tell whether the run came to its end."""
        return self.status == Status.DONE.text


@dataclass(frozen=True)
class Case:
    """A stage and the results of checking it.

    - `judgement`: the verdict and the results behind it.
    - `peaks`: the thesis's peak count, with peaks at `peak_times` [s] and of `peak_heights` [m] above the reference.
    - `peak_to_peak` [m], `offset` [m] of the middle from the reference, `period` [s] (None: no cycle): of the last
      quarter.
    - `bands` [m]: about the reference, into which it settles (see `friso.hunting.measures.bands_of`).
    - `settling_time`: for each of them, the time [s] to settle wherever the reference stands (None: it does not
      settle; see `friso.hunting.criteria.run_outcome`); `in_the_end`: at the last of these places.
    - `largest_force` [N]: of the actuator; `breakaway` [N]: the smallest actuator force, beside constant forces, that
      may move the stage. A motion with less force leaves a stage without a free joint `unmoved`.
    - `force_limit` [N]: the controller's limit, if it holds the stage off its reference (None: it does not).
    - `unstable`: states in which the loop is unstable regardless of friction (see `friso.hunting.loop`).
    - `unstable_bandwidths`: bandwidths at which it is so, for a stage that may hunt.
    - `feeding`: with a backlash, the cause without which hunting ends (None also if the search took too much work).
    - `static_friction`: margin in static friction (None: not asked for, or see `friso.hunting.stage_margins`).
    - `faster`, `slower`: bandwidths advised to a stage that hunts, or that settles close to hunting (None: no advice).
    - `dwells`: how the stage settles at each place, if its reference stands at more than two.
    - `tracking`: how it follows a reference that keeps moving (None: one that stands in the end).
    - `stick_slip`: at which constant speeds it sticks and slips, if its reference moves at one (None: not decided).
    - `trace`: the time response, if asked for.
    """

    stage: Stage
    judgement: Judgement
    peaks: int
    peak_times: np.ndarray
    peak_heights: np.ndarray
    peak_to_peak: float
    offset: float
    period: float | None
    bands: tuple[float, float]
    settling_time: dict[float, float | None]
    in_the_end: dict[float, float | None]
    largest_force: float
    solver: Solver
    breakaway: float = 0.0
    force_limit: float | None = None
    unstable: tuple[LoopState, ...] = ()
    unstable_bandwidths: tuple[BandwidthWindow, ...] = ()
    feeding: Feeding | None = None
    static_friction: ParameterMargin | None = None
    faster: BandwidthAdvice | None = None
    slower: BandwidthAdvice | None = None
    dwells: tuple[Dwell, ...] = ()
    tracking: Tracking | None = None
    stick_slip: StickSlipSpeeds | None = None
    trace: xr.Dataset | None = None

    @property
    def verdict(self) -> Verdict:
        """Return the verdict of `Judgement`, or "none" for a reference that keeps moving."""
        return self.judgement.verdict

    @property
    def runs_away(self) -> bool:
        """Tell whether the motion diverges because the loop is unstable; then no verdict follows."""
        return self.verdict == "failed" and self.judgement.runs_away

    @property
    def unmoved(self) -> bool:
        """Tell whether the motion exerts too little force to move the stage.

        The result is false with a free joint. It is false, too, if the stage settles after a motion of more than twice
        the widest band: a force that rises quickly may break it away below its static friction.
        """
        joint = self.stage.joint
        settles = any(time is not None for time in self.settling_time.values())
        moved = settles and size(self.stage.flat()) > 2 * max(self.settling_time)
        return self.largest_force < self.breakaway and not moved and (joint is None or joint.locked)


PART_COUNT = len(PARTS) + 1
"""Number of parts of a check: the parts of its verdict, and its margin in static friction."""


LONG_RUN_RTOL = 1e-6
"""Tolerance of runs that only show how a motion ends. Times and widths come from finer runs."""


def check(
    stage: Stage,
    rtol: float = SIMULATION_RTOL,
    traces: bool = False,
    progress: Progress = silent,
    margins: bool = True,
    tell: Callable[[str, Verdict], None] = lambda name, verdict: None,
) -> dict[str, Case]:
    """Check a stage as given, with its joint locked, and with it free.

    The cases are called "given", "locked" and "free". A stage without a joint has only the case "given". A file that
    leaves out the joint's stiffness gives no case "free". With `traces`, each case has its time response, and with
    `margins` its margin in static friction. `progress` is called as work is done. `tell` is called with the name of a
    case and its verdict as soon as the verdict is certain. Both may be called from worker threads. Raises InputError
    for an `rtol` that is not usable.
    """
    checked_rtol(rtol)
    variants = stage.variants()
    kernels(needed_kernels(stage))
    different: list[Stage] = []
    different += (variant for variant in variants.values() if variant not in different)
    done = Tally(progress, len(different) * PART_COUNT)

    def judged(variant: Stage) -> Case:
        """Check a variant of the stage within its fraction of the work.

        A variant is the stage as given, with its joint locked, or with it free.
        """
        names = [name for name, other in variants.items() if other == variant]
        share = _share(variant) if len(different) > 1 else 1.0
        return _case(
            variant,
            rtol,
            traces,
            done,
            share * CHECK_WORK,
            lambda verdict: tell(names[-1], verdict),
            margins,
        )

    cases = side_by_side([partial(judged, variant) for variant in different])
    return {name: cases[different.index(variant)] for name, variant in variants.items()}


def needed_kernels(stage: Stage) -> set[KernelRequest]:
    """Return the kernels that a check of a stage needs, to be compiled side by side."""
    return set[KernelRequest]().union(*map(_needed, stage.variants().values()))


FREE_WORK_SHARE = 0.58
"""Fraction of the work for the case with a free joint, whose limiter chatters."""


def _share(stage: Stage) -> float:
    """Return the fraction of a check's work that a variant of the stage may take.

    It depends on whether the variant has a free joint.
    """
    free = stage.joint is not None and not stage.joint.locked
    return FREE_WORK_SHARE if free else 1 - FREE_WORK_SHARE


def check_given(stage: Stage, rtol: float = SIMULATION_RTOL, progress: Progress = silent) -> Case:
    """Check a stage with its joint as in its file, without its margin in static friction.

    `progress` is called as parts end. Raises InputError for an unusable `rtol`.
    """
    checked_rtol(rtol)
    kernels(_needed(stage))
    return _case(stage, rtol, False, Tally(progress, PART_COUNT), CHECK_WORK)


def _needed(stage: Stage) -> set[KernelRequest]:
    """Return the kernels for a check of the stage as it is, without variants of its joint."""
    return kernels_to_judge(structure(stage.flat()))


FEEDING_WORK_SHARE = 0.3
"""Least fraction of a case's work for the search of the cause that feeds a cycle."""

FRICTION_MARGIN_WORK_SHARE = 0.4
"""Work for the margin in static friction, as a fraction of that of a case."""


def _case(
    stage: Stage,
    rtol: float,
    traces: bool,
    done: Tally,
    work: float,
    tell: Callable[[Verdict], None] = lambda verdict: None,
    margins: bool = False,
) -> Case:
    """Check one stage, within an amount of work.

    `done` counts the parts of the check. `tell` is called with the verdict as soon as it is certain. With `traces` the
    time response is kept, and with `margins` the margin in static friction is computed. Nothing is certain if the
    stage file lists values as unknown.
    """
    flat, ended = stage.flat(), 0
    tell = (lambda verdict: None) if stage.doubt else tell

    def begin(part: CheckPart) -> None:
        """Count a part of the check as begun, and the parts before it as ended."""
        nonlocal ended
        ended += (step := int(part != CheckPart.ATTRACTION))
        done.add(step, part.progress_word)

    options = measuring_options(rtol, bands=bands_of(flat))
    with allowance() as spent:
        (runs,) = run_chunks(kernel(structure(flat)), flat, 1, replace(options, room=RUN_TURNING_POINTS))
        measures = measure_runs(flat, runs, bands_of(flat))
        judgement = judge(stage, measures, max(rtol, LONG_RUN_RTOL), begin, work - spent.used, tell)
    room = measures.turns.shape[1]
    status = Status(int(measures.status[0]))
    fed = None
    if judgement.swing and structure(flat).plays:
        fed = _fed(stage, max(work - spent.used, FEEDING_WORK_SHARE * work))
        judgement = judgement if fed else replace(judgement, given_up=(*judgement.given_up, CheckPart.FEEDING))
    static_friction, lost = None, unstable_bandwidths(stage) if judgement.hunting.possible else ()
    if margins:
        begin(CheckPart.FRICTION)
        with allowance(FRICTION_MARGIN_WORK_SHARE * work):
            static_friction = friction_margin(stage, judgement)
        if static_friction and static_friction.open_sides:
            judgement = replace(judgement, given_up=(*judgement.given_up, CheckPart.FRICTION))
    if judgement.at_an_edge:
        judgement = replace(judgement, hunting=replace(judgement.hunting, certain=False, reason=HuntingDoubt.EDGE))
    if stage.doubt:
        judgement = judgement.uncertain(stage.doubt)
        static_friction = static_friction and static_friction.uncertain()
    faster, slower = advised(stage, judgement, lost, static_friction, work)
    breakaway = least_breakaway_force(flat)
    # parts left out without an attractor count as done, too
    done.add(PART_COUNT - ended, CheckPart.FRICTION.progress_word)
    return Case(
        stage=stage,
        judgement=judgement,
        peaks=int(measures.peaks[0]),
        peak_times=runs.results.turn_times[0, :room][measures.turns[0]],
        peak_heights=runs.results.turn_values[0, :room][measures.turns[0]],
        peak_to_peak=float(measures.peak_to_peak[0]),
        offset=float(measures.offset[0]),
        period=_finite(measures.period[0]),
        bands=measures.bands,
        settling_time={b: _finite(time[0]) for b, time in zip(measures.bands, measures.settling_time, strict=True)},
        in_the_end={b: _finite(time[0]) for b, time in zip(measures.bands, measures.in_the_end, strict=True)},
        largest_force=float(measures.largest_force[0]),
        solver=Solver(status.text, int(measures.steps[0]), int(measures.rejected[0]), rtol),
        breakaway=breakaway,
        force_limit=_holding_limit(flat, runs, judgement, breakaway) if status == Status.DONE else None,
        unstable=unstable(stage),
        unstable_bandwidths=lost,
        feeding=fed,
        dwells=dwells(stage, rtol) if len(stands(flat)) > 2 and status == Status.DONE else (),
        tracking=tracking(stage, rtol) if keeps_moving(flat) else None,
        stick_slip=stick_slip(stage, work) if is_moved_evenly(stage) else None,
        static_friction=static_friction,
        faster=faster,
        slower=slower,
        trace=simulate(stage, rtol) if traces else None,
    )


def _fed(stage: Stage, work: float) -> Feeding | None:
    """Find the cause that feeds the cycle of a stage with a backlash.

    Returns None if that takes too much work.
    """
    try:
        with allowance(work):
            return feeding(stage)
    except Exhausted:
        return None


LIMIT_FORCE_SHARE = 1e-9  # [of the limit]
"""Largest difference between a force and its limit that is only rounding."""


def _holding_limit(flat: dict[str, Any], runs: Runs, judgement: Judgement, breakaway: float) -> float | None:
    """Return the controller's force limit [N] if it holds the stage off its reference, or None.

    It does so if break-away takes more force, `breakaway` [N], or if the run ends with the force at the limit. The
    result is None for a stage that settles, swings, or may still move, as `judgement` says.
    """
    limit, possible = flat.get(FORCE_LIMIT), judgement.hunting.possible
    stands = judgement.followed is not None if possible else judgement.verdict == "settles"
    stays = stands and judgement.settled_after is None
    if not limit or not stays or judgement.swing or judgement.observed:
        return None
    shape = kernel(structure(flat))
    forces = sampled_outputs(shape, flat, runs.results.ends.T, runs.statistic("ended"))
    force = float(forces[list(shape.outputs).index("force")][0])
    return limit if abs(force) > limit * (1 - LIMIT_FORCE_SHARE) or (possible and limit < breakaway) else None


def least_breakaway_force(flat: Mapping[str, Any]) -> float:
    """Return the smallest actuator force [N] that may move a sticking stage; 0 without friction.

    Constant forces may help the actuator, and friction may be smaller in one direction. `flat` has the stage's keys in
    SI.
    """
    if leading_friction(flat)["friction.model"] == "none":
        return 0.0
    uneven = abs(flat.get("friction.asymmetry") or 0.0)
    stages = Ensemble.held(flat, 1)
    least = float(stages.friction_at_rest[0]) * (1 - uneven) / (1 + uneven)
    return max(least - sum(abs(value) for key, value in flat.items() if key.startswith("bias.") and value), 0.0)


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
