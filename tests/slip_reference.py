"""Elements that stick or slip, event by event, written by hand: under an imposed displacement exactly, and in a closed
loop by SciPy with events. Nothing is shared with friso or the law's file but the names of keys."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import pi, sqrt
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

Flat = Mapping[str, Any]


def elements(flat: Flat) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness [N/m] and deflection at which they slip [m] of the elements."""
    count = sum(key.startswith("friction.element_stiffness.") for key in flat)
    stiffness = np.array([flat[f"friction.element_stiffness.{n}"] for n in range(1, count + 1)])
    strength = np.array([flat[f"friction.element_strength.{n}"] for n in range(1, count + 1)])
    return stiffness, strength / stiffness


def virgin(flat: Flat, way: Any) -> Any:
    """Force [N] after a way [m] from rest without load."""
    stiffness, limit = elements(flat)
    return np.sum(stiffness * np.minimum(np.asarray(way)[..., None], limit), axis=-1)


def imposed(flat: Flat, displacement: Sequence[float] | np.ndarray) -> np.ndarray:
    """Deflections [m], shape (n, elements), along a displacement [m] that is monotone between its n points, from rest
    without load: each moves along and stays within its limits."""
    _, limit = elements(flat)
    deflections = [np.zeros(len(limit))]
    for before, after in pairwise(displacement):
        deflections.append(np.clip(deflections[-1] + after - before, -limit, limit))
    return np.array(deflections)


class Loop:
    """A mass under van Dijk's controller, its reference 0, with elements whose force may drop as they break loose.

    States: position, velocity, filtered error, integral, deflections.
    """

    def __init__(self, flat: Flat) -> None:
        self.stiffness, self.limit = elements(flat)
        self.share, self.viscous = flat.get("friction.kinetic_share", 1.0), flat["friction.viscous"]
        self.mass = flat.get("masses.cart", 0.0) + flat.get("masses.stage", 0.0)
        omega, root = 2 * pi * flat["controller.crossover"], sqrt(1 / flat["controller.alpha"])
        self.tau_z, self.tau_p = root / omega, 1 / (omega * root)
        self.tau_i = flat["controller.beta"] * self.tau_z
        self.gain = flat["controller.tuned_mass"] * omega**2 / root

    def rates(self, x: np.ndarray, slips: np.ndarray) -> np.ndarray:
        position, velocity, filtered, integral = x[:4]
        slope = (-position - filtered) / self.tau_p
        force = self.gain * ((1 + self.tau_z / self.tau_i) * filtered + integral / self.tau_i + self.tau_z * slope)
        drag = self.stiffness @ x[4:] + self.viscous * velocity
        return np.array([velocity, (force - drag) / self.mass, slope, filtered, *np.where(slips, 0.0, velocity)])

    def run(self, x: np.ndarray, duration: float, rtol: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times [s], states and slipping of all events, the start and the end; from no slip."""
        count = len(self.limit)
        slips, t, x = np.zeros(count, bool), 0.0, np.array(x, dtype=float)
        scale = np.array([1e-3, 1e-2, 1e-3, 1e-3, *self.limit])
        history = [(t, x, slips.copy())]
        while t < duration:
            events = [self._breaks(n, side) for n in range(count) for side in (-1.0, 1.0) if not slips[n]]
            numbers = [n for n in range(count) for _ in range(2) if not slips[n]]
            if slips.any():
                events.append(_stops(float(np.sign(x[4 + int(np.argmax(slips))]))))
            run = solve_ivp(
                lambda _, y, slips=slips: self.rates(y, slips),
                (t, duration), x, "Radau", events=events, rtol=rtol, atol=rtol * 1e-3 * scale,
            )  # fmt: skip
            assert run.success
            t, x = float(run.t[-1]), run.y[:, -1].copy()
            slips = slips.copy()
            if run.status == 1:
                happened = next(k for k, times in enumerate(run.t_events) if len(times))
                if slips.any() and happened == len(events) - 1:
                    slips[:] = False
                    x[1] = 0.0
                else:
                    n = numbers[happened]
                    slips[n] = True
                    x[4 + n] = np.sign(x[4 + n]) * self.share * self.limit[n]
            history.append((t, x, slips.copy()))
        times, states, slipping = zip(*history, strict=True)
        return np.array(times), np.array(states), np.array(slipping)

    def _breaks(self, n: int, side: float) -> Any:
        def event(_: float, x: np.ndarray) -> float:
            return side * x[4 + n] - self.limit[n]

        event.terminal, event.direction = True, 1.0  # type: ignore[attr-defined]
        return event


def _stops(side: float) -> Any:
    def event(_: float, x: np.ndarray) -> float:
        return side * x[1]

    event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
    return event
