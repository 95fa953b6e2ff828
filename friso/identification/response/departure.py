"""Find where a measured response leaves a linear model at low frequency."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import stats

from friso.errors import InputError
from friso.identification.estimate import Estimate
from friso.identification.response.response import FrequencyResponse
from friso.identification.response.settings import settings


@dataclass(frozen=True)
class Departure:
    """Where a response leaves its linear model at low frequency.

    Below `frequency` [Hz] the response differs from the model. `excess` (lines,) is |G/G_model| at all frequencies
    `lines` [Hz]. `differ` tells whether realisations differ below `frequency` by more than noise (chance below 1 %),
    None with a single realisation. `ratio` is their scatter there relative to the noise.
    """

    frequency: Estimate
    lines: np.ndarray
    excess: np.ndarray
    differ: bool | None
    ratio: float


def departure(response: FrequencyResponse, model: Callable[[np.ndarray], np.ndarray]) -> Departure:
    """Find where a response leaves `model`, a function of frequencies [Hz], at its low end.

    In windows of neighbouring lines in the lower half, the mean of the ratio of response to model is tested against 1
    (F-test). The scale of the test comes from the upper half, where the model is taken to hold as well as it can. The
    departure ends with the highest window that differs. Raises InputError for fewer than 36 lines.
    """
    frequency = response.frequency
    if len(frequency) < 4 * settings.lines_of_a_window:
        least = f"at least {4 * settings.lines_of_a_window} lines"
        raise InputError("response", f"{len(frequency)} lines", least, "a multisine of 100 lines")
    ratio = response.response / model(frequency)
    weight = 2 * np.abs(response.response) ** 2 / response.scatter() ** 2
    half, ones = len(frequency) // 2, np.ones(settings.lines_of_a_window)
    pulls = np.abs(np.convolve(weight * (ratio - 1), ones, "valid")) ** 2 / np.convolve(weight, ones, "valid") / 2
    scale = max(float(np.mean(pulls[half:])), 1.0)
    limit = scale * stats.f.ppf(1 - settings.chance_of_a_departure, 2, max(np.median(response.degrees), 2.0))
    off = np.flatnonzero(pulls[:half] > limit)
    name, method = "departure frequency", f"mean over {settings.lines_of_a_window} lines, against the linear model"
    if not off.size:
        reason = "the response follows the model down to its lowest line"
        onset = Estimate.unknown(name, "Hz", method, reason, 0.0, float(frequency[0]))
        return Departure(onset, frequency, np.abs(ratio), *_differ(response, slice(None)))
    last = int(off[-1]) + settings.lines_of_a_window - 1
    places = last - settings.lines_of_a_window // 2, last - settings.lines_of_a_window + 1, last
    value, low, high = (float(frequency[place]) for place in places)
    onset = Estimate(name, "Hz", value, low, high, method)
    return Departure(onset, frequency, np.abs(ratio), *_differ(response, slice(0, last + 1)))


def _differ(response: FrequencyResponse, part: slice) -> tuple[bool | None, float]:
    """Tell whether distortion exceeds noise on the spectral lines `part`, and by which ratio.

    The ratio is that of noise with distortion to noise alone. The first result is None, and the ratio NaN, if the
    distortion is not known.
    """
    noise, distortion = response.noise[part], response.distortion[part]
    if not np.all(np.isfinite(distortion)) or not np.all(noise > 0):
        return None, np.nan
    ratio = np.median((noise**2 + distortion**2) / noise**2)
    degrees = float(np.median(response.degrees))
    return bool(ratio > stats.f.ppf(1 - settings.chance_of_a_departure, degrees, 10 * degrees)), float(np.sqrt(ratio))
