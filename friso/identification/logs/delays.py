"""Estimate the delay between two instruments with an interval; the delay is reported, never applied."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from friso.identification.logs.settings import settings


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


def lag(first: np.ndarray, second: np.ndarray) -> float:
    """Return by how many samples the second signal lags behind the first.

    The lag is at the peak of the cross-correlation, interpolated by a parabola; NaN if the peak is below 0.5 or at a
    border of the search.
    """
    longest = settings.longest_delay_samples
    first, second = first - first.mean(), second - second.mean()
    middle = first[longest:-longest]
    products = np.array([middle @ second[k : second.size - 2 * longest + k] for k in range(2 * longest + 1)])
    norm = np.sqrt((middle @ middle) * (second @ second))
    return _peak(products / norm) if norm > 0 else np.nan


def _clear_lag(effect: np.ndarray, causes: np.ndarray) -> float:
    """Return the lag [samples] with which causes explain an effect best; NaN if it is unclear.

    The lag is unclear if a lag of 0 explains almost as much.
    """
    shares = _explained(effect, causes)
    none = 1 - shares[settings.longest_delay_samples]
    return _peak(shares) if 1 - shares.max() < settings.share_left_by_a_delay * none else np.nan


def _explained(effect: np.ndarray, causes: np.ndarray) -> np.ndarray:
    """Return the fraction of an effect that its causes explain, for each lag of the search.

    The effect has the shape (n,); lags run from the longest negative to the longest positive one.
    """
    longest = settings.longest_delay_samples
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
    return i - settings.longest_delay_samples + (0.5 * (left - right) / curve if curve < 0 else 0.0)


def in_blocks(estimate: Callable[[int, int], float], size: int) -> tuple[float, float]:
    """Return the mean estimate over blocks of a record and half of its 95 % interval (Student).

    `estimate` takes the first and the last sample of a block, of a record of `size` samples. Both results are NaN for a
    short record, or if fewer than half of the blocks have an estimate.
    """
    from scipy.stats import t as student

    length = size // settings.blocks_of_a_delay
    if length < 10 * settings.longest_delay_samples:
        return np.nan, np.nan
    delays = np.array([estimate(k * length, (k + 1) * length) for k in range(settings.blocks_of_a_delay)])
    delays = delays[np.isfinite(delays)]
    if delays.size < settings.blocks_of_a_delay / 2:
        return np.nan, np.nan
    half = student.ppf(0.975, delays.size - 1) * np.std(delays, ddof=1) / np.sqrt(delays.size)
    return float(delays.mean()), float(half)


def _line(late: str, early: str, estimate: tuple[float, float], period: float) -> str:
    """Write an estimated delay, given in samples of `period` [s], of one signal behind another.

    `late` and `early` are their names; a negative delay exchanges them. Returns "" if the motion does not show a delay.
    A delay does not show if its interval contains 0, if it is below a quarter of a sample, or if blocks differ by
    samples.
    """
    value, half = estimate
    if not np.isfinite(value) or abs(value) <= max(half, settings.shortest_delay_samples) or half > 1:
        return ""
    late, early = (late, early) if value > 0 else (early, late)
    size = f"{abs(value) * period * 1e3:.3g} ms +/- {half * period * 1e3:.2g} ms (95 %)"
    after = f"{late} seems to come after {early} by {size}"
    return f"{after}: a delay between two instruments looks like this; not corrected"


def _smoothed(values: np.ndarray, order: int, period: float) -> np.ndarray:
    """Return the smoothed derivative of an `order`, without its distorted ends.

    Values are sampled every `period` [s]; fewer than the filter needs are returned as they are.
    """
    from scipy.signal import savgol_filter

    window = settings.samples_of_a_derivative
    if values.size <= 2 * window:
        return values
    return np.asarray(savgol_filter(values, window, 3, deriv=order, delta=period))[window:-window]
