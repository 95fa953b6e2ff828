"""Run moves of a machine on rails of several seeds, and evaluate how they end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.engine.arrays import ArrayColumns, Status
from friso.equations import motion
from friso.equations.bandwidth import bandwidth
from friso.errors import InputError
from friso.hunting.criteria import COUNTED_ABOVE, FAILED, SWINGS, End, last_outside, lasts, outcomes, peaks_in_traces
from friso.hunting.measures import LAST_HALF, LAST_QUARTER, scan_turning_points, zigzag
from friso.intervals import Share, share
from friso.progress import Progress, silent
from friso.stage import Stage
from friso.stage.controllers import CONTROLLER
from friso.virtual_rig.run import RecordedRuns, run
from friso.virtual_rig.task import MoveTask, point_to_point
from friso_thesis.studies.rig.outcome import free_stage, interval, locked_stage, pace, quicker

RAIL_COUNT = 20
"""Rails on which a machine is repeated (friso's choice)."""

LEAST_DURATION = 20.0
"""Least duration of a run [s], as in the thesis (Sec. 3.2.2), whose peaks count after 10 s."""

LONGEST_INTERVAL = 1e-3
"""Longest sample time of a log [s]; the thesis states none."""

PEAK_BAND = COUNTED_ABOVE
"""Band about the reference [m] within which a run rests: the height above which the thesis counts peaks."""

ROUND_MANTISSAS = (1.0, 2.0, 5.0, 10.0)
"""Mantissas to which a length is rounded."""


def distance(stage: Stage) -> float:
    """Return the distance [m] of a stage's move: its motion's, rounded to 1, 2 or 5 times 10^n.

    It is 100 mm for the 90 mm of the thesis's rig (Sec. 4.3.2). Raises InputError for a motion that does not move.
    """
    exact = float(motion.size(stage.flat()))
    if not exact:
        raise InputError("motion.kind", repr(stage.flat()["motion.kind"]), "a motion that moves the stage", '"step"')
    power = 10.0 ** np.floor(np.log10(exact))
    return float(power * min(ROUND_MANTISSAS, key=lambda digit: abs(np.log(digit * power / exact))))


def duration(stage: Stage) -> float:
    """Return the duration of a run of a stage [s], at least that of the thesis."""
    return max(LEAST_DURATION, float(stage.flat()["motion.duration"]))


def move(stage: Stage) -> MoveTask:
    """Return the move from 0 with the acceleration of the stage's motion, then a stand.

    A motion that states no acceleration gets one that the loop can just follow: a move then takes two time constants of
    the loop.
    """
    flat, travel = stage.flat(), distance(stage)
    rate = 2 * np.pi * (bandwidth(flat) or 1.0)
    acceleration = flat.get("motion.acceleration", travel * rate**2)
    rows = point_to_point([0.0, travel], acceleration, np.inf, 0.0).pieces
    return MoveTask(rows[1:], duration(stage))


def released(stage: Stage, displacement: float) -> MoveTask:
    """Return the task of a release at the end of the move, from `displacement` [m] beside it."""
    return MoveTask(np.array([[0.0, distance(stage), 0.0, 0.0]]), duration(stage), displacement=displacement)


def with_joint(stage: Stage, locked: bool) -> Stage:
    """Return the stage with its joint locked, or free.

    Raises InputError if it has no joint, or none that can be free.
    """
    return locked_stage(stage) if locked else free_stage(stage)


def crossover(stage: Stage) -> float:
    """Return the crossover of the stage's controller [Hz].

    Raises InputError for a controller that has gains instead.
    """
    return float(stage.flat()[crossover_key(stage)])


def crossover_key(stage: Stage) -> str:
    """Return the key that states the crossover of the stage's controller.

    Raises InputError for a controller that has gains instead.
    """
    key = stage.controller.bandwidth_key
    if key is None:
        actual, expected = "gains", "a controller tuned by its crossover, which the experiment varies"
        raise InputError(CONTROLLER, actual, expected, 'crossover = "8 Hz"')
    return key


def at_crossovers(stage: Stage, frequencies: np.ndarray) -> dict[str, np.ndarray]:
    """Return the controller's keys at crossovers [Hz], with SI values of their shape.

    A controller that states no crossover is made faster as a whole, from the crossover of a van Dijk controller with
    the same proportional gain (`pace`).
    """
    key = stage.controller.bandwidth_key
    return quicker(stage, frequencies / pace(stage)) if key is None else {key: frequencies}


def rails(stage: Stage) -> np.ndarray:
    """Return the seeds of the rails on which a machine is repeated, the stage's own first.

    A stage whose friction does not vary along the rail has a single NaN.
    """
    if stage.rail is None:
        return np.array([np.nan])
    return stage.flat()["rail.seed"] + np.arange(float(RAIL_COUNT))


def on_rails(stage: Stage, cases: Mapping[str, np.ndarray], seeds: np.ndarray) -> dict[str, np.ndarray]:
    """Repeat each case's changes of keys, (cases,), on every rail: (cases * rails,).

    Rails, by their `seeds`, vary fastest.
    """
    count = len(next(iter(cases.values())))
    repeated = {key: np.repeat(values, len(seeds)) for key, values in cases.items()}
    return repeated if stage.rail is None else {**repeated, "rail.seed": np.tile(seeds, count)}


def numbers_of(seed: int, cases: int, machines: int) -> list[int]:
    """Return the noise seeds of cases on machines, machines varying fastest.

    A machine has the same noise in all cases.
    """
    return [seed + machine for _ in range(cases) for machine in range(machines)]


@dataclass(frozen=True)
class RailRuns(ArrayColumns):
    """Results of runs on rails, each of shape (runs,).

    - `peaks`: distinct peaks (see `friso.hunting.criteria.peak_count`).
    - `outcome`: words of `friso.hunting.criteria.run_outcome`, with `PEAK_BAND` as band.
    - `swing` [m], peak to peak, and `period` [s] of the last quarter (NaN: none).
    - `above`, `below` [m]: mean heights of swings on both sides of the reference, after half of the run.
    - `rising`: fraction of the period in which the deviation rises.
    - `period_scatter`: standard deviation of the period over its mean; `height_scatter`: standard deviation of the
      heights over the swing.

    The last five are NaN with fewer than three swings to either side. Runs that failed have NaN, and no peaks.
    """

    peaks: np.ndarray
    outcome: np.ndarray
    swing: np.ndarray
    period: np.ndarray
    above: np.ndarray
    below: np.ndarray
    rising: np.ndarray
    period_scatter: np.ndarray
    height_scatter: np.ndarray

    @property
    def swings(self) -> np.ndarray:
        """Return which runs swing at their end."""
        return self.outcome == SWINGS

    @property
    def failed(self) -> np.ndarray:
        """Return which runs failed."""
        return self.outcome == FAILED

    @property
    def counted(self) -> np.ndarray:
        """Return which runs have a distinct peak."""
        return self.peaks > 0

    def share(self, which: Any = ...) -> Share:
        """Return the fraction of runs with a counted peak, and its 95 % interval.

        `which` are the indices of the runs, by default all.
        """
        return share(self.counted[which], ~self.failed[which])


def once(stage: Stage, task: MoveTask, seeds: Sequence[int], changes: Mapping[str, Any] | None = None) -> RecordedRuns:
    """Run a task once for each seed of the noise, and keep all samples.

    `changes` of keys are SI numbers, or arrays with one value for each run.
    """
    (recorded,) = run(stage, task, seeds, interval(stage, LONGEST_INTERVAL), changes)
    return recorded


def run_moves(
    stage: Stage,
    task: MoveTask,
    seeds: Sequence[int],
    changes: Mapping[str, Any],
    progress: Progress = silent,
    label: str = "",
) -> RailRuns:
    """Run a task once for each seed, and evaluate the runs without keeping their samples.

    `changes` of keys are SI numbers, or arrays with one value for each run.
    """
    parts: list[RailRuns] = []
    progress(0, len(seeds), label)
    for chunk in run(stage, task, seeds, interval(stage, LONGEST_INTERVAL), changes):
        parts.append(rail_runs(chunk))
        progress(int(chunk.numbers[-1]) + 1, len(seeds), label)
    return RailRuns.joined(parts)


def rail_runs(recorded: RecordedRuns) -> RailRuns:
    """Evaluate the logged positions of a chunk of runs."""
    time, failed = recorded.time, recorded.statuses != Status.DONE
    deviation = recorded.logged["position"] - recorded.logged["reference"]
    deviation[failed] = 0.0
    turns = [turning_points(time, row) for row in deviation]
    counts = np.array([len(run_turns) for run_turns, _ in turns])
    times, values = np.zeros((2, len(turns), max(1, counts.max(initial=0))))
    for row, (at, value) in enumerate(turns):
        times[row, : len(at)], values[row, : len(at)] = at, value
    swing, earlier = (np.ptp(deviation[:, time >= part * time[-1]], axis=1) for part in (LAST_QUARTER, LAST_HALF))
    ended = np.full(len(turns), time[-1])
    ending = scan_turning_points(times, values, counts, swing, ended)
    end = End(~failed, swing, earlier, ending.period, ending.turned, last_outside(time, deviation, PEAK_BAND), ended)
    shapes = [cycle_shape(*turn, size, time[-1]) for turn, size in zip(turns, swing, strict=True)]
    valid = np.where(failed, np.nan, 1.0)
    above, below, rising, periods, heights = np.array(shapes).T * valid
    counted = np.where(failed, 0, peaks_in_traces(time, deviation))
    words = outcomes(end, PEAK_BAND)
    return RailRuns(counted, words, swing * valid, ending.period * valid, above, below, rising, periods, heights)


def turning_points(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] and values [m] of the turning points of a sampled deviation.

    Where the deviation stays level at a turn, the last of the level samples counts.
    """
    ways = np.sign(np.diff(values))
    moving = np.flatnonzero(ways)
    turned = moving[1:][ways[moving[1:]] * ways[moving[:-1]] < 0]
    return time[turned], values[turned]


def cycle_shape(times: np.ndarray, values: np.ndarray, swing: float, ended: float) -> tuple[float, ...]:
    """Return the shape of the swings in a run's last half: five numbers.

    The numbers are `above`, `below`, `rising`, `period_scatter` and `height_scatter` of `RailRuns`. They follow from
    turning points, times [s] and values [m], and the `swing` peak to peak. The run `ended` at a time [s]. All are NaN
    if the run does not swing, or has fewer than three swings to either side.
    """
    nothing = (np.nan,) * 5
    if not lasts(np.asarray(swing), 0.0, PEAK_BAND):
        return nothing
    late = times >= ended / 2
    at, value = times[late], values[late]
    kinds = np.zeros(len(at), np.int64)
    zigzag(value, len(at), swing / 2, kinds)
    turned = np.flatnonzero(kinds)[:-1]  # the last swing is not over yet
    at, value, kinds = at[turned], value[turned], kinds[turned]
    tops, bottoms = kinds > 0, kinds < 0
    if tops.sum() < 3 or bottoms.sum() < 3:
        return nothing
    periods = np.concatenate([np.diff(at[side]) for side in (tops, bottoms)])
    halves = np.diff(at)
    rising = halves[bottoms[:-1]].mean()
    heights = [float(np.mean(value[side])) for side in (tops, bottoms)]
    spread = np.concatenate([value[side] - mean for side, mean in zip((tops, bottoms), heights, strict=True)])
    share = float(rising / periods.mean())
    return heights[0], -heights[1], share, float(periods.std() / periods.mean()), float(spread.std() / swing)
