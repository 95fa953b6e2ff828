"""Compute closed orbits of one rigid mass by SciPy alone.

It uses shooting, multipliers by finite differences, and bifurcations. The mass rides on a LuGre bearing
(doi:10.1109/9.376053) under van Dijk's PID, its reference held at 0. An orbit begins where the mass passes its
reference, which it does once a swing and fast. A symmetric one ends half a period later in the mirror image of its
beginning. Runs are SciPy's LSODA at 1e-13; nothing of friso is used.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from scipy.integrate import odeint, solve_ivp

MASS, ALPHA, BETA = 1.7, 0.1, 2.0
STATIC, COULOMB, STRIBECK, SIGMA_0, SIGMA_1, SIGMA_2 = 3.0, 1.0, 1.6e-3, 1e5, np.sqrt(1e5), 0.5
"""The rigid mass of `references.md`, sections 2 and 5: 1.7 kg, friction of the thesis's Table 2, in SI units."""

SCALES = np.array([1e-3, 1e-2, 1e-5, 1e-3, 1e-4])
"""Magnitudes of place, speed, bristles, filtered error and its integral."""

RTOL = 1e-13

DIFFERENCE = 2e-6
"""Step of a central difference, relative to a state's magnitude."""

CLOSED = 1e-8
"""Largest gap of a closed orbit, relative to the magnitudes."""

MOST_TRIES, MOST_CHANGE = 12, 3.0
"""Most steps of Newton's method, and largest change of an unknown in one step."""

APART, FARTHEST, TELLING = 1e-7, 1e-3, 0.003
"""Least and largest relative difference of the first two speeds at the passage, the latter also the longest step; and
the difference of multipliers that decides the direction. Some families change by 1e-8 of the crossover while their
speed changes by a hundredth."""

SECANTS, REACHED = 40, 1e-7
"""Most secant steps, and relative change of the crossover at which they end."""

RELEASE, SETTLING = 2e-3, 60.0
"""Distance [m] from which the mass is released for a first orbit, and the time [s] after which its motion is taken."""


@njit(cache=True)
def rates(y: np.ndarray, crossover: float) -> np.ndarray:
    """Return the derivatives of place, speed, bristles, filtered error and its integral."""
    omega = 2 * np.pi * crossover
    gain = MASS * omega**2 * np.sqrt(ALPHA)
    tau_z, tau_p = 1 / (omega * np.sqrt(ALPHA)), np.sqrt(ALPHA) / omega
    tau_i = BETA * tau_z
    x, v, z, low, integral = y
    low_rate = (-x - low) / tau_p
    force = gain * ((1 + tau_z / tau_i) * low + integral / tau_i + tau_z * low_rate)
    level = COULOMB + (STATIC - COULOMB) * np.exp(-((v / STRIBECK) ** 2))
    z_rate = v - SIGMA_0 * abs(v) / level * z
    friction = SIGMA_0 * z + SIGMA_1 * z_rate + SIGMA_2 * v
    return np.array([v, (force - friction) / MASS, z_rate, low_rate, low])


def flow(y: np.ndarray, time: float, crossover: float) -> np.ndarray:
    """Return the state after a time [s]."""
    ends, report = odeint(
        lambda t, x: rates(x, crossover),
        y,
        (0.0, time),
        rtol=RTOL,
        atol=RTOL * SCALES,
        tfirst=True,
        mxstep=1_000_000,
        full_output=True,
    )
    if report["message"] != "Integration successful.":
        raise RuntimeError(report["message"])
    return ends[-1]


@dataclass(frozen=True)
class Orbit:
    """A closed orbit.

    It has a crossover [Hz], the state where it passes the reference, a time [s], and a sign: -1 if it ends in the
    mirror image of its beginning, else 1.
    """

    crossover: float
    start: np.ndarray
    time: float
    sign: float

    @property
    def period(self) -> float:
        return self.time * (2 if self.sign < 0 else 1)

    def returned(self) -> np.ndarray:
        """Return the state at the end, mirrored back; on an orbit it equals `start`."""
        return self.sign * flow(self.start, self.time, self.crossover)

    def gap(self) -> np.ndarray:
        return (self.returned() - self.start) / SCALES

    def moved(self, shift: np.ndarray) -> Orbit:
        """Return the orbit with its unknowns changed by fractions of their magnitudes.

        They are speed, bristles, filtered error, integral, time and crossover.
        """
        start = self.start + SCALES * np.append(0.0, shift[:4])
        return Orbit(self.crossover * (1 + shift[5]), start, self.time * (1 + shift[4]), self.sign)

    def map_derivative(self) -> np.ndarray:
        """Return the derivative of the Poincare map, (4, 4), relative to the magnitudes.

        It is by speed, bristles, filtered error and integral: differences of the flow, corrected for the time of the
        next passage.
        """
        columns = np.array([self._slope(k) for k in range(4)]).T
        speed = self.sign * rates(self.returned() * self.sign, self.crossover) / SCALES
        return (columns - np.outer(speed, columns[0] / speed[0]))[1:]

    def _slope(self, number: int) -> np.ndarray:
        shift = np.zeros(6)
        shift[number] = DIFFERENCE
        ends = [self.moved(side * shift).returned() for side in (1, -1)]
        return (ends[0] - ends[1]) / SCALES / (2 * DIFFERENCE)

    @property
    def multipliers(self) -> np.ndarray:
        """Return the multipliers of this orbit's map from passage to passage, largest first."""
        values = np.linalg.eigvals(self.map_derivative())
        return values[np.argsort(-np.abs(values))]

    @property
    def multiplier(self) -> float:
        """Return the largest multiplier, which is real here."""
        return float(self.multipliers[0].real)

    def amplitude(self) -> float:
        """Return half of peak to peak over the orbit [m]."""
        run = solve_ivp(
            lambda t, y: rates(y, self.crossover),
            (0.0, self.period),
            self.start,
            "Radau",
            rtol=1e-9,
            atol=1e-9 * SCALES,
            events=lambda t, y: y[1],
        )
        return float(np.ptp(run.y_events[0][:, 0])) / 2


def closed(guess: Orbit, free: int = 5) -> Orbit:
    """Return the orbit next to a guess by Newton's method.

    The unknown with the number `free` is held (5: the crossover, 0: the speed at the passage). Raises RuntimeError if
    there is none.
    """
    unknown = [k for k in range(6) if k != free]
    for _ in range(MOST_TRIES):
        gap = guess.gap()
        slopes = np.empty((5, 5))
        for column, k in enumerate(unknown):
            shift = np.zeros(6)
            shift[k] = DIFFERENCE if k < 4 else DIFFERENCE / 100
            slopes[:, column] = (guess.moved(shift).gap() - guess.moved(-shift).gap()) / (2 * shift[k])
        change = np.zeros(6)
        change[unknown] = np.linalg.solve(slopes, -gap)
        if not np.abs(change).max() < MOST_CHANGE:
            break
        guess = guess.moved(change)
        if np.abs(guess.gap()).max() < CLOSED:
            return guess
    raise RuntimeError(f"no orbit closed near {guess.crossover:.6g} Hz")


def first_orbit(crossover: float) -> Orbit:
    """Return the symmetric orbit in which a release ends."""
    upward = lambda t, y: y[0]  # noqa: E731
    upward.direction = 1.0  # pyright: ignore[reportFunctionMemberAccess]
    released = np.array([RELEASE, 0.0, 0.0, 0.0, 0.0])
    run = solve_ivp(
        lambda t, y: rates(y, crossover),
        (0.0, SETTLING),
        released,
        "LSODA",
        rtol=1e-9,
        atol=1e-9 * SCALES,
        events=upward,
    )
    times, states = run.t_events[0], run.y_events[0]
    start = states[-1].copy()
    start[0] = 0.0
    return closed(Orbit(crossover, start, float(times[-1] - times[-2]) / 2, -1.0))


def passing(crossover: float, state: np.ndarray, time: float, sign: float) -> Orbit:
    """Return the orbit near a state, from where it next passes the reference upward.

    `time` [s] is the time of a return.
    """
    upward = lambda t, y: y[0]  # noqa: E731
    upward.direction, upward.terminal = 1.0, True  # pyright: ignore[reportFunctionMemberAccess]
    run = solve_ivp(
        lambda t, y: rates(y, crossover), (0, 3 * time), state, "LSODA", rtol=1e-9, atol=1e-9 * SCALES, events=upward
    )
    start = run.y_events[0][0].copy()
    start[0] = 0.0
    return Orbit(crossover, start, time, sign)


def located(guess: Orbit, multiplier: float) -> Orbit:
    """Return the orbit near a guess with a given multiplier, 1 at a fold, -1 at a flip.

    Secants vary the speed at the passage, which continues around a fold.
    """

    def at(speed: float, near: Orbit) -> tuple[float, Orbit]:
        orbit = closed(replace(near, start=np.append([0.0, speed], near.start[2:])), free=0)
        return orbit.multiplier - multiplier, orbit

    speed, apart = float(guess.start[1]), APART
    before, last = at(speed, guess)
    off, orbit = at(speed * (1 + apart), last)
    while abs(off - before) < TELLING and apart < FARTHEST:
        apart *= 10
        off, orbit = at(speed * (1 + apart), last)
    for _ in range(SECANTS):
        step = -off * (orbit.start[1] - last.start[1]) / (off - before)
        step = np.clip(step, -FARTHEST * speed, FARTHEST * speed)
        before, last = off, orbit
        off, orbit = at(float(orbit.start[1] + step), orbit)
        if abs(off) < TELLING and abs(orbit.crossover / last.crossover - 1) < REACHED:
            return orbit
    raise RuntimeError(f"no multiplier of {multiplier:g} near {orbit.crossover:.6g} Hz")
