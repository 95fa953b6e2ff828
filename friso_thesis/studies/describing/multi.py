"""Find a periodic motion of a loop with friction as a Fourier series.

The method is multi-harmonic balance with Newton's method, alternating frequency and time (Cameron, Griffin 1989,
doi:10.1115/1.3176036). The series gives the velocity in time, and the velocity the friction force. The harmonics of
that force must move the loop by the series. Mechanics and controller may be any linear ones. The method cannot find a
cycle by itself, and single-harmonic balance, the usual start, may have none (`balance`). So it starts from a known
motion, such as a simulated one.

It needs the friction force on any periodic motion, and its derivative by the motion. The period is divided into M equal
intervals, at whose middles the velocity is given. The friction law has one state of its own, which obeys a differential
equation. The implicit midpoint rule makes this a chain of M steps, which must end where it began. Over half a period of
a symmetric motion it ends at the mirror image. The force at the middles follows. The rule is of second order, and a
fast state settles on its steady value however long the intervals are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import sympy as sp
from scipy.linalg import solve_banded

from friso.equations.component import Switch, state
from friso.equations.friction.common import DIRECTION, direction, friction_alone
from friso.equations.imposed import Imposed, imposed_form
from friso.errors import InputError
from friso_thesis.studies.describing.balance import TOUCHES, beyond_stroke, receptance


@dataclass(frozen=True)
class OneStateLaw:
    """A friction law with at most one state z, as functions of parameters, velocity and z.

    The functions return the rate of change of z and the force, each with its derivatives by z and velocity.
    """

    values: Mapping[str, Any]
    function: Callable[..., list[Any]]
    names: tuple[str, ...]
    remembers: bool

    @classmethod
    def of(cls, flat: Mapping[str, Any]) -> OneStateLaw:
        """Make the functions from a stage's friction law; `flat` has its keys in SI.

        Raises InputError for a stage without friction, or a law with more states or with modes that have a memory.
        """
        form = imposed_form(flat)
        function, names, remembers = _compiled(form)
        return cls({name: flat[name] for name in names}, function, names, remembers)

    def at(self, velocity: np.ndarray, z: np.ndarray) -> list[np.ndarray]:
        """Return the rate of z and the force [N], at velocities [m/s] and states z.

        Each is followed by its derivatives by z and by velocity.
        """
        values = self.function(velocity, z, (velocity > 0).astype(float), *self.values.values())
        return [np.broadcast_to(np.asarray(value, dtype=float), velocity.shape) for value in values]


@cache
def _compiled(form: Imposed) -> tuple[Callable[..., list[Any]], tuple[str, ...], bool]:
    velocity, none = state("velocity"), state("no_state")
    friction = friction_alone(form.friction, velocity, form.friction_variant)
    inner = friction.component.states
    if any(isinstance(kink, Switch) for kink in friction.component.kinks):
        actual = f'"{form.friction}", with modes that remember'
        raise InputError("friction.model", actual, "a law that is smooth but for the direction", 'model = "lugre"')
    if any(kink.name != DIRECTION for kink in friction.component.kinks):
        actual = f'"{form.friction}", with kinks of its own'
        raise InputError("friction.model", actual, "a law that is smooth but for the direction", 'model = "lugre"')
    if len(inner) > 1:
        law = f'"{form.friction}", with {len(inner)} states of its own'
        raise InputError("friction.model", law, "a law with at most one", 'model = "lugre"')
    z, rate = (inner[0].symbol, inner[0].derivative) if inner else (none, sp.S.Zero)
    forward = direction(velocity).beyond
    parts = [e for f in (rate, friction.force) for e in (f, sp.diff(f, z), sp.diff(f, velocity))]
    names = sorted(set[Any]().union(*(e.free_symbols for e in parts)) - {velocity, z, forward}, key=str)
    function = sp.lambdify([velocity, z, forward, *names], parts, "numpy", cse=True)
    return function, tuple(map(str, names)), bool(inner)


@dataclass(frozen=True)
class FrictionAnswer:
    """Friction force [N] at the middles of intervals (M,), and what its derivative is made of.

    The derivative is by the velocities at the middles; `along` applies it.
    """

    force: np.ndarray
    by_velocity: np.ndarray
    by_state: np.ndarray
    chain: Chain | None
    pushed: np.ndarray

    def along(self, velocities: np.ndarray) -> np.ndarray:
        """Return how the force [N] changes with changes of the velocities [m/s], both (M, columns)."""
        direct = self.by_velocity[:, None] * velocities
        if self.chain is None:
            return direct
        return direct + self.by_state[:, None] * _middles(self.chain.solve(self.pushed[:, None] * velocities))


@dataclass(frozen=True)
class Chain:
    """Equations of a chain of states, z_0 to z_M: after[k] z_(k+1) - before[k] z_k = right side.

    The chain ends where it began, or at the mirror image: z_M = sign z_0.
    """

    after: np.ndarray
    before: np.ndarray
    sign: float

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Return the states, shape (M + 1, columns), for right sides (M, columns) of the equations."""
        count = len(self.after)
        bands = np.zeros((2, count + 1))
        bands[0, 0], bands[0, 1:], bands[1, :-1] = 1.0, self.after, -self.before
        start = np.zeros((count + 1, right.shape[1] + 1))
        start[1:, :-1], start[0, -1] = right, 1.0
        solution = solve_banded((1, 0), bands, start, check_finite=False)
        forced, free = solution[:, :-1], solution[:, -1:]
        return forced + free * (forced[-1] / (self.sign - free[-1]))


def _middles(z: np.ndarray) -> np.ndarray:
    return (z[:-1] + z[1:]) / 2


STATE_NEWTON_STEPS = 30
"""Newton steps for laws with one state, which converge in a handful."""

STATE_ERROR = 1e-12
"""Largest Newton step of the friction state, relative to the state, at which the state has converged."""


def friction_answer(law: OneStateLaw, velocity: np.ndarray, interval: float, sign: float) -> FrictionAnswer:
    """Compute the friction force on a periodic motion from velocities [m/s], shape (M,).

    Velocities are taken at the middles of M intervals, each an `interval` [s] long. After these the motion is back at
    its start (`sign` 1), or at the mirror image (-1).
    """
    z = np.zeros(len(velocity) + 1)
    chain, pushed = None, np.zeros(0)
    for _ in range(STATE_NEWTON_STEPS if law.remembers else 0):
        rate, by_z, by_velocity, *_ = law.at(velocity, _middles(z))
        chain = Chain(1 - interval * by_z / 2, 1 + interval * by_z / 2, sign)
        missed = interval * rate - np.diff(z)
        step = chain.solve(missed[:, None])[:, 0]
        z, pushed = z + step, interval * by_velocity
        if np.max(np.abs(step)) <= STATE_ERROR * np.max(np.abs(z)):
            break
    _, _, _, force, by_state, by_velocity = law.at(velocity, _middles(z))
    return FrictionAnswer(force, by_velocity, by_state, chain, pushed)


DONE, REST, OPEN = "done", "only the rest at the reference was found", "no series was found near the known motion"


LEAST_INTERVALS = 4096
"""Least number of intervals. Fewer miss the instant at which friction reverses."""

SAMPLES_PER_HARMONIC = 32
"""Intervals per harmonic. Fewer alias the corners of friction into the harmonics."""


@dataclass(frozen=True)
class HarmonicSeries:
    """A periodic motion by its harmonics, as found by Newton's method.

    `cart` and `stage` [m], complex, are harmonics at `orders` of the angular frequency [rad/s]: position = Re(sum of
    harmonic exp(i order omega t)). `step` is the last step of the method, relative to the known amplitude. The result
    is a motion only if `status` is "done".
    """

    orders: np.ndarray
    cart: np.ndarray
    stage: np.ndarray
    omega: float
    step: float
    status: str

    @property
    def period(self) -> float:
        """Return the period [s]."""
        return 2 * np.pi / self.omega

    @property
    def amplitude(self) -> float:
        """Return half of the peak-to-peak motion of the stage [m]."""
        return float(np.ptp(self.over_period(self.stage)) / 2)

    def over_period(self, harmonics: np.ndarray) -> np.ndarray:
        """Return a signal with these harmonics, (orders,), at many times of a period."""
        angles = np.linspace(
            0,
            2 * np.pi,
            max(LEAST_INTERVALS, SAMPLES_PER_HARMONIC * int(self.orders[-1])),
            endpoint=False,
        )
        return np.real(np.exp(1j * np.outer(angles, self.orders)) @ harmonics)


@dataclass(frozen=True)
class Basis:
    """Cosines and sines, the waves of which a periodic motion is made, with their slopes.

    They have the `orders` 1, 2, ... of the frequency, and are taken at the middles of the intervals of a period. A
    motion that is its own mirror image has odd orders over half a period; any other motion has all orders over a whole
    one.
    """

    orders: np.ndarray
    sign: float
    waves: np.ndarray
    slopes: np.ndarray
    share: float

    @classmethod
    def of(cls, harmonics: int, mirrored: bool, intervals: int) -> Basis:
        """Make the cosines and sines up to the order `harmonics`, with `intervals` per period.

        A `mirrored` motion is its own mirror image after half a period.
        """
        orders = np.arange(1, harmonics + 1, 2) if mirrored else np.arange(harmonics + 1)
        share = 0.5 if mirrored else 1.0
        angles = 2 * np.pi * (np.arange(int(intervals * share)) + 0.5) / intervals
        phases = np.outer(angles, orders)
        waves = np.hstack([np.cos(phases), -np.sin(phases)])
        slopes = np.hstack([-np.sin(phases), -np.cos(phases)]) * np.tile(orders, 2)
        return cls(orders, -1.0 if mirrored else 1.0, waves, slopes, share)

    def harmonics(self, signal: np.ndarray) -> np.ndarray:
        """Return the complex harmonics (orders, columns) of signals at mid-intervals (M, columns)."""
        weights = np.where(self.orders == 0, 1.0, 2.0)[:, None] / len(self.waves)
        real, imaginary = np.split(self.waves.T @ signal, 2)
        return weights * (real + 1j * imaginary)


def balanced(
    flat: Mapping[str, Any],
    time: np.ndarray,
    position: np.ndarray,
    harmonics: int,
    mirrored: bool = True,
    intervals: int | None = None,
) -> HarmonicSeries:
    """Return the periodic motion near a known one, with harmonics up to the order `harmonics`.

    `time` [s] and `position` [m] of the cart, shape (samples,), are one period of the known motion. The last sample
    lies one interval before the first comes again. A `mirrored` motion is its own mirror image after half a period. The
    friction force is computed in `intervals` per period (None: as the settings say). Raises InputError for a stage
    without friction or for a law with more than one state of its own.
    """
    law, size = (
        OneStateLaw.of(flat),
        intervals or max(LEAST_INTERVALS, SAMPLES_PER_HARMONIC * harmonics),
    )
    basis = Basis.of(harmonics, mirrored, 2 * (size // 2))
    spectrum = np.fft.rfft(position)[basis.orders] / len(position) * np.where(basis.orders == 0, 1, 2)
    length = float(np.ptp(position) / 2)
    unknown = _parts(spectrum) / length
    omega = 2 * np.pi / (len(time) * (time[1] - time[0]))
    problem = _Problem(flat, law, basis, length, omega, unknown)
    state, step = problem.solve()
    cart, speed = problem.split(state)
    _, stage = receptance(flat, basis.orders * speed / (2 * np.pi))
    force = basis.harmonics(problem.answer(state).force[:, None])[:, 0]
    series = HarmonicSeries(basis.orders, cart, stage * force, speed, step, DONE)
    return replace(series, status=_status(flat, series, length))


RESTING_SHARE = 1e-3
"""Amplitude relative to the previous one below which a series is the rest at the reference."""

SERIES_STEP = 1e-9
"""Step, relative to the amplitude, below which a change is only rounding."""


def _status(flat: Mapping[str, Any], series: HarmonicSeries, length: float) -> str:
    """Return "done" if a series is a motion of the stage, and otherwise why it is none.

    It is none in three cases: Newton's method did not converge; the limiter would be touched; or the amplitude is tiny
    against `length` [m], that of the known motion, so that the stage rests.
    """
    if series.amplitude < RESTING_SHARE * length:
        return REST
    if series.step > SERIES_STEP:
        return OPEN
    deflection = np.max(np.abs(series.over_period(series.stage - series.cart)))
    return TOUCHES if beyond_stroke(flat, deflection) else DONE


SERIES_NEWTON_STEPS = 40
"""Newton steps after which a series does not converge."""

LONGEST_STEP_SHARE = 0.5
"""Longest step relative to the amplitude. A longer one jumps to another solution, or to rest."""

SERIES_HALVINGS = 6
"""Halvings of a step after which its direction is useless."""


@dataclass(frozen=True)
class _Problem:
    """The equations X_k = R(k omega) F_k(X, omega) of harmonic balance, in real numbers.

    Unknowns are real and imaginary parts of the harmonics, divided by `length` [m], the amplitude of the known motion.
    The last unknown is the logarithm of omega over the `omega` of that motion. `start` has the harmonics of the known
    motion, which also fixes the phase.
    """

    flat: Mapping[str, Any]
    law: OneStateLaw
    basis: Basis
    length: float
    omega: float
    start: np.ndarray

    def split(self, state: np.ndarray) -> tuple[np.ndarray, float]:
        real, imaginary = np.split(state[:-1] * self.length, 2)
        return real + 1j * imaginary, float(self.omega * np.exp(state[-1]))

    def answer(self, state: np.ndarray) -> FrictionAnswer:
        speed = self.omega * np.exp(state[-1])
        velocity = speed * self.length * (self.basis.slopes @ state[:-1])
        interval = 2 * np.pi / speed * self.basis.share / len(velocity)
        return friction_answer(self.law, velocity, interval, self.basis.sign)

    def receptances(self, speed: float) -> np.ndarray:
        return receptance(self.flat, self.basis.orders * speed / (2 * np.pi))[0]

    def residual(self, state: np.ndarray) -> np.ndarray:
        """Return the residuals of the equations, (unknowns,); the last is that of the phase."""
        cart, speed = self.split(state)
        force = self.basis.harmonics(self.answer(state).force[:, None])[:, 0]
        left = (cart - self.receptances(speed) * force) / self.length
        return np.append(_parts(left), self._phase @ (state[:-1] - self.start))

    @property
    def _phase(self) -> np.ndarray:
        """Return the direction, among the harmonics' parts, in which a time shift moves the motion."""
        real, imaginary = np.split(self.start, 2)
        return np.concatenate([-imaginary * self.basis.orders, real * self.basis.orders])

    def jacobian(self, state: np.ndarray) -> np.ndarray:
        """Return the derivatives of the residuals by the unknowns, shape (unknowns, unknowns)."""
        _, speed = self.split(state)
        answer, nudge = self.answer(state), 1e-6
        stretched = self.basis.slopes @ state[:-1]
        by_motion = answer.along(speed * self.length * np.column_stack([self.basis.slopes, stretched]))
        forces = self.basis.harmonics(np.column_stack([by_motion, answer.force]))
        receptances = self.receptances(speed)
        later = (self.receptances(speed * (1 + nudge)) - self.receptances(speed * (1 - nudge))) / (2 * nudge)
        by_state = -receptances[:, None] * forces[:, :-1]
        by_state[:, -1] -= later * forces[:, -1]
        count = len(self.basis.orders)
        jacobian = np.zeros((2 * count + 1, 2 * count + 1))
        jacobian[: 2 * count] = _parts(by_state) / self.length
        jacobian[: 2 * count, : 2 * count] += np.eye(2 * count)
        jacobian[-1, :-1] = self._phase
        return jacobian

    def solve(self) -> tuple[np.ndarray, float]:
        """Solve the equations by Newton's method; return the unknowns and the size of the last step."""
        state, size = np.append(self.start, 0.0), np.inf
        for _ in range(SERIES_NEWTON_STEPS):
            left = self.residual(state)
            step = np.linalg.lstsq(self.jacobian(state), -left, rcond=None)[0]
            step /= max(1.0, float(np.max(np.abs(step))) / LONGEST_STEP_SHARE)
            state = state + step * self._share(state, step, float(np.linalg.norm(left)))
            size = float(np.max(np.abs(step)))
            if size <= SERIES_STEP:
                break
        return state, size

    def _share(self, state: np.ndarray, step: np.ndarray, left: float) -> float:
        """Return what fraction of a step leads closer to the solution: 1, a half, a quarter, ...

        `state` are the unknowns, and `left` is the size of the residuals there.
        """
        shares = [0.5**halving for halving in range(SERIES_HALVINGS)]
        return next((s for s in shares if np.linalg.norm(self.residual(state + s * step)) < left), shares[-1])


def _parts(values: np.ndarray) -> np.ndarray:
    """Return the real parts of complex numbers (n,), followed by the imaginary parts, (2 n,)."""
    return np.concatenate([np.real(values), np.imag(values)])
