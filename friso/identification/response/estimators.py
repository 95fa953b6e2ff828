"""Estimate responses from periodic excitation, with noise and distortion separated, and from any other.

For periodic excitation, the robust method of Pintelon, Schoukens, System Identification (2nd ed., 2012), chapter 4:
noise differs from period to period, nonlinear distortion from one random-phase realisation to another. With an external
reference (closed loop, indirect) both spectra are taken relative to it, which makes them comparable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from friso.errors import InputError
from friso.identification.response.records import ResponseRecord, Spectra, spectra
from friso.identification.response.response import Channels, FrequencyResponse
from friso.identification.response.settings import settings


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


def _together(records: list[Spectra]) -> tuple[list[Spectra], list[str]]:
    """Bring the spectra of realisations to common frequencies; also return remarks on clocks.

    Raises InputError without common lines.
    """
    if not records:
        raise InputError("records", "none", "at least one record", "two realisations of a multisine")
    spacings = np.array([realisation.frequency[0] for realisation in records])
    apart = float(np.ptp(spacings) / spacings.min())
    counts = np.array([len(realisation.frequency) for realisation in records])
    if apart > settings.period_tolerance or np.ptp(counts) > 1 + settings.period_tolerance * counts.min():
        text = "periods of " + ", ".join(f"{1 / spacing:.6g} s" for spacing in spacings)
        raise InputError("records", text, "realisations with the same period and sample time", "5 s each")
    records = [_first_lines(realisation, int(counts.min())) for realisation in records]
    if apart <= settings.tolerance_of_equal_periods:
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


def _total(records: list[Spectra], excited: np.ndarray, response: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the deviation of the mean response over realisations, and its degrees of freedom.

    Both are arrays of shape (lines,). With few realisations, neighbouring spectral lines share their variance.
    """
    outputs, inputs = _relative(records, excited)
    count = len(records)
    squares = np.sum(np.abs(outputs - response * inputs) ** 2, axis=0)
    relative = squares / (count * (count - 1)) / np.abs(outputs.mean(axis=0)) ** 2
    freedom = 2 * (count - 1)
    width = 1 if freedom >= settings.freedom_of_a_variance else min(settings.lines_sharing_variance, len(relative))
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
    near = np.argsort(np.abs(free[:, None] - places), axis=0, kind="stable")[: settings.lines_sharing_variance]
    local = np.maximum(power[near].mean(axis=0), 0.0)
    return np.sqrt(local) / np.abs(realisation.input.mean(axis=0)[places])


def local_polynomial(record: ResponseRecord, channels: Channels | None = None) -> FrequencyResponse:
    """Estimate a response by the local polynomial method, free of leakage.

    The method is that of Pintelon, Schoukens, 2nd ed., ch. 7: about every line, response and transient are polynomials
    of order 2 in the frequency over 17 lines of the spectrum of the whole record; the residual is the noise. One line
    in 9 is returned, so that neighbours share little. With a reference the method is indirect, which a closed loop
    requires: the response is the ratio of the responses of output and input to the reference. Raises InputError for a
    record of fewer than 200 samples.
    """
    record, side = record.checked(200), settings.lines_on_a_side
    size = len(record.driving)
    driving, excitation, answer = (
        np.fft.rfft(channel - channel.mean()) / size for channel in (record.driving, record.input, record.output)
    )
    centres = np.arange(1 + side, len(driving) - side - 1, side + 1)
    around = np.arange(-side, side + 1)
    strength = np.sqrt(np.mean(np.abs(driving[centres[:, None] + around]) ** 2, axis=1))
    strong = strength > settings.amplitude_of_a_weak_line * strength.max()
    centres, scale = centres[strong], strength[strong]
    window = centres[:, None] + around
    powers = (around / side)[:, None] ** np.arange(settings.order_of_local_polynomials + 1)
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
