"""Generate the vibration of the floor over time from its spectrum."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.special import exprel

from friso.errors import InputError
from friso.stage.rig import Floor

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
