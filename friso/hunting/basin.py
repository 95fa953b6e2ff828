"""Find the kicks and moves of a stage that end in hunting."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.engine.arrays import Status
from friso.engine.batch import RunOptions, run_chunks
from friso.engine.kernel import kernel
from friso.equations.motion import last_corner, standing, without_motion
from friso.equations.structure import shared_structure
from friso.hunting.attractors import Target
from friso.hunting.attractors.rounds import SURVEY_RTOL, TIGHT_SURVEY_RTOL, typical_period
from friso.hunting.criteria.run_outcome import lasts
from friso.hunting.cycle.ensemble import Ensemble, pushed
from friso.hunting.measures import swing_of
from friso.hunting.motions import run_motions, some_of
from friso.hunting.path import SEARCH_LIMITS
from friso.hunting.return_map.attracting import motions_go_on
from friso.hunting.return_map.landing_map import LandingMap
from friso.intervals import share_interval
from friso.stage import Stage
from friso.stage.controllers import FORCE_LIMIT
from friso.stage.rig import motion_of


@dataclass(frozen=True)
class Kick:
    """Kicks that start hunting of a stage at rest at its reference.

    A kick is either a displacement [m] of all masses, followed by a release as in the motion "release", or a push: a
    velocity [m/s] of all masses. `windows` are the ranges of kicks that start hunting, with ends known to 1 %. The last
    window may end with the range `searched`. Kicks in the negative direction have a minus sign and follow those in the
    positive one; a symmetric stage, whose kicks in either direction are alike, has none of them. `unknown` counts runs
    that were not completed; they are left out, so a window may reach across them.
    """

    windows: tuple[tuple[float, float], ...]
    searched: tuple[float, float]
    unknown: int = 0
    symmetric: bool = True

    @property
    def smallest(self) -> float | None:
        """Return the smallest kick that was seen to start hunting, with its sign; None if none was."""
        return min((low for low, _ in self.windows), key=abs, default=None)

    def towards(self, side: float) -> tuple[tuple[float, float], ...]:
        """Return the ranges of sizes of kicks that start hunting in the direction of the sign of `side`."""
        sign = -1.0 if side < 0 and not self.symmetric else 1.0
        return tuple((sign * low, sign * high) for low, high in self.windows if sign * low > 0)


@dataclass(frozen=True)
class MoveShare:
    """Fraction of moves that end in hunting.

    Moves were drawn evenly over two keys of the motion, within `ranges` [SI], and simulated. `count` of them have a
    certain end, and `hunting` of these hunt.
    """

    count: int
    hunting: int
    ranges: Mapping[str, tuple[float, float]]

    @property
    def fraction(self) -> float:
        """Return the fraction of moves with a certain end that hunt."""
        return self.hunting / self.count

    @property
    def interval(self) -> tuple[float, float]:
        """Return the 95 % interval of the fraction of moves that hunt."""
        return share_interval(self.hunting, self.count)


def ends_in(
    flat: Mapping[str, Any], count: int, target: Target, starts: np.ndarray | None = None, **options: Any
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Run stages, and find which of them end in one of their attractors.

    The stages are flat keys, such as "friction.static", with SI numbers or arrays (count,). A run ends in an attractor
    if, long after its motion, it swings by more than half of the smallest attracting swing, peak to peak. Returns which
    runs end there, which were completed, and the peak-to-peak swing [m] at the end, all of shape (count,).

    `target` is common to all runs, or has one row for each. Where swings were only observed, half of each run is
    inspected, because the swing may come less often. `starts` are initial states (count, states); None: those of the
    motion. `options` are those of `RunOptions`.
    """
    ends, completed, swing = np.zeros(count, bool), np.zeros(count, bool), np.zeros(count)
    observed = np.broadcast_to(target.observed, (count,))
    for runs in (np.flatnonzero(~observed), np.flatnonzero(observed)):
        if runs.size:
            part = some_of(flat, runs), target.take(runs) if np.ndim(target.amplitude) else target
            begin = None if starts is None else starts[runs]
            find = _ends_observed if observed[runs[0]] else _ends_closed
            ends[runs], completed[runs], swing[runs] = find(*part, begin, len(runs), **options)
    return ends, completed, swing


JUDGED_PERIODS = 1.5  # [periods]
"""Length of the end of a run that is judged. Shorter ones miss a whole swing; longer ones include the transient."""

CAUGHT_SWING_SHARE = 0.003
"""Largest difference in swing between a run and the attractor at which the run need not be continued."""


def _ends_closed(
    flat: Mapping[str, Any], target: Target, starts: np.ndarray | None, count: int, **options: Any
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find which runs end in attractors of which it is known how fast they attract.

    Runs begin in the states `starts` (None: those of the motion), and must swing as `target` says. They are judged
    early; a run that has not reached an attractor by then is continued, twice as long each time. Returns which runs end
    there, which were completed, and the peak-to-peak swing [m], all of shape (count,).
    """
    size, lasting, early, last = (
        np.broadcast_to(part, (count,))
        for part in (2 * target.amplitude, target.lasting, target.early, JUDGED_PERIODS * target.period)
    )
    ends, completed, swing, since = np.zeros(count, bool), np.zeros(count, bool), np.zeros(count), np.zeros(count)
    left, until, leg = np.arange(count), np.minimum(early, lasting), np.max(last_corner(flat)) + early
    while left.size:
        part = some_of(flat, left), leg[left], last[left], starts
        swing[left], completed[left], starts = _last_swing(*part, SURVEY_RTOL, **options)
        final = until[left] >= lasting[left]
        close = np.abs(swing[left] / size[left] - 1) <= CAUGHT_SWING_SHARE
        ends[left] = completed[left] & np.where(final, lasts(swing[left], 0.0, size[left] / 4), close)
        on = completed[left] & ~ends[left] & ~final
        left, starts, flat = left[on], starts[on], standing(flat)
        since, until = until, np.minimum(2 * until, lasting)
        leg = np.maximum(until - since, last)
    return ends, completed, swing


RESTING_END_SHARE = 0.5  # [of the run]
"""Shortest standstill at the end of a run at rest. A shorter one may only be the wait for the next break-away."""


def _ends_observed(
    flat: Mapping[str, Any], target: Target, starts: np.ndarray | None, count: int, **options: Any
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Run stages whose attractors were only observed; find which runs end there.

    Runs begin in the states `starts` (None: those of the motion), and must swing half as far as `target` says. The
    tolerance is tighter than for closed orbits. Returns which runs end there, which were completed, and the
    peak-to-peak swing [m], all of shape (count,).
    """
    after = np.broadcast_to(np.max(last_corner(flat)) + target.lasting, (count,))
    swing, completed, _ = _last_swing(flat, after, JUDGED_PERIODS * target.period, starts, TIGHT_SURVEY_RTOL, **options)
    ends = completed & lasts(swing, 0.0, np.broadcast_to(target.amplitude, (count,)) / 2)
    if (others := np.flatnonzero(completed & ~ends)).size:
        begin = None if starts is None else starts[others]
        part = some_of(flat, others), after[others], RESTING_END_SHARE * after[others]
        swing[others], completed[others], _ = _last_swing(*part, begin, TIGHT_SURVEY_RTOL, **options)
    return ends, completed, swing


def swings_seldom(target: Target, ends: np.ndarray, swing: np.ndarray) -> np.ndarray:
    """Return which runs swing as far as the observed attractor, but too seldom, (count,).

    It is unknown whether such runs end in the attractor, `target`. `ends` marks runs that swing so within its last
    period, and `swing` [m] is peak to peak over a longer time.
    """
    return ~ends & np.asarray(target.observed) & lasts(swing, 0.0, np.asarray(target.amplitude) / 2)


def _last_swing(
    flat: Mapping[str, Any],
    end: np.ndarray,
    last: Any,
    starts: np.ndarray | None,
    rtol: float,
    **run_options: Any,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Run stages to the time `end` [s]; measure peak to peak over at least `last` [s] before it.

    Both times have the shape (count,). Returns the swing [m], which runs were completed, and the final states with
    modes that have a memory, (count, kept). `starts` are initial states (None: those of the motion).
    """
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
    """Return which runs end in an attractor, and for which that is certain, both (count,).

    The return map decides where it is reliable. Elsewhere long runs decide; their end is uncertain if they swing by
    more than `widest`, peak to peak [m], because the swing may grow or decay. The end is also uncertain if a run swings
    less often than an observed attractor.
    """
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
    """Find the displacements [m] from which a released stage ends in hunting.

    `target` is how far and how late a run must swing to count as hunting. Runs that swing wider than `widest`, peak to
    peak [m], count as unknown. A `landing_map`, the stage's return map, saves long runs.
    """
    flat = {**without_motion(stage.flat()), "motion.kind": "release"}

    def hunts(kicks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Release the stage from displacements [m]; return which hunt, and which are certain, (n,)."""
        return _caught({**flat, "motion.displacement": kicks}, len(kicks), target, widest, landing_map)

    return kick_windows(hunts, target.amplitude, _symmetric(stage))


RUNAWAY_PERIODS = 200.0  # [typical periods]
"""Time after which a motion that has not diverged does not diverge."""


def displacements_that_run_away(stage: Stage) -> Kick:
    """Find the displacements after which a stage with a force limit and no anti-windup diverges."""
    flat, stages = {**without_motion(stage.flat()), "motion.kind": "release"}, Ensemble.held(stage.flat(), 1)
    end = RUNAWAY_PERIODS * float(typical_period(stages)[0])

    def runs_away(kicks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Run the stage from displacements [m]; return which diverge, and which are certain, (n,)."""
        options = RunOptions(rtol=SURVEY_RTOL, record_from=np.inf, least_swing=np.inf)
        motions = run_motions({**flat, "motion.displacement": kicks, "motion.duration": end}, len(kicks), options)
        return motions.away, motions.away | motions.completed

    return kick_windows(runs_away, flat[FORCE_LIMIT] / float(stages.number("stiffness")[0]), _symmetric(stage))


def pushes_that_hunt(
    stage: Stage, target: Target, widest: float = np.inf, landing_map: LandingMap | None = None
) -> Kick:
    """Find the pushes, velocities [m/s] of all masses, after which a stage at rest hunts.

    `target` is how far and how late a run must swing to count as hunting. Runs that swing wider than `widest`, peak to
    peak [m], count as unknown. A `landing_map`, the stage's return map, saves long runs.
    """
    stages = Ensemble.held(stage.flat(), 1)

    def hunts(kicks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Push the stage at velocities [m/s]; return which hunt, and which are certain, (n,)."""
        several = stages.take(np.zeros(len(kicks), np.int64))
        released = {**several.flat, "motion.displacement": float(stages.length[0])}
        return _caught(released, len(kicks), target, widest, landing_map, pushed(several, kicks))

    return kick_windows(hunts, target.amplitude * float(stages.number("rate")[0]), _symmetric(stage))


def _symmetric(stage: Stage) -> bool:
    """Tell whether kicks of a stage in either direction are alike."""
    return bool(Ensemble.held(stage.flat(), 1).symmetric[0])


def kick_windows(
    hunts: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], unit: float, symmetric: bool = True
) -> Kick:
    """Find the windows of kicks that hunt, in both directions unless they are alike, and their edges to 1 %.

    The search covers a range of sizes around the kick `unit`, in [m] or [m/s]. `hunts` runs some kicks; it returns
    which of them hunt, and for which that is certain. In a `symmetric` stage, only positive kicks are run.
    """
    sides = [_windows_of_sizes(hunts, unit)]
    if not symmetric:
        sides.append(_windows_of_sizes(lambda sizes: hunts(-sizes), unit))
    windows = (
        (sign * low, sign * high) for sign, side in zip((1.0, -1.0), sides, strict=False) for low, high in side.windows
    )
    low, high = zip(*(side.searched for side in sides), strict=True)
    return Kick(tuple(windows), (max(low), min(high)), sum(side.unknown for side in sides), symmetric)


KICK_RANGE = (1 / 30, 300.0)  # [least attracting motions]
"""Smallest and largest kick. Smaller ones do not break away; larger ones meet the force limit."""

KICK_COUNT = 128
"""Kicks tried. Windows narrower than a step are missed; more kicks take longer."""

KICK_EDGE_SHARE = 0.01
"""Precision of the edges of windows, which are shown with three digits."""

KICKS_BETWEEN = 7
"""Kicks tried at once between the edges of a window, which take hardly longer than one."""


def _windows_of_sizes(hunts: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], unit: float) -> Kick:
    """Find the windows of positive kicks that hunt (see `kick_windows`)."""
    tried = np.geomspace(KICK_RANGE[0] * unit, KICK_RANGE[1] * unit, KICK_COUNT)
    hunting, completed = hunts(tried)
    kicks, hunting, unknown = tried[completed], hunting[completed], int(np.count_nonzero(~completed))
    if not kicks.size:
        return Kick((), (float(tried[0]), float(tried[-1])), unknown)
    edges = np.flatnonzero(hunting[1:] != hunting[:-1])
    low, high = kicks[edges], kicks[edges + 1]
    while edges.size and np.any(high > (1 + KICK_EDGE_SHARE) * low):
        between = np.geomspace(low, high, KICKS_BETWEEN + 2, axis=1)
        ends, completed = (part.reshape(-1, KICKS_BETWEEN) for part in hunts(between[:, 1:-1].ravel()))
        unknown += int(np.count_nonzero(~completed))
        unlike = completed & (ends != hunting[edges, None])
        last = np.where(unlike.any(axis=1), unlike.argmax(axis=1), KICKS_BETWEEN)
        low, high = (between[np.arange(len(edges)), last + step] for step in (0, 1))
    places = np.where(hunting[edges], low, high)  # the side that hunts
    turns = [*([kicks[0]] if hunting[0] else []), *places, *([kicks[-1]] if hunting[-1] else [])]
    windows = tuple((float(a), float(b)) for a, b in zip(turns[::2], turns[1::2], strict=True))
    return Kick(windows, (float(kicks[0]), float(kicks[-1])), unknown)


DRAWN_MOVES = 128
"""Moves drawn. The interval of the fraction narrows with the root of this number."""


def moves_that_hunt(
    stage: Stage, target: Target, widest: float = np.inf, landing_map: LandingMap | None = None
) -> MoveShare | None:
    """Estimate the fraction of moves like the stage's own that end in hunting.

    `target` is how far and how late a run must swing to count as hunting. Runs that swing wider than `widest`, peak to
    peak [m], are left out. A `landing_map`, the stage's return map, saves long runs. Returns None for motions that are
    no moves, or if every run fails.
    """
    flat = stage.flat()
    if not (ranges := motion_of(flat).varied(flat, SEARCH_LIMITS.move_shares)):
        return None
    drawn = zip(ranges.items(), evenly(DRAWN_MOVES), strict=True)
    moved = {**flat, **{key: low + places * (high - low) for (key, (low, high)), places in drawn}}
    ends, decided = _caught(moved, DRAWN_MOVES, target, widest, landing_map)
    return MoveShare(int(decided.sum()), int(ends[decided].sum()), ranges) if decided.any() else None


def evenly(count: int) -> np.ndarray:
    """Spread points evenly over the unit square, shape (2, count).

    They are the Kronecker sequence of the plastic number; see Roberts 2018, "The unreasonable effectiveness of
    quasirandom sequences". SciPy's Sobol points would do, but take 0.7 s to import.
    """
    plastic = 1.32471795724474602596  # x^3 = x + 1
    return (0.5 + np.outer([1 / plastic, 1 / plastic**2], np.arange(1, count + 1))) % 1.0
