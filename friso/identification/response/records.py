"""Turn records of a periodic experiment into spectra, period by period."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from friso.errors import InputError
from friso.identification.logs.log import Log
from friso.identification.response.period import Periods, find_periods
from friso.identification.response.response import Channels
from friso.identification.response.settings import settings


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
    if abs(slip) * periods.count > settings.samples_of_a_slip:
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


def _excited(driving: np.ndarray) -> np.ndarray:
    """Tell which lines the external signal excites intentionally, shape (lines,).

    `driving` is its spectrum, shape (periods, lines). These lines stand out of its noise, and of other lines that are
    much weaker.
    """
    mean = np.abs(driving.mean(axis=0))
    noise = np.std(driving, axis=0, ddof=1) / np.sqrt(len(driving)) if len(driving) > 1 else 0 * mean
    excited = mean > settings.amplitude_of_an_excited_line * mean.max()
    excited &= mean > settings.deviations_of_an_excited_line * noise
    sizes = np.sort(mean[excited])[::-1]
    if sizes.size > 2:
        steps = sizes[:-1] / sizes[1:]
        cut = int(np.argmax(steps))
        share = np.sum(sizes[: cut + 1] ** 2) / np.sum(sizes**2)
        if steps[cut] > settings.step_between_lines and share > settings.power_of_meant_lines:
            excited &= mean >= sizes[cut]
    return excited


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
    return int(np.flatnonzero(off <= settings.distance_of_a_transient * off[later].max())[0])


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
