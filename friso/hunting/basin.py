"""Which kicks and which moves end in hunting."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.engine.arrays import Status
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import kernel
from friso.equations.motion import CRUISE, last_corner, standing, without_motion
from friso.equations.structure import shared_structure
from friso.hunting.attractors import Target
from friso.hunting.attractors.rounds import RTOL, TIGHT, typical_period
from friso.hunting.criteria.run_outcome import lasts
from friso.hunting.cycle.ensemble import Ensemble
from friso.hunting.cycle.rest import pushed
from friso.hunting.limits import SEARCH_LIMITS
from friso.hunting.measures import swing_of
from friso.hunting.motions import run_motions, some_of
from friso.hunting.return_map.fates import motions_go_on
from friso.hunting.return_map.landing_map import LandingMap
from friso.hunting.settings import BasinSettings
from friso.shares import share_interval
from friso.stage import Stage
from friso.stage.controllers import FORCE_LIMIT


@dataclass(frozen=True)
class Kick:
    """Kicks of a stage at rest at its reference that start hunting: a displacement [m] (everything displaced, then let
    go, as in the motion "release") or a push, a velocity [m/s] of all masses. `windows` are ranges of kicks that do,
    their ends found to 1 %; the last may end with the range that was `searched`. `unknown` counts the runs that were
    not completed: they are left out, and windows may reach across them."""

    windows: tuple[tuple[float, float], ...]
    searched: tuple[float, float]
    unknown: int = 0

    @property
    def smallest(self) -> float | None:
        """The smallest kick that was seen to start hunting; None if none was."""
        return self.windows[0][0] if self.windows else None


@dataclass(frozen=True)
class MoveShare:
    """Share of moves that end in the cycle, of an even sample over acceleration [m/s^2] and acceleration time [s]: how
    many were drawn (and run to their end), how many hunt, and the ranges they were drawn from."""

    count: int
    hunting: int
    accelerations: tuple[float, float]
    times: tuple[float, float]

    @property
    def fraction(self) -> float:
        return self.hunting / self.count

    @property
    def interval(self) -> tuple[float, float]:
        """The range that holds the true share with a probability of 95 %."""
        return share_interval(self.hunting, self.count)


def ends_in(
    flat: Mapping[str, Any], count: int, target: Target, starts: np.ndarray | None = None, **options: Any
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which runs of stages, given as flat keys to SI numbers or arrays (count,), end in one of the motions that attract
    the stage: they still swing long after their motion, by half of the least of these from peak to peak or more; which
    were completed; and how far they swing at the end, peak to peak [m]; all of shape (count,). The target is the same
    for all, or there is one for each. Where its swings were observed, a motion that does not end in them is looked at
    for half of its run: it may swing less often. `options`: `RunOptions`."""
    ends, completed, swing = np.zeros(count, bool), np.zeros(count, bool), np.zeros(count)
    observed = np.broadcast_to(target.observed, (count,))
    for runs in (np.flatnonzero(~observed), np.flatnonzero(observed)):
        if runs.size:
            part = some_of(flat, runs), target.take(runs) if np.ndim(target.amplitude) else target
            begin = None if starts is None else starts[runs]
            find = _ends_observed if observed[runs[0]] else _ends_closed
            ends[runs], completed[runs], swing[runs] = find(*part, begin, len(runs), **options)
    return ends, completed, swing


def _ends_closed(
    flat: Mapping[str, Any], target: Target, starts: np.ndarray | None, count: int, **options: Any
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Runs are looked at early, and those that are not caught by then are followed on, for twice as long each time."""
    settings = BasinSettings.current()
    size, lasting, early, last = (
        np.broadcast_to(part, (count,))
        for part in (2 * target.amplitude, target.lasting, target.early, settings.judged_periods * target.period)
    )
    ends, completed, swing, since = np.zeros(count, bool), np.zeros(count, bool), np.zeros(count), np.zeros(count)
    left, until, leg = np.arange(count), np.minimum(early, lasting), np.max(last_corner(flat)) + early
    while left.size:
        part = some_of(flat, left), leg[left], last[left], starts
        swing[left], completed[left], starts = _last_swing(*part, RTOL, **options)
        final = until[left] >= lasting[left]
        close = np.abs(swing[left] / size[left] - 1) <= settings.caught_swing_share
        ends[left] = completed[left] & np.where(final, lasts(swing[left], 0.0, size[left] / 4), close)
        on = completed[left] & ~ends[left] & ~final
        left, starts, flat = left[on], starts[on], standing(flat)
        since, until = until, np.minimum(2 * until, lasting)
        leg = np.maximum(until - since, last)
    return ends, completed, swing


def _ends_observed(
    flat: Mapping[str, Any], target: Target, starts: np.ndarray | None, count: int, **options: Any
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which motions end in swings that were only observed, and for which that is known."""
    settings = BasinSettings.current()
    after = np.broadcast_to(np.max(last_corner(flat)) + target.lasting, (count,))
    swing, completed, _ = _last_swing(flat, after, settings.judged_periods * target.period, starts, TIGHT, **options)
    ends = completed & lasts(swing, 0.0, np.broadcast_to(target.amplitude, (count,)) / 2)
    if (others := np.flatnonzero(completed & ~ends)).size:
        begin = None if starts is None else starts[others]
        part = some_of(flat, others), after[others], settings.resting_end_share * after[others]
        swing[others], completed[others], _ = _last_swing(*part, begin, TIGHT, **options)
    return ends, completed, swing


def swings_seldom(target: Target, ends: np.ndarray, swing: np.ndarray) -> np.ndarray:
    """Which runs (see `ends_in`) swing as far as what was observed, but not in the last of its periods: what becomes of
    them is not known."""
    return ~ends & np.asarray(target.observed) & lasts(swing, 0.0, np.asarray(target.amplitude) / 2)


def _last_swing(
    flat: Mapping[str, Any],
    end: np.ndarray,
    last: Any,
    starts: np.ndarray | None,
    rtol: float,
    **run_options: Any,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Peak to peak in the last time [s] before the ends of runs [s], (count,), which runs were completed, and their
    states at the end, (count, kept)."""
    long, count = {**flat, "motion.duration": end}, len(end)
    window = float(np.min(1 - last / end))
    options = RunOptions(rtol=rtol, window=window, record_from=np.inf, least_swing=np.inf, **run_options)
    form = kernel(shared_structure(flat))
    swing, completed, ends = np.zeros(count), np.zeros(count, bool), np.zeros((count, len(form.full_state)))
    for runs in run_chunks(form, long, count, options, starts):
        completed[runs.numbers] = runs.results.statuses == Status.DONE
        swing[runs.numbers], ends[runs.numbers] = swing_of(runs), runs.results.ends
    return swing, completed, ends


def _caught(
    flat: Mapping[str, Any],
    count: int,
    target: Target,
    widest: float,
    landing_map: LandingMap | None,
    starts: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Which runs end in what attracts, and of which that is known: by the return map, as far as that is sure, or by
    long runs. One that swings by more than the `widest` at its end, peak to peak [m], may grow or die out, and one that
    swings less often than what was observed, too."""
    ends, decided = np.zeros(count, bool), np.zeros(count, bool)
    if landing_map is not None:
        ends, decided = motions_go_on(flat, count, landing_map, starts)
    if (left := np.flatnonzero(~decided)).size:
        begin = None if starts is None else starts[left]
        ends[left], completed, swing = ends_in(some_of(flat, left), left.size, target, begin)
        decided[left] = completed & ~(swing > widest) & ~swings_seldom(target, ends[left], swing)
    return ends, decided


def displacements_that_hunt(
    stage: Stage, target: Target, widest: float = np.inf, landing_map: LandingMap | None = None
) -> Kick:
    """Find the displacements [m] from which a stage that is let go ends in its `target`; swings wider than `widest`,
    peak to peak [m], are counted as unknown. A return map that is resolved spares long runs."""
    flat = {**without_motion(stage.flat()), "motion.kind": "release"}

    def hunts(kicks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _caught({**flat, "motion.displacement": kicks}, len(kicks), target, widest, landing_map)

    return kick_windows(hunts, target.amplitude)


def displacements_that_run_away(stage: Stage) -> Kick:
    """The displacements after which a stage whose force is limited, without anti-windup, runs away from its reference
    for good, in the same way."""
    flat, stages = {**without_motion(stage.flat()), "motion.kind": "release"}, Ensemble.held(stage.flat(), 1)
    end = BasinSettings.current().runaway_periods * float(typical_period(stages)[0])

    def runs_away(kicks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which kicks make the stage run away, and for which that is known."""
        options = RunOptions(rtol=RTOL, record_from=np.inf, least_swing=np.inf)
        motions = run_motions({**flat, "motion.displacement": kicks, "motion.duration": end}, len(kicks), options)
        return motions.away, motions.away | motions.completed

    return kick_windows(runs_away, flat[FORCE_LIMIT] / float(stages.number("stiffness")[0]))


def pushes_that_hunt(
    stage: Stage, target: Target, widest: float = np.inf, landing_map: LandingMap | None = None
) -> Kick:
    """Find the pushes, velocities [m/s] of all masses, after which a stage at rest ends in its `target`; swings wider
    than `widest`, peak to peak [m], are counted as unknown. A return map that is resolved spares long runs."""
    stages = Ensemble.held(stage.flat(), 1)

    def hunts(kicks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        several = stages.take(np.zeros(len(kicks), np.int64))
        released = {**several.flat, "motion.displacement": float(stages.length[0])}
        return _caught(released, len(kicks), target, widest, landing_map, pushed(several, kicks))

    return kick_windows(hunts, target.amplitude * float(stages.number("rate")[0]))


def kick_windows(hunts: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], unit: float) -> Kick:
    """The windows of kicks that hunt, searched on a grid about `unit`, their edges closer and closer; `hunts` tells
    which kicks do, and whose runs were completed."""
    settings = BasinSettings.current()
    tried = np.geomspace(settings.kick_range[0] * unit, settings.kick_range[1] * unit, settings.kick_count)
    hunting, completed = hunts(tried)
    kicks, hunting, unknown = tried[completed], hunting[completed], int(np.count_nonzero(~completed))
    if not kicks.size:
        return Kick((), (float(tried[0]), float(tried[-1])), unknown)
    edges = np.flatnonzero(hunting[1:] != hunting[:-1])
    low, high = kicks[edges], kicks[edges + 1]
    while edges.size and np.any(high > (1 + settings.kick_edge_share) * low):
        between = np.geomspace(low, high, settings.kicks_between + 2, axis=1)
        ends, completed = (part.reshape(-1, settings.kicks_between) for part in hunts(between[:, 1:-1].ravel()))
        unknown += int(np.count_nonzero(~completed))
        unlike = completed & (ends != hunting[edges, None])
        last = np.where(unlike.any(axis=1), unlike.argmax(axis=1), settings.kicks_between)
        low, high = (between[np.arange(len(edges)), last + step] for step in (0, 1))
    places = np.where(hunting[edges], low, high)  # the side that hunts
    turns = [*([kicks[0]] if hunting[0] else []), *places, *([kicks[-1]] if hunting[-1] else [])]
    windows = tuple((float(a), float(b)) for a, b in zip(turns[::2], turns[1::2], strict=True))
    return Kick(windows, (float(kicks[0]), float(kicks[-1])), unknown)


def moves_that_hunt(
    stage: Stage, target: Target, widest: float = np.inf, landing_map: LandingMap | None = None
) -> MoveShare | None:
    """Draw moves about that of the stage's file and find the share of them that ends in its `target`; swings wider than
    `widest`, peak to peak [m], are left out. A return map that is resolved spares long runs. None for motions that have
    no acceleration, or if every run fails."""
    settings = BasinSettings.current()
    flat = stage.flat()
    if flat["motion.kind"] != "there_and_back" or not flat["motion.acceleration"] * flat["motion.acceleration_time"]:
        return None
    acceleration, time = flat["motion.acceleration"], flat["motion.acceleration_time"]
    least, most = SEARCH_LIMITS.move_shares
    accelerations = (least * acceleration, most * acceleration)
    times = (least * time, min(most * time, flat["motion.return_at"] / (2 + flat.get(CRUISE, 0.0))))
    (low, shortest), (high, longest) = zip(accelerations, times, strict=True)
    across, along = evenly(settings.drawn_moves)
    moved = {
        **flat,
        "motion.acceleration": low + across * (high - low),
        "motion.acceleration_time": shortest + along * (longest - shortest),
    }
    ends, decided = _caught(moved, settings.drawn_moves, target, widest, landing_map)
    return MoveShare(int(decided.sum()), int(ends[decided].sum()), accelerations, times) if decided.any() else None


def evenly(count: int) -> np.ndarray:
    """Points spread evenly over the unit square, shape (2, count): the Kronecker sequence of the plastic number
    (Roberts 2018, "The unreasonable effectiveness of quasirandom sequences"). SciPy's Sobol points would do as well,
    but take 0.7 s to import."""
    plastic = 1.32471795724474602596  # x^3 = x + 1
    return (0.5 + np.outer([1 / plastic, 1 / plastic**2], np.arange(1, count + 1))) % 1.0
