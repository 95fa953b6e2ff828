"""Represent many linear systems with equal states at once: arrays with one system per row.

Equations are linearised by their Jacobian, derived in symbols and evaluated for many states. The drive between
controller and plant is modelled by its hold, delay and current loop.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import comb, factorial
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy as sp

from friso.errors import InputError
from friso.frequency.settings import settings
from friso.stage.rig import LOOPS

Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class System:
    """Linear systems x' = a x + b u, y = c x + d u, as many as there are members.

    a (members, n, n), b (members, n, m), c (members, p, n), d (members, p, m), with the names of states, inputs and
    outputs. For a sampled system x' is the next x.
    """

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray
    states: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()

    def take(self, inputs: Sequence[str], outputs: Sequence[str]) -> System:
        """Return the system with the given inputs and outputs only, in this order."""
        columns = [self.inputs.index(name) for name in inputs]
        rows = [self.outputs.index(name) for name in outputs]
        b, c, d = self.b[..., columns], self.c[..., rows, :], self.d[..., rows, :][..., columns]
        return System(self.a, b, c, d, self.states, tuple(inputs), tuple(outputs))

    def keep(self, numbers: Sequence[int]) -> System:
        """Return the system with some of its states only, the others being 0."""
        a, b, c = self.a[:, numbers][:, :, numbers], self.b[:, numbers], self.c[:, :, numbers]
        return replace(self, a=a, b=b, c=c, states=tuple(self.states[i] for i in numbers))

    def sees(self, name: str) -> bool:
        """Tell whether any state or output depends on the input with this name."""
        column = self.inputs.index(name)
        return bool(self.b[..., column].any() or self.d[..., column].any())

    def at(self, points: np.ndarray) -> Complex:
        """Return transfer matrices c (s - a)^-1 b + d at points s, (k,) or (members, k).

        The result has shape (members, k, p, m).
        """
        shifted = points[..., None, None] * np.eye(self.a.shape[-1]) - self.a[:, None]
        answers = np.linalg.solve(shifted, self.b[:, None])
        return (self.c[:, None] @ answers + self.d[:, None]).astype(complex)


@dataclass(frozen=True)
class Declared:
    """Equations to be linearised, in symbols.

    `states` have their `rates` of change. `inputs` are symbols, and `outputs` expressions, by name.
    """

    states: tuple[sp.Symbol, ...]
    rates: tuple[sp.Expr, ...]
    inputs: Mapping[str, sp.Symbol]
    outputs: Mapping[str, sp.Expr]

    @cached_property
    def _entries(self) -> tuple[list[tuple[int, int]], Any, list[str]]:
        """Return where the matrix [[a, b], [c, d]] is not zero, and a function for these entries.

        Also returns the names of the function's arguments.
        """
        rows = sp.Matrix([*self.rates, *self.outputs.values()])
        matrix = rows.jacobian([*self.states, *self.inputs.values()])
        entries = {place: entry for place, entry in matrix.todok().items() if entry != 0}
        symbols = sorted(set[Any]().union(*(entry.free_symbols for entry in entries.values())), key=str)
        function = sp.lambdify(symbols, list(entries.values()), [{"sine": sine}, "numpy"], cse=True)
        return list(entries), function, [str(symbol) for symbol in symbols]

    def at(self, values: Mapping[str, Any], members: int) -> System:
        """Return the linear systems for values of the symbols, by name.

        Values are numbers, or arrays of shape (members,) for as many systems.
        """
        places, function, names = self._entries
        n, m, p = len(self.states), len(self.inputs), len(self.outputs)
        matrices = np.zeros((members, n + p, n + m))
        for (i, j), entry in zip(places, function(*(values[name] for name in names)), strict=True):
            matrices[:, i, j] = entry
        parts = matrices[:, :n, :n], matrices[:, :n, n:], matrices[:, n:, :n], matrices[:, n:, n:]
        return System(*parts, tuple(map(str, self.states)), tuple(self.inputs), tuple(self.outputs))


def sine(turns: Any) -> Any:
    """Return sin(2 pi x) of a number of turns x, for `friso.equations.component.sine`."""
    return np.sin(2 * np.pi * turns)


SLOW_LOOPS = tuple(f"drive.{name}_sample_time" for name in LOOPS)
"""Keys of the sample times of slower loops."""

PADE_6 = tuple(comb(6, k) / (comb(12, k) * factorial(k)) for k in range(7))
"""Coefficients of the numerator of Pade's approximation of order 6 to the exponential."""

SCALED_NORM = 0.5
"""Norm to which matrices are scaled for the exponential, whose relative error is then below 1e-16."""


@dataclass(frozen=True)
class DriveTiming:
    """Timing of a drive.

    `sample_time` [s] is 0 for a controller in continuous time; `delay` [s] lies between measurement and force. `period`
    is the number of samples after which all loops are due again. `lag` [s] is the time constant of the current loop, 0
    without one.
    """

    sample_time: float
    delay: float
    period: int = 1
    lag: float = 0.0

    @classmethod
    def of(cls, flat: Mapping[str, Any]) -> DriveTiming:
        """Return the timing of a stage's drive; `flat` has the stage's keys in SI.

        Raises InputError for a delay of too many samples, and for a loop that is due too rarely.
        """
        sample_time = flat.get("drive.sample_time", 0.0)
        slow = {key: flat[key] for key in SLOW_LOOPS if key in flat}
        key = max(slow, key=lambda key: slow[key], default="")
        period = round(slow[key] / sample_time) if slow else 1
        if period > settings.most_delay_samples:
            text = f"{slow[key]:g} s, {period} samples of {sample_time:g} s"
            raise InputError(
                key, text, f"at most {settings.most_delay_samples} samples", 'position_sample_time = "1 ms"'
            )
        lag = 1 / (2 * np.pi * flat["drive.current_bandwidth"]) if "drive.current_bandwidth" in flat else 0.0
        drive = cls(sample_time, flat.get("drive.delay", 0.0), period, lag)
        if drive.sample_time and drive.delay > settings.most_delay_samples * drive.sample_time * (1 + 1e-9):
            text = f"{drive.delay:g} s, {drive.delay / drive.sample_time:.3g} samples of {drive.sample_time:g} s"
            raise InputError("drive.delay", text, f"at most {settings.most_delay_samples} samples", 'delay = "100 us"')
        return drive

    @property
    def highest(self) -> float:
        """Return half the sampling frequency [rad/s], the highest that the drive can represent.

        It is infinite for a controller in continuous time.
        """
        return np.pi / self.sample_time if self.sample_time else np.inf

    @property
    def samples_late(self) -> tuple[int, float]:
        """Return the delay as whole samples, and the remaining time [s]."""
        samples = int(self.delay / self.sample_time + 1e-9)
        return samples, max(0.0, self.delay - samples * self.sample_time)

    def transfer(self, omega: np.ndarray) -> np.ndarray:
        """Return the frequency response of hold, delay and current loop, in the shape of `omega`.

        Frequencies are in [rad/s]. Aliases are left out.
        """
        half = omega * self.sample_time / 2
        return np.sinc(half / np.pi) * np.exp(-1j * (half + omega * self.delay)) / (1 + 1j * omega * self.lag)

    def to_s(self, poles: Complex) -> Complex:
        """Return the poles of the loop as s [rad/s].

        For a sampled loop each is the slowest s whose exponential over the period is the pole; a pole at 0 becomes
        minus infinity.
        """
        if not self.sample_time:
            return poles
        time = self.sample_time * self.period
        with np.errstate(divide="ignore"):
            return (np.log(np.abs(poles)) / time + 1j * (np.angle(poles) / time)).astype(complex)


def resonances(poles: Complex) -> Complex:
    """Return those of the poles [rad/s] that are lightly damped."""
    return poles[np.abs(poles.real) < settings.light_damping * np.abs(poles.imag)]


def behind_current_loop(machine: System, lag: float) -> System:
    """Return a plant with one input whose force follows by a first-order `lag` [s]; 0 for none."""
    if not lag:
        return machine
    pole = np.full((1, 1), 1 / lag)
    return _behind(machine, (-pole, pole, np.eye(1), np.zeros((1, 1))), "motor_force")


def zero_order_hold(machine: System, sample_time: float, late: float) -> System:
    """Return a plant with one input in discrete time, behind a hold and a delay, exactly.

    The delay `late` [s] is less than a sample. The force that is still acting becomes a further state.
    """
    members, n, waiting = len(machine.a), len(machine.states), int(late > 0)
    rest, before = _transition(machine, late)
    ahead, after = _transition(machine, sample_time - late)
    following = np.zeros((members, n + waiting, n + 1 + waiting))  # from states, the new force, and the previous one
    following[:, :n, :n], following[:, :n, [n]] = ahead @ rest, after
    if waiting:
        following[:, :n, [n + 1]], following[:, n, n] = ahead @ before, 1.0
    a, b = np.delete(following, n, axis=2), following[:, :, [n]]
    c = np.concatenate([machine.c, np.zeros((members, machine.c.shape[1], waiting))], axis=2)
    return replace(machine, a=a, b=b, c=c, states=machine.states + ("force_before",) * waiting)


def waited(machine: System, samples: int) -> System:
    """Return a plant in discrete time whose force, the one input, is delayed by some samples."""
    if not samples:
        return machine
    register = np.eye(samples, k=-1)
    return _behind(
        machine, (register, np.eye(samples, 1), np.eye(1, samples, samples - 1), np.zeros((1, 1))), "waiting"
    )


def delayed(machine: System, delay: float, loop: float) -> System:
    """Return a plant with one input behind a delay [s], made of rational functions (Pade).

    A long delay is split into several such functions. `loop` [rad/s] is the fastest resonance of the closed loop
    without delay. Raises InputError if the phase of the plant's own resonances turns too far within the delay.
    """
    turn = fastest(np.linalg.eigvals(machine.a).astype(complex)) * delay
    sections = int(
        np.ceil(
            max(settings.least_delay_phase, turn, min(loop * delay, settings.most_delay_phase)) / settings.pade_phase
        )
    )
    if sections > settings.most_delay_sections:
        most = settings.most_delay_sections * settings.pade_phase / (2 * np.pi)
        expected = f"at most {most:.3g} periods, or a drive.sample_time"
        text = f"{delay:g} s, {turn / (2 * np.pi):.3g} periods of the fastest mode"
        raise InputError("drive.delay", text, expected, 'delay = "100 us"')
    from control import pade
    from scipy.signal import tf2ss  # 0.8 s to import

    for k in range(sections):
        machine = _behind(machine, tf2ss(*pade(delay / sections, settings.pade_order)), f"delay_{k}")
    return machine


def fastest(poles: Complex) -> float:
    """Return the largest magnitude [rad/s] of the resonances among poles; 0 if there are none."""
    return float(np.abs(resonances(poles.ravel())).max(initial=0.0))


def _behind(machine: System, first: tuple[np.ndarray, ...], name: str) -> System:
    """Return a plant with one input behind the system `first`, its matrices a, b, c, d.

    `name` names that system's states.
    """
    la, lb, lc, ld = first
    members, n, k = len(machine.a), len(machine.states), len(la)
    a = np.zeros((members, n + k, n + k))
    a[:, n:, n:] = la
    a[:, :n, :n], a[:, :n, n:] = machine.a, machine.b @ lc
    b = np.concatenate([machine.b @ ld, np.tile(np.asarray(lb), (members, 1, 1))], axis=1)
    c = np.concatenate([machine.c, machine.d @ lc], axis=2)
    return replace(machine, a=a, b=b, c=c, d=machine.d @ ld, states=machine.states + (name,) * k)


def _transition(machine: System, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the effect of states and of a constant force on the states after a time [s].

    The shapes are (members, n, n) and (members, n, 1).
    """
    n = len(machine.states)
    matrices = np.zeros((len(machine.a), n + 1, n + 1))
    matrices[:, :n, :n], matrices[:, :n, n:] = machine.a * time, machine.b * time
    moved = exponentials(matrices)
    return moved[:, :n, :n], moved[:, :n, n:]


def exponentials(matrices: np.ndarray) -> np.ndarray:
    """Return the exponentials of square matrices, shape (members, n, n), all at once.

    The method is Pade's of order 6 with scaling and squaring (Higham 2005, doi:10.1137/04061101X); `scipy.linalg.expm`
    takes them one by one.
    """
    norm = np.abs(matrices).sum(axis=-2).max()
    squarings = max(0, int(np.ceil(np.log2(norm / SCALED_NORM)))) if norm > 0 else 0
    scaled, identity = matrices / 2.0**squarings, np.eye(matrices.shape[-1])
    power, even, odd = identity, identity * 0.0, identity * 0.0
    for k, weight in enumerate(PADE_6):
        term = weight * power
        even, odd = (even + term, odd) if k % 2 == 0 else (even, odd + term)
        power = power @ scaled
    moved = np.linalg.solve(even - odd, even + odd)
    for _ in range(squarings):
        moved = moved @ moved
    return moved
