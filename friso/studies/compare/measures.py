"""What becomes of a machine: hunting, settling, standstill, force; and the margin of its linear loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np

from friso.engine.arrays import Status
from friso.frequency.drive import Drive
from friso.frequency.family import stability_by_poles
from friso.frequency.loops import poles
from friso.frequency.members import limit_cases
from friso.hunting.peaks import COUNTED_AFTER, WINDOW, scan
from friso.rig.run import Recorded
from friso.stage import Stage

LASTING = 0.5
"""A swing of the last quarter lasts if it is at least this share of that of the last half."""

DENSITY, SLOWEST = 100, 0.1
"""Frequencies per decade at which loops are looked at, besides those about resonances, and the lowest, as a share of
the slowest pole; the highest is half that of sampling."""


@dataclass(frozen=True)
class Found:
    """Measures of runs, arrays of shape (count,): whether the run was completed (`done`), whether it `hunts` (it swings
    on beyond the tolerance), peaks `counted` as in the thesis (Sec. 3.2.2), the time of `settling` [s] from the last
    corner of the reference until the stage stays in position (infinite: never), root mean squares of the deviation
    `in_position`, in the last quarter of the run [m], and of the commanded `force`, over all of it [N]."""

    done: np.ndarray
    hunts: np.ndarray
    counted: np.ndarray
    settling: np.ndarray
    in_position: np.ndarray
    force: np.ndarray


Measures = TypeVar("Measures", "Found", "Later")


def joined(parts: Sequence[Measures]) -> Measures:
    """Chunks of runs, one after the other."""
    names = [each.name for each in fields(parts[0])]
    return type(parts[0])(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


@np.errstate(all="ignore")  # runs that fail leave infinities and NaN behind
def measured(recorded: Recorded, corner: float, within: float) -> Found:
    """The measures of a chunk of runs whose reference stands from `corner` [s] on; in position is `within` [m]. What
    the drive logs counts for the peaks, what really moves for the rest."""
    time, reference = recorded.time, recorded.logged["reference"]
    deviation = recorded.true["position"] - reference
    counted, _ = _peaks_and_period(time, recorded.logged["position"] - reference, np.full(len(deviation), np.inf))
    done = recorded.statuses == Status.DONE
    hunts = done & lasting_swing(time, deviation, within)
    late = deviation[:, time >= WINDOW * time[-1]]
    settling = np.where(hunts, np.inf, settling_time(time, deviation, corner, within))
    return Found(
        done=done,
        hunts=hunts,
        counted=np.where(done, counted, 0),
        settling=np.where(done, settling, np.nan),
        in_position=np.where(done, _rms(late), np.nan),
        force=np.where(done, _rms(recorded.logged["force"]), np.nan),
    )


@dataclass(frozen=True)
class Later:
    """Some of the runs followed for longer, arrays of shape (some,): whether they were completed (`done`), and whether
    the stage `stays` in position throughout the last half."""

    done: np.ndarray
    stays: np.ndarray


@np.errstate(all="ignore")
def followed(recorded: Recorded, within: float) -> Later:
    """Of a chunk of runs, whether they stay in position, `within` [m]."""
    late = recorded.time >= 0.5 * recorded.time[-1]
    deviation = (recorded.true["position"] - recorded.logged["reference"])[:, late]
    done = recorded.statuses == Status.DONE
    return Later(done, done & (np.abs(deviation).max(axis=1) <= within))


def lasting_swing(time: np.ndarray, deviation: np.ndarray, within: float) -> np.ndarray:
    """Which deviations [m], shape (runs, n), over times [s], shape (n,), swing on at the end, shape (runs,): to and fro
    by more than twice the tolerance in the last quarter, and no less than half as far as in the last half."""
    last, half = (np.ptp(deviation[:, time >= share * time[-1]], axis=1) for share in (WINDOW, 0.5))
    wide = (last > 2 * within) & (last >= LASTING * half)
    wide[wide] = np.isfinite(_peaks_and_period(time, deviation[wide], last[wide])[1])
    return wide


def settling_time(time: np.ndarray, deviation: np.ndarray, corner: float, within: float) -> np.ndarray:
    """Time [s] from the corner on until the deviation [m], shape (runs, n), stays within; infinite where it is not at
    the end, shape (runs,)."""
    outside = ~(np.abs(deviation) <= within)
    last = deviation.shape[1] - 1 - outside[:, ::-1].argmax(axis=1)
    following = time[np.minimum(last + 1, len(time) - 1)]
    found = np.where(outside.any(axis=1), following, 0.0)
    return np.where(outside[:, -1], np.inf, np.maximum(found - corner, 0.0))


def _peaks_and_period(time: np.ndarray, deviation: np.ndarray, amplitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How many peaks are counted, and the period of each run [s] of this amplitude [m], shape (runs,); what is before a
    little before the first peak that may count, and before the last half, does not matter."""
    some = time >= min(0.8 * COUNTED_AFTER, 0.5 * time[-1])
    values = np.ascontiguousarray(deviation[:, some])
    times = np.tile(time[some], (len(values), 1))
    counts, ended = np.full(len(values), values.shape[1]), np.full(len(values), time[-1])
    peaks, period = scan(times, values, counts, amplitude, ended)
    return peaks.sum(axis=1), period


def _rms(values: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(values**2, axis=1))


@dataclass(frozen=True)
class Loops:
    """Of the linear loop of each machine, arrays of shape (count,): whether it is `stable` in all limit cases, and the
    least modulus `margin` of these (0 where it is not stable)."""

    stable: np.ndarray
    margin: np.ndarray


def linear_loops(stage: Stage, flat: Mapping[str, Any], count: int) -> Loops:
    """The loops of machines, given as flat keys to SI numbers or arrays; the limit cases are those of the stage."""
    drive, stable, margin = Drive.of(flat), np.ones(count, bool), np.full(count, np.inf)
    for one in limit_cases(stage.flat()).values():
        machines = one.repeated(count)
        known, looked = poles(flat, machines, drive), stability_by_poles(flat, machines)
        size = np.abs(known.continuous)
        low, high = SLOWEST * float(np.median(size.min(axis=1))), drive.highest
        omega = np.geomspace(low, high, int(DENSITY * np.log10(high / low)) + 2)
        shared = known.distance(np.broadcast_to(omega, (count, len(omega)))).min(axis=1)
        stable &= looked.abscissa < 0
        margin = np.minimum(margin, np.minimum(shared, looked.resonant))
    return Loops(stable, np.where(stable, margin, 0.0))
