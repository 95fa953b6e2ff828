"""Margins of one loop, by their definitions: how much gain, phase or delay it takes to the edge of stability.

Astrom, Murray 2008, Feedback Systems, chapter 9 (stability margins).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from friso.frequency.loops import Drive, closed_poles, open_loop, sampled_open_loop
from friso.frequency.members import Members
from friso.frequency.system import Complex

POINTS = 2000
"""Frequencies at which a loop is looked at before anything is located, besides those about its resonances."""

BEYOND = 100.0
"""Factor by which these reach beyond the slowest and the fastest pole."""

NEGLIGIBLE = 1e-9
"""Share of the fastest pole below which one is taken to be 0."""

LIGHT = 0.3
"""Damping ratio below which a pole is a resonance."""

AROUND = np.tan(np.linspace(-1.5, 1.5, 15))
"""Where a resonance is looked at, in units of its half width."""

Response = Callable[[np.ndarray], Complex]


@dataclass(frozen=True)
class Margins:
    """Stability of a loop L cut at the actuator, and how far it is from its edge.

    `poles` [rad/s] of the closed loop (k,), complex; `crossovers` [Hz], all frequencies where abs(L) = 1; the least
    `phase_margin` [deg], lag or lead, that takes the loop to the edge; `gain_margin`, the factor above 1, and
    `gain_reduction`, that below 1, by which the gain may change; `delay_margin` [s]; `modulus_margin`, the least
    distance of L from -1, reached at `closest` [Hz]. Infinite (the reduction 0) where nothing takes it there; NaN for
    a loop that is not stable.
    """

    poles: Complex
    stable: bool
    crossovers: tuple[float, ...]
    phase_margin: float
    gain_margin: float
    gain_reduction: float
    delay_margin: float
    modulus_margin: float
    closest: float

    @property
    def peak_sensitivity(self) -> float:
        """Largest absolute value of 1/(1 + L)."""
        return 1 / self.modulus_margin if self.modulus_margin else np.inf


def margins(flat: Mapping[str, Any], one: Members) -> Margins:
    """The margins of a stage in one of its states."""
    drive = Drive.of(flat)
    poles = closed_poles(flat, one, drive)[0]
    poles = poles[np.isfinite(poles)]
    loop, response = loop_response(flat, one)
    omega = frequencies(poles, loop, drive.highest)
    ends = [0.0] if np.abs(loop).min() > 0 else []  # a loop with an integrator is infinite at rest
    ends += [drive.highest] if drive.sample_time else []
    return of_loop(response, poles, omega, response(np.array(ends)) if ends else np.empty(0, complex))


def loop_response(flat: Mapping[str, Any], one: Members) -> tuple[Complex, Response]:
    """Poles [rad/s] of the cut loop, and L over angular frequencies [rad/s], exactly, of a stage in one state."""
    drive = Drive.of(flat)
    continuous = open_loop(flat, one)
    poles = np.linalg.eigvals(continuous.a)[0].astype(complex)
    if not drive.sample_time:
        return poles, lambda omega: continuous.at(1j * omega)[0, :, 0, 0] * np.exp(-1j * omega * drive.delay)
    sampled = sampled_open_loop(flat, one, drive)
    return poles, lambda omega: sampled.at(np.exp(1j * omega * drive.sample_time))[0, :, 0, 0]


def frequencies(closed: Complex, modes: Complex, highest: float, points: int = POINTS) -> np.ndarray:
    """Angular frequencies [rad/s] that show all that a loop does, up to the highest, by the poles of the closed loop
    and those of what is in it: so many evenly spread, and more about resonances."""
    size = np.abs(closed)
    size = size[size > NEGLIGIBLE * size.max(initial=0.0)] if size.any() else np.ones(1)
    even = np.geomspace(size.min() / BEYOND, min(size.max() * BEYOND, highest), points)
    return with_resonances(even, np.concatenate([closed, modes]))


def with_resonances(even: np.ndarray, poles: Complex) -> np.ndarray:
    """Ascending angular frequencies [rad/s] with those about the resonances among these poles between them."""
    light = poles[np.abs(poles.real) < LIGHT * np.abs(poles.imag)]
    near = (np.abs(light.imag)[:, None] + np.abs(light.real)[:, None] * AROUND).ravel()
    return np.unique(np.concatenate([even, near[(near > even[0]) & (near < even[-1])]]))


def of_loop(response: Response, poles: Complex, omega: np.ndarray, ends: Complex) -> Margins:
    """The margins of a loop from its response, the poles of the closed loop, frequencies [rad/s] that show it, and its
    values where it is real at any gain: at rest, and at half the sampling frequency."""
    seen = response(omega)
    crossovers = _roots(lambda w: np.log(np.abs(response(np.array([w]))[0])), omega, np.log(np.abs(seen)))
    stable = bool(np.all(poles.real < 0))
    if not stable:
        return Margins(poles, stable, _hertz(crossovers), *[np.nan] * 6)
    turned = np.angle(-response(crossovers)) if crossovers.size else np.empty(0)
    gains = _gains(response, omega, seen, ends)
    closest, distance = _closest(response, omega, np.abs(1 + seen))
    return Margins(
        poles=poles,
        stable=stable,
        crossovers=_hertz(crossovers),
        phase_margin=float(np.degrees(np.abs(turned).min(initial=np.inf))),
        gain_margin=float(gains[gains > 1].min(initial=np.inf)),
        gain_reduction=float(gains[gains < 1].max(initial=0.0)),
        delay_margin=float((turned % (2 * np.pi) / crossovers).min(initial=np.inf)),
        modulus_margin=distance,
        closest=closest / (2 * np.pi),
    )


def _hertz(omega: np.ndarray) -> tuple[float, ...]:
    return tuple((omega / (2 * np.pi)).tolist())


def _roots(function: Callable[[float], float], omega: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Where a function of the frequency, known at some, passes zero."""
    with np.errstate(invalid="ignore"):
        passes = np.flatnonzero(values[:-1] * values[1:] < 0)
    found = [brentq(function, omega[k], omega[k + 1], xtol=1e-14 * omega[k], rtol=np.float64(1e-13)) for k in passes]
    return np.array(sorted({*found, *omega[values == 0].tolist()}))


def _gains(response: Response, omega: np.ndarray, seen: Complex, ends: Complex) -> np.ndarray:
    """Factors by which the gain takes the loop through -1: where L is real and negative."""
    real = _roots(lambda w: response(np.array([w]))[0].imag, omega, seen.imag)
    at = np.concatenate([response(real) if real.size else np.empty(0), ends])
    return -1 / at.real[at.real < 0]


def _closest(response: Response, omega: np.ndarray, distance: np.ndarray) -> tuple[float, float]:
    """Where L comes closest to -1 [rad/s], and how close."""
    inner = np.flatnonzero((distance[1:-1] <= distance[:-2]) & (distance[1:-1] <= distance[2:])) + 1
    least = int(distance.argmin())
    best = float(omega[least]), float(distance[least])
    for k in inner[distance[inner] < 1.1 * best[1]]:
        found: Any = minimize_scalar(
            lambda w: abs(1 + response(np.array([w]))[0]),
            bounds=(omega[k - 1], omega[k + 1]),
            method="bounded",
            options={"xatol": 1e-9 * omega[k]},
        )
        best = min(best, (float(found.x), float(found.fun)), key=lambda pair: pair[1])
    return best
