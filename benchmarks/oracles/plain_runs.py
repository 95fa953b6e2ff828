"""Simulate a stage plainly, with equations written by hand and a separate integrator.

The equations are those of `benchmarks.truth.by_hand`, with a second friction, at the motor, added here. The integrator
is the Rosenbrock method of Kaps and Rentrop with Shampine's coefficients, order 4 with an error of order 3 (L. F.
Shampine, Implementation of Rosenbrock methods, ACM Trans. Math. Software 8, 1982, doi:10.1145/355993.355994). There are
no events: the control of the error steps over every kink. Nothing of friso's equations or engine is used.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import njit

from benchmarks.truth.by_hand import (
    INTEGRAL,
    LAWS,
    LOW,
    NAMES,
    RATE,
    STATES,
    VC,
    VP,
    XC,
    XP,
    ByHand,
    NotWritten,
    V,
    X,
    Z,
    _rate,
    by_hand,
)

BRISTLE = len(STATES)
"""Index of the motor's bristles, after the states of `by_hand`."""

SIZE = BRISTLE + 1

MOTOR = "motor_friction."

SECOND = (
    *("static", "coulomb", "stribeck_velocity", "stribeck_exponent", "bristle_stiffness", "bristle_damping"),
    *("viscous", "regularisation_velocity"),
)
"""Keys of the friction at the motor, in the order in which `_all_rates` reads them after its law."""

SPEED = {"kp": 2, "ki": 3, "kd": 1, "tau": -1}
"""Powers of the factor by which the gains of a PID change when it becomes faster as a whole."""

MOST_TURNS = 20_000
"""Most turning points stored for a run; further ones are only counted."""

MOST_STEPS = 500_000
"""Steps after which a run is abandoned."""

AWAY = 1e6
"""Distance, in deflections at break-away, beyond which a run is abandoned because the loop is unstable."""


@dataclass(frozen=True)
class Run:
    """Result of a run.

    It has times [s] and places [m] of the turning points, the last state, the spread of the place in the last quarter
    [m], and the steps. It was completed if it took few enough steps and did not diverge.
    """

    times: np.ndarray
    places: np.ndarray
    state: np.ndarray
    spread: float
    steps: int
    done: bool


@dataclass(frozen=True)
class Plain:
    """A stage with its reference at 0, by hand, with friction at the motor (all 0: none)."""

    equations: ByHand
    second: np.ndarray

    @classmethod
    def of(cls, flat: Mapping[str, Any]) -> Plain:
        """Return the stage given as flat keys to SI numbers. Raises NotWritten."""
        second = np.zeros(1 + len(SECOND))
        model = flat.get(f"{MOTOR}model", "none")
        if model not in LAWS:
            raise NotWritten(f"{model} at the motor")
        if model != "none":
            keys = {key.removeprefix(MOTOR): value for key, value in flat.items() if key.startswith(MOTOR)}
            if missing := keys.keys() - {*SECOND, "model"}:
                raise NotWritten(", ".join(sorted(missing)))
            keys.setdefault("static", keys["coulomb"])
            second[:] = [LAWS.index(model), *(float(keys.get(name, 1.0)) for name in SECOND)]
        rest = {key: value for key, value in flat.items() if not key.startswith(MOTOR)}
        return cls(by_hand(rest).held(), second)

    def faster(self, factor: float) -> Plain:
        """Return the stage with its PID faster as a whole by a factor."""
        numbers = self.equations.numbers.copy()
        if numbers[NAMES.index("observer")]:
            raise NotWritten("the bandwidth of an observer")
        for name, power in SPEED.items():
            numbers[NAMES.index(name)] *= factor**power
        return replace(self, equations=replace(self.equations, numbers=numbers))

    def _number(self, name: str) -> float:
        return float(self.equations.numbers[NAMES.index(name)])

    @property
    def length(self) -> float:
        """Return the deflection [m] of the loop by the forces at which both frictions break away."""
        return self.equations.length + float(self.second[1] if self.second[0] else 0.0) / self._number("kp")

    @property
    def period(self) -> float:
        """Return roughly the time [s] between two departures to the same side.

        It is two waits at a third of `length`, and two swings.
        """
        return 2 * (3 * self._number("kp") / self._number("ki") + 2 * np.pi / self.equations.omega)

    @property
    def scales(self) -> np.ndarray:
        """Return the magnitudes of the states."""
        second = self.second[1] / self.second[5] if self.second[0] and self.second[5] else 1.0
        return np.append(self.equations.scales, second)

    @property
    def live(self) -> np.ndarray:
        """Return the indices of the states that ever move."""
        joint, motor, part = (self._number(name) > 0 for name in ("joint", "motor", "part"))
        bristles = self._number("law") in (LAWS.index("lugre"), LAWS.index("dahl"))
        second = self.second[0] in (LAWS.index("lugre"), LAWS.index("dahl"))
        moves = {
            **{X: True, V: True, XC: joint, VC: joint, XP: part or motor, VP: part or motor, Z: bristles},
            **{LOW: True, INTEGRAL: True, RATE: self._number("observer") > 0, BRISTLE: second},
        }
        return np.array([place for place, live in sorted(moves.items()) if live])

    def released(self, displacement: float) -> np.ndarray:
        """Return a start at rest at a displacement [m], with nothing wound up."""
        return np.append(self.equations.start(displacement), 0.0)

    def jumped(self, displacement: float) -> np.ndarray:
        """Return a start at rest at a displacement [m] after a jump of the reference.

        Filters of the error have not followed it yet.
        """
        y = self.released(displacement)
        if self._number("on_error") or self._number("observer"):
            y[[LOW, RATE, INTEGRAL]] = 0.0
        return y

    def stuck(self, displacement: float) -> np.ndarray:
        """Return a start at rest at a displacement [m], with the integral in balance.

        It balances the proportional force.
        """
        y = self.released(displacement)
        if self._number("tuned") or (self._number("tau") and self._number("on_error")):
            y[LOW] = -displacement
        y[INTEGRAL] = displacement * self._number("kp") / self._number("ki")
        return y

    def run(self, y: np.ndarray, end: float, rtol: float) -> Run:
        """Run from a state to the time `end` [s]."""
        measured, far = self.equations.measured, AWAY * self.length
        arrays = self.equations.numbers, self.second, self.scales, self.live
        run = _followed(y.astype(float), end, rtol, measured, far, *arrays)
        times, places, count, state, spread, steps, done = run
        return Run(times[:count], places[:count], state, spread, steps, done)


@njit(cache=True)
def _all_rates(y, n, second):  # type: ignore[no-untyped-def]
    """Return dy/dt, with the reference held at 0.

    The friction at the motor acts on its velocity.
    """
    out = np.zeros(SIZE)
    out[:BRISTLE] = _rate(0.0, y[:BRISTLE], np.zeros(4), n)
    law = second[0]
    if law > 0:
        _, static, coulomb, v_s, exponent, sigma0, sigma1, viscous, v_r = second
        v = y[VP]
        steady = coulomb
        if law != 2:
            steady += (static - coulomb) * np.exp(-(abs(v / v_s) ** exponent))
        friction = viscous * v
        if law == 3:
            friction += steady * np.tanh(v / v_r)
        else:
            out[BRISTLE] = v - sigma0 * abs(v) / steady * y[BRISTLE]
            friction += sigma0 * y[BRISTLE] + (sigma1 * out[BRISTLE] if law == 1 else 0.0)
        out[VP] -= friction / n[34]
    return out


@njit(cache=True)
def _slopes(y, base, n, second, scales, live):  # type: ignore[no-untyped-def]
    """Return the Jacobian of the moving states by differences.

    Velocities are changed to the side on which they are.
    """
    out = np.zeros((len(live), len(live)))
    moved = y.copy()
    for column, k in enumerate(live):
        step = 1e-7 * max(abs(y[k]), scales[k])
        if k in (V, VC, VP) and y[k] < 0:
            step = -step
        moved[k] += step
        out[:, column] = (_all_rates(moved, n, second)[live] - base) / (moved[k] - y[k])
        moved[k] = y[k]
    return out


@njit(cache=True)
def factored(a):  # type: ignore[no-untyped-def]
    """Factor a matrix in place (LU); return the order of rows."""
    size = len(a)
    order = np.arange(size)
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        if best != k:
            for j in range(size):
                a[k, j], a[best, j] = a[best, j], a[k, j]
            order[k], order[best] = order[best], order[k]
        for i in range(k + 1, size):
            if a[i, k] != 0.0:
                a[i, k] /= a[k, k]
                for j in range(k + 1, size):
                    a[i, j] -= a[i, k] * a[k, j]
    return order


@njit(cache=True)
def solved(lu, order, b):  # type: ignore[no-untyped-def]
    """Solve a system whose matrix was factored, with its order of rows, for the right-hand side b."""
    size = len(b)
    x = np.empty(size)
    for i in range(size):
        total = b[order[i]]
        for j in range(i):
            total -= lu[i, j] * x[j]
        x[i] = total
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            x[i] -= lu[i, j] * x[j]
        x[i] /= lu[i, i]
    return x


@njit(cache=True)
def _step(y, h, base, slopes, n, second, live):  # type: ignore[no-untyped-def]
    """Return the state after a step of h, and its estimated error, for the moving states."""
    lu = np.eye(len(live)) * (2.0 / h) - slopes
    order = factored(lu)
    moved = y.copy()
    g1 = solved(lu, order, base)
    moved[live] = y[live] + 2.0 * g1
    g2 = solved(lu, order, _all_rates(moved, n, second)[live] - 8.0 / h * g1)
    moved[live] = y[live] + 48 / 25 * g1 + 6 / 25 * g2
    third = _all_rates(moved, n, second)[live]
    g3 = solved(lu, order, third + (372 / 25 * g1 + 12 / 5 * g2) / h)
    g4 = solved(lu, order, third - (112 / 125 * g1 + 54 / 125 * g2 + 2 / 5 * g3) / h)
    moved[live] = y[live] + 19 / 9 * g1 + g2 / 2 + 25 / 108 * g3 + 125 / 108 * g4
    return moved, 17 / 54 * g1 + 7 / 36 * g2 + 125 / 108 * g4


@njit(cache=True)
def _followed(y, end, rtol, measured, far, n, second, scales, live):  # type: ignore[no-untyped-def]
    times, places = np.empty(MOST_TURNS), np.empty(MOST_TURNS)
    count, time, h, steps = 0, 0.0, end * 1e-9, 0
    low, high = np.inf, -np.inf
    speed = measured + 1
    base = _all_rates(y, n, second)[live]
    slopes = _slopes(y, base, n, second, scales, live)
    while time < end:
        steps += 1
        if steps > MOST_STEPS or not h > 1e-13 * end or abs(y[measured]) > far:
            return times, places, count, y, high - low, steps, False
        h = min(h, end - time, end / 50)
        moved, error = _step(y, h, base, slopes, n, second, live)
        size = 0.0
        for row, k in enumerate(live):
            size = max(size, abs(error[row]) / (rtol * max(scales[k], abs(y[k]))))
        if not size <= 1.0:  # NaN counts as too large
            h *= max(0.2, 0.9 * size ** (-1 / 3)) if size < np.inf else 0.2
            continue
        before = y[speed]
        time += h
        y = moved
        if before * y[speed] <= 0 and before != 0 and count < MOST_TURNS:
            times[count], places[count] = time, y[measured]
            count += 1
        if time >= 0.75 * end:
            low, high = min(low, y[measured]), max(high, y[measured])
        h *= min(4.0, 0.9 * size ** (-1 / 4)) if size > 0 else 4.0
        base = _all_rates(y, n, second)[live]
        slopes = _slopes(y, base, n, second, scales, live)
    return times, places, count, y, high - low, steps, True
