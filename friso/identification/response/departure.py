"""Find where a measured response leaves a linear model at low frequency, and whether friction explains it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from friso.errors import InputError
from friso.identification.estimate import Estimate
from friso.identification.response.estimators import multisine
from friso.identification.response.fitting import ResponseTarget
from friso.identification.response.records import ResponseRecord
from friso.identification.response.response import FrequencyResponse
from friso.identification.response.settings import settings
from friso.intervals import NORMAL_COVERAGE

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
    fit = ResponseTarget(model, values[None], deviation[None]).refined(np.array([np.log(inertia), inertia, 0.0]))
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
    coulomb = _coulomb(damping, velocity, into)
    return Drag(mass, damping, stiffness, coulomb, velocity, sign, float(left), tuple(warnings))


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
    half = float(np.hypot(damping.half_width * random, NORMAL_COVERAGE * model / np.sqrt(3)))
    return Estimate("friction.coulomb", unit, value, max(value - half, 0.0), value + half, method)


@dataclass(frozen=True)
class Explanation:
    """A simulation of friction, compared with a measured response that leaves its mass line.

    `responses` are simulated responses by the factor on the recorded input. `left` is the fraction of the departure
    from the mass line, weighted by the deviations, that the simulation with the recorded input does not explain. It is
    0 for a full explanation and 1 for none.
    """

    responses: Mapping[float, FrequencyResponse]
    left: float


def explained(
    drag: Drag,
    measured: FrequencyResponse,
    inputs: Sequence[np.ndarray],
    sample_time: float,
    limits: tuple[float, float],
    factors: Sequence[float] = (0.5, 1.0, 2.0),
) -> Explanation:
    """Simulate mass, spring and Coulomb friction of `drag` under each realisation's input.

    One period of each input is simulated, shape (n,). The result is compared with the `measured` response between
    `limits` [Hz]. The `factors`, of which 1 must be one, show how the response depends on the amplitude. Raises
    InputError if `drag` has no friction level or 1 is missing.
    """
    if not drag.coulomb.value > 0:
        raise InputError("friction.coulomb", "no level found in the departure", "a level above 0", "0.087 V")
    if 1.0 not in factors:
        raise InputError("factors", f"{list(factors)}", "factors with 1 among them, the recorded input", "(0.5, 1, 2)")
    forces = np.concatenate([factor * drag.sign * np.stack(inputs) for factor in factors])
    spring = max(drag.stiffness.value, 0.0)
    repeated = np.tile(forces, settings.periods_simulated)
    positions = slid(repeated, sample_time, drag.mass.value, drag.coulomb.value, spring)[0]
    settled = slice(4 * forces.shape[1], None)
    records = [
        ResponseRecord(drag.sign * force[settled], position[settled], sample_time)
        for force, position in zip(repeated, positions, strict=True)
    ]
    groups = {factor: records[i * len(inputs) : (i + 1) * len(inputs)] for i, factor in enumerate(factors)}
    responses = {factor: multisine(group, channels=measured.channels) for factor, group in groups.items()}
    return Explanation(responses, _unexplained(drag, measured.between(*limits), responses[1.0]))


def slid(
    force: np.ndarray, sample_time: float, mass: float, coulomb: float, stiffness: float
) -> tuple[np.ndarray, np.ndarray]:
    """Simulate a mass [kg] on a spring [N/m] with Coulomb friction [N] under forces [N].

    The mass starts at rest. Returns position [m] and velocity [m/s], with the forces' shape (runs, n). Time stepping
    treats sticking exactly (Moreau 1988, doi:10.1007/978-3-7091-2624-0_1): friction stops the mass if it can within the
    step. The error is of first order in the sample time.
    """
    position, velocity = np.zeros(len(force)), np.zeros(len(force))
    positions, velocities = np.empty_like(force), np.empty_like(force)
    most = sample_time * coulomb / mass
    for k in range(force.shape[1]):
        free = velocity + sample_time / mass * (force[:, k] - stiffness * position)
        velocity = free - np.clip(free, -most, most)
        position = position + sample_time * velocity
        positions[:, k], velocities[:, k] = position, velocity
    return positions, velocities


def _unexplained(drag: Drag, measured: FrequencyResponse, simulated: FrequencyResponse) -> float:
    """Return the part of a response's distance from its mass line that a simulation leaves.

    The part is a fraction: 0 if the simulation equals the response, 1 if it does no better than the mass line.
    """
    real, imaginary = (
        np.interp(measured.frequency, simulated.frequency, part(simulated.response)) for part in (np.real, np.imag)
    )
    line = -drag.sign / (drag.mass.value * (2 * np.pi * measured.frequency) ** 2)
    weight = 1 / measured.scatter()
    off = [np.linalg.norm(weight * (measured.response - model)) for model in (real + 1j * imaginary, line)]
    return float(off[0] / off[1])
