"""Responses from arbitrary excitation: Welch's averages, and the local polynomial method.

With a reference, both methods are indirect, which a closed loop requires: the response is the ratio of the responses of
output and input to the reference.
"""

from __future__ import annotations

import numpy as np
from scipy import signal

from friso.errors import InputError
from friso.identification.response.records import ResponseRecord
from friso.identification.response.response import Channels, FrequencyResponse
from friso.identification.response.settings import settings

OVERLAP = 1 / 36
"""Squared correlation of neighbouring Hann segments that overlap by half (Welch 1967, doi:10.1109/TAU.1967.1161901)."""


def welch(record: ResponseRecord, resolution: float, channels: Channels | None = None) -> FrequencyResponse:
    """Estimate a response and its coherence by averages over overlapping Hann segments.

    The length of a segment is one over the `resolution` [Hz]. Without a reference the estimate is H1. Its variance is
    the power of the output that is not coherent with the external signal (Bendat, Piersol, Random Data, 4th ed., ch.
    9), divided by the effective number of segments. Leakage is not included: a mode sharper than the resolution comes
    out too low. Raises InputError for fewer than 4 segments.
    """
    record = record.checked()
    length = round(1 / (resolution * record.sample_time))
    count = (2 * len(record.input)) // max(length, 1) - 1
    if length < 8 or count < 4:
        text = f"{resolution:g} Hz: {count} segments of {length} samples"
        raise InputError("resolution", text, "at least 4 segments of at least 8 samples", "0.5 Hz")
    external = record.input if record.reference is None else record.reference

    def spectrum(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        spectral = signal.csd(first, second, 1 / record.sample_time, nperseg=length, detrend="linear")
        return np.asarray(spectral[1], complex)[1:-1]

    frequency = np.fft.rfftfreq(length, record.sample_time)[1:-1]
    driven, answer = spectrum(external, record.input), spectrum(external, record.output)
    power = np.real(spectrum(external, external))
    with np.errstate(divide="ignore", invalid="ignore"):
        response = answer / driven
        total = np.real(spectrum(record.output, record.output))
        left = total - 2 * np.real(np.conj(response) * spectrum(record.input, record.output))
        left += np.abs(response) ** 2 * np.real(spectrum(record.input, record.input))
        effective = count / (1 + 2 * OVERLAP * (count - 1) / count)
        deviation = np.sqrt(np.maximum(left, 0.0) * power / (max(effective - 1, 1) * np.abs(driven) ** 2))
        coherence = np.abs(answer) ** 2 / (power * total)
    excited = np.sqrt(power) > settings.amplitude_of_a_weak_line * np.sqrt(power.max())
    degrees = np.full(len(frequency), 2 * (effective - 1))
    return _response(frequency, response, deviation, degrees, "welch", channels, coherence, record.sample_time).at(
        excited
    )


def local_polynomial(record: ResponseRecord, channels: Channels | None = None) -> FrequencyResponse:
    """Estimate a response by the local polynomial method, free of leakage.

    The method is that of Pintelon, Schoukens, 2nd ed., ch. 7: about every line, response and transient are polynomials
    of order 2 in the frequency over 17 lines of the spectrum of the whole record; the residual is the noise. One line
    in 9 is returned, so that neighbours share little. Raises InputError for a record of fewer than 200 samples.
    """
    record = record.checked(200)
    external = record.input if record.reference is None else record.reference
    size = len(external)
    driving, excitation, answer = (
        np.fft.rfft(channel - channel.mean()) / size for channel in (external, record.input, record.output)
    )
    centres = np.arange(
        1 + settings.lines_on_a_side, len(driving) - settings.lines_on_a_side - 1, settings.lines_on_a_side + 1
    )
    window = centres[:, None] + np.arange(-settings.lines_on_a_side, settings.lines_on_a_side + 1)
    strong = np.sqrt(np.mean(np.abs(driving[window]) ** 2, axis=1))
    centres, window = (
        centres[strong > settings.amplitude_of_a_weak_line * strong.max()],
        window[strong > settings.amplitude_of_a_weak_line * strong.max()],
    )
    powers = (np.arange(-settings.lines_on_a_side, settings.lines_on_a_side + 1) / settings.lines_on_a_side)[
        :, None
    ] ** np.arange(settings.order_of_local_polynomials + 1)
    scale = np.sqrt(np.mean(np.abs(driving[window]) ** 2, axis=1))
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
    frequency = centres / (size * record.sample_time)
    degrees = np.full(len(centres), 2.0 * free)
    return _response(frequency, response, deviation, degrees, "local polynomial", channels, None, record.sample_time)


def _response(
    frequency: np.ndarray,
    response: np.ndarray,
    deviation: np.ndarray,
    degrees: np.ndarray,
    kind: str,
    channels: Channels | None,
    coherence: np.ndarray | None,
    sample_time: float,
) -> FrequencyResponse:
    """Make the frequency response to an arbitrary excitation from estimates on spectral lines."""
    unknown = np.full(len(frequency), np.nan)
    warnings = ("noise and nonlinear distortion cannot be distinguished: the deviation covers both",)
    return FrequencyResponse(
        frequency,
        response,
        deviation,
        unknown,
        unknown,
        degrees,
        kind,
        channels or Channels(),
        coherence,
        warnings,
        sample_time,
    )
