"""Provide checked channels, zero-phase filters, and means of correlated samples for experiments in time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.linalg import solve_banded
from scipy.signal import butter, sosfiltfilt, welch
from scipy.stats import t as student

from friso.errors import InputError
from friso.identification.estimate import Estimate
from friso.identification.logs.log import ROLES, Log
from friso.intervals import NORMAL_COVERAGE

FILTER_ORDER = 2
"""Order of the Butterworth low-pass filter. It is applied forward and backward, which makes 4 in total."""

NORMAL_MAD = 1.4826
"""Ratio of standard deviation to median absolute deviation for a normal distribution."""

_EXAMPLES = {"force": '--scale force="35.1507 N/V"', "position": '--unit position="mm"'}


def record(name: str, sample_time: float, **signals: Any) -> Log:
    """Make a log of plain SI arrays by role, without gaps, `sample_time` [s] apart.

    Raises InputError for invalid arrays.
    """
    arrays = {role: np.asarray(values, dtype=float) for role, values in signals.items()}
    for role, values in arrays.items():
        if role not in ROLES:
            raise InputError(role, "no role", f"one of {', '.join(ROLES)}", "position", name)
        if values.ndim != 1 or values.shape != next(iter(arrays.values())).shape:
            raise InputError(role, f"an array of shape {values.shape}", "arrays of one length", "1000 values", name)
    if not (np.isfinite(sample_time) and sample_time > 0):
        raise InputError("sample_time", f"{sample_time!r}", "a time greater than 0 s", "1 ms", name)
    count = len(next(iter(arrays.values()))) if arrays else 0
    return Log(name, np.arange(count) * sample_time, float(sample_time), arrays, (slice(0, count),))


def channel(log: Log, role: str) -> np.ndarray:
    """Return the signal of a role, checked to be finite and in its SI unit, shape (n,).

    Raises InputError otherwise.
    """
    if role not in log:
        actual = f"channels for {', '.join(log.signals) or 'nothing'}"
        raise InputError(role, actual, f"a channel for the {role.replace('_', ' ')}", f'--map {role}="NAME"', log.name)
    if log.unit(role) != ROLES[role]:
        example = _EXAMPLES.get(role, f'--unit {role}="mm"')
        raise InputError(role, f"a channel in {log.unit(role)}", f"one in {ROLES[role]}", example, log.name)
    values = log[role]
    if not np.isfinite(values).all():
        actual = f"{int((~np.isfinite(values)).sum())} of {len(values)} values are not finite"
        raise InputError(role, actual, "finite values, with gaps between segments", "", log.name)
    return values


def deflection(log: Log) -> np.ndarray | None:
    """Return the stage's position minus the cart's [m], shape (n,).

    It is measured, or computed from a stage and a cart sensor; None if the log has neither.
    """
    return _apart(log, "relative_position", "cart_position")


def cart(log: Log) -> np.ndarray | None:
    """Return the position of the cart [m], shape (n,).

    It is measured, or the stage's position minus the measured deflection; None if the log has neither.
    """
    return _apart(log, "cart_position", "relative_position")


def _apart(log: Log, role: str, other: str) -> np.ndarray | None:
    """Return the signal of a role, or the position minus the signal of the role `other`.

    Returns None if the log has neither the role nor both other signals.
    """
    if role in log:
        return channel(log, role)
    return channel(log, "position") - channel(log, other) if {"position", other} <= log.signals.keys() else None


def on_bearing(log: Log) -> np.ndarray:
    """Return the position [m] of the body on the bearing, shape (n,): the cart's, if measured."""
    moved = cart(log)
    return channel(log, "position") if moved is None else moved


def low_pass(values: np.ndarray, sample_time: float, cutoff: float) -> np.ndarray:
    """Low-pass values forth and back, without phase shift, at `cutoff` [Hz] (Butterworth).

    Records sampled too slowly to contain anything above the cut-off, or shorter than the filter's ends, are unchanged.
    """
    if cutoff >= 0.45 / sample_time:
        return values
    sections = _butterworth(sample_time, cutoff)
    padding = min(int(3 / (cutoff * sample_time)), len(values) - 1)
    return values if len(values) < 10 else sosfiltfilt(sections, values, padlen=padding)


@lru_cache(maxsize=16)
def _butterworth(sample_time: float, cutoff: float) -> np.ndarray:
    """Return the low-pass filter as second-order sections (cached for repeated fits)."""
    return np.asarray(butter(FILTER_ORDER, cutoff, fs=1 / sample_time, output="sos"))


def rate(values: np.ndarray, sample_time: float, cutoff: float) -> np.ndarray:
    """Differentiate values, shape (n,), sampled every `sample_time` [s], below `cutoff` [Hz].

    The rate of fewer than two values is 0.
    """
    if len(values) < 2:
        return np.zeros(len(values))
    return np.gradient(low_pass(values, sample_time, cutoff), sample_time)


def by_segment(
    log: Log, values: np.ndarray, treated: Callable[[np.ndarray, float, float], np.ndarray], cutoff: float
) -> np.ndarray:
    """Return values of a log, (n,), `treated` below `cutoff` [Hz] segment by segment, by `low_pass` or `rate`."""
    return np.concatenate([treated(values[part], log.sample_time, cutoff) for part in log.segments])


BLOCKS_OF_A_MEAN = 8
"""Blocks of a stretch for its mean. Each must be long enough to forget the previous one."""

LINES_OF_A_SPECTRUM = 1000
"""Lines of the spectrum. More resolve more and scatter more."""

SPECTRUM_SHARE_OF_NOISE = 0.25
"""Upper part of the spectrum that is taken for noise."""

POWER_OF_CLEAR_MOTION = 100.0
"""Smallest power of visible motion, relative to the noise. Less occurs by chance among many spectral lines."""

POWER_OF_STRONG_MOTION = 1e-3
"""Smallest spectral power of visible motion, relative to the acceleration's largest."""


def motion_bandwidth(position: np.ndarray, sample_time: float) -> float:
    """Return the highest frequency [Hz] at which a position, (n,), stands out of its noise.

    The noise is taken to be white. Returns 0 if the position stands out nowhere.
    """
    pieces = min(len(position) // BLOCKS_OF_A_MEAN, 2 * LINES_OF_A_SPECTRUM)
    rates, density = welch(np.diff(position, 2), 1 / sample_time, nperseg=pieces)
    white = np.sin(np.pi * rates * sample_time) ** 4
    top = slice(-int(np.ceil(SPECTRUM_SHARE_OF_NOISE * len(rates))), None)
    noise = white * float(np.median(density[top] / white[top]))
    least = np.maximum(POWER_OF_CLEAR_MOTION * noise, POWER_OF_STRONG_MOTION * density.max())
    return float(rates[density > least].max(initial=0.0))


def robust(values: np.ndarray) -> float:
    """Return the standard deviation by the median absolute deviation; 0 without values."""
    if not len(values):
        return 0.0
    return float(NORMAL_MAD * np.median(np.abs(values - np.median(values))))


def noise_of(signal: np.ndarray) -> float:
    """Return the standard deviation of the noise of a force [N] or a position [m], shape (n,).

    The noise is estimated from third differences, to which smooth motion adds little; it is at least the resolution's.
    """
    rough, digit = np.abs(np.diff(signal, 3)), digit_of(signal)
    white = NORMAL_MAD * _median(rough, digit) / np.sqrt(20) if rough.size else 0.0
    return max(white, digit / np.sqrt(12))


def _median(sizes: np.ndarray, digit: float) -> float:
    """Return the median of sizes that were rounded to multiples of `digit` (grouped data).

    A rounded size stands for all sizes within half a digit of it, none below 0.
    """
    middle = float(np.median(sizes))
    low = max(middle - digit / 2, 0.0)
    below, within = np.mean(sizes < low), np.mean(np.abs(sizes - middle) < digit / 2)
    return low + float((0.5 - below) / within) * (middle + digit / 2 - low) if within > 0 else middle


ROUNDING_OF_A_SIGNAL = 1e-12
"""Largest step that is rounding of numbers rather than the signal's resolution, relative to the signal."""

LEVELS_OF_A_DIGIT = 8
"""Fewest distinct levels at which a signal must stay for its resolution to show."""

ERROR_OF_A_DIGIT = 0.1
"""Largest distance of levels from multiples of the resolution, relative to it."""

SHARE_OF_COMMANDED_CHANGES = 0.03
"""Largest fraction of samples at which a stepped command changes. A rounded signal that is logged ten times as
often as it changes has more."""

DIGITS_OF_A_COMMANDED_STEP = 1.5
"""Smallest usual jump of a stepped command, in common steps of its levels. A rounded signal that changes seldom is
slow, and changes by one step."""


def digit_of(signal: np.ndarray) -> float:
    """Return the resolution of a signal, shape (n,); 0 if it has none.

    The resolution is the common step of the levels at which the signal stays (interpolation does not change it), else
    the smallest step. A stepped command has no resolution: it mostly stays at a few levels, or it changes seldom, by
    several common steps.
    """
    steps = np.abs(np.diff(signal))
    dust = ROUNDING_OF_A_SIGNAL * np.abs(signal).max(initial=0.0)
    changes = steps > dust
    real, stays = steps[changes], np.sort(signal[1:][~changes])
    apart = np.diff(stays)
    apart = apart[apart > dust]
    if apart.size >= LEVELS_OF_A_DIGIT:
        digits = apart / apart.min()
        if np.abs(digits - np.round(digits)).max() <= ERROR_OF_A_DIGIT:
            few = real.size < SHARE_OF_COMMANDED_CHANGES * steps.size
            stepped = few and np.median(real) > DIGITS_OF_A_COMMANDED_STEP * apart.min()
            return 0.0 if stepped else float(apart.min())
    elif stays.size > steps.size / 2:
        return 0.0
    return float(real.min()) if real.size else 0.0


def turns_of(position: np.ndarray, swing: float) -> np.ndarray:
    """Return the samples at which a motion [m] turns, to go back by more than `swing` [m]."""
    turns, values = [], position.tolist()
    lowest = highest = values[0]
    low = high = 0
    rises = falls = True  # the direction is open until the motion has gone either way by the swing
    for k, value in enumerate(values):
        if value > highest:
            highest, high = value, k
        if value < lowest:
            lowest, low = value, k
        if rises and highest - value > swing:
            turns.append(high)
            rises, falls, lowest, low = False, True, value, k
        elif falls and value - lowest > swing:
            turns.append(low)
            rises, falls, highest, high = True, False, value, k
    return np.array(turns, dtype=int)


@dataclass(frozen=True)
class Mean:
    """A mean, its standard error, and the degrees of freedom of the standard error."""

    value: float
    error: float
    freedom: float


def block_mean(values: np.ndarray) -> Mean:
    """Return the mean and its error, by the scatter of blocks of neighbouring samples.

    Neighbouring samples are not independent.
    """
    count = min(BLOCKS_OF_A_MEAN, len(values))
    means = np.array([part.mean() for part in np.array_split(values, count)])
    error = float(means.std(ddof=1) / np.sqrt(count)) if count > 1 else np.inf
    return Mean(float(values.mean()), error, count - 1)


def correlated_mean(values: np.ndarray) -> Mean:
    """Return the mean of values in a row, each of which may be correlated with the one before.

    The degrees of freedom follow from the equivalent number of independent values (first-order autoregression).
    """
    count = len(values)
    off = values - values.mean()
    power = float(off @ off)
    enough = power > 0 and count >= BLOCKS_OF_A_MEAN
    share = min(max(float(off[1:] @ off[:-1]) / power, 0.0), 0.9) if enough else 0.0
    independent = max(count * (1 - share) / (1 + share), 2.0)
    error = float(values.std(ddof=1) / np.sqrt(independent))
    return Mean(float(values.mean()), error, max(round(independent) - 1, 1))


def t_value(freedom: float) -> float:
    """Return the half-width of a 95 % interval of Student's t distribution, in standard errors."""
    return float(student.ppf(0.975, freedom))


def by_t(name: str, unit: str, mean: Mean, method: str, low: float = 0.0, high: float = 0.0) -> Estimate:
    """Make an estimate with Student's 95 % interval, widened by systematic errors.

    `low` and `high` are the systematic errors below and above the mean, in its `unit`.
    """
    half = t_value(mean.freedom) * mean.error
    ends = (mean.value - half - low, mean.value + half + high)
    return Estimate(name, unit, mean.value, *ends, method, systematic=(low + high) / 2)


def solve_normal_equations(square: np.ndarray, product: np.ndarray) -> np.ndarray:
    """Solve normal equations, shape (p, p) and (p,), whose columns differ widely in size.

    The solution for an empty column is 0.
    """
    size = np.sqrt(np.maximum(np.diag(square), 0.0))
    size = np.where(size > 0, size, 1.0)
    return np.linalg.lstsq(square / np.outer(size, size), product / size, rcond=None)[0] / size


def jackknife(columns: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return the covariance (p, p) of a least-squares fit, by leaving out blocks of the record.

    The target, shape (n,), is fitted by columns, shape (n, p).
    """
    blocks = BLOCKS_OF_A_MEAN
    parts = zip(np.array_split(columns, blocks), np.array_split(target, blocks), strict=True)
    square, product = columns.T @ columns, columns.T @ target
    without = np.array([solve_normal_equations(square - x.T @ x, product - x.T @ y) for x, y in parts])
    off = without - without.mean(axis=0)
    return off.T @ off * (blocks - 1) / blocks


def correlation_of(covariance: np.ndarray, shifts: np.ndarray, even: np.ndarray) -> np.ndarray:
    """Return the correlation (p, p) of quantities with a covariance and systematic errors.

    Systematic `shifts`, shape (m, p), move the quantities together; errors of half-width `even`, shape (p,), are
    independent.
    """
    total = covariance + (shifts.T @ shifts + np.diag(even**2)) / NORMAL_COVERAGE**2
    size = np.sqrt(np.maximum(np.diag(total), np.finfo(float).tiny))
    return total / np.outer(size, size)


def deflections(moves: np.ndarray, ends: np.ndarray, start: float = 0.0) -> np.ndarray:
    """Return the deflection [m] of bristles under a moving body at n samples, shape (n,).

    `moves` [m], shape (n - 1,), are the displacements between samples. During a move the bristles approach a steady
    deflection in its direction, whose size is in `ends` [m], shape (n - 1,). `start` [m] is the first deflection. The
    solution is exact in each move.
    """
    kept = np.exp(-np.abs(moves) / ends)
    after = np.append(start, np.sign(moves) * ends * (1 - kept))  # by each move alone
    bands = np.stack([np.ones(len(after)), np.append(-kept, 0.0)])
    return np.asarray(solve_banded((1, 0), bands, after, check_finite=False))


def by_direction(directions: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Yield "forward" and "backward", each with the mask of the samples in this direction, (n,).

    `directions`, shape (n,), are positive or negative numbers.
    """
    yield "forward", directions > 0
    yield "backward", directions < 0


def stribeck_curve(
    speeds: np.ndarray, coulomb: float, static: float, velocity: float, exponent: float = 2.0
) -> np.ndarray:
    """Return friction [N] at steady speeds [m/s], without the viscous part (thesis, Eq. 4).

    Arguments are Coulomb and static friction [N], the Stribeck velocity [m/s] and the exponent.
    """
    return coulomb + (static - coulomb) * np.exp(-((speeds / velocity) ** exponent))
