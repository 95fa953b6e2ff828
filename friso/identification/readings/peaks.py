"""Find the largest friction before break-away in a noisy force, with its uncertainty.

A maximum over noise reads high, by up to about sqrt(2 ln n) deviations of n independent values; a smoothed peak reads
low, by the rise of the force within the smoothing. The smoothing minimises the sum of both errors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from friso.identification.readings.settings import settings

LOSS = 2.2
"""Loss of a smoothed peak of a ramp that ends in a sudden fall, in units of its rise R w within one deviation w of the
Gaussian. It holds for a fall by 10 R w (least over k of k Phi(k) + phi(k) + 10 Phi(-k), of the normal distribution;
1.8 for a fall by 5 R w, 2.8 for one by 50); a gradual fall loses less."""

GAUSSIAN = 0.1325
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
    least = max(GAUSSIAN / (cutoff * sample_time), 1.0)
    widths = np.geomspace(least, max(settings.ramp_share_of_a_width * (start - begin), least), settings.widths_tried)
    # deviations of white noise under a Gaussian, and under its second derivative
    left = np.hypot(noise[0] / np.sqrt(2 * np.pi**0.5 * widths), noise[1] * np.sqrt(3 / (8 * np.pi**0.5 * widths**5)))
    high = left * np.sqrt(2 * np.log(1 + (start - begin) / (2 * widths)))
    low = LOSS * rising * widths * sample_time
    best = int(np.argmin(high + low))
    width = float(widths[best])
    # second differences of the smoothed signal: the derivative of a truncated Gaussian does not sum to 0
    friction = smoothed(force, width) - mass / sample_time**2 * _second(smoothed(position, width))
    at = begin + int(np.argmax(friction[begin : start + 1]))
    return Peak(at, float(friction[at] + (low[best] - high[best]) / 2), float(low[best] + high[best]) / 2)
