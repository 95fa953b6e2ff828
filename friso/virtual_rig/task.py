"""Define the task of a drive: a reference and an injected force."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from friso.equations import motion
from friso.equations.reference import value
from friso.stage import Stage
from friso.stage.motion import QUADRATIC, ReferenceForm

SAMPLE_TIME = 50e-6
"""Sample time [s] of a drive that states none, as in the thesis (Sec. 3.5.2)."""


@dataclass(frozen=True)
class MoveTask:
    """The task of runs with the real drive: a reference, and an injected force.

    The reference consists of `pieces`, shape (pieces, 1 + inputs): the start of each, then the numbers of its
    polynomial or other `form` (`friso.equations.reference`). For runs with different moves the shape is (runs, pieces,
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
