"""Find the period of an input in samples, and the samples of whole periods."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft

from friso.errors import InputError
from friso.identification.response.settings import settings


@dataclass(frozen=True)
class Periods:
    """Whole periods of `samples` each, `count` of them, from sample `start` to `stop`."""

    samples: int
    start: int
    stop: int
    warnings: tuple[str, ...] = ()

    @property
    def count(self) -> int:
        """Return the number of whole periods."""
        return (self.stop - self.start) // self.samples

    def cut(self, signal: np.ndarray) -> np.ndarray:
        """Cut a signal into periods, shape (periods, samples)."""
        return signal[self.start : self.stop].reshape(self.count, self.samples)


def find_periods(signal: np.ndarray, expected: float | None = None) -> Periods:
    """Find the whole periods of an input, shape (n,), counted backward from its end.

    `expected` is the approximate number of samples in a period; the search covers 2 % about it. Raises InputError if
    the signal does not repeat, or has fewer than two periods.
    """
    stop = _switched_off(signal)
    if np.unique(signal[:stop]).size < 2:
        raise _not_periodic("an input that is constant")
    change = repetition(signal[:stop])
    samples = _shortest(change) if expected is None else _near(change, expected)
    warnings: tuple[str, ...] = ()
    if expected is not None and samples != round(expected):
        warnings = (f"the input repeats every {samples} samples, not every {expected:g}: those are used",)
    start, stop = _repeating(signal[:stop], samples)
    start = stop - (stop - start) // samples * samples
    if (stop - start) // samples < 2:
        raise _not_periodic(f"{len(signal)} samples, which hold no two whole periods of {samples}")
    return Periods(samples, start, stop, warnings)


def repetition(signal: np.ndarray) -> np.ndarray:
    """Return how much a signal, shape (n,), changes over lags of 0 to n/2 samples.

    The change is the mean square over the record, in units of twice the variance.
    """
    centred = signal - signal.mean()
    n, lags = len(centred), np.arange(len(centred) // 2 + 1)
    size = fft.next_fast_len(2 * n, real=True)
    correlation = np.fft.irfft(np.abs(np.fft.rfft(centred, size)) ** 2, size)[: len(lags)]
    squares = np.concatenate([[0.0], np.cumsum(centred**2)])
    parts = squares[n - lags] + squares[n] - squares[lags]
    return np.maximum(parts - 2 * correlation, 0.0) / ((n - lags) * 2 * squares[n] / n)


def _switched_off(signal: np.ndarray) -> int:
    """Return the number of samples before an input is switched off.

    An input that is off at the end for 10 samples or fewer, or 0.5 % of the record, is not switched off: all samples
    count.
    """
    moving = np.flatnonzero(np.abs(signal - signal[-1]) > settings.amplitude_switched_off * np.ptp(signal))
    stop = int(moving[-1]) + 1 if moving.size else 0
    return stop if len(signal) - stop > max(10, len(signal) // 200) else len(signal)


def _shortest(change: np.ndarray) -> int:
    """Return the shortest lag at which a signal repeats as well as at any other.

    Lags before the signal has changed do not count. Raises InputError if it repeats at no lag.
    """
    away = np.flatnonzero(change > 0.5)
    first = int(away[0]) if away.size else len(change)
    lags = np.arange(max(first, 2), len(change))
    if not lags.size or change[lags].min() > settings.change_between_periods:
        raise _not_periodic("an input that does not repeat within half the record")
    good = lags[change[lags] <= 1.5 * change[lags].min() + 1e-9]
    return min([_lowest(change, int(good[0])), *_slipping(change, lags)[:1]])


def _slipping(change: np.ndarray, lags: np.ndarray) -> list[int]:
    """Return lags [samples] at which a signal nearly repeats, as it would with a drifting clock.

    After twice such a lag the signal has changed several times as much as after one. `change`, over all lags, is how
    much it changes; `lags` are those searched.
    """
    inner = lags[2 * lags < len(change)]
    inner = inner[inner + 1 < len(change)]
    here = change[inner]
    lowest = (here <= change[inner - 1]) & (here <= change[inner + 1]) & (here < settings.change_of_a_slip)
    return [int(lag) for lag in inner[lowest] if change[2 * lag] > settings.growth_of_a_slip * change[lag]]


def _lowest(change: np.ndarray, lag: int) -> int:
    """Return the lag of the first minimum of `change` at or above a `lag`."""
    while lag + 1 < len(change) and change[lag + 1] < change[lag]:
        lag += 1
    return lag


def _near(change: np.ndarray, expected: float) -> int:
    """Return the lag within 2 % of an expected one at which the signal repeats best.

    `change` is how much the signal changes over each lag. Raises InputError if it does not repeat there, or if the
    expected lag is beyond half the record.
    """
    low, high = int(0.98 * expected), int(np.ceil(1.02 * expected)) + 1
    if not 2 <= expected < len(change):
        raise _not_periodic(f"a period of {expected:g} samples in a record of {2 * len(change) - 2}")
    lags = np.arange(max(low, 2), min(high, len(change)))
    best = int(lags[np.argmin(change[lags])])
    if change[best] > settings.change_between_periods:
        raise _not_periodic(f"an input that does not repeat near {expected:g} samples")
    return best


def _repeating(signal: np.ndarray, samples: int) -> tuple[int, int]:
    """Return from which sample to before which a signal repeats itself, with a known period.

    The period has a number of `samples`. Parts at the beginning and the end are cut off if most of their samples differ
    from those one period away.
    """
    change = np.abs(signal[samples:] - signal[:-samples])
    unlike = change > 8 * 1.4826 * np.median(change) + 1e-5 * np.ptp(signal)
    width = max(3, samples // 50)
    mostly = np.flatnonzero(np.convolve(unlike, np.full(width, 1 / width), "same") > 0.5)
    early, late = mostly[mostly < samples], mostly[mostly >= max(len(change) - samples, samples)]
    start = int(early[-1]) + width // 2 + 1 if early.size else 0
    stop = int(late[0]) - width // 2 + samples if late.size else len(signal)
    return start, stop


def _not_periodic(problem: str) -> InputError:
    """Build the error for an input that does not repeat."""
    expected = "an input that repeats at least twice"
    return InputError("period", problem, expected, "a multisine of 5 s, repeated 20 times")
