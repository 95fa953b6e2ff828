"""Check signals: repeated stamps, constant, clipped, held or wrapped values, contradictions and delays between signals.

A delay is reported with its interval, never applied.
"""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from friso.errors import LogError


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
        step = 1e3 * _step_of_rounded(time)
        expected = "one value per time stamp; if the stamps are rounded too coarsely, use --dt"
        raise LogError(name, actual, expected, f'--dt "{step:.4g} ms"')
    keep = np.r_[True, steps > 0]
    if keep.sum() < 2:
        raise LogError(name, f"the same time stamp {time[0]:.9g} s throughout", "time that increases", '--dt "1 ms"')
    return time[keep], values[keep], int(again.size)


def _step_of_rounded(time: np.ndarray) -> float:
    """Return the likely step [s] between samples whose stamps are rounded, from how many share a stamp.

    The first and the last stamp may be of few samples.
    """
    stamps, counts = np.unique(time, return_counts=True)
    if stamps.size < 4:
        return float(time[-1] - time[0]) / (len(time) - 1)
    return float(stamps[-1] - stamps[1]) / float(counts[1:-1].sum())


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


SHARE_OF_REPEATED_VALUES = 0.01
"""Fraction of repeated values up to which a signal hardly ever repeats a value."""


def clipped_share(values: np.ndarray) -> float:
    """Return the fraction of samples in flat tops, which show that a signal is clipped.

    A flat top lies at an extreme and has at least 3 equal samples. One at either end of a record may be a rest: it
    counts beside others only. The signal enters it abruptly (the step before is at least a fifth of the largest step),
    or hardly ever repeats a value elsewhere. A command that switches between two values is not clipped.
    """
    steps = np.abs(np.diff(values))
    if values.size < 5 or steps.max() == 0:
        return 0.0
    count, inside = 0, (values[1:] > values.min()) & (values[1:] < values.max())
    repeats = np.count_nonzero(steps[inside] == 0) >= SHARE_OF_REPEATED_VALUES * np.count_nonzero(inside)
    for extreme in (values.max(), values.min()):
        tops = [top for top in runs(values == extreme) if top.stop - top.start >= 3]
        flat = [top for top in tops if not repeats or (top.start >= 2 and steps[top.start - 2] >= 0.2 * steps.max())]
        if any(top.start > 0 and top.stop < values.size for top in flat):
            count += sum(top.stop - top.start for top in flat)
    return count / values.size


SAMPLES_OF_A_SIGNAL = 100
"""Fewest samples of which one can say that some are none."""

SHARE_OF_ABSENT_VALUES = 0.2
"""Largest fraction of a signal that may stand for no value. With more, it is a signal."""

GAP_OF_ABSENT_VALUES = 3.0
"""Least distance of a number that stands for no value from all others, over their range."""

_STANDS_FOR_NONE = re.compile(r"-?9{2,}(\.0|\.25|\.9+)?")
"""Numbers that instruments write where they have no value: -9999, -999.25."""


@np.errstate(over="ignore", invalid="ignore")
def absent(values: np.ndarray) -> float | None:
    """Return the number in a signal that stands for no value, such as -9999; None without one."""
    finite = values[np.isfinite(values)]
    if finite.size < SAMPLES_OF_A_SIGNAL:
        return None
    for number in {float(finite.min()), float(finite.max())}:
        others = finite[finite != number]
        few = 0 < finite.size - others.size <= SHARE_OF_ABSENT_VALUES * finite.size
        far = few and np.abs(others - number).min() > GAP_OF_ABSENT_VALUES * np.ptp(others)
        if far and _STANDS_FOR_NONE.fullmatch(repr(number)):
            return number
    return None


LONGEST_DROPOUT, SHARE_OF_DROPOUTS = 50, 0.01
"""Most samples of a dropout, and the largest fraction of a signal in dropouts."""

STEP_OF_A_DROPOUT = 10.0
"""Least step into a dropout and out of it, over the largest of 99 % of all steps."""


@np.errstate(over="ignore", invalid="ignore")  # huge values are no dropouts
def dropouts(values: np.ndarray) -> np.ndarray:
    """Return which values of a signal, (n,), are dropouts: short zeros between alike values far from zero."""
    lost = np.zeros(values.size, bool)
    steps = np.abs(np.diff(values))
    if values.size < SAMPLES_OF_A_SIGNAL or not np.isfinite(steps).any():
        return lost
    usual = float(np.nanquantile(steps, 0.99))
    for zeros in runs(values == 0.0):
        before, after = zeros.start - 1, zeros.stop
        if before < 0 or after >= values.size or zeros.stop - zeros.start > LONGEST_DROPOUT:
            continue
        low, high = sorted(np.abs(values[[before, after]]))
        alike = values[before] * values[after] > 0 and high - low <= 0.5 * low
        lost[zeros] = alike and low > STEP_OF_A_DROPOUT * usual
    return lost if lost.mean() <= SHARE_OF_DROPOUTS else np.zeros(values.size, bool)


NUMBER_OF_LARGE_STEPS = 20
"""Rank, by size, of the step with which a jump is compared. Larger steps may be jumps themselves."""

RATIO_OF_A_JUMP = 10.0
"""Ratio of a step to the twentieth largest above which it is a jump, not motion."""


def jumps(values: np.ndarray) -> tuple[float, int]:
    """Return the largest step of a signal, and the sample after it, if the step is a jump.

    A jump is many times larger than nearly all other steps. Returns (0, 0) without one.
    """
    steps = np.diff(values)
    if steps.size < NUMBER_OF_LARGE_STEPS:
        return 0.0, 0
    sizes = np.abs(steps)
    largest = int(np.argmax(sizes))
    usual = np.partition(sizes, -NUMBER_OF_LARGE_STEPS)[-NUMBER_OF_LARGE_STEPS]
    return (float(steps[largest]), largest + 1) if sizes[largest] > RATIO_OF_A_JUMP * usual else (0.0, 0)


SLOWEST_SAMPLING = 20
"""Largest number of samples for which a slower signal is held. Beyond it the signal consists of steps."""


def samples_held(values: np.ndarray) -> int:
    """Return for how many samples each value is held; 1 if the signal changes at any sample.

    The changes all fall on every n-th sample, n up to 20 (a signal that changes more rarely consists of steps).
    """
    changes = np.flatnonzero(np.diff(values) != 0)
    if changes.size < 50:
        return 1
    gaps = np.diff(changes)
    n = int(np.gcd.reduce(gaps))
    return n if 1 < n <= SLOWEST_SAMPLING else 1


SHARE_OF_ALL_BENDS = 0.999
"""Fraction of a signal's bends that must fall on a grid for it to count as interpolated. The rest is rounding."""


def interpolated(values: np.ndarray) -> int:
    """Return the number of samples on each straight piece of a signal; 1 if it has no such pieces.

    A slower signal that was resampled bends only at every n-th sample, n up to 20.
    """
    bends = np.abs(np.diff(values, 2))
    if bends.size < 50 * SLOWEST_SAMPLING or not bends.any():
        return 1
    for n in range(SLOWEST_SAMPLING, 1, -1):
        whole = bends[: bends.size // n * n].reshape(-1, n)
        alike = whole.sum(axis=0).max() > SHARE_OF_ALL_BENDS * whole.sum()
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


def velocity_line(position: np.ndarray, velocity: np.ndarray, period: float, parts: list[slice]) -> str:
    """Report the delay of the velocity [m/s] behind the derivative of position [m], "" for none.

    Both signals are sampled every `period` [s]; the longest of `parts` is used.
    """
    part = max(parts, key=lambda span: span.stop - span.start)
    slope, speed = _smoothed(position[part], 1, period), _smoothed(velocity[part], 0, period)
    estimate = in_blocks(lambda a, b: lag(slope[a:b], speed[a:b]), slope.size)
    return _line("velocity", "the derivative of position", estimate, period)


def force_line(position: np.ndarray, force: np.ndarray, period: float, parts: list[slice]) -> str:
    """Report the delay of the motion [m] behind the force [N]; "" for none.

    Both are sampled every `period` [s]. For each lag the force is fitted by acceleration, velocity, its sign, position
    and a constant, because with acceleration alone friction or a spring would look like a delay. The lag with the
    smallest residual counts.
    """
    part = max(parts, key=lambda span: span.stop - span.start)
    place, velocity, acceleration = (_smoothed(position[part], order, period) for order in (0, 1, 2))
    push = _smoothed(force[part], 0, period)
    sign = np.sign(velocity) * (np.abs(velocity) > 0.01 * np.abs(velocity).max())
    causes = np.stack([acceleration, velocity, sign, place - place.mean(), np.ones_like(push)], axis=1)
    return _line("motion", "the force", in_blocks(lambda a, b: _clear_lag(push[a:b], causes[a:b]), push.size), period)


LONGEST_DELAY_SAMPLES = 20
"""Longest delay that is searched, in samples. Longer delays do not come from instruments."""


def lag(first: np.ndarray, second: np.ndarray) -> float:
    """Return by how many samples the second signal lags behind the first.

    The lag is at the peak of the cross-correlation, interpolated by a parabola; NaN if the peak is below 0.5 or at a
    border of the search.
    """
    longest = LONGEST_DELAY_SAMPLES
    first, second = first - first.mean(), second - second.mean()
    middle = first[longest:-longest]
    products = np.array([middle @ second[k : second.size - 2 * longest + k] for k in range(2 * longest + 1)])
    norm = np.sqrt((middle @ middle) * (second @ second))
    return _peak(products / norm) if norm > 0 else np.nan


SHARE_LEFT_BY_A_DELAY = 1 / 3
"""Largest ratio of the residuals with and without a delay. Sticking looks like a delay too, but leaves half."""


def _clear_lag(effect: np.ndarray, causes: np.ndarray) -> float:
    """Return the lag [samples] with which causes explain an effect best; NaN if it is unclear.

    The lag is unclear if a lag of 0 explains almost as much.
    """
    shares = _explained(effect, causes)
    none = 1 - shares[LONGEST_DELAY_SAMPLES]
    return _peak(shares) if 1 - shares.max() < SHARE_LEFT_BY_A_DELAY * none else np.nan


def _explained(effect: np.ndarray, causes: np.ndarray) -> np.ndarray:
    """Return the fraction of an effect that its causes explain, for each lag of the search.

    The effect has the shape (n,); lags run from the longest negative to the longest positive one.
    """
    longest = LONGEST_DELAY_SAMPLES
    middle = effect[longest:-longest] - effect[longest:-longest].mean()
    energy = middle @ middle
    causes = causes / np.maximum(np.abs(causes).max(axis=0), np.finfo(float).tiny)
    shares = []
    for k in range(2 * longest + 1):
        shifted = causes[k : effect.size - 2 * longest + k]
        fit = np.linalg.lstsq(shifted.T @ shifted, shifted.T @ middle, rcond=None)[0]
        shares.append(float(fit @ (shifted.T @ middle)) / energy if energy > 0 else 0.0)
    return np.array(shares)


def _peak(heights: np.ndarray) -> float:
    """Return the lag [samples] of the highest value, by a parabola through three values.

    `heights` are values over all lags of the search. NaN if the peak is low or at a border.
    """
    i = int(np.argmax(heights))
    if heights[i] < 0.5 or i in (0, heights.size - 1):
        return np.nan
    left, top, right = heights[i - 1 : i + 2]
    curve = left - 2 * top + right
    return i - LONGEST_DELAY_SAMPLES + (0.5 * (left - right) / curve if curve < 0 else 0.0)


BLOCKS_OF_A_DELAY = 8
"""Number of parts of a record whose separate estimates give the interval of a delay."""

SAMPLES_OF_A_BLOCK = 16384
"""Largest number of samples of a part of a record for its delay. Longer ones take seconds and change nothing."""


def in_blocks(estimate: Callable[[int, int], float], size: int) -> tuple[float, float]:
    """Return the mean estimate over blocks of a record and half of its 95 % interval (Student).

    Of long blocks only the beginning counts. `estimate` takes the first and the last sample of a block, of a record of
    `size` samples. Both results are NaN for a short record, or if fewer than half of the blocks have an estimate.
    """
    from scipy.stats import t as student

    length = size // BLOCKS_OF_A_DELAY
    if length < 10 * LONGEST_DELAY_SAMPLES:
        return np.nan, np.nan
    reach = min(length, SAMPLES_OF_A_BLOCK)
    delays = np.array([estimate(k * length, k * length + reach) for k in range(BLOCKS_OF_A_DELAY)])
    delays = delays[np.isfinite(delays)]
    if delays.size < BLOCKS_OF_A_DELAY / 2:
        return np.nan, np.nan
    half = student.ppf(0.975, delays.size - 1) * np.std(delays, ddof=1) / np.sqrt(delays.size)
    return float(delays.mean()), float(half)


SHORTEST_DELAY_SAMPLES = 0.25
"""Shortest delay that is reported, in samples. Smoothing of derivatives hides shorter delays."""


def _line(late: str, early: str, estimate: tuple[float, float], period: float) -> str:
    """Write an estimated delay, given in samples of `period` [s], of one signal behind another.

    `late` and `early` are their names; a negative delay exchanges them. Returns "" if the motion does not show a delay.
    A delay does not show if its interval contains 0, if it is below a quarter of a sample, or if blocks differ by
    samples.
    """
    value, half = estimate
    if not np.isfinite(value) or abs(value) <= max(half, SHORTEST_DELAY_SAMPLES) or half > 1:
        return ""
    late, early = (late, early) if value > 0 else (early, late)
    size = f"{abs(value) * period * 1e3:.3g} ms +/- {half * period * 1e3:.2g} ms (95 %)"
    after = f"{late} seems to come after {early} by {size}"
    return f"{after}: a delay between two instruments looks like this; not corrected"


SAMPLES_OF_A_DERIVATIVE = 11
"""Number of samples over which derivatives are smoothed (Savitzky-Golay, without delay)."""


def _smoothed(values: np.ndarray, order: int, period: float) -> np.ndarray:
    """Return the smoothed derivative of an `order`, without its distorted ends.

    Values are sampled every `period` [s]; fewer than the filter needs are returned as they are.
    """
    from scipy.signal import savgol_filter

    window = SAMPLES_OF_A_DERIVATIVE
    if values.size <= 2 * window:
        return values
    return np.asarray(savgol_filter(values, window, 3, deriv=order, delta=period))[window:-window]
