"""A plant with friction, driven by a sinusoidal force: by which force it moves by how much, and all inverse answers.

The masses, joint and parasitic mode are linear; friction acts on the cart through its describing function N(A, omega).
A force of amplitude Phi on the stage moves the cart by x_c = H_cs Phi - H_cc N x_c, so that its amplitude A is a root
of A abs(1 + H_cc N(A)) / abs(H_cs) = Phi, where H are the compliances of the masses without friction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.frequency.describing.function import dynamic_stiffness
from friso.frequency.describing.steady import RTOL
from friso.frequency.parts import mechanics

POINTS = 160
"""Amplitudes, per frequency, between which roots are looked for."""

BEYOND = 30.0
"""How far these reach beyond the amplitudes of a cart that is stuck and of one that is free."""

EXTREMES = (1e-6, 10.0)
"""Amplitudes in units of that of a free cart at which it counts as stuck, and as free."""

CLOSE = 1e-10
"""Relative error of the force at which an amplitude counts as found."""

STEPS = 60
"""Steps to a root at most."""


@dataclass(frozen=True)
class Driven:
    """A plant at some frequencies [Hz] (frequencies,), with its compliances without friction [m/N], complex, shape
    (frequencies, 2, 2): positions of stage and cart for forces on stage and cart."""

    flat: Mapping[str, Any]
    frequencies: np.ndarray
    compliances: np.ndarray
    rtol: float

    @classmethod
    def of(cls, flat: Mapping[str, Any], frequencies: np.ndarray, rtol: float = RTOL) -> Driven:
        """The plant of a stage whose limiter is not touched."""
        (compliances,) = mechanics(flat, np.zeros(1, bool)).at(2j * np.pi * frequencies)
        return cls(flat, frequencies, compliances, rtol)

    def answer(self, amplitudes: np.ndarray, which: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Forces [N] that move the cart by amplitudes [m] at the frequencies with these numbers, the positions of
        stage and cart over them [m/N], complex, and the dynamic stiffness of friction [N/m], each of shape (count,)."""
        stiffness = dynamic_stiffness(self.flat, amplitudes, self.frequencies[which], self.rtol)
        some = self.compliances[which]
        cart = some[:, 1, 0] / (1 + some[:, 1, 1] * stiffness)
        stage = some[:, 0, 0] - some[:, 0, 1] * stiffness * cart
        return amplitudes / np.abs(cart), np.stack([stage, cart], axis=1), stiffness

    def grid(self, forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Amplitudes [m] with their forces [N], both of shape (frequencies, POINTS), that reach from well below the
        amplitude of a stuck cart under the least of `forces` to well above that of a free one under the greatest."""
        count = len(self.frequencies)
        free = np.abs(self.compliances[:, 1, 0])
        every = np.arange(count)
        ends = [self.answer(share * free * forces.max(), every)[1][:, 1] for share in EXTREMES]
        compliant = np.abs([*ends, free])
        low, high = compliant.min(axis=0) * forces.min() / BEYOND, compliant.max(axis=0) * forces.max() * BEYOND
        amplitudes = np.geomspace(low, high, POINTS, axis=1)
        found, _, _ = self.answer(amplitudes.ravel(), np.repeat(every, POINTS))
        return amplitudes, found.reshape(amplitudes.shape)


@dataclass(frozen=True)
class Roots:
    """Amplitudes [m] of the cart, each with the numbers of its force and frequency; whether the force rises with the
    amplitude there, and the relative error of the force that is left; all of shape (count,)."""

    force: np.ndarray
    frequency: np.ndarray
    amplitude: np.ndarray
    rising: np.ndarray
    error: np.ndarray


def roots(driven: Driven, forces: np.ndarray) -> Roots:
    """All amplitudes at which forces [N] move the cart, as far as they are told apart by the grid."""
    amplitudes, reached = driven.grid(forces)
    excess = reached - forces[:, None, None]
    force, frequency, cell = np.nonzero(np.sign(excess[:, :, :-1]) * np.sign(excess[:, :, 1:]) < 0)
    low, high = (np.log(amplitudes[frequency, cell + side]) for side in (0, 1))
    f_low, f_high = (np.log(reached[frequency, cell + side] / forces[force]) for side in (0, 1))
    rising = f_high > f_low
    middle, error = _illinois(
        lambda x, which: np.log(driven.answer(np.exp(x), frequency[which])[0] / forces[force[which]]),
        (low, high),
        (f_low, f_high),
    )
    return Roots(force, frequency, np.exp(middle), rising, np.abs(error))


def _illinois(function: Any, ends: tuple[np.ndarray, ...], values: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
    """Zeros of many functions between ends at which they have these values of opposite sign, and what is left there:
    the secant of the bracket, with the value of an end that stays halved (Illinois)."""
    (low, high), (f_low, f_high) = (end.copy() for end in ends), (value.copy() for value in values)
    best, left = low.copy(), np.full(len(low), np.inf)
    open_ = np.arange(len(low))
    for _ in range(STEPS):
        if not open_.size:
            break
        a, b, f_a, f_b = low[open_], high[open_], f_low[open_], f_high[open_]
        x = (a * f_b - b * f_a) / (f_b - f_a)
        f = function(x, open_)
        best[open_], left[open_] = x, f
        upper = np.sign(f) == np.sign(f_b)
        f_low[open_], f_high[open_] = np.where(upper, f_a / 2, f), np.where(upper, f, f_b / 2)
        low[open_], high[open_] = np.where(upper, a, x), np.where(upper, x, b)
        open_ = open_[np.abs(f) > CLOSE]
    return best, left
