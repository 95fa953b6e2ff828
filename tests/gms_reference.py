"""Generalised Maxwell-slip elements event by event, written by hand from the paper (Al-Bender, Lampaert, Swevers 2005):
under an imposed velocity, and in the loop of a mass under van Dijk's controller. Nothing is shared with friso but the
names of keys."""

from collections.abc import Callable, Mapping
from math import exp, pi, sqrt
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

Flat = Mapping[str, Any]


class Elements:
    """States of stick or slip are kept by the caller: booleans, one per element. Forces in N, one per element."""

    def __init__(self, flat: Flat) -> None:
        count = sum(name.startswith("friction.element_stiffness.") for name in flat)
        self.stiffness, self.share, self.damping = (
            np.array([flat.get(f"friction.element_{key}.{n + 1}", 0.0) for n in range(count)])
            for key in ("stiffness", "share", "damping")
        )
        self.flat, self.count = flat, count

    def level(self, v: float) -> float:
        get = {name: self.flat[f"friction.{name}"] for name in ("static", "coulomb", "stribeck_velocity")}
        power = abs(v / get["stribeck_velocity"]) ** self.flat["friction.stribeck_exponent"]
        return get["coulomb"] + (get["static"] - get["coulomb"]) * exp(-power)

    def rates(self, forces: np.ndarray, slips: np.ndarray, v: float, way: float) -> np.ndarray:
        """dF_i/dt [N/s]; `way` is the sign of the motion."""
        pulled = self.flat["friction.attraction"] * (way * self.share - forces / self.level(v))
        return np.where(slips, pulled, self.stiffness * v)

    def drag(self, forces: np.ndarray, slips: np.ndarray, v: float, way: float) -> float:
        """Friction force [N]."""
        rates = self.rates(forces, slips, v, way)
        return float(np.sum(forces + self.damping / self.stiffness * rates) + self.flat["friction.viscous"] * v)

    def lacking(self, n: int, forces: np.ndarray, v: float, way: float) -> float:
        """Return by how much the force of a sticking element along the motion is below its share of the level [N]."""
        return float(self.share[n] * self.level(v) - way * forces[n])


class Loop:
    """A mass, its reference 0; states: position, velocity, filtered error, integral, forces of the elements."""

    def __init__(self, flat: Flat) -> None:
        self.elements = Elements(flat)
        self.mass = flat.get("masses.cart", 0.0) + flat.get("masses.stage", 0.0)
        omega, root = 2 * pi * flat["controller.crossover"], sqrt(1 / flat["controller.alpha"])
        self.tau_z, self.tau_p = root / omega, 1 / (omega * root)
        self.tau_i = flat["controller.beta"] * self.tau_z
        self.gain = flat["controller.tuned_mass"] * omega**2 / root

    def rates(self, x: np.ndarray, slips: np.ndarray, way: float) -> np.ndarray:
        position, velocity, filtered, integral = x[:4]
        slope = (-position - filtered) / self.tau_p
        force = self.gain * ((1 + self.tau_z / self.tau_i) * filtered + integral / self.tau_i + self.tau_z * slope)
        drag = self.elements.drag(x[4:], slips, velocity, way)
        forces = self.elements.rates(x[4:], slips, velocity, way)
        return np.array([velocity, (force - drag) / self.mass, slope, filtered, *forces])

    def run(self, x: np.ndarray, duration: float, rtol: float, method: str = "Radau") -> tuple[np.ndarray, ...]:
        """Times [s], states and slipping of all events, the start and the end; from no slip."""
        count = self.elements.count
        t, x = 0.0, np.array(x, dtype=float)
        slips = np.zeros(count, bool)
        way = float(np.sign(x[1]) or np.sign(self.rates(x, slips, 1.0)[1]))
        scale = np.array([1e-3, 1e-2, 1e-3, 1e-3, *self.elements.share])
        history = [(t, x, slips.copy())]
        while t < duration:
            sticking = [n for n in range(count) if not slips[n]]
            events = [_event(lambda _, y, n=n, w=way: self.elements.lacking(n, y[4:], y[1], w)) for n in sticking]
            events.append(_event(lambda _, y, w=way: w * y[1]))
            run = solve_ivp(
                lambda _, y, s=slips, w=way: self.rates(y, s, w),
                (t, duration), x, method, events=events, rtol=rtol, atol=rtol * 1e-3 * scale,
            )  # fmt: skip
            assert run.success
            t, x, slips = float(run.t[-1]), run.y[:, -1].copy(), slips.copy()
            if run.status == 1:
                happened = next(k for k, times in enumerate(run.t_events) if len(times))
                if happened == len(sticking):
                    slips[:], x[1], way = False, 0.0, -way
                else:
                    slips[sticking[happened]] = True
            history.append((t, x, slips.copy()))
        times, states, slipping = zip(*history, strict=True)
        return np.array(times), np.array(states), np.array(slipping)


def _event(function: Callable[..., float]) -> Any:
    """Return an event that ends the run where the function falls through 0."""
    function.terminal, function.direction = True, -1.0  # type: ignore[attr-defined]
    return function
