"""Check signals: repeated stamps, constant, clipped, held or wrapped values, and contradictions between signals."""

from __future__ import annotations

import numpy as np

from friso.errors import LogError
from friso.identification.logs.settings import settings


def runs(mask: np.ndarray) -> list[slice]:
    """Return the stretches over which a mask, shape (n,), is true."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def repeated_stamps(name: str, time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Drop samples that repeat the previous time stamp [s] and value, and count them.

    Raises LogError for decreasing time and for two values at one stamp.
    """
    steps = np.diff(time)
    back = np.flatnonzero(steps < 0)
    if back.size:
        i = int(back[0])
        actual = f"time that decreases, from {time[i]:.9g} s to {time[i + 1]:.9g} s at sample {i + 2}"
        raise LogError(name, actual, "time that increases", "")
    again = np.flatnonzero(steps == 0)
    if again.size == 0:
        return time, values, 0
    other = again[values[again] != values[again + 1]]
    if other.size:
        i = int(other[0])
        actual = f"two values at {time[i]:.9g} s ({values[i]:.6g} and {values[i + 1]:.6g}), at {other.size} instants"
        step = 1e3 * (time[-1] - time[0]) / (len(time) - 1)
        expected = "one value per time stamp; if the stamps are rounded too coarsely, use --dt"
        raise LogError(name, actual, expected, f'--dt "{step:.4g} ms"')
    keep = np.r_[True, steps > 0]
    if keep.sum() < 2:
        raise LogError(name, f"the same time stamp {time[0]:.9g} s throughout", "time that increases", '--dt "1 ms"')
    return time[keep], values[keep], int(again.size)


COUNTER_BITS = 64
"""Largest number of bits of a counter."""


def unwrapped(values: np.ndarray) -> tuple[np.ndarray, int]:
    """Remove the overflow jumps from a counter's values, and return its number of bits.

    Values without overflow are unchanged, with 0 bits. A counter of b bits jumps by nearly 2^b while every other step
    is below 2^b/4. With 2^b added, a jump must be at most twice as large as the other steps, which excludes square
    waves.
    """
    finite = values[np.isfinite(values)]
    if finite.size < 3 or np.any(finite != np.round(finite)) or np.abs(finite).max() > 2.0**COUNTER_BITS:
        return values, 0
    bits = int(np.ceil(np.log2(np.ptp(finite) + 1))) if np.ptp(finite) > 0 else 0
    steps = np.diff(values)
    jumps = np.abs(steps) > 0.75 * 2.0**bits
    small = np.abs(steps[~jumps & np.isfinite(steps)])
    if bits < 8 or not jumps.any() or not 0 < small.max(initial=0.0) <= 0.25 * 2.0**bits:
        return values, 0
    if np.any(2.0**bits - np.abs(steps[jumps]) > 2 * small.max()):
        return values, 0
    turns = np.cumsum(np.r_[0.0, np.where(jumps, -np.sign(np.nan_to_num(steps)), 0.0)])
    return values + 2.0**bits * turns, bits


def constant(name: str, values: np.ndarray) -> bool:
    """Tell whether a signal never changes."""
    return bool(np.ptp(values) == 0)


def rises_evenly(values: np.ndarray) -> bool:
    """Tell whether values rise evenly, as a clock does and no measured motion."""
    steps = np.diff(values)
    return bool(values.size > 2 and steps[0] > 0 and np.allclose(steps, steps[0], rtol=1e-3, atol=0))


def clipped_share(values: np.ndarray) -> float:
    """Return the fraction of samples in flat tops, which show that a signal is clipped.

    A flat top lies at an extreme and has at least 3 equal samples. The signal enters it abruptly (the step before is at
    least a fifth of the largest step), or hardly ever repeats a value elsewhere. A command that switches between two
    values is not clipped.
    """
    steps = np.abs(np.diff(values))
    if values.size < 5 or steps.max() == 0:
        return 0.0
    count, inside = 0, (values[1:] > values.min()) & (values[1:] < values.max())
    repeats = np.count_nonzero(steps[inside] == 0) >= settings.share_of_repeated_values * np.count_nonzero(inside)
    for extreme in (values.max(), values.min()):
        for top in runs(values == extreme):
            kink = top.start >= 2 and steps[top.start - 2] >= 0.2 * steps.max()
            if top.stop - top.start >= 3 and (kink or not repeats):
                count += top.stop - top.start
    return count / values.size


def jumps(values: np.ndarray) -> tuple[float, int]:
    """Return the largest step of a signal, and the sample after it, if the step is a jump.

    A jump is many times larger than nearly all other steps. Returns (0, 0) without one.
    """
    steps = np.diff(values)
    if steps.size < settings.number_of_large_steps:
        return 0.0, 0
    sizes = np.abs(steps)
    largest = int(np.argmax(sizes))
    usual = np.partition(sizes, -settings.number_of_large_steps)[-settings.number_of_large_steps]
    return (float(steps[largest]), largest + 1) if sizes[largest] > settings.ratio_of_a_jump * usual else (0.0, 0)


def samples_held(values: np.ndarray) -> int:
    """Return for how many samples each value is held; 1 if the signal changes at any sample.

    The changes all fall on every n-th sample, n up to 20 (a signal that changes more rarely consists of steps).
    """
    changes = np.flatnonzero(np.diff(values) != 0)
    if changes.size < 50:
        return 1
    gaps = np.diff(changes)
    n = int(np.gcd.reduce(gaps))
    return n if 1 < n <= settings.slowest_sampling else 1


def interpolated(values: np.ndarray) -> int:
    """Return the number of samples on each straight piece of a signal; 1 if it has no such pieces.

    A slower signal that was resampled bends only at every n-th sample, n up to 20.
    """
    bends = np.abs(np.diff(values, 2))
    if bends.size < 50 * settings.slowest_sampling or not bends.any():
        return 1
    for n in range(settings.slowest_sampling, 1, -1):
        whole = bends[: bends.size // n * n].reshape(-1, n)
        alike = whole.sum(axis=0).max() > settings.share_of_all_bends * whole.sum()
        if alike and np.count_nonzero(whole.max(axis=1)) >= 50:
            return n
    return 1


def velocity_factor(
    position: np.ndarray, velocity: np.ndarray, period: float, parts: list[slice]
) -> tuple[float, float]:
    """Return the ratio of measured velocity to the derivative of position, with correlation.

    The ratio is by least squares. Velocity [m/s] and position [m] are sampled every `period` [s], with gaps between
    `parts`, and smoothed over 11 samples. Returns NaN and 0 if nothing can be compared.
    """
    from scipy.signal import savgol_filter

    window = 11
    long = [part for part in parts if part.stop - part.start > 2 * window]
    if not long:
        return np.nan, 0.0
    slope = np.concatenate([np.asarray(savgol_filter(position[p], window, 2, deriv=1, delta=period)) for p in long])
    speed = np.concatenate([np.asarray(savgol_filter(velocity[p], window, 2)) for p in long])
    power, size = float(slope @ slope), float(np.sqrt((slope @ slope) * (speed @ speed)))
    return (float(speed @ slope) / power, float(speed @ slope) / size) if size > 0 else (np.nan, 0.0)


_FACTORS = {
    1e3: "mm against m",
    1e-3: "m against mm",
    1e6: "um against m",
    60.0: "per minute",
    1 / 60: "per minute",
    2 * np.pi: "rad against turns",
    180 / np.pi: "deg against rad",
    np.pi / 180: "rad against deg",
    -1.0: "the sign",
}
"""Usual mistakes: the ratio of velocity to the derivative of position, and the units that explain it."""


def velocity_warning(position: np.ndarray, velocity: np.ndarray, period: float, parts: list[slice]) -> str:
    """Return a warning if velocity [m/s] and derivative of position [m] contradict each other.

    Returns "" if they agree. Both are sampled every `period` [s], with gaps between `parts`. The warning names the
    likely cause, such as counts for metres, if the ratio is a usual one.
    """
    ratio, correlation = velocity_factor(position, velocity, period, parts)
    if abs(correlation) < 0.8:
        return (
            f"velocity does not follow the derivative of position (correlation {correlation:.2f}): one of them is "
            "wrong, delayed, or belongs to another body"
        )
    if abs(ratio - 1) < 0.05:
        return ""
    guess = next((text for at, text in _FACTORS.items() if abs(ratio / at - 1) < 0.05), "wrong units or counts")
    return (
        f"velocity is {ratio:.4g} times the derivative of position ({guess}); if position is right: "
        f'--scale velocity="{1 / ratio:.6g} ..." or the right --unit'
    )
