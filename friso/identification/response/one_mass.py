"""Decide whether a response needs two masses, or is explained by one."""

from __future__ import annotations

from functools import partial
from itertools import product

import numpy as np
from scipy import stats

from friso.identification.response.beyond import COMPLIANCES, HELD, believed, beyond, bounds
from friso.identification.response.fitting import ResponseFit, ResponseTarget, deviations
from friso.identification.response.response import FrequencyResponse
from friso.identification.response.settings import settings
from friso.identification.response.two_mass import TwoMass

MASS, DRAG, SPRING, BEYOND = range(4)
"""Indices of the parameters: logarithm of the mass, viscous friction, spring to ground; from `BEYOND` on, the
parameters of module `beyond`."""


def needs_two(model: TwoMass, driven: FrequencyResponse, other: FrequencyResponse | None = None) -> bool:
    """Tell whether two masses explain the responses much better than one mass does.

    The single mass has viscous friction and a spring to ground. Both models include delay and compliance, and cover the
    band of `model`. An F-test decides whether the difference is chance; its level is divided by the number of lines,
    because the mode could lie at any line.
    """
    responses = [response for response in (driven, other) if response is not None]
    one, two = fit_one_mass(responses, model.signs, model.band), model.fit
    free, more = max(two.count - len(two.parameters), 1), len(two.parameters) - len(one.parameters)
    better = (one.squares - two.squares) / more / (two.squares / free)
    chance = float(stats.f.sf(better, more, free)) * one.count / (2 * len(responses))
    return two.squares < settings.squares_left_by_two * one.squares and chance < settings.chance_of_two_masses


def fit_one_mass(
    responses: list[FrequencyResponse], signs: tuple[float, ...], band: tuple[float, float]
) -> ResponseFit:
    """Fit one mass to the responses of one or two outputs on the same lines in a band [Hz].

    Responses with sign -1 are reversed. Fits start from several corner frequencies of friction and spring inside and
    below the band; the best is returned, with parameters as listed in this module.
    """
    held = {BEYOND + HELD: believed(responses[0])}
    outside = bounds(responses[0], band[1], len(responses))
    responses = [response.between(*band) for response in responses]
    frequency = responses[0].frequency
    values = np.stack([sign * response.response for response, sign in zip(responses, signs, strict=False)])
    deviation = np.stack([deviations(response) for response in responses])

    target = ResponseTarget(partial(one_mass, frequency=frequency), values, deviation)
    lower, upper = np.array([-np.inf, 0.0, 0.0, *outside[0]]), np.array([np.inf, np.inf, np.inf, *outside[1]])
    starts = sorted(_starts(values, frequency), key=target.misfit)[: settings.starts_refined]
    fits = [target.refined(start, lower, upper, held) for start in starts]
    return min(fits, key=lambda fit: fit.squares)


def one_mass(parameters: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Return the response of one mass to a force, at frequencies [Hz]; shape (outputs, lines).

    The mass has viscous friction and a spring to ground. Delay, hold and a compliance for each output are added.
    `parameters` are in the order of this module's indices, such as `MASS`.
    """
    mass, outputs = np.exp(parameters[MASS]), len(parameters) - BEYOND - COMPLIANCES

    def masses(frequency: np.ndarray) -> np.ndarray:
        s = 2j * np.pi * frequency
        return np.tile(1 / (mass * s**2 + parameters[DRAG] * s + parameters[SPRING]), (outputs, 1))

    return beyond(masses, frequency, parameters[BEYOND:])


def _starts(values: np.ndarray, frequency: np.ndarray) -> list[np.ndarray]:
    """Return starts of a fit, with different corner frequencies of friction and spring.

    The magnitude of each start is, on average, that of the first response in `values`.
    """
    places = 2 * np.pi * np.array([0.0, *np.geomspace(frequency[0] / 3, frequency[-1], 6)])
    starts = []
    for corner, mode in product(places, places):
        drag, spring = corner + settings.width_of_a_start * mode, mode**2
        rest = np.zeros(COMPLIANCES + len(values))
        shape = one_mass(np.array([0.0, drag, spring, *rest]), frequency)[0]
        level = float(np.mean(np.log(np.abs(shape) / np.abs(values[0]))))
        starts.append(np.array([level, drag * np.exp(level), spring * np.exp(level), *rest]))
    return starts
