"""Find where a measured response leaves a linear model at low frequency, and whether friction explains it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from friso.errors import InputError
from friso.identification.estimate import Estimate
from friso.identification.response.fitting import refined
from friso.identification.response.response import FrequencyResponse
from friso.identification.response.settings import settings
from friso.intervals import COVERAGE

RANDOM = np.sqrt(2 / np.pi)
"""Equivalent damping of Coulomb friction F under a normally distributed velocity with standard deviation v, relative to
F/v (Gelb, Vander Velde 1968, table E.2: random-input describing function of the ideal relay)."""


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
        raise InputError(
            "response",
            f"{len(frequency)} lines",
            f"at least {4 * settings.lines_of_a_window} lines",
            "a multisine of 100 lines",
        )
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
    low, high = frequency[last - settings.lines_of_a_window + 1], frequency[last]
    middle = float(frequency[last - settings.lines_of_a_window // 2])
    onset = Estimate(name, "Hz", middle, float(low), float(high), method)
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


@dataclass(frozen=True)
class Drag:
    """Spring and damper that describe how friction acts on a rigid mass at low frequency.

    `coulomb` is the friction level that damps as much as the damper at the record's velocity (random, with standard
    deviation `velocity`). `sign` is -1 if the output opposes the input. `left` is the fraction of the departure from
    the mass line that spring and damper do not explain.
    """

    mass: Estimate
    damping: Estimate
    stiffness: Estimate
    coulomb: Estimate
    velocity: float
    sign: float
    left: float
    warnings: tuple[str, ...]


def friction_from_departure(
    response: FrequencyResponse, velocities: Sequence[np.ndarray], limits: tuple[float, float], sign: float = 1.0
) -> Drag:
    """Return the friction that explains how a response leaves its mass line at low frequency.

    The model 1/(m s^2 + d s + k) is fitted between `limits` [Hz], to the response times `sign`. Under a broad-band
    excitation, Coulomb friction F acts as a damper d = sqrt(2/pi) F/(standard deviation of the velocity), as long as
    the body slides most of the time. `velocities` [output unit/s] are those of the realisations, each of shape (n,).

    The interval of the friction covers that of the damping. It also covers the difference between normal and sinusoidal
    velocities (gain 4/pi over the amplitude). Raises InputError for fewer than 8 lines.
    """
    part = response.between(*limits)
    if len(part.frequency) < 8:
        raise InputError("limits", f"{len(part.frequency)} lines", "at least 8 lines", "0.2 to 5 Hz")
    s = 2j * np.pi * part.frequency
    values, deviation = sign * part.response, np.hypot(part.scatter(), 0.01 * np.abs(part.response))

    def model(p: np.ndarray) -> np.ndarray:
        return (1 / (np.exp(p[0]) * s**2 + p[1] * s + p[2]))[None]

    inertia = float(np.median(1 / np.abs(values[-4:] * s[-4:] ** 2)))
    fit = refined(model, np.array([np.log(inertia), inertia, 0.0]), values[None], deviation[None])
    into, out = part.channels.input_unit, part.channels.output_unit
    method = "mass, damper and spring fitted to the response"
    mass = fit.estimate("mass", f"{into} s^2/{out}", method, lambda p: float(np.exp(p[0])), positive=True)
    damping = fit.estimate("equivalent damping", f"{into} s/{out}", method, lambda p: float(p[1]))
    stiffness = fit.estimate("equivalent stiffness", f"{into}/{out}", method, lambda p: float(p[2]))
    velocity = float(np.sqrt(np.mean([np.var(run) for run in velocities])))
    bare = 1 / (np.exp(fit.parameters[0]) * s**2)
    left = np.linalg.norm((values - model(fit.parameters)[0]) / deviation) / np.linalg.norm((values - bare) / deviation)
    warnings = []
    if stiffness.low > 0:
        warnings.append("besides friction a spring acts (guide, cable, cogging or friction before sliding)")
    if left > 0.5:
        warnings.append("friction as a damper and a spring leaves more than half of the departure unexplained")
    return Drag(
        mass, damping, stiffness, _coulomb(damping, velocity, into), velocity, sign, float(left), tuple(warnings)
    )


def _coulomb(damping: Estimate, velocity: float, unit: str) -> Estimate:
    """Return the Coulomb friction that damps as much as an equivalent damper.

    `velocity` is the standard deviation of the record's velocity, `unit` that of the friction. The interval spans the
    describing functions of random and of sinusoidal motion. The friction is not determined without any damping.
    """
    method = "damping at low frequency, as Coulomb friction under random motion"
    if damping.high <= 0:
        reason = "the response shows no damping at low frequency"
        return Estimate.unknown("friction.coulomb", unit, method, reason, 0.0, 0.0)
    random, sine = velocity / RANDOM, velocity * np.sqrt(2) * np.pi / 4
    value = max(damping.value, 0.0) * random
    model = abs(sine / random - 1) * value
    half = float(np.hypot(damping.half_width * random, COVERAGE * model / np.sqrt(3)))
    return Estimate("friction.coulomb", unit, value, max(value - half, 0.0), value + half, method)
