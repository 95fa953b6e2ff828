"""Define the task of a drive, and build its surroundings as tables.

A task is a reference and an injected force. Friction and motor constant are tables over position; floor and injected
force are tables over time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.special import exprel

from friso.engine.arrays import Tables
from friso.equations import motion
from friso.equations.motion import value
from friso.equations.rail import friction_factors
from friso.errors import InputError
from friso.stage import Stage
from friso.stage.rig import QUADRATIC, Floor, ReferenceForm

SAMPLE_TIME = 50e-6
"""Sample time [s] of a drive that states none, as in the thesis (Sec. 3.5.2)."""


@dataclass(frozen=True)
class MoveTask:
    """The task of runs with the real drive: a reference, and an injected force.

    The reference consists of `pieces`, shape (pieces, 1 + inputs): the start of each, then the numbers of its
    polynomial or other `form` (`friso.equations.motion`). For runs with different moves the shape is (runs, pieces,
    1 + inputs). `duration` is in seconds. `injected` has the injected force [N] every `injected_each` [s], shape (n,),
    empty for none, or (runs, n) for runs with different forces; the drive logs it unless it is `unknown` to it. The
    stage starts at rest where the reference does, or displaced from it by `displacement` [m].
    """

    pieces: np.ndarray
    duration: float
    injected: np.ndarray = field(default_factory=lambda: np.zeros(0))
    injected_each: float = 1.0
    unknown: bool = False
    displacement: Any = 0.0
    form: ReferenceForm = QUADRATIC

    @property
    def span(self) -> tuple[float, float]:
        """Return the lowest and highest position of the reference [m]."""
        starts, velocity, acceleration = self.pieces[..., 0], self.pieces[..., 2], self.pieces[..., 3]
        lengths = np.diff(starts, axis=-1, append=self.duration)
        turns = np.divide(-velocity, acceleration, out=np.zeros_like(velocity), where=acceleration != 0)
        times = 0.0 * lengths, lengths, np.clip(turns, 0.0, lengths)
        places = np.stack([value(self.form, self.pieces, time) for time in times])
        begins = self.pieces[..., 0, 1] + self.displacement
        return float(min(places.min(), np.min(begins))), float(max(places.max(), np.max(begins)))

    def of_runs(self, numbers: np.ndarray) -> MoveTask:
        """Return the task restricted to some of the runs, by number."""
        own = self.pieces[numbers] if self.pieces.ndim > 2 else self.pieces
        displacement = self.displacement[numbers] if np.ndim(self.displacement) else self.displacement
        injected = self.injected[numbers] if self.injected.ndim > 1 else self.injected
        return replace(self, pieces=own, displacement=displacement, injected=injected)

    def injected_at(self, times: np.ndarray) -> np.ndarray:
        """Return the injected force [N] at times [s], shape (1 or runs, times): 0 after its end."""
        places = np.arange(self.injected.shape[-1]) * self.injected_each
        return np.array([np.interp(times, places, force, right=0.0) for force in np.atleast_2d(self.injected)])


def own_motion(stage: Stage) -> MoveTask:
    """Return the motion of the stage file, which starts at 0 or at a displacement.

    The reference of a step starts there as well, and jumps after one sample of the drive.
    """
    return motion_task(stage.flat(), 1)


def motion_task(flat: Mapping[str, Any], runs: int) -> MoveTask:
    """Return the motions of stages given as flat keys, each from 0 or from a displacement.

    A reference that begins with a step jumps after one sample of the drive. All `runs` have the longest duration.
    """
    several = motion.varies(flat)
    pieces = motion.pieces(flat, runs if several else 1)
    if pieces[:, 0, 1].any():
        before = np.zeros((len(pieces), 1, pieces.shape[2]))
        pieces[:, :, 0] += np.reshape(flat.get("drive.sample_time", SAMPLE_TIME), (-1, 1))
        pieces = np.concatenate([before, pieces], axis=1)
    displacement, duration = motion.initial_displacement(flat), float(np.max(flat["motion.duration"]))
    return MoveTask(pieces if several else pieces[0], duration, displacement=displacement, form=motion.form_of(flat))


def standing(place: float, duration: float) -> MoveTask:
    """Return the task of standing at a place [m] for a duration [s]."""
    return MoveTask(np.array([[0.0, place, 0.0, 0.0]]), duration)


def staircase(steps: Sequence[float], stands: float) -> MoveTask:
    """Return the task of taking steps [m] in turn from 0.

    The reference stands for a time [s] before and after each step.
    """
    places = np.cumsum([0.0, *steps])
    rows = [[number * stands, place, 0.0, 0.0] for number, place in enumerate(places)]
    return MoveTask(np.array(rows), stands * len(places))


def legs(start: float, parts: Sequence[tuple[float, float]]) -> MoveTask:
    """Return the task of moving at constant velocities [m/s] in turn, each for a time [s].

    `parts` are pairs of velocity and time. The reference begins at `start` [m]; a velocity of 0 is a standstill.
    """
    times = np.cumsum([0.0, *(time for _, time in parts)])
    places = start + np.cumsum([0.0, *(velocity * time for velocity, time in parts)])
    rows = [[t, p, v, 0.0] for t, p, (v, _) in zip(times[:-1], places[:-1], parts, strict=True)]
    return MoveTask(np.array(rows), float(times[-1]))


def point_to_point(places: Sequence[float], acceleration: float, top_speed: float, stands: float) -> MoveTask:
    """Return the task of moving from place to place [m], with a stand [s] after each move.

    Moves accelerate and brake at `acceleration` [m/s^2], and are no faster than `top_speed` [m/s].
    """
    rows, now = [[0.0, places[0], 0.0, 0.0]], stands
    for start, end in pairwise(places):
        travel, sign = abs(end - start), np.sign(end - start)
        ramp = min(top_speed / acceleration, np.sqrt(travel / acceleration))
        speed = acceleration * ramp
        cruise = travel / speed - ramp
        at = start + sign * speed * ramp / 2
        rows += [[now, start, 0.0, sign * acceleration], [now + ramp, at, sign * speed, 0.0]]
        rows += [[now + ramp + cruise, end - sign * speed * ramp / 2, sign * speed, -sign * acceleration]]
        now += 2 * ramp + cruise
        rows.append([now, end, 0.0, 0.0])
        now += stands
    return MoveTask(np.array(rows), now)


def tables(flat: Mapping[str, Any], floor: Floor | None, task: MoveTask, seeds: Sequence[int]) -> Tables:
    """Return friction, motor constant, floor and injected force of runs as tables.

    Stages are given as flat keys to SI numbers or arrays of shape (runs,). `seeds` are the seeds of the runs' noise.
    Friction along a rail has a seed of its own, the stage's "rail.seed". If the runs do not differ, all share one
    table.
    """
    places, grid = _places(flat, task)
    varied = [key for key, value in flat.items() if key.startswith(("rail.", "drive.ripple")) and np.ndim(value)]
    over = [_over_places(_of_run(flat, run), places) for run in (range(len(seeds)) if varied else range(1))]
    times, per_second = _over_time(floor, task, seeds)
    return Tables(np.array(over), grid, times, np.array([per_second]))


def _of_run(flat: Mapping[str, Any], run: int) -> dict[str, Any]:
    return {key: value[run] if np.ndim(value) else value for key, value in flat.items()}


TABLE_MARGIN = 0.01  # [m]
"""Margin of tables beyond the motion. Stages that overshoot further leave the rail."""

TABLE_SHARE = 0.5
"""Margin of tables in long moves, as a fraction of the travel. Stages that overshoot further leave the rail."""

POINTS_PER_LENGTH = 12
"""Table points per correlation length of the rail. Fewer show corners in the rail's friction; tables grow in
proportion."""

POINTS_PER_WAVE = 40
"""Table points per wave. Fewer flatten the ripple by a percent; tables grow in proportion."""


def _places(flat: Mapping[str, Any], task: MoveTask) -> tuple[np.ndarray, np.ndarray]:
    """Return the places [m] at which tables have points, and the grid that they form, (1, 2).

    The places reach beyond the reference on both sides. The grid holds the first place [m] and the points per metre.
    """
    low, high = task.span
    margin = max(TABLE_MARGIN, TABLE_SHARE * (high - low))
    lengths = [np.inf]
    for key, points in (
        ("rail.correlation_length", POINTS_PER_LENGTH),
        ("drive.ripple_pitch", POINTS_PER_WAVE),
    ):
        lengths += [float(np.min(flat[key])) / points] if key in flat else []
    if "rail.rolling_pitch" in flat:
        lengths.append(float(np.min(flat["rail.rolling_pitch"])) / (3 * POINTS_PER_WAVE))
    step = min(lengths)
    count = 2 if step == np.inf else int(np.ceil((high - low + 2 * margin) / step)) + 2
    step = (high - low + 2 * margin) / (count - 1)
    return low - margin + step * np.arange(count), np.array([[low - margin, 1 / step]])


def _over_places(flat: Mapping[str, Any], places: np.ndarray) -> np.ndarray:
    """Return factors of static friction, Coulomb friction and motor constant, shape (3, places)."""
    ripple = 1 + flat.get("drive.ripple", 0.0) * np.cos(2 * np.pi * places / flat.get("drive.ripple_pitch", np.inf))
    return np.array([*friction_factors(flat, places), ripple])


POINTS_PER_PERIOD = 10
"""Points per period of the highest frequency of the floor. Fewer flatten it by some percent."""


def _over_time(floor: Floor | None, task: MoveTask, seeds: Sequence[int]) -> tuple[np.ndarray, float]:
    """Return injected force and floor acceleration over time, shape (runs or 1, 2, points).

    The second result is the number of points per second.
    """
    injected = task.injected.size > 0
    if floor is None and not injected:
        return np.zeros((1, 2, 2)), 0.0
    fine = [task.injected_each] if injected else []
    fine += [1 / (POINTS_PER_PERIOD * floor.frequency[-1])] if floor else []
    interval = min(fine)
    count = int(np.ceil(task.duration / interval)) + 2
    inputs = np.zeros((len(seeds) if floor or task.injected.ndim > 1 else 1, 2, count))
    if injected:
        inputs[:, 0] = task.injected_at(np.arange(count) * interval)
    if floor:
        shaken = {seed: floor_acceleration(floor, count * interval, interval, seed)[:count] for seed in set(seeds)}
        inputs[:, 1] = [shaken[seed] for seed in seeds]
    return inputs, 1 / interval


FLOOR = int.from_bytes(b"floor")
"""Second half of the Philox key for random numbers of the floor's vibration."""


def floor_acceleration(floor: Floor, duration: float, interval: float, seed: int) -> np.ndarray:
    """Return a random acceleration of the floor [m/s^2], shape (n,), every `interval` [s].

    It lasts from 0 to `duration` [s], and is equal for equal `seed`. There is one wave per frequency of the Fourier
    transform. The variance of each wave is that of the spectrum in the band around it, so the total variance does not
    depend on the length of the record. Raises InputError for a spectrum that reaches beyond half the sampling
    frequency.
    """
    highest = floor.frequency[-1]
    if highest * interval > 0.5:
        expected = f"at most {0.5 / interval:g} Hz, half the sampling frequency"
        raise InputError("floor.frequency", f"{highest.text!r}", expected, 'frequency = ["1 Hz", "100 Hz"]')
    count = int(duration / interval * (1 + 1e-12)) + 1
    size = 1 << count.bit_length()
    step = 1 / (size * interval)
    waves = min(int(highest / step + 0.5), (size - 1) // 2) + 1
    edges = np.concatenate([[0.0], (np.arange(waves) + 0.5) * step])
    edges[-1] = max(edges[-1], highest)  # the last wave takes what lies beyond it
    rng = np.random.Generator(np.random.Philox(key=[seed, FLOOR]))
    cosine, sine = rng.standard_normal((2, waves)) * np.sqrt(np.diff(variance_below(floor, edges)))
    spectrum = np.zeros(size // 2 + 1, dtype=complex)
    spectrum[:waves] = (cosine - 1j * sine) / 2
    spectrum[0] = cosine[0]
    return np.fft.irfft(spectrum, size, norm="forward")[:count]


def variance_below(floor: Floor, frequencies: np.ndarray) -> np.ndarray:
    """Return the variance [m^2/s^4] of the floor's acceleration below frequencies [Hz].

    The result has the shape of `frequencies`.
    """
    total = np.zeros(len(frequencies))
    for (low, high), (first, last) in zip(pairwise(floor.frequency), pairwise(floor.acceleration), strict=True):
        slope = 2 * np.log(last / first) / np.log(high / low) + 1
        span = np.log(np.clip(frequencies, low, high) / low)
        total += first**2 * low * span * exprel(slope * span)
    return total
