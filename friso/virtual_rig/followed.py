"""Follow runs of a stage as built until each rests, or surely does not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from friso.engine.arrays import Status
from friso.engine.batch import usual_interval
from friso.hunting import resting
from friso.hunting.measures import LAST_HALF, LAST_QUARTER
from friso.stage.rig import Floor
from friso.virtual_rig.run import run_flat
from friso.virtual_rig.task import MoveTask

Fate = Literal["hunts", "toggles", "rests", "runs away", "open", "failed"]
"""What a run does in the end.

It swings by more than a count, swings by at most one, rests, or diverges. It is open what it does, or the run failed.
"""


@dataclass(frozen=True)
class FollowedRuns:
    """Runs that were followed, (n,) each.

    They have a `fate`; a swing [m] and a period [s]; the largest deviation in the end, `error` [m]; and times [s] after
    the last corner of the reference: until the deviation stays in a band, to the next slip, and followed in all.
    """

    fate: np.ndarray
    swing: np.ndarray
    period: np.ndarray
    error: np.ndarray
    settled: np.ndarray
    slips_after: np.ndarray
    followed: np.ndarray


@dataclass(frozen=True)
class Bounds:
    """What tells runs apart, on a `floor` that may shake.

    - `size` [m]: largest swing of a stage at rest, peak to peak; see `size_of_rest`.
    - `breakaway` [N]: least force that moves the stage, inf if its motor exerts less.
    - `band` [m]: deviation within which a stage is in position.
    """

    floor: Floor | None
    size: float
    breakaway: float
    band: float


SAMPLES = 1e7
"""Samples of the drive over which all runs together are followed. More take longer than the rest of a check."""

LONGER = 4.0
"""Factor by which an undecided run is followed longer."""


def size_of_rest(flat: Mapping[str, Any]) -> float:
    """Return the largest swing [m], peak to peak, that is no hunting.

    It is a count and the noise, as a drive sees no less, or the deviation at which a controller exerts no force.
    """
    seen = COUNT * flat["drive.encoder_resolution"] + NOISE_WIDTH * flat["drive.encoder_noise"]
    return max(float(seen), float(resting(flat)[0]))


COUNT = 1.1  # [counts]
"""Largest swing, peak to peak, that is told to be of one count: as a reading flips, a stage goes on a little."""


NOISE_WIDTH = 10.0  # [RMS]
"""Width of noise, peak to peak. Of a million samples none lies beyond."""


def follow(flat: Mapping[str, Any], task: MoveTask, bounds: Bounds, samples: float = SAMPLES) -> FollowedRuns:
    """Run a task until each run rests or surely does not, over at most so many samples of the drive in all."""
    count, step = len(task.pieces), float(np.min(flat["drive.sample_time"]))
    corner = float(np.max(task.pieces[:, -1, 0]))
    runs = FollowedRuns(np.full(count, "open", object), *(np.full(count, np.nan) for _ in range(6)))
    left, after = np.arange(count), max(task.duration - corner, FEWEST_SAMPLES * step, corner / LONGEST_MOTION)
    if count * (corner + after) > samples * step:
        least = min(after / LONGER**2, samples * step / TOGETHER - corner)
        after = max(samples * step / FIRST_SHARE / count - corner, least)
    while left.size and after > 0 and (affordable := int(samples * step / (corner + after)) // TOGETHER * TOGETHER):
        left = left[:affordable]
        part = {key: value[left] if np.ndim(value) else value for key, value in flat.items()}
        some = runs_to_their_end(part, replace(task.of_runs(left), duration=corner + after), bounds, left)
        for name, column in vars(runs).items():
            column[left] = getattr(some, name)
        samples -= -(-left.size // TOGETHER) * TOGETHER * (corner + after) / step
        undecided = some.fate == "open"
        left = left[undecided | np.isfinite(some.slips_after)]
        slip = 0.0 if undecided.any() else SLIPS_FOLLOWED * float(np.min(some.slips_after))
        after = max(LONGER * after, slip)
    return runs


FEWEST_SAMPLES = 1000
"""Fewest samples after a motion from which its end is judged. Between fewer, a loop hardly settles."""

LONGEST_MOTION = 20.0
"""Duration of a motion in times after it from which its end is judged, at most."""

SLIPS_FOLLOWED = 2.0
"""Factor by which a run at rest is followed beyond the time at which its winding force should break it away."""


TOGETHER = 8
"""Number of runs that take hardly longer than one."""

FIRST_SHARE = 3.0
"""Part of the samples that runs take at first, if the motion lasts too long to be run whole: a third."""


SLOWEST_SLIP = 86400.0  # [s]
"""Longest time to a slip that counts. Nobody waits longer."""

JUDGED_PERIODS = 3.0
"""Periods of a swing in the last half of a run that show that it lasts."""

LASTING_SHARE, SMALL_LASTING_SHARE = 0.8, 0.95
"""Least ratio of the swing over the last quarter of a run to that over the last half, for it to last.

A swing of few counts changes its size with each count, so that one that dies is told from one that lasts by the
second."""

SMALL_SWING = 3.0  # [largest swing of a stage at rest]
"""Largest swing that is small."""


def runs_to_their_end(flat: Mapping[str, Any], task: MoveTask, bounds: Bounds, seeds: np.ndarray) -> FollowedRuns:
    """Run a task once, with these seeds of its noise, (runs,), and say what each run does in the end."""
    step, corner, size = float(np.min(flat["drive.sample_time"])), float(np.max(task.pieces[:, -1, 0])), bounds.size
    interval = max(1, round(usual_interval(task.duration) / step)) * step
    several = [*run_flat(flat, bounds.floor, task, seeds.tolist(), interval)]
    position, reference, force, reading = (
        np.concatenate([getattr(one, kind)[name] for one in several])
        for kind, name in (("true", "position"), ("logged", "reference"), ("logged", "force"), ("logged", "position"))
    )
    time, statuses = several[0].time, np.concatenate([one.statuses for one in several])
    done, away = statuses == Status.DONE, statuses == Status.DIVERGED
    deviation, followed = position - reference, time[-1] - corner
    half, quarter = (time >= corner + share * followed for share in (LAST_HALF, LAST_QUARTER))
    swing, earlier = (np.ptp(deviation[:, part], axis=1) for part in (quarter, half))
    period, turned = _periods(time[half], deviation[:, half])
    resolution, noise = (np.asarray(flat[f"drive.encoder_{name}"]) for name in ("resolution", "noise"))
    least = np.maximum(resolution, np.abs(reading - reference)[:, -1])
    slips = _time_to_slip(time[quarter], force[:, quarter], position[:, quarter], bounds.breakaway, least)
    share = np.where(swing > SMALL_SWING * size, LASTING_SHARE, SMALL_LASTING_SHARE)
    lasting = (swing > size) & (swing >= share * earlier) & (time[-1] - turned <= period)
    sure, still = lasting & (JUDGED_PERIODS * period <= followed / 2), (earlier <= size) & (slips > 0)
    sure, still = (fate & (followed >= FEWEST_SAMPLES * step) for fate in (sure, still))
    flipping, flipped = _periods(time[half], reading[:, half])
    counts = (resolution > 0) & (noise == 0) & (earlier <= COUNT * resolution)
    toggles = still & counts & (time[-1] - flipped <= 2 * flipping)
    fates = {"runs away": away, "failed": ~done, "hunts": sure, "toggles": toggles, "rests": still}
    fate = np.select([*fates.values()], [*fates], "open").astype(object)
    outside = np.abs(deviation) > bounds.band
    settled = time[len(time) - 1 - np.argmax(outside[:, ::-1], axis=1)] - corner
    return FollowedRuns(
        fate,
        swing,
        np.where(toggles, flipping, period),
        np.abs(deviation[:, half]).max(axis=1),
        np.where(outside[:, -1], np.inf, np.where(outside.any(axis=1), np.maximum(settled, 0.0), 0.0)),
        np.where(fate == "rests", slips, np.inf),
        np.full(len(fate), followed),
    )


def _periods(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean period of swings [s] and the last time [s] at which they turned, from times (n,) and values.

    Both have the shape (runs,). A swing crosses the middle half of the range between the values, of shape (runs, n).
    """
    periods, turned = np.full(len(values), np.nan), np.full(len(values), -np.inf)
    for run, row in enumerate(values):
        low, high = row.min(), row.max()
        side = np.sign(row - (low + high) / 2) * (np.abs(row - (low + high) / 2) > (high - low) / 4)
        away = np.flatnonzero(side)
        crossed = away[1:][np.diff(side[away]) != 0]
        if len(crossed) > 2:
            whole = crossed[(len(crossed) - 1) % 2 :]
            periods[run] = 2 * (time[whole[-1]] - time[whole[0]]) / (len(whole) - 1)
            turned[run] = time[crossed[-1]]
    return periods, turned


DRIFT_SHARE = 0.4
"""Least drift of the force between the halves of a record, as a share of its width, for it to wind. It is a half for
a force that rises evenly."""


def _time_to_slip(
    time: np.ndarray, force: np.ndarray, position: np.ndarray, breakaway: float, least: np.ndarray
) -> np.ndarray:
    """Return the time [s] in which a force [N] that winds evenly breaks a stage away, inf if it does not, (runs,).

    It does not if the stage yields by `least` [m] before: its reading then changes, and the force turns. Forces and
    positions [m] have the shape (runs, n).
    """
    half = len(time) // 2
    drift, yielded = (part[:, half:].mean(axis=1) - part[:, :half].mean(axis=1) for part in (force, position))
    with np.errstate(all="ignore"):
        winds = (drift != 0) & (np.abs(drift) >= DRIFT_SHARE * np.ptp(force, axis=1)) & (breakaway > 0)
        rest = np.maximum(breakaway - np.sign(drift) * force[:, -1], 0.0) / np.abs(drift)
        after = rest * (time[half:].mean() - time[:half].mean())
        return np.where(winds & (np.abs(yielded) * rest < least) & (after < SLOWEST_SLIP), after, np.inf)
