"""Simulate a mass with Coulomb friction and a spring, to explain a measured response."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from friso.errors import InputError
from friso.identification.response.departure import Drag
from friso.identification.response.periodic import multisine
from friso.identification.response.records import ResponseRecord
from friso.identification.response.response import FrequencyResponse
from friso.identification.response.settings import settings


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
    positions = slid(
        np.tile(forces, settings.periods_simulated), sample_time, drag.mass.value, drag.coulomb.value, spring
    )[0]
    settled = slice(4 * forces.shape[1], None)
    records = [
        ResponseRecord(drag.sign * np.tile(force, settings.periods_simulated)[settled], position[settled], sample_time)
        for force, position in zip(forces, positions, strict=True)
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
