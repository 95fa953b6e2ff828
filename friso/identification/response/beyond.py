"""Model the effect of drive and modes above the band on the response of masses: delay, hold, compliance.

A force that is held for T at each sample acts T/2 late on average, and is weaker by sin(x)/x, x = omega T/2. The
samples of the position also contain the images of the force at the frequencies f + k/T with k = +/- 1, +/- 2 and so on:
a response G(f) is sampled as the sum over all k of G(f + k/T) sin(x)/(x + k pi), with a delay of T/2 (of the double
integrator with a zero-order hold that is x^2 cos(x)/sin(x)^2 / (m s^2): Astrom, Wittenmark, Computer-Controlled
Systems, 3rd ed. 1997, section 2.3). The images move every mass that is rigid up there, not the driven one alone. A log
does not show whether its force was held, so T is fitted, between zero and the sample time. Modes above the band add a
compliance that does not depend on frequency.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from friso.identification.response.response import FrequencyResponse
from friso.identification.response.settings import settings

DELAY, HELD, COMPLIANCES = range(3)
"""Indices of the parameters: the delay [s]; the square of the time for which the force is held [ms^2]; from
`COMPLIANCES` on, the compliance for each output."""

IMAGES = np.array([k for k in range(-8, 9) if k])[:, None]
"""Numbers k of the images that are summed, shape (images, 1). At four samples per period the others add 0.00002 of a
mass's response."""

ONE_THOUSANDTH = 1e-3


def beyond(model: Callable[[np.ndarray], np.ndarray], frequency: np.ndarray, parameters: np.ndarray) -> np.ndarray:
    """Add delay, hold and a compliance for each output to the responses of masses.

    `model` returns the responses of the masses, shape (outputs, n), at any frequencies [Hz], shape (n,), also negative
    ones. The result has the shape (outputs, lines).
    """
    delay, held, compliances = (
        parameters[DELAY],
        ONE_THOUSANDTH * np.sqrt(parameters[HELD]),
        parameters[COMPLIANCES:, None],
    )
    masses = model(frequency) * np.sinc(frequency * held)
    if held > 0:
        turns = IMAGES + frequency * held
        shares = np.sin(np.pi * frequency * held) / (np.pi * turns)
        images = model((turns / held).ravel()).reshape(len(masses), *turns.shape)
        masses = masses + np.sum(images * shares, axis=1)
    return (masses + compliances) * np.exp(-2j * np.pi * frequency * delay)


def bounds(response: FrequencyResponse, top: float, outputs: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower and the upper limits of the parameters: delay, hold, and compliances.

    Both arrays have the shape (COMPLIANCES + outputs,); compliances have no limits. The model covers frequencies up to
    `top` [Hz].
    """
    late, longest = settings.periods_of_a_delay / top, _longest(response, 0.5)
    free = np.full(outputs, np.inf)
    return np.array([-late, 0.0, *-free]), np.array([late, (longest / ONE_THOUSANDTH) ** 2, *free])


def believed(response: FrequencyResponse) -> tuple[float, float]:
    """Return value and standard deviation [ms squared] of the squared time of holding the force.

    They stand for a time between 0 and the whole sample time.
    """
    half = (_longest(response, settings.periods_of_a_sample) / ONE_THOUSANDTH) ** 2 / 2
    return half, half


def _longest(response: FrequencyResponse, share: float) -> float:
    """Return the sample time [s] of a response or, if not known, the longest that is plausible.

    Plausible is at most the fraction `share` of the period of the response's highest frequency.
    """
    return response.sample_time or share / float(response.frequency[-1])
