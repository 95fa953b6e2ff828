"""Stretches of constant velocity in a log, from which friction is read: force without inertia."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import detrend

from friso.identification.logs.checks import runs
from friso.identification.logs.log import Log
from friso.identification.readings.common import Mean, block_mean, channel, low_pass, on_bearing, rate, robust
from friso.identification.readings.settings import settings


@dataclass(frozen=True)
class Pass:
    """A stretch of constant velocity in a log.

    Fields are the samples (`span`), the mean velocity [m/s], the velocity's standard deviation below and above the
    cut-off, the mean force [N] by blocks, and the mean acceleration [m/s^2].
    """

    span: slice
    velocity: float
    swing: float
    quick_swing: float
    force: Mean
    acceleration: float

    @property
    def steady(self) -> bool:
        """Tell whether the velocity hardly swings, neither slowly nor fast."""
        speed = abs(self.velocity)
        quick = self.quick_swing > settings.quick_swing_of_a_steady_pass * speed
        return self.swing <= settings.swing_of_a_steady_pass * speed and not quick


def passes(log: Log) -> tuple[Pass, ...]:
    """Find all stretches of constant velocity.

    The reference decides where the velocity is constant; without a reference, the body's own motion. Each pass states
    whether its motion was steady. Raises InputError for missing position or force.
    """
    position, velocity = on_bearing(log), _velocity(log)
    channel(log, "force")
    stretches = []
    for part in log.segments:
        if part.stop - part.start < settings.samples_of_a_pass:
            continue
        spans = _of_reference(log, part) if "reference" in log else _of_motion(velocity[part], log.sample_time)
        for steady in spans:
            span = slice(part.start + steady.start, part.start + steady.stop)
            if np.ptp(position[span]) > 0 and velocity[span].mean() != 0:
                stretches.append(_pass(log, span, velocity))
    return tuple(stretches)


def on_common_places(log: Log, stretches: Sequence[Pass]) -> tuple[Pass, ...]:
    """Cut passes to the way that all of them cover, to compare friction at the same places.

    Passes stay uncut if the common way is too short.
    """
    position, velocity = on_bearing(log), _velocity(log)
    covered = [(float(position[single.span].min()), float(position[single.span].max())) for single in stretches]
    low, high = max((span[0] for span in covered), default=0.0), min((span[1] for span in covered), default=0.0)
    if high - low < settings.share_in_common * min((span[1] - span[0] for span in covered), default=np.inf):
        return tuple(stretches)
    cut = []
    for stretch in stretches:
        inside = stretch.span.start + np.flatnonzero((position[stretch.span] >= low) & (position[stretch.span] <= high))
        if len(inside) < settings.samples_in_common:
            return tuple(stretches)
        cut.append(_pass(log, slice(int(inside[0]), int(inside[-1]) + 1), velocity))
    return tuple(cut)


def places_of(log: Log, stretches: Sequence[Pass]) -> tuple[float, float]:
    """Return the lowest and highest position [m] in passes of a log; NaN without any."""
    places = [on_bearing(log)[stretch.span] for stretch in stretches]
    return (min(place.min() for place in places), max(place.max() for place in places)) if places else (np.nan, np.nan)


def _velocity(log: Log) -> np.ndarray:
    """Return the velocity [m/s] of the body on the bearing, (n,); NaN in segments too short."""
    position = on_bearing(log)
    velocity = np.full(len(position), np.nan)
    for part in log.segments:
        if part.stop - part.start >= settings.samples_of_a_pass:
            velocity[part] = rate(position[part], log.sample_time, settings.low_pass_of_passes)
    return velocity


def _of_reference(log: Log, part: slice) -> list[slice]:
    """Find where the reference has constant velocity, without the time of settling.

    `part` are the samples of a segment. Standstill does not count.
    """
    reference = channel(log, "reference")[part]
    velocity = np.gradient(low_pass(reference, log.sample_time, settings.low_pass_of_passes), log.sample_time)
    acceleration = np.abs(np.gradient(velocity, log.sample_time))
    steady = acceleration <= settings.acceleration_of_a_constant_speed * float(acceleration.max())
    moving = np.abs(velocity) > settings.speed_share_of_creeping * float(np.abs(velocity).max())
    return _trimmed(steady & moving, log.sample_time, 0.1)


def _of_motion(velocity: np.ndarray, sample_time: float) -> list[slice]:
    """Find the stretches over which the body itself keeps its velocity.

    The acceleration is within the noise there, or small compared with the largest acceleration and with the velocity. A
    stretch that swings throughout counts as well.
    """
    smooth = low_pass(velocity, sample_time, settings.low_pass_of_passes / 2)
    acceleration, speed = np.abs(np.gradient(smooth, sample_time)), np.abs(smooth)
    noise, top = 5 * robust(np.gradient(smooth, sample_time)), float(speed.max())
    gentle = settings.acceleration_of_a_constant_speed * float(np.percentile(acceleration, 99.5))
    moving = speed > max(settings.speed_share_of_creeping * top, 8 * robust(velocity - smooth))
    kept_velocity = settings.change_of_a_kept_velocity * settings.low_pass_of_passes * speed
    even = moving & (acceleration <= np.maximum(np.minimum(gentle, kept_velocity), noise))
    swinging = moving & (speed > settings.speed_share_of_settling * top) & (acceleration <= max(gentle, noise))
    kept = _trimmed(even, sample_time, 0.0)
    others = _trimmed(swinging, sample_time, 0.0)
    kept += [one for one in others if not any(one.start < other.stop and other.start < one.stop for other in kept)]
    return sorted(kept, key=lambda one: one.start)


def _trimmed(mask: np.ndarray, sample_time: float, share: float) -> list[slice]:
    """Return the stretches of a mask without their ends, as far as they are long enough.

    Both ends are cut by the filter's settling time, and the start by a further fraction, `share`, for the axis to
    settle.
    """
    edge = int(1 / (settings.low_pass_of_passes * sample_time))
    least = max(int(settings.time_of_a_pass / sample_time), settings.samples_of_a_pass)
    stretches = []
    for run in runs(mask):
        begin, end = run.start + edge + int(share * (run.stop - run.start)), run.stop - edge
        if end - begin >= least:
            stretches.append(slice(begin, end))
    return stretches


def _pass(log: Log, span: slice, velocity: np.ndarray) -> Pass:
    """Describe a stretch of constant velocity."""
    went, force = velocity[span], block_mean(channel(log, "force")[span])
    acceleration = float((went[-1] - went[0]) / ((span.stop - span.start - 1) * log.sample_time))
    position = on_bearing(log)
    quick = _quick_swing(position[span], log.sample_time, _digit(position))
    return Pass(span, float(went.mean()), float(went.std()), quick, force, acceleration)


def _digit(position: np.ndarray) -> float:
    """Return the resolution [m] of a position: the smallest step, if all steps are multiples.

    Otherwise, and for a position that never changes, the result is 0.
    """
    steps = np.abs(np.diff(position))
    steps = steps[steps > settings.rounding_of_a_step * steps.max(initial=0.0)]
    if not len(steps):
        return 0.0
    digits = steps / steps.min()
    return float(steps.min()) if np.abs(digits - np.rint(digits)).max() < settings.error_of_whole_digits else 0.0


def _quick_swing(position: np.ndarray, sample_time: float, digit: float) -> float:
    """Return the standard deviation of fast oscillation of the velocity [m/s]; 0 if none shows.

    The oscillation is faster than the low-pass of passes. Only spectral lines clear of the noise count. Motion by less
    than one `digit` [m] of the position does not count.
    """
    window = np.hanning(len(position))
    lines = np.abs(np.fft.rfft(detrend(position) * window)) ** 2 * 2 / (len(position) * np.sum(window**2))
    frequency = np.fft.rfftfreq(len(position), sample_time)
    lobe = 2 / (len(position) * sample_time)  # half a main lobe of the window, to separate the lines
    above = frequency > settings.low_pass_of_passes + lobe
    if not above.any():
        return 0.0
    power = np.where(above & (lines > settings.power_of_a_clear_line * np.median(lines[above])), lines, 0.0)
    if power.sum() < digit**2:
        return 0.0
    return float(np.sqrt(np.sum(power * (2 * np.pi * frequency) ** 2)))
