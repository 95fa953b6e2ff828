"""Solve for the motions of a plant with friction under a sinusoidal force.

Masses, joint and parasitic mode are linear; friction acts on the cart through its describing function N(A, omega). A
force of amplitude Phi on the stage moves the cart by x_c = H_cs Phi - H_cc N x_c. So its amplitude A is a root of A
abs(1 + H_cc N(A)) / abs(H_cs) = Phi, where H are the compliances of the masses without friction. A force may have
several roots.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from friso.frequency.describing.function import dynamic_stiffness
from friso.frequency.describing.steady import RTOL, Imposition
from friso.frequency.parts import mechanics
from friso.frequency.settings import settings

LIMITS = (1e-18, 1e18)
"""Smallest and largest amplitude [m] of the search."""


@dataclass(frozen=True)
class DrivenPlant:
    """A plant at some frequencies [Hz], shape (frequencies,), without its friction.

    `compliances` [m/N], complex, shape (frequencies, 2, 2), are positions of stage and cart for forces on stage and
    cart. `flat` has the stage's keys in SI, among them the friction.
    """

    flat: Mapping[str, Any]
    frequencies: np.ndarray
    compliances: np.ndarray
    rtol: float

    @classmethod
    def of(cls, flat: Mapping[str, Any], frequencies: np.ndarray, rtol: float = RTOL) -> DrivenPlant:
        """Return the plant of a stage whose limiter is not touched, at frequencies [Hz]."""
        (compliances,) = mechanics(flat, np.zeros(1, bool)).at(2j * np.pi * frequencies)
        return cls(flat, frequencies, compliances, rtol)

    def answer(self, amplitudes: np.ndarray, which: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the forces [N] that move the cart by amplitudes [m], shape (count,).

        `which` numbers the frequencies. Also returns the positions of stage and cart over the forces [m/N], complex,
        (count, 2), and the dynamic stiffness of friction [N/m]. Results are NaN or infinite where friction was not
        found.
        """
        stiffness = dynamic_stiffness(self.flat, amplitudes, self.frequencies[which], self.rtol)
        compliances = self.compliances[which]
        with np.errstate(all="ignore"):  # failures give NaN or infinity, which is no root
            cart = compliances[:, 1, 0] / (1 + compliances[:, 1, 1] * stiffness)
            stage = compliances[:, 0, 0] - compliances[:, 0, 1] * stiffness * cart
            return amplitudes / np.abs(cart), np.stack([stage, cart], axis=1), stiffness

    @cached_property
    def stuck(self) -> float:
        """Return an amplitude [m] so small that bristles do not slip."""
        friction = Imposition.of(self.flat, np.ones(1), np.ones(1), self.rtol)
        return float(
            np.min(
                settings.stuck_amplitude * friction.scales[0, friction.inner],
                initial=settings.stateless_amplitude if not friction.inner else 1,
            )
        )

    def ends(self, forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return amplitudes [m] that need less force, and more, than some forces [N].

        Both have the shape (forces, frequencies). They lie well beyond the amplitudes of a stuck and of a free cart,
        and do not depend on other forces.
        """
        rows, shape = np.arange(len(self.frequencies)), (len(forces), len(self.frequencies))
        with np.errstate(over="ignore"):
            bare = np.clip(np.abs(self.compliances[:, 1, 0]) * forces[:, None], *LIMITS)
        stuck = np.abs(self.answer(np.full(shape[1], self.stuck), rows)[1][:, 1])
        slid = np.abs(self.answer((settings.free_amplitude * bare).ravel(), np.tile(rows, shape[0]))[1][:, 1]).reshape(
            shape
        )
        with np.errstate(over="ignore"):
            states = np.stack([bare, stuck * forces[:, None], slid * forces[:, None]])
        low, high = (
            np.fmin.reduce(states) / settings.amplitudes_beyond,
            np.fmax.reduce(states) * settings.amplitudes_beyond,
        )
        return self._extended(low, forces, -1), self._extended(high, forces, 1)

    def _extended(self, amplitudes: np.ndarray, forces: np.ndarray, side: int) -> np.ndarray:
        """Return amplitudes moved until they need less force (`side` -1) or more (1) than `forces`."""
        amplitudes = np.clip(amplitudes, *LIMITS)
        force, frequency = (indices.ravel() for indices in np.indices(amplitudes.shape))
        for _ in range(settings.most_decades):
            reached = self.answer(amplitudes[force, frequency], frequency)[0]
            missed = ~(side * (reached - forces[force]) > 0)
            force, frequency = force[missed], frequency[missed]
            if not force.size:
                break
            amplitudes[force, frequency] = np.clip(amplitudes[force, frequency] * 10.0**side, *LIMITS)
        return amplitudes

    def grid(self, forces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return amplitudes [m] and the forces [N] that they need, both (frequencies, points).

        The third result, shape (forces, frequencies, points - 1), marks the cells of the grid in which an amplitude for
        a force is searched.
        """
        low, high = self.ends(forces)
        first = np.floor(settings.amplitudes_per_decade * np.log10(low)).astype(int)
        last = np.ceil(settings.amplitudes_per_decade * np.log10(high)).astype(int)
        points = int(np.max(last.max(axis=0) - first.min(axis=0))) + 1
        numbers = first.min(axis=0)[:, None] + np.arange(points)
        amplitudes = 10.0 ** (numbers / settings.amplitudes_per_decade)
        pending = numbers <= last.max(axis=0)[:, None]
        reached = np.full(amplitudes.shape, np.nan)
        reached[pending], _, _ = self.answer(amplitudes[pending], np.nonzero(pending)[0])
        cells = numbers[None, :, :-1]
        return amplitudes, reached, (cells >= first[:, :, None]) & (cells < last[:, :, None])


@dataclass(frozen=True)
class Roots:
    """Amplitudes [m] of the cart in equilibrium with a force at a frequency, shape (count,).

    `force` and `frequency` are indices. `rising` is true if the force rises with the amplitude, and `error` is the
    remaining relative error. `unknown`, of shape (forces, frequencies), marks where friction was not found at an
    amplitude that may be a root.
    """

    force: np.ndarray
    frequency: np.ndarray
    amplitude: np.ndarray
    rising: np.ndarray
    error: np.ndarray
    unknown: np.ndarray


def driven_amplitudes(driven: DrivenPlant, forces: np.ndarray) -> Roots:
    """Find all amplitudes at which forces [N] move the cart, as far as the grid resolves."""
    amplitudes, reached, inside = driven.grid(forces)
    above = reached >= forces[:, None, None]
    computed = np.isfinite(reached[:, :-1] + reached[:, 1:])
    force, frequency, cell = np.nonzero((above[:, :, :-1] != above[:, :, 1:]) & inside & computed)
    low, high = (np.log(amplitudes[frequency, cell + side]) for side in (0, 1))
    f_low, f_high = (np.log(reached[frequency, cell + side] / forces[force]) for side in (0, 1))
    rising = f_high > f_low
    middle, error = _illinois(
        lambda x, which: np.log(driven.answer(np.exp(x), frequency[which])[0] / forces[force[which]]),
        (low, high),
        (f_low, f_high),
    )
    return Roots(force, frequency, np.exp(middle), rising, np.abs(error), np.any(inside & ~computed, axis=2))


def _illinois(function: Any, ends: tuple[np.ndarray, ...], values: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
    """Return zeros of many functions between ends of opposite sign, and the remaining values.

    `ends` are the lower and upper ends, `values` the functions there. The method takes the secant of the bracket, and
    halves the value at an end that stays (Illinois).
    """
    (low, high), (f_low, f_high) = (end.copy() for end in ends), (value.copy() for value in values)
    best, left = low.copy(), np.full(len(low), np.inf)
    open_ = np.arange(len(low))
    for _ in range(settings.most_root_steps):
        if not open_.size:
            break
        a, b, f_a, f_b = low[open_], high[open_], f_low[open_], f_high[open_]
        x = (a * f_b - b * f_a) / (f_b - f_a)
        f = function(x, open_)
        best[open_], left[open_] = x, f
        upper = np.sign(f) == np.sign(f_b)
        f_low[open_], f_high[open_] = np.where(upper, f_a / 2, f), np.where(upper, f, f_b / 2)
        low[open_], high[open_] = np.where(upper, a, x), np.where(upper, x, b)
        open_ = open_[np.abs(f) > settings.force_error]
    return best, left
