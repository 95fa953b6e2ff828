"""Estimate frequency responses from records: complex values on lines, with their uncertainty.

A periodic input has a period in samples, and only whole periods become spectra, period by period.

For periodic excitation, noise and distortion are separated by the robust method of Pintelon, Schoukens, System
Identification (2nd ed., 2012), chapter 4: noise differs from period to period, nonlinear distortion from one
random-phase realisation to another. With an external reference (closed loop, indirect) both spectra are taken relative
to it, which makes them comparable. Any other excitation gives a response without that separation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import fft, stats
from scipy.interpolate import CubicSpline

from friso.errors import InputError
from friso.identification.logs.log import Log


@dataclass(frozen=True)
class Channels:
    """Names and units of input and output."""

    input: str = "force"
    input_unit: str = "N"
    output: str = "position"
    output_unit: str = "m"


@dataclass(frozen=True)
class ResponseBand:
    """Limits of the 95 % intervals of magnitude [output per input unit] and phase [rad], (lines,)."""

    magnitude_low: np.ndarray
    magnitude_high: np.ndarray
    phase_low: np.ndarray
    phase_high: np.ndarray


COHERENCE_OF_A_LINE = 0.5
"""Smallest coherence of a spectral line that is used, if known."""

LINES_OF_A_SCATTER = 15
"""Number of lines from which the scatter between neighbours is computed."""


@dataclass(frozen=True, kw_only=True)
class FrequencyResponse:
    """A response at the spectral lines `frequency` [Hz]; all arrays have the shape (lines,).

    `response` is complex [output unit per input unit]. `deviation` is its total standard deviation, sqrt(E|error|^2).
    Its parts are `noise` (differs from period to period) and `distortion` (differs from realisation to realisation):
    deviation^2 = noise^2 + distortion^2 if both are known, else NaN.

    `degrees` is the number of real degrees of freedom behind the deviation. `coherence` is between input and output
    (None: not known). `kind` is "multisine", "local polynomial" or "measured". `sample_time` [s] is the
    record's (None: not known).
    """

    frequency: np.ndarray
    response: np.ndarray
    deviation: np.ndarray
    noise: np.ndarray
    distortion: np.ndarray
    degrees: np.ndarray
    kind: str
    channels: Channels = Channels()
    coherence: np.ndarray | None = None
    warnings: tuple[str, ...] = ()
    sample_time: float | None = None

    @classmethod
    def undivided(
        cls, frequency: np.ndarray, response: np.ndarray, deviation: np.ndarray, degrees: float, **further: Any
    ) -> FrequencyResponse:
        """Make a response whose deviation is not divided into noise and distortion.

        Frequencies [Hz] and all other arrays have the shape (lines,). All lines have equally many `degrees` of freedom.
        `further` has the other fields.
        """
        unknown = np.full(len(frequency), np.nan)
        freedom = np.full(len(frequency), degrees)
        lines = {"frequency": frequency, "response": response, "deviation": deviation, "degrees": freedom}
        return cls(**lines, noise=unknown, distortion=unknown, **further)

    def band(self) -> ResponseBand:
        """Return the 95 % intervals of magnitude and phase.

        Half of the variance is taken in the direction of the complex response, half across it.
        """
        half = stats.t.ppf(0.975, self.degrees) * self.deviation / np.sqrt(2)
        size, phase = np.abs(self.response), np.unwrap(np.angle(self.response))
        with np.errstate(divide="ignore", invalid="ignore"):
            turn = np.where(half < size, np.arcsin(np.minimum(half / size, 1.0)), np.pi)
        return ResponseBand(np.maximum(size - half, 0.0), size + half, phase - turn, phase + turn)

    def accelerations(self) -> FrequencyResponse:
        """Return the response of the acceleration in place of the position: times (i omega)^2."""
        factor = (2 * np.pi * self.frequency) ** 2
        channels = replace(self.channels, output="acceleration", output_unit=f"{self.channels.output_unit}/s^2")
        scaled = {name: factor * getattr(self, name) for name in ("deviation", "noise", "distortion")}
        return replace(self, response=-factor * self.response, channels=channels, **scaled)

    def at(self, chosen: np.ndarray) -> FrequencyResponse:
        """Return the response at spectral lines that a mask or their numbers choose."""
        names = ("frequency", "response", "deviation", "noise", "distortion", "degrees")
        lines = {name: getattr(self, name)[chosen] for name in names}
        return replace(self, coherence=None if self.coherence is None else self.coherence[chosen], **lines)

    def between(self, low: float, high: float) -> FrequencyResponse:
        """Return the response at spectral lines from `low` to `high` [Hz], both included.

        Raises InputError where there are none.
        """
        inside = (self.frequency >= low) & (self.frequency <= high)
        if not inside.any():
            text = f"{low:g} to {high:g} Hz"
            held = f"{self.frequency.min():g} to {self.frequency.max():g} Hz" if self.frequency.size else "no lines"
            raise InputError("band", text, f"a band that holds lines of the response, which has {held}", "3 to 20 Hz")
        return self.at(inside)

    def usable(self, ratio: float = 3.0) -> FrequencyResponse:
        """Return the response at spectral lines that are clear of noise: `ratio` deviations large.

        Their coherence must also suffice, if it is known. Warnings list the lines left out. Raises InputError if none
        is left, because the excitation is too weak.
        """
        enough = np.abs(self.response) >= ratio * self.deviation
        if self.coherence is not None:
            enough &= self.coherence >= COHERENCE_OF_A_LINE
        if not enough.any():
            best = np.max(np.abs(self.response) / np.maximum(self.deviation, np.finfo(float).tiny), initial=0.0)
            text = f"no line stands out of the noise (at best {best:.2g} standard deviations)"
            if self.coherence is not None and self.coherence.size:
                text += f", coherence at most {np.max(self.coherence):.2g}"
            coherence = f"a coherence of {COHERENCE_OF_A_LINE:g}"
            expected = f"a response of {ratio:g} deviations and {coherence} on some line"
            raise InputError("excitation", text, expected, "a larger force, or a longer record")
        if enough.all():
            return self
        left_out = self.frequency[~enough]
        band = f"{left_out.min():.3g} to {left_out.max():.3g} Hz"
        warning = f"{left_out.size} of {enough.size} lines left out, too weakly excited ({band})"
        return replace(self.at(enough), warnings=(*self.warnings, warning))

    def scatter(self) -> np.ndarray:
        """Return the deviations (lines,), raised to the scatter between neighbouring lines.

        Nonlinear distortion makes the lines of one realisation scatter beyond their noise; a smooth system cannot.
        """
        size = np.abs(self.response)
        if len(size) < 3 or not np.all(size > 0):
            return self.deviation
        second = np.abs(np.diff(np.log(size), 2)) / np.sqrt(6)
        width = min(LINES_OF_A_SCATTER, len(second))
        medians = np.median(np.lib.stride_tricks.sliding_window_view(second, width), axis=1)
        places = np.arange(len(size)) - 1 - (width - 1) / 2
        rough = 1.4826 * np.interp(places, np.arange(len(medians)), medians)  # of normal deviations
        return np.maximum(self.deviation, np.sqrt(2) * rough * size)


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


AMPLITUDE_SWITCHED_OFF = 0.01
"""Amplitude below which the end of an input counts as switched off, relative to the input's range."""


def _switched_off(signal: np.ndarray) -> int:
    """Return the number of samples before an input is switched off.

    An input that is off at the end for 10 samples or fewer, or 0.5 % of the record, is not switched off: all samples
    count.
    """
    moving = np.flatnonzero(np.abs(signal - signal[-1]) > AMPLITUDE_SWITCHED_OFF * np.ptp(signal))
    stop = int(moving[-1]) + 1 if moving.size else 0
    return stop if len(signal) - stop > max(10, len(signal) // 200) else len(signal)


CHANGE_BETWEEN_PERIODS = 0.2
"""Largest change from one period to the next of an input that repeats, in twice the variance."""


def _shortest(change: np.ndarray) -> int:
    """Return the shortest lag at which a signal repeats as well as at any other.

    Lags before the signal has changed do not count. Raises InputError if it repeats at no lag.
    """
    away = np.flatnonzero(change > 0.5)
    first = int(away[0]) if away.size else len(change)
    lags = np.arange(max(first, 2), len(change))
    if not lags.size or change[lags].min() > CHANGE_BETWEEN_PERIODS:
        raise _not_periodic("an input that does not repeat within half the record")
    good = lags[change[lags] <= 1.5 * change[lags].min() + 1e-9]
    return min([_lowest(change, int(good[0])), *_slipping(change, lags)[:1]])


CHANGE_OF_A_SLIP = 0.02
"""Change between periods above which a slip of the generator's clock is searched, in twice the variance."""

GROWTH_OF_A_SLIP = 2.0
"""Smallest ratio of changes after two periods and after one that shows a slip of the clock, whose ratio is 4."""


def _slipping(change: np.ndarray, lags: np.ndarray) -> list[int]:
    """Return lags [samples] at which a signal nearly repeats, as it would with a drifting clock.

    After twice such a lag the signal has changed several times as much as after one. `change`, over all lags, is how
    much it changes; `lags` are those searched.
    """
    inner = lags[2 * lags < len(change)]
    inner = inner[inner + 1 < len(change)]
    here = change[inner]
    lowest = (here <= change[inner - 1]) & (here <= change[inner + 1]) & (here < CHANGE_OF_A_SLIP)
    return [int(lag) for lag in inner[lowest] if change[2 * lag] > GROWTH_OF_A_SLIP * change[lag]]


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
    if change[best] > CHANGE_BETWEEN_PERIODS:
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


@dataclass(frozen=True)
class ResponseRecord:
    """Input, output and, in closed loop, the external reference or injected force, (n,) each.

    Samples are `sample_time` [s] apart.
    """

    input: np.ndarray
    output: np.ndarray
    sample_time: float
    reference: np.ndarray | None = None

    @property
    def driving(self) -> np.ndarray:
        """Return the external signal: the reference, or in open loop the input."""
        return self.input if self.reference is None else self.reference

    def checked(self, least: int = 8) -> ResponseRecord:
        """Return the record as floats, after checking it.

        Raises InputError for NaN, unequal lengths, constant signals, too few samples.
        """
        named = {"input": self.input, "output": self.output}
        if self.reference is not None:
            named["reference"] = self.reference
        arrays = {name: np.asarray(values, float) for name, values in named.items()}
        lengths = {name: values.shape for name, values in arrays.items()}
        if len(set(lengths.values())) > 1 or any(values.ndim != 1 for values in arrays.values()):
            raise InputError("record", f"shapes {lengths}", "signals of one and the same length", "20 000 samples each")
        if not self.sample_time > 0:
            raise InputError("sample_time", f"{self.sample_time}", "a time greater than 0 s", "0.001")
        for name, values in arrays.items():
            _check_signal(name, values, least)
        return ResponseRecord(arrays["input"], arrays["output"], self.sample_time, arrays.get("reference"))


def from_log(
    log: Log, driving: str = "force", output: str = "position", reference: str | None = None
) -> tuple[ResponseRecord, Channels]:
    """Return the longest segment of a log as a record, and the names and units of its channels.

    `driving` is the role of the input, `output` that of the output; the `reference` is the role of an external signal.
    Raises InputError for a role that is missing.
    """
    roles = [driving, output] + ([reference] if reference else [])
    for role in roles:
        if role not in log:
            actual = f"a log with {', '.join(log.signals)}"
            raise InputError(role, actual, f"a channel for the {role}", f'{role}="Axis1"')
    part = log.longest
    external = log[reference][part] if reference else None
    record = ResponseRecord(log[driving][part], log[output][part], log.sample_time, external)
    return record, Channels(driving, log.unit(driving), output, log.unit(output))


def _check_signal(name: str, values: np.ndarray, least: int) -> None:
    """Check that a signal is finite, changes, and has enough samples, at least `least`.

    Raises InputError, with the `name` of the signal, if not.
    """
    if len(values) < least:
        raise InputError(name, f"{len(values)} samples", f"at least {least}", "20 000 samples")
    bad = int(np.count_nonzero(~np.isfinite(values)))
    if bad:
        actual = f"{bad} samples that are not numbers"
        raise InputError(name, actual, "finite samples", "a log cut into segments at gaps")
    if not np.ptp(values) > 0:
        raise InputError(name, f"a constant signal ({values[0]:g})", "a signal that moves", "a multisine")


@dataclass(frozen=True)
class Spectra:
    """Spectra of one realisation at the harmonics `frequency` [Hz], shape (lines,).

    `input` and `output` are (periods, lines). `reference` (lines,) is the spectrum of the external signal, averaged
    over periods, and `excited` (lines,) marks the lines that this signal contains.
    """

    frequency: np.ndarray
    reference: np.ndarray
    input: np.ndarray
    output: np.ndarray
    excited: np.ndarray
    warnings: tuple[str, ...] = ()


SAMPLES_OF_A_SLIP = 0.05
"""Slip of a generator's clock, in samples over the record, from which the record is resampled."""


def spectra(record: ResponseRecord) -> Spectra:
    """Compute the spectra of a record over whole periods, without the transient.

    The external signal, the reference or else the input, gives the periods.
    Drift from period to period is removed first. Raises InputError if nothing repeats or fewer than two periods are
    left.
    """
    record = record.checked()
    periods = find_periods(record.driving)
    driving = _harmonics(record.driving, periods)
    warnings = periods.warnings
    slip = _slip(driving, periods.samples)
    if abs(slip) * periods.count > SAMPLES_OF_A_SLIP:
        text = f"a period has {periods.samples + slip:.7g} samples, because the clocks differ"
        warnings = (*warnings, f"{text}: resampled to whole periods")
        record = _at_other_rate(record, 1 + slip / periods.samples)
        periods = find_periods(record.driving, periods.samples)
        driving = _harmonics(record.driving, periods)
    driven, reaction = (_harmonics(signal, periods) for signal in (record.input, record.output))
    alike = _same_excitation(driving)
    excited = _excited(driving[alike])
    if not excited.any():
        raise InputError("excitation", "no line above the noise", "a periodic input with lines", "a multisine")
    first = _transient_periods(reaction[alike][:, excited])
    stationary = np.flatnonzero(alike)[first:]
    warnings = (*warnings, *_left_out(alike, first))
    if len(stationary) < 2:
        raise InputError("period", f"{len(stationary)} period without transient", "at least two", "a longer record")
    frequency = np.arange(1, driven.shape[1] + 1) / (periods.samples * record.sample_time)
    mean = driving[stationary].mean(axis=0)
    return Spectra(frequency, mean, driven[stationary], reaction[stationary], excited, warnings)


def _left_out(alike: np.ndarray, first: int) -> Iterator[str]:
    """Write sentences on periods left out: those with another input, and transient ones.

    `alike`, shape (periods,), marks the periods with equal input; the `first` ones of these are transient, by number.
    Nothing is yielded if no period is left out.
    """
    if not alike.all():
        yield f"{np.count_nonzero(~alike)} of {alike.size} periods left out, because their input differs"
    if first:
        yield f"the first {first} of {np.count_nonzero(alike)} periods left out as transient"


def _slip(driving: np.ndarray, samples: int) -> float:
    """Return by what fraction of a sample a period is longer than `samples`.

    `driving` has the harmonics of the external signal, shape (periods, lines). If a period is longer, their phases
    advance from one period to the next, in proportion to the number of the harmonic.
    """
    turned = np.sum(driving[1:] * driving[:-1].conj(), axis=0)
    number, weight = np.arange(1, driving.shape[1] + 1), np.abs(turned)
    most = float(weight @ number**2)
    return -float(weight * np.angle(turned) @ number) / most * samples / (2 * np.pi) if most > 0 else 0.0


def _at_other_rate(record: ResponseRecord, step: float) -> ResponseRecord:
    """Resample a record every `step` samples by cubic splines, which treat all signals alike."""
    at = np.arange(int((len(record.input) - 1) / step) + 1) * step

    def taken(signal: np.ndarray) -> np.ndarray:
        return CubicSpline(np.arange(len(signal)), signal)(at)

    reference = None if record.reference is None else taken(record.reference)
    return ResponseRecord(taken(record.input), taken(record.output), record.sample_time * step, reference)


def _harmonics(signal: np.ndarray, periods: Periods) -> np.ndarray:
    """Return amplitudes of the harmonics in every period, (periods, lines), without drift."""
    samples = signal[periods.start : periods.stop]
    cut = (samples - drift(samples, periods.samples)).reshape(periods.count, periods.samples)
    return np.fft.rfft(cut, axis=1)[:, 1 : (periods.samples - 1) // 2 + 1] * (2 / periods.samples)


def drift(signal: np.ndarray, samples: int) -> np.ndarray:
    """Average a signal, shape (n,), over a moving period, which removes the harmonics exactly.

    At both ends, where no whole period fits, the average is continued as a straight line.
    """
    sums = np.concatenate([[0.0], np.cumsum(signal - signal.mean())])
    average = (sums[samples:] - sums[:-samples]) / samples + signal.mean()
    at = np.arange(len(average)) + (samples - 1) / 2
    length = min(len(average), samples)
    ends = [np.polynomial.Polynomial.fit(at[part], average[part], 1) for part in (slice(length), slice(-length, None))]
    numbers = np.arange(len(signal))
    inside = np.interp(numbers, at, average)
    return np.where(numbers < at[0], ends[0](numbers), np.where(numbers > at[-1], ends[1](numbers), inside))


def _same_excitation(driving: np.ndarray) -> np.ndarray:
    """Tell in which periods the external signal is the same as in most, shape (periods,).

    `driving`, shape (periods, lines), is its spectrum.
    """
    middle = np.median(np.real(driving), axis=0) + 1j * np.median(np.imag(driving), axis=0)
    off = np.sqrt(np.mean(np.abs(driving - middle) ** 2, axis=1))
    return off <= 5 * np.median(off) + 1e-3 * np.sqrt(np.mean(np.abs(middle) ** 2))


AMPLITUDE_OF_AN_EXCITED_LINE = 0.01
"""Amplitude below which a line counts as not excited, relative to the strongest line (-40 dB)."""

DEVIATIONS_OF_AN_EXCITED_LINE = 3.0
"""Distance of an excited line from the noise, in standard deviations of its mean."""

STEP_BETWEEN_LINES = 2.5
"""Ratio of amplitudes that separates intended lines from unintended ones."""

POWER_OF_MEANT_LINES = 0.95
"""Smallest fraction of the power that intended lines must contain."""


def _excited(driving: np.ndarray) -> np.ndarray:
    """Tell which lines the external signal excites intentionally, shape (lines,).

    `driving` is its spectrum, shape (periods, lines). These lines stand out of its noise, and of other lines that are
    much weaker.
    """
    mean = np.abs(driving.mean(axis=0))
    noise = np.std(driving, axis=0, ddof=1) / np.sqrt(len(driving)) if len(driving) > 1 else 0 * mean
    excited = mean > AMPLITUDE_OF_AN_EXCITED_LINE * mean.max()
    excited &= mean > DEVIATIONS_OF_AN_EXCITED_LINE * noise
    sizes = np.sort(mean[excited])[::-1]
    if sizes.size > 2:
        steps = sizes[:-1] / sizes[1:]
        cut = int(np.argmax(steps))
        share = np.sum(sizes[: cut + 1] ** 2) / np.sum(sizes**2)
        if steps[cut] > STEP_BETWEEN_LINES and share > POWER_OF_MEANT_LINES:
            excited &= mean >= sizes[cut]
    return excited


DISTANCE_OF_A_TRANSIENT = 1.5
"""Smallest distance of a leading period from the others that makes it a transient, in their variance."""


def _transient_periods(reaction: np.ndarray) -> int:
    """Count the leading periods that are transient, by the output (periods, lines).

    A period counts as transient if it differs too much from the later half of the others. The limit is so high that a
    period without a transient is rarely dropped. At least three periods are kept; of fewer, none counts as transient.
    """
    count = len(reaction)
    last = max(3, count // 2)
    if count <= last:
        return 0
    later = np.arange(count - last, count)
    off = np.array([_distance(reaction[number], reaction[later[later != number]]) for number in range(count)])
    return int(np.flatnonzero(off <= DISTANCE_OF_A_TRANSIENT * off[later].max())[0])


def _distance(single: np.ndarray, others: np.ndarray) -> float:
    """Return the squared distance of a period from the mean of others, over their variance.

    `single`, shape (lines,), and `others`, shape (periods, lines), are spectra. The median over the lines is taken.
    """
    variance = np.maximum(np.var(others, axis=0, ddof=1), np.finfo(float).tiny)
    return float(np.median(np.abs(single - others.mean(axis=0)) ** 2 / variance))


def relative_error(
    model: Callable[[np.ndarray], np.ndarray],
    record: ResponseRecord,
    band: tuple[float, float],
) -> float:
    """Return ||G U - Y|| / ||Y|| of a model on a periodic record that it was not fitted to.

    `model` gives complex responses G at frequencies [Hz]; U and Y are averaged over periods, on the excited lines in
    `band` [Hz]. Raises InputError if the record is not periodic or no line lies in the band.
    """
    measured = spectra(record)
    inside = measured.excited & (measured.frequency >= band[0]) & (measured.frequency <= band[1])
    if not inside.any():
        raise InputError("band", f"{band[0]:g} to {band[1]:g} Hz", "a band that holds excited lines", "3 to 20 Hz")
    force, reaction = measured.input.mean(axis=0)[inside], measured.output.mean(axis=0)[inside]
    return float(np.linalg.norm(model(measured.frequency[inside]) * force - reaction) / np.linalg.norm(reaction))


def multisine(records: Sequence[ResponseRecord], channels: Channels | None = None) -> FrequencyResponse:
    """Estimate the response on excited lines from realisations of a periodic excitation.

    A realisation is a record with its own random phases. With a reference, the response is indirect: output over input,
    each relative to the reference. The deviation covers
    noise and, with two realisations or with lines left free in the excitation, nonlinear distortion. Raises InputError
    for records that are not periodic or do not belong together.
    """
    spectra_of_records, remarks = _together([spectra(record) for record in records])
    excited = np.logical_and.reduce([realisation.excited for realisation in spectra_of_records])
    if not excited.any():
        actual = "realisations without a common line"
        raise InputError("records", actual, "the same excited lines", "one period for all")
    response, noise = _averaged(spectra_of_records, excited)
    degrees = np.full(response.shape, 2.0 * sum(len(realisation.input) - 1 for realisation in spectra_of_records))
    if len(spectra_of_records) > 1:
        total, total_degrees = _total(spectra_of_records, excited, response)
        distortion, distortion_known = np.sqrt(np.maximum(total**2 - noise**2, 0.0)), True
        degrees = np.where(distortion > 0, total_degrees, degrees)
    else:
        distortion = _at_free_lines(spectra_of_records[0], excited, response)
        distortion_known = bool(np.isfinite(distortion).any())
    deviation = np.hypot(noise, np.nan_to_num(distortion))
    warnings = dict.fromkeys([*remarks, *(text for realisation in spectra_of_records for text in realisation.warnings)])
    if not distortion_known:
        warnings["one realisation with all lines excited: the deviation covers noise, not nonlinear distortion"] = None
    return FrequencyResponse(
        frequency=spectra_of_records[0].frequency[excited],
        response=response,
        deviation=deviation,
        noise=noise,
        distortion=distortion,
        degrees=degrees,
        kind="multisine",
        channels=channels or Channels(),
        warnings=tuple(warnings),
        sample_time=records[0].sample_time,
    )


PERIOD_TOLERANCE = 1e-3
"""Largest relative difference between the periods of realisations."""

TOLERANCE_OF_EQUAL_PERIODS = 1e-6
"""Relative difference below which periods count as equal."""


def _together(records: list[Spectra]) -> tuple[list[Spectra], list[str]]:
    """Bring the spectra of realisations to common frequencies; also return remarks on clocks.

    Raises InputError without common lines.
    """
    if not records:
        raise InputError("records", "none", "at least one record", "two realisations of a multisine")
    spacings = np.array([realisation.frequency[0] for realisation in records])
    apart = float(np.ptp(spacings) / spacings.min())
    counts = np.array([len(realisation.frequency) for realisation in records])
    if apart > PERIOD_TOLERANCE or np.ptp(counts) > 1 + PERIOD_TOLERANCE * counts.min():
        text = "periods of " + ", ".join(f"{1 / spacing:.6g} s" for spacing in spacings)
        raise InputError("records", text, "realisations with the same period and sample time", "5 s each")
    records = [_first_lines(realisation, int(counts.min())) for realisation in records]
    if apart <= TOLERANCE_OF_EQUAL_PERIODS:
        return records, []
    mean = float(spacings.mean())
    lines = np.arange(1, counts.min() + 1) * mean
    remark = f"the periods of the records differ by {1e6 * apart:.3g} ppm, as clocks do: {1 / mean:.6g} s is used"
    return [replace(realisation, frequency=lines) for realisation in records], [remark]


def _first_lines(realisation: Spectra, count: int) -> Spectra:
    """Return the first `count` spectral lines of a realisation."""
    names = ("frequency", "reference", "excited", "input", "output")
    return replace(realisation, **{name: getattr(realisation, name)[..., :count] for name in names})


def _averaged(records: list[Spectra], excited: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the response and its deviation by noise, each (lines,), from all realisations.

    `excited` marks the lines that count.
    """
    outputs, inputs = _relative(records, excited)
    gain = inputs.mean(axis=0)
    response = outputs.mean(axis=0) / gain
    variance = np.zeros(len(response))
    for realisation in records:
        left = realisation.output[:, excited] - response * realisation.input[:, excited]
        variance += np.var(left / realisation.reference[excited], axis=0, ddof=1) / len(left)
    return response, np.sqrt(variance) / (len(records) * np.abs(gain))


def _relative(records: list[Spectra], excited: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return output and input relative to the external signal, each (realisations, lines).

    Both are averaged over periods.
    """
    outputs, inputs = (
        np.array([getattr(one, name)[:, excited].mean(axis=0) / one.reference[excited] for one in records])
        for name in ("output", "input")
    )
    return outputs, inputs


FREEDOM_OF_A_VARIANCE = 10
"""Degrees of freedom from which a spectral line's own variance is used."""

LINES_SHARING_VARIANCE = 5
"""Number of neighbouring lines that share their variance if there are few realisations."""


def _total(records: list[Spectra], excited: np.ndarray, response: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the deviation of the mean response over realisations, and its degrees of freedom.

    Both are arrays of shape (lines,). With few realisations, neighbouring spectral lines share their variance.
    """
    outputs, inputs = _relative(records, excited)
    count = len(records)
    squares = np.sum(np.abs(outputs - response * inputs) ** 2, axis=0)
    relative = squares / (count * (count - 1)) / np.abs(outputs.mean(axis=0)) ** 2
    freedom = 2 * (count - 1)
    width = 1 if freedom >= FREEDOM_OF_A_VARIANCE else min(LINES_SHARING_VARIANCE, len(relative))
    window = np.ones(width)
    shared = np.convolve(np.ones(len(relative)), window, "same")
    relative = np.convolve(relative, window, "same") / shared
    return np.sqrt(relative) * np.abs(response), freedom * shared


def _at_free_lines(realisation: Spectra, excited: np.ndarray, response: np.ndarray) -> np.ndarray:
    """Return the nonlinear distortion (lines,), from the output at lines that are not excited.

    Noise and the linear response to the input at these lines are subtracted. The result is NaN if fewer than two lines
    of the band were left free.
    """
    places = np.flatnonzero(excited)
    free = np.setdiff1d(np.arange(places[0], places[-1] + 1), places)
    if len(free) < 2:
        return np.full(len(places), np.nan)
    parts = [np.interp(free, places, part) for part in (np.real(response), np.imag(response))]
    left = realisation.output[:, free] - (parts[0] + 1j * parts[1]) * realisation.input[:, free]
    power = np.abs(left.mean(axis=0)) ** 2 - np.var(left, axis=0, ddof=1) / len(left)
    near = np.argsort(np.abs(free[:, None] - places), axis=0, kind="stable")[:LINES_SHARING_VARIANCE]
    local = np.maximum(power[near].mean(axis=0), 0.0)
    return np.sqrt(local) / np.abs(realisation.input.mean(axis=0)[places])


LINES_ON_A_SIDE = 8
"""Number of lines on each side in a local fit: 17 complex equations for 6 unknowns."""

AMPLITUDE_OF_A_WEAK_LINE = 1e-4
"""Amplitude below which a line counts as not excited, relative to the largest (-80 dB)."""

ORDER_OF_LOCAL_POLYNOMIALS = 2
"""Order of the local polynomials of response and transient."""


def local_polynomial(record: ResponseRecord, channels: Channels | None = None) -> FrequencyResponse:
    """Estimate a response by the local polynomial method, free of leakage.

    The method is that of Pintelon, Schoukens, 2nd ed., ch. 7: about every line, response and transient are polynomials
    of order 2 in the frequency over 17 lines of the spectrum of the whole record; the residual is the noise. One line
    in 9 is returned, so that neighbours share little. With a reference the method is indirect, which a closed loop
    requires: the response is the ratio of the responses of output and input to the reference. Raises InputError for a
    record of fewer than 200 samples.
    """
    record, side = record.checked(200), LINES_ON_A_SIDE
    size = len(record.driving)
    driving, excitation, answer = (
        np.fft.rfft(channel - channel.mean()) / size for channel in (record.driving, record.input, record.output)
    )
    centres = np.arange(1 + side, len(driving) - side - 1, side + 1)
    around = np.arange(-side, side + 1)
    strength = np.sqrt(np.mean(np.abs(driving[centres[:, None] + around]) ** 2, axis=1))
    strong = strength > AMPLITUDE_OF_A_WEAK_LINE * strength.max()
    centres, scale = centres[strong], strength[strong]
    window = centres[:, None] + around
    powers = (around / side)[:, None] ** np.arange(ORDER_OF_LOCAL_POLYNOMIALS + 1)
    regressors = driving[window][:, :, None] * powers / scale[:, None, None]
    transient = np.broadcast_to(powers, (len(centres), *powers.shape))
    columns = np.concatenate([regressors, transient], axis=2)
    q, r = np.linalg.qr(columns)
    row = np.linalg.inv(r)[:, 0, :]
    fitted = [np.einsum("kij,ki->kj", q.conj(), quantity[window]) for quantity in (excitation, answer)]
    gain, output = (np.einsum("kj,kj->k", row, quantity) for quantity in fitted)
    response = output / gain
    left = answer[window] - response[:, None] * excitation[window]
    left = left - np.einsum("kij,kj->ki", q, np.einsum("kij,ki->kj", q.conj(), left))
    free = window.shape[1] - columns.shape[2]
    variance = np.sum(np.abs(left) ** 2, axis=1) / free
    deviation = np.sqrt(variance * np.sum(np.abs(row) ** 2, axis=1)) / np.abs(gain)
    return FrequencyResponse.undivided(
        centres / (size * record.sample_time),
        response,
        deviation,
        2.0 * free,
        kind="local polynomial",
        channels=channels or Channels(),
        warnings=("noise and nonlinear distortion cannot be distinguished: the deviation covers both",),
        sample_time=record.sample_time,
    )
