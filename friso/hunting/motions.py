"""Run and measure the motions of stage files, and continue those that have not come to rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.engine.allowance import Exhausted
from friso.engine.arrays import Status
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import kernel
from friso.equations.motion import last_corner, rests
from friso.equations.structure import shared_structure
from friso.hunting.attractors.rounds import LEAST_SWING, loose_from
from friso.hunting.criteria import COUNTED_ABOVE, lasts
from friso.hunting.cycle.ensemble import ArrayRows, Ensemble, wait
from friso.hunting.measures import Measures, measure_runs, measuring_options, swing_of
from friso.hunting.turning import LAST_HALF, LAST_QUARTER


@dataclass(frozen=True)
class Motions(ArrayRows):
    """Results of the stages' own motions, arrays of shape (count,).

    Runs were `completed`, or diverged (`away`). `peaks` is the thesis's peak count and `swing` [m] the peak-to-peak
    deviation of the last quarter. `settling` [s] is the time from the last corner of the reference until the deviation
    stays within the wider band (NaN: not within the run).
    """

    completed: np.ndarray
    away: np.ndarray
    peaks: np.ndarray
    swing: np.ndarray
    settling: np.ndarray

    @classmethod
    def of(cls, measures: Measures) -> Motions:
        """Make the results from runs that were measured."""
        completed, away = (np.equal(measures.status, status) for status in (Status.DONE, Status.DIVERGED))
        return cls(completed, away, measures.peaks, measures.peak_to_peak, measures.in_the_end[1])

    @property
    def _arrays(self) -> tuple[np.ndarray, ...]:
        return self.completed, self.away, self.peaks, self.swing, self.settling


def run_motions(flat: Mapping[str, Any], count: int, run_options: RunOptions) -> Motions:
    """Run and measure the stages' own motions; `flat` has the keys of `count` stages in SI."""
    columns = [*(np.zeros(count, bool) for _ in range(2)), *(np.full(count, np.nan) for _ in range(3))]
    for runs in run_chunks(kernel(shared_structure(flat)), flat, count, run_options):
        part = Motions.of(measure_runs(runs.part(flat), runs))
        for column, values in zip(columns, part._arrays, strict=True):
            column[runs.numbers] = values
    return Motions(*columns)


@np.errstate(all="ignore")  # runs that fail leave infinities and NaN behind
def rests_off(flat: Mapping[str, Any], count: int, rtol: float) -> np.ndarray:
    """Return how far off their references stages rest at the end of their own motions [m], shape (count,).

    `flat` has the keys of stages of one structure in SI; they are run to the relative tolerance `rtol`. The distance
    is NaN for a motion that was not completed or has not come to rest.
    """
    off = np.full(count, np.nan)
    for runs in run_chunks(kernel(shared_structure(flat)), flat, count, measuring_options(rtol)):
        still = np.equal(runs.results.statuses, Status.DONE) & (swing_of(runs) <= COUNTED_ABOVE)
        middle = (runs.statistic("deviation_max") + runs.statistic("deviation_min")) / 2
        off[runs.numbers] = np.where(still, np.abs(middle), np.nan)
    return off


LEAST_FOLLOWED_WAITS = 120.0  # [longest waits]
"""Shortest continuation in waits, which slow stages need for as many swings."""

LEAST_FOLLOWED_TIME = 1000.0  # [s]
"""Shortest time for which motions that have not settled are continued."""

STEADY_MOTION_SHARE = 0.01
"""Largest change of a steady swing over a quarter of the run. With more it grows or decays."""


@dataclass(frozen=True)
class FollowedMotions:
    """Motions of stages without a stable cycle, arrays of shape (count,).

    - `rests`: at rest at the end, within the wider band about the reference.
    - `moving`: not at rest, or still swinging within the band.
    - `after` [s]: time after which the stage rests if the motion is continued (NaN: it does not rest, or this is
      unknown).
    - `steady`: it keeps swinging, neither settling nor decaying.
    - `followed` [s]: time for which it was continued (NaN: not continued, or the longer run was not completed).
    - `swing` [m]: peak to peak over the last quarter of that time.
    - `away`: it diverges from the reference.
    """

    rests: np.ndarray
    moving: np.ndarray
    after: np.ndarray
    steady: np.ndarray
    followed: np.ndarray
    swing: np.ndarray
    away: np.ndarray

    @property
    def unknown(self) -> np.ndarray:
        """Return which motions had to be continued but did not reach the end, shape (count,)."""
        return self.moving & ~np.isfinite(self.followed)

    def follow(self, which: np.ndarray, flat: Mapping[str, Any], count: int, run_options: RunOptions) -> None:
        """Continue the motions numbered `which` for long, and enter the results.

        `flat` has the keys of their `count` stages in SI. Raises Exhausted if an allowance of work is used up.
        """
        stages = Ensemble.held(flat, count, form=shared_structure(flat))
        waits = LEAST_FOLLOWED_WAITS * wait(stages, loose_from(stages))
        lasts_for = np.maximum(np.maximum(LEAST_FOLLOWED_TIME, flat["motion.duration"]), waits)
        long = {**flat, "motion.duration": lasts_for + last_corner(flat)}
        last = run_motions(long, count, replace(run_options, window=LAST_QUARTER))
        done = last.completed.copy()
        if (swinging := np.flatnonzero(done & (last.swing > COUNTED_ABOVE))).size:
            half = run_motions(some_of(long, swinging), swinging.size, replace(run_options, window=LAST_HALF))
            done[swinging] = half.completed
            swing = last.swing[swinging]
            self.steady[which[swinging]] = half.completed & lasts(
                swing, half.swing, COUNTED_ABOVE / 2, 1 / (1 + STEADY_MOTION_SHARE)
            )
        self.followed[which], self.away[which] = np.where(done, lasts_for, np.nan), last.away
        after = np.where(self.rests[which], self.after[which], last.settling)
        self.after[which], self.swing[which] = np.where(done, after, np.nan), last.swing


def followed_motions(
    flat: Mapping[str, Any], motions: Motions, count: int, run_options: RunOptions, possible: bool
) -> FollowedMotions:
    """Continue motions that are not at rest at their end, until an allowance of work is used up.

    `flat` has the keys of the stages in SI. If hunting is not `possible`, a stage may also rest off its reference.
    """
    rests, still = np.isfinite(motions.settling), np.zeros(count, bool)
    steady, away, followed = np.zeros(count, bool), np.zeros(count, bool), np.full(count, np.nan)
    rest = FollowedMotions(rests, still, motions.settling.copy(), steady, followed, motions.swing.copy(), away)
    if not possible:
        idle = (motions.swing <= COUNTED_ABOVE) & (motions.peaks == 0)
        return replace(rest, rests=rests | idle)
    rest.moving[:] = ~(rests & (motions.swing <= resting(flat, count)))
    if (moving := np.flatnonzero(rest.moving)).size:
        # turning points that may leave the band at the end
        late = replace(run_options, record_from=np.inf, least_swing=run_options.bands[1] / 2)
        try:
            rest.follow(moving, some_of(flat, moving), moving.size, late)
        except Exhausted:
            rest.steady[moving], rest.followed[moving] = False, np.nan
    return rest


def resting(flat: Mapping[str, Any], count: int = 1) -> np.ndarray:
    """Return the peak-to-peak swings [m] up to which stages count as at rest, shape (count,).

    `flat` has the keys of stages of one structure in SI.
    """
    return 2 * LEAST_SWING * Ensemble.held(flat, count, form=shared_structure(flat)).length


def some_of(columns: Mapping[str, Any], which: np.ndarray) -> dict[str, Any]:
    """Select the entries `which` of each array in a mapping; other values stay."""
    return {key: value[which] if np.ndim(value) else value for key, value in columns.items()}


def keeps_moving(flat: Mapping[str, Any]) -> bool:
    """Tell whether the reference never comes to stand; `flat` has the stages' keys in SI."""
    return not rests(flat)
