"""Stretches of constant velocity in a log, from which friction is read: force without inertia."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from friso.identify.experiments.common import Mean, block_mean, channel, low_pass, on_bearing, rate, robust, runs
from friso.identify.logs.log import Log

CUTOFF = 25.0
"""Low-pass of the velocity [Hz] by which constant stretches are found."""

LEAST = 0.1
"""Shortest stretch [s], and at least 40 samples."""

STEADY = 0.3
"""Standard deviation of the velocity over its mean from which a motion is not steady: it hunts, sticks or swings."""

CORNER = 0.02
"""Share of the largest acceleration of the reference below which its velocity is constant."""


@dataclass(frozen=True)
class Pass:
    """A stretch of constant velocity: where it is in the log, mean velocity [m/s] and its standard deviation, the mean
    force [N] by blocks, and the mean acceleration [m/s^2]."""

    span: slice
    velocity: float
    unsteady: float
    force: Mean
    acceleration: float

    @property
    def steady(self) -> bool:
        return self.unsteady <= STEADY * abs(self.velocity)


def passes(log: Log, cutoff: float = CUTOFF) -> tuple[Pass, ...]:
    """All stretches over which the reference, or the body itself where there is none, goes at constant velocity.

    With a reference the motion may be unsteady, which each tells. Raises StageError for missing position or force.
    """
    position, force = on_bearing(log), channel(log, "force")
    found = []
    for part in log.segments:
        if part.stop - part.start < 40:
            continue
        velocity = rate(position[part], log.sample_time, cutoff)
        spans = (
            _of_reference(log, part, cutoff) if "reference" in log else _of_motion(velocity, log.sample_time, cutoff)
        )
        for each in spans:
            if np.ptp(position[part][each]) > 0 and velocity[each].mean() != 0:
                found.append(_pass(part.start, each, velocity, force[part], log.sample_time))
    return tuple(found)


def _of_reference(log: Log, part: slice, cutoff: float) -> list[slice]:
    """Where the reference moves at one velocity, less what the axis takes to settle on it."""
    reference = channel(log, "reference")[part]
    velocity = np.gradient(low_pass(reference, log.sample_time, cutoff), log.sample_time)
    acceleration = np.abs(np.gradient(velocity, log.sample_time))
    steady = acceleration <= CORNER * float(acceleration.max())
    moving = np.abs(velocity) > 1e-3 * float(np.abs(velocity).max())
    return _trimmed(steady & moving, log.sample_time, cutoff, 0.1)


def _of_motion(velocity: np.ndarray, sample_time: float, cutoff: float) -> list[slice]:
    """Where the body itself keeps its velocity: its acceleration is within the noise, or small against the largest."""
    smooth = low_pass(velocity, sample_time, cutoff / 2)
    acceleration = np.gradient(smooth, sample_time)
    limit = max(CORNER * float(np.percentile(np.abs(acceleration), 99.5)), 5 * robust(acceleration))
    moving = np.abs(smooth) > max(0.01 * float(np.abs(smooth).max()), 8 * robust(velocity - smooth))
    return _trimmed((np.abs(acceleration) <= limit) & moving, sample_time, cutoff, 0.0)


def _trimmed(mask: np.ndarray, sample_time: float, cutoff: float, share: float) -> list[slice]:
    """The stretches of a mask without their ends: what the filter smears, and a share of the start to settle."""
    edge, least = int(1 / (cutoff * sample_time)), max(int(LEAST / sample_time), 40)
    found = []
    for each in runs(mask):
        begin, end = each.start + edge + int(share * (each.stop - each.start)), each.stop - edge
        if end - begin >= least:
            found.append(slice(begin, end))
    return found


def _pass(first: int, each: slice, velocity: np.ndarray, force: np.ndarray, sample_time: float) -> Pass:
    went = velocity[each]
    acceleration = float((went[-1] - went[0]) / ((each.stop - each.start - 1) * sample_time))
    span = slice(first + each.start, first + each.stop)
    return Pass(span, float(went.mean()), float(went.std()), block_mean(force[each]), acceleration)
