"""Stretches of constant velocity in a log, from which friction is read: force without inertia."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import detrend

from friso.identification.logs.log import Log
from friso.identification.readings.common import Mean, block_mean, channel, low_pass, on_bearing, rate, robust, runs

CUTOFF = 25.0
"""Low-pass of the velocity [Hz] by which constant stretches are found."""

LEAST, LEAST_SAMPLES = 0.1, 40
"""Shortest stretch, in seconds and in samples."""

STEADY, QUICK = 0.3, 0.02
"""Standard deviation of the velocity over its mean from which a motion is not steady: it sticks and slips, or
oscillates; the second holds for swings quicker than the cutoff that stand clear of noise, and is so small since a swing
above half the sampling rate looks slower than it is: one of 940 Hz, sampled at 1 kHz, like one of a seventeenth of its
velocity."""

ROUNDING, NEAR_INTEGER = 1e-6, 0.1
"""Share of the largest step of a position up to which steps are rounding of numbers, and how far those in digits may
be from whole numbers."""

CLEAR = 20.0
"""Power over the median from which a line of a spectrum is no noise."""

LEAST_COMMON, COMMON = 16, 0.5
"""Samples of each pass on the way that all of them share, and the share of this in the way of the shortest, from which
it is enough."""

SETTLED = 0.1
"""Share of its velocity by which a body that keeps it changes it within a period of the cutoff: at slow speeds a share
of the largest acceleration would take a start for a stretch."""

SLOWEST, SWINGING = 1e-4, 1e-3
"""Shares of the greatest speed of a log below which a body creeps, or settles where it does not keep its velocity: no
speed that was asked for (our choice)."""

CORNER = 0.02
"""Share of the largest acceleration of the reference below which its velocity is constant."""


@dataclass(frozen=True)
class Pass:
    """A stretch of constant velocity: where it is in the log, mean velocity [m/s] and its standard deviation, below and
    above the cutoff, the mean force [N] by blocks, and the mean acceleration [m/s^2]."""

    span: slice
    velocity: float
    swing: float
    quick_swing: float
    force: Mean
    acceleration: float

    @property
    def steady(self) -> bool:
        return self.swing <= STEADY * abs(self.velocity) and self.quick_swing <= QUICK * abs(self.velocity)


def passes(log: Log, cutoff: float = CUTOFF) -> tuple[Pass, ...]:
    """All stretches over which the reference, or the body itself where there is none, goes at constant velocity.

    With a reference the motion may be unsteady, which each states; `cutoff` [Hz] is that of the velocity. Raises
    InputError for missing position or force.
    """
    position, velocity = on_bearing(log), _velocity(log, cutoff)
    channel(log, "force")
    stretches = []
    for part in log.segments:
        if part.stop - part.start < LEAST_SAMPLES:
            continue
        if "reference" in log:
            spans = _of_reference(log, part, cutoff)
        else:
            spans = _of_motion(velocity[part], log.sample_time, cutoff)
        for steady in spans:
            span = slice(part.start + steady.start, part.start + steady.stop)
            if np.ptp(position[span]) > 0 and velocity[span].mean() != 0:
                stretches.append(_pass(log, span, velocity, cutoff))
    return tuple(stretches)


def on_common_places(log: Log, stretches: Sequence[Pass], cutoff: float = CUTOFF) -> tuple[Pass, ...]:
    """Passes of a log, each cut to the way that all of them go, where friction is that of the same places; as they are
    where that is too little. `cutoff` [Hz] is that of the velocity."""
    position, velocity = on_bearing(log), _velocity(log, cutoff)
    covered = [(float(position[single.span].min()), float(position[single.span].max())) for single in stretches]
    low, high = max((span[0] for span in covered), default=0.0), min((span[1] for span in covered), default=0.0)
    if high - low < COMMON * min((span[1] - span[0] for span in covered), default=np.inf):
        return tuple(stretches)
    cut = []
    for stretch in stretches:
        inside = stretch.span.start + np.flatnonzero((position[stretch.span] >= low) & (position[stretch.span] <= high))
        if len(inside) < LEAST_COMMON:
            return tuple(stretches)
        cut.append(_pass(log, slice(int(inside[0]), int(inside[-1]) + 1), velocity, cutoff))
    return tuple(cut)


def places_of(log: Log, stretches: Sequence[Pass]) -> tuple[float, float]:
    """The lowest and highest position [m] in passes of a log; NaN without any."""
    places = [on_bearing(log)[stretch.span] for stretch in stretches]
    return (min(place.min() for place in places), max(place.max() for place in places)) if places else (np.nan, np.nan)


def _velocity(log: Log, cutoff: float) -> np.ndarray:
    """Velocity [m/s] of the body on the bearing, shape (n,); NaN in segments that are too short."""
    position = on_bearing(log)
    velocity = np.full(len(position), np.nan)
    for part in log.segments:
        if part.stop - part.start >= LEAST_SAMPLES:
            velocity[part] = rate(position[part], log.sample_time, cutoff)
    return velocity


def _of_reference(log: Log, part: slice, cutoff: float) -> list[slice]:
    """Where the reference moves at one velocity, less what the axis takes to settle on it."""
    reference = channel(log, "reference")[part]
    velocity = np.gradient(low_pass(reference, log.sample_time, cutoff), log.sample_time)
    acceleration = np.abs(np.gradient(velocity, log.sample_time))
    steady = acceleration <= CORNER * float(acceleration.max())
    moving = np.abs(velocity) > SLOWEST * float(np.abs(velocity).max())
    return _trimmed(steady & moving, log.sample_time, cutoff, 0.1)


def _of_motion(velocity: np.ndarray, sample_time: float, cutoff: float) -> list[slice]:
    """Where the body itself keeps its velocity: its acceleration is within the noise, or small against the largest and
    its velocity. Where none of a stretch does the latter it swings, and is no less a stretch."""
    smooth = low_pass(velocity, sample_time, cutoff / 2)
    acceleration, speed = np.abs(np.gradient(smooth, sample_time)), np.abs(smooth)
    noise, top = 5 * robust(np.gradient(smooth, sample_time)), float(speed.max())
    gentle = CORNER * float(np.percentile(acceleration, 99.5))
    moving = speed > max(SLOWEST * top, 8 * robust(velocity - smooth))
    even = moving & (acceleration <= np.maximum(np.minimum(gentle, SETTLED * cutoff * speed), noise))
    swinging = moving & (speed > SWINGING * top) & (acceleration <= max(gentle, noise))
    kept = _trimmed(even, sample_time, cutoff, 0.0)
    others = _trimmed(swinging, sample_time, cutoff, 0.0)
    kept += [one for one in others if not any(one.start < other.stop and other.start < one.stop for other in kept)]
    return sorted(kept, key=lambda one: one.start)


def _trimmed(mask: np.ndarray, sample_time: float, cutoff: float, share: float) -> list[slice]:
    """The stretches of a mask without their ends: what the filter smears, and a share of the start to settle."""
    edge, least = int(1 / (cutoff * sample_time)), max(int(LEAST / sample_time), LEAST_SAMPLES)
    stretches = []
    for run in runs(mask):
        begin, end = run.start + edge + int(share * (run.stop - run.start)), run.stop - edge
        if end - begin >= least:
            stretches.append(slice(begin, end))
    return stretches


def _pass(log: Log, span: slice, velocity: np.ndarray, cutoff: float) -> Pass:
    went, force = velocity[span], block_mean(channel(log, "force")[span])
    acceleration = float((went[-1] - went[0]) / ((span.stop - span.start - 1) * log.sample_time))
    position = on_bearing(log)
    quick = _quick_swing(position[span], log.sample_time, cutoff, _digit(position))
    return Pass(span, float(went.mean()), float(went.std()), quick, force, acceleration)


def _digit(position: np.ndarray) -> float:
    """The digit [m] of which all steps of a position are whole numbers; 0 if there is none."""
    steps = np.abs(np.diff(position))
    steps = steps[steps > ROUNDING * steps.max(initial=0.0)]
    if not len(steps):
        return 0.0
    digits = steps / steps.min()
    return float(steps.min()) if np.abs(digits - np.rint(digits)).max() < NEAR_INTEGER else 0.0


def _quick_swing(position: np.ndarray, sample_time: float, cutoff: float, digit: float) -> float:
    """Standard deviation of the velocity [m/s] in the lines of its spectrum above the cutoff [Hz] that stand clear of
    noise: a stage that swings quickly goes smoothly for the filter. What is less than a digit [m] is no motion."""
    window = np.hanning(len(position))
    lines = np.abs(np.fft.rfft(detrend(position) * window)) ** 2 * 2 / (len(position) * np.sum(window**2))
    frequency = np.fft.rfftfreq(len(position), sample_time)
    above = frequency > cutoff + 2 / (len(position) * sample_time)  # by half a main lobe of the window
    if not above.any():
        return 0.0
    power = np.where(above & (lines > CLEAR * np.median(lines[above])), lines, 0.0)
    if power.sum() < digit**2:
        return 0.0
    return float(np.sqrt(np.sum(power * (2 * np.pi * frequency) ** 2)))
