"""Find force ramps from rest until the body moves off, and read the friction at the start of motion.

A maximum over noise reads high, by up to about sqrt(2 ln n) deviations of n independent values; a smoothed peak reads
low, by the rise of the force within the smoothing. The smoothing minimises the sum of both errors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from friso.identification.logs.log import Log
from friso.identification.readings.common import channel, low_pass, on_bearing
from friso.identification.readings.settings import settings
from friso.identification.readings.slips import slips


@dataclass(frozen=True)
class Ramps:
    """Ramps of the force from rest, each until the body moves off.

    Per ramp, shape (n,), there are time [s], place [m], direction, break-away force [N] in this direction, force rate
    [N/s], the break-away force's error [N] by noise and smoothing to either side, its possible excess [N] if the mass
    is not known, and the body's highest speed [m/s] until break-away. `threshold` [m/s] is the speed at which motion
    counts.
    """

    times: np.ndarray
    places: np.ndarray
    directions: np.ndarray
    forces: np.ndarray
    rates: np.ndarray
    unsure: np.ndarray
    late: np.ndarray
    speeds: np.ndarray
    threshold: float
    notes: tuple[str, ...]


def force_ramps(log: Log, mass: float = 0.0) -> Ramps:
    """Find the ramps of the force in a log, each from rest of the body on the bearing.

    With the moving `mass` [kg], the break-away force is the greatest friction (force minus inertia) as motion begins,
    the published definition. Without, it is the force at which motion becomes visible, which contains inertia. Raises
    InputError for a missing channel.
    """
    force, body = channel(log, "force"), on_bearing(log)
    rows: list[tuple[float, ...]] = []
    cutoff, threshold, quick, stops = settings.low_pass_of_ramps, 0.0, 0, 0
    shortest = max(settings.periods_of_a_ramp / (cutoff * log.sample_time), settings.samples_of_a_ramp)
    for part in log.segments:
        if part.stop - part.start < settings.samples_with_a_ramp:
            continue
        breaks = slips(body[part], log.sample_time, cutoff)
        threshold = max(threshold, breaks.threshold)
        pushed = low_pass(force[part], log.sample_time, cutoff)
        for onset, start, rest, fastest, direction in breaks.starts:
            push = direction * force[part][rest : start + 1]
            if _lowest(push) > settings.force_share_of_a_start * float(direction * pushed[start]) > 0:
                stops += 1
                continue
            begin = rest + _half(push)
            before = pushed[max(rest, start - round(shortest))]
            if start - begin < shortest or direction * (2 * before - pushed[rest] - pushed[start]) < 0:
                quick += 1
                continue
            rising = direction * np.polyfit(np.arange(begin, start) * log.sample_time, pushed[begin:start], 1)[0]
            at, level, unsure, late = onset, float(direction * pushed[onset]), 0.0, 0.0
            if rising > 0:
                # friction opposes the motion, so the force's impulse is at least mass times speed
                heaviest = direction * float(pushed[onset:fastest].sum()) * log.sample_time / abs(breaks.speed[fastest])
                signals = direction * force[part], direction * body[part]
                top = peak(*signals, mass or heaviest, log.sample_time, rising, (begin, start), cutoff)
                if mass:
                    at, level, unsure = top.at, top.level, top.unsure
                else:
                    late = max(level - top.level + top.unsure, 0.0)
            first = part.start + at
            place = float(log.time[first]), float(body[first]), float(direction)
            rows.append((*place, level, float(rising), unsure, late, abs(float(breaks.speed[start]))))
    table = np.array([row for row in rows if row[3] > 0 and row[4] > 0]).reshape(-1, 8).T
    notes = []
    if quick:
        too_fast = f"{quick} ramps rise too fast for a low-pass at {cutoff:g} Hz (or the sampling)"
        notes.append(f"{too_fast} and are left out.")
    if stops:
        notes.append(f"{stops} motions continued after a stop within a ramp and are left out: they began from no rest.")
    if len(rows) > table.shape[1]:
        notes.append(f"{len(rows) - table.shape[1]} motions did not begin under a rising force and are left out.")
    times, places, directions, forces, rates, unsure, late, speeds = table
    return Ramps(times, places, directions, forces, rates, unsure, late, speeds, threshold, tuple(notes))


def _lowest(push: np.ndarray) -> float:
    """Return the smallest smoothed force [N] on a body during its rest before a motion."""
    return float(smoothed(push, len(push) / settings.smoothing_of_a_ramp).min())


def _half(push: np.ndarray) -> int:
    """Return the last sample at which a smoothed force is at most the mean of its end values."""
    smooth = smoothed(push, len(push) / settings.smoothing_of_a_ramp)
    return int(np.flatnonzero(smooth <= (smooth[0] + smooth[-1]) / 2)[-1])


PEAK_LOSS = 2.2
"""Loss of a smoothed peak of a ramp that ends in a sudden fall, in units of its rise R w within one deviation w of the
Gaussian. It holds for a fall by 10 R w (least over k of k Phi(k) + phi(k) + 10 Phi(-k), of the normal distribution;
1.8 for a fall by 5 R w, 2.8 for one by 50); a gradual fall loses less."""

GAUSSIAN_WIDTH = 0.1325
"""Standard deviation of a Gaussian in time, times the frequency at which it halves the power: sqrt(ln 2) / (2 pi)."""


@dataclass(frozen=True)
class Peak:
    """Largest friction in a break-away: its sample, its level [N], and its uncertainty [N]."""

    at: int
    level: float
    unsure: float


def smoothed(values: np.ndarray, width: float) -> np.ndarray:
    """Smooth values, shape (n,), by a Gaussian of `width` samples.

    Beyond its ends, the signal is continued by point reflection about its end values.
    """
    more = min(int(settings.deviations_of_a_kernel * width) + 1, len(values) - 1)
    longer = np.pad(values, more, mode="reflect", reflect_type="odd")
    return gaussian_filter1d(longer, width, truncate=settings.deviations_of_a_kernel)[more : len(longer) - more]


def scatter(values: np.ndarray) -> float:
    """Return the standard deviation of white noise on slow values; 0 for fewer than 3 values.

    The deviation is computed from second differences.
    """
    return float(np.sqrt(np.mean(np.diff(values, 2) ** 2) / 6)) if len(values) > 2 else 0.0


def _second(values: np.ndarray) -> np.ndarray:
    """Return second differences, shape (n,); 0 at the ends."""
    return np.pad(np.diff(values, 2), 1)


def peak(
    force: np.ndarray,
    position: np.ndarray,
    mass: float,
    sample_time: float,
    rising: float,
    marks: tuple[int, int],
    cutoff: float,
) -> Peak:
    """Find the largest friction before a body breaks away.

    Friction is the force [N] minus `mass` [kg] times the second derivative of the position [m], both of shape (n,) and
    positive in the direction of motion. It is searched between two `marks` (indices); the body rests in the first half.
    The force rises at `rising` [N/s]; frequencies above `cutoff` [Hz] are filtered out.
    """
    begin, start = marks
    rest = slice(begin, (begin + start) // 2)
    noise = scatter(force[rest]), mass / sample_time**2 * scatter(position[rest])
    least = max(GAUSSIAN_WIDTH / (cutoff * sample_time), 1.0)
    widths = np.geomspace(least, max(settings.ramp_share_of_a_width * (start - begin), least), settings.widths_tried)
    # deviations of white noise under a Gaussian, and under its second derivative
    left = np.hypot(noise[0] / np.sqrt(2 * np.pi**0.5 * widths), noise[1] * np.sqrt(3 / (8 * np.pi**0.5 * widths**5)))
    high = left * np.sqrt(2 * np.log(1 + (start - begin) / (2 * widths)))
    low = PEAK_LOSS * rising * widths * sample_time
    best = int(np.argmin(high + low))
    width = float(widths[best])
    # second differences of the smoothed signal: the derivative of a truncated Gaussian does not sum to 0
    friction = smoothed(force, width) - mass / sample_time**2 * _second(smoothed(position, width))
    at = begin + int(np.argmax(friction[begin : start + 1]))
    return Peak(at, float(friction[at] + (low[best] - high[best]) / 2), float(low[best] + high[best]) / 2)
