"""The loop of plant, controller and drive: closed, and cut at the actuator force."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import comb, factorial
from typing import Any

import numpy as np

from friso.frequency.members import Members
from friso.frequency.parts import DISTURBANCE, FORCE, NOISE, REFERENCE, STAGE, VELOCITY, compensator, plant
from friso.frequency.system import Complex, System

PADE = 4
"""Order of the rational function that stands for a delay in continuous time, where poles are wanted."""

PADE_6 = tuple(comb(6, k) / (comb(12, k) * factorial(k)) for k in range(7))
"""Coefficients of the numerator of Pade's approximation of order 6 to the exponential."""

SCALED = 0.5
"""Norm to which matrices are scaled for it: its relative error is then below 1e-16."""


@dataclass(frozen=True)
class Drive:
    """Sample time [s], 0 for a controller in continuous time, and delay between measurement and force [s]."""

    sample_time: float
    delay: float

    @classmethod
    def of(cls, flat: Mapping[str, Any]) -> Drive:
        return cls(flat.get("drive.sample_time", 0.0), flat.get("drive.delay", 0.0))

    @property
    def highest(self) -> float:
        """Angular frequency [rad/s] up to which the drive knows frequencies: half that of sampling."""
        return np.pi / self.sample_time if self.sample_time else np.inf

    def answer(self, omega: np.ndarray) -> np.ndarray:
        """What hold and delay do to a frequency [rad/s], all but its aliases."""
        half = omega * self.sample_time / 2
        return np.sinc(half / np.pi) * np.exp(-1j * (half + omega * self.delay))

    def laplace(self, omega: np.ndarray) -> np.ndarray:
        """The s of the continuous controller that the sampled one answers like (bilinear transform)."""
        if not self.sample_time:
            return 1j * omega
        return 2j / self.sample_time * np.tan(omega * self.sample_time / 2)


def open_loop(flat: Mapping[str, Any], members: Members) -> System:
    """The loop cut at the actuator force, in continuous time: from the force on the stage to the force with which the
    controller answers, its sign reversed, so that 1 + L = 0 at the poles of the closed loop."""
    return _cut(plant(flat, members), compensator(flat, len(members)))


def closed_loop(flat: Mapping[str, Any], members: Members) -> System:
    """The closed loop in continuous time: from a force on the stage, reference, disturbance on the cart and noise of
    the sensor to all that the plant shows and the actuator force."""
    machine, control = plant(flat, members), compensator(flat, len(members))
    n, k = len(machine.states), len(control.states)
    seen = machine.take((FORCE, DISTURBANCE), (STAGE, VELOCITY))
    push = machine.b[:, :, [machine.inputs.index(FORCE)]]
    measured, commanded = control.take((STAGE, VELOCITY), (FORCE,)), control.take((REFERENCE, STAGE), (FORCE,))
    a = np.zeros((len(members), n + k, n + k))
    a[:, :n, :n] = machine.a + push @ measured.d @ seen.c
    a[:, :n, n:] = push @ control.c
    a[:, n:, :n], a[:, n:, n:] = measured.b @ seen.c, control.a
    outside = np.zeros((len(members), n + k, 2))
    outside[:, :n] = machine.b
    inside = np.concatenate([push @ commanded.d, commanded.b], axis=1)
    shown = np.concatenate([machine.c, np.zeros((len(members), machine.c.shape[1], k))], axis=2)
    force = np.concatenate([measured.d @ seen.c, control.c], axis=2)
    d = np.zeros((len(members), shown.shape[1] + 1, 4))
    d[:, -1:, 2:] = commanded.d
    whole = System(
        a,
        np.concatenate([outside, inside], axis=2),
        np.concatenate([shown, force], axis=1),
        d,
        machine.states + control.states,
        (FORCE, DISTURBANCE, REFERENCE, NOISE),
        (*machine.outputs, FORCE),
    )
    return whole


def closed_poles(flat: Mapping[str, Any], members: Members, drive: Drive) -> Complex:
    """Poles of the closed loop [rad/s], complex, shape (members, poles), of members all of which are stuck or none.

    Those of a sampled loop, an eigenvalue of 0 being at minus infinity, as the s whose exponential over a sample they
    are.
    """
    machine, control = plant(flat, members).take((FORCE,), (STAGE, VELOCITY)), compensator(flat, len(members))
    if drive.sample_time:
        loop = _cut(_held(machine, drive), _bilinear(control, drive.sample_time))
        found = np.linalg.eigvals(_shut(loop))
        with np.errstate(divide="ignore"):
            return ((np.log(np.abs(found)) + 1j * np.angle(found)) / drive.sample_time).astype(complex)
    if drive.delay:
        machine = _delayed(machine, drive.delay)
    return np.linalg.eigvals(_shut(_cut(machine, control))).astype(complex)


def sampled_open_loop(flat: Mapping[str, Any], members: Members, drive: Drive) -> System:
    """The loop of a sampled controller cut at the force, in discrete time: plant under a hold, with its delay."""
    machine, control = plant(flat, members).take((FORCE,), (STAGE, VELOCITY)), compensator(flat, len(members))
    return _cut(_held(machine, drive), _bilinear(control, drive.sample_time))


def _cut(machine: System, control: System) -> System:
    """Plant and controller in a row, from force to minus the answering force."""
    machine, control = machine.take((FORCE,), (STAGE, VELOCITY)), control.take((STAGE, VELOCITY), (FORCE,))
    n, k = len(machine.states), len(control.states)
    a = np.zeros((len(machine.a), n + k, n + k))
    a[:, :n, :n], a[:, n:, :n], a[:, n:, n:] = machine.a, control.b @ machine.c, control.a
    b = np.concatenate([machine.b, np.zeros((len(machine.a), k, 1))], axis=1)
    b[:, n:] = control.b @ machine.d
    c = -np.concatenate([control.d @ machine.c, control.c], axis=2)
    return System(a, b, c, -control.d @ machine.d, machine.states + control.states, (FORCE,), (FORCE,))


def _shut(loop: System) -> np.ndarray:
    """State matrix of the closed loop of one that is cut."""
    return loop.a - loop.b @ loop.c / (1 + loop.d)


def _bilinear(control: System, sample_time: float) -> System:
    """The controller in discrete time, by the bilinear transform."""
    half = control.a * sample_time / 2
    one = np.eye(len(control.states))
    inverse = np.linalg.inv(one - half)
    b = inverse @ control.b * sample_time
    d = control.d + control.c @ b / 2
    return replace(control, a=inverse @ (one + half), b=b, c=control.c @ inverse, d=d)


def _held(machine: System, drive: Drive) -> System:
    """The plant in discrete time behind a hold and a delay: exact, with the forces on their way as further states."""
    whole, late = divmod(drive.delay, drive.sample_time)
    age, members, n = int(whole), len(machine.a), len(machine.states)
    waiting = age + (late > 0)
    rest, before = _over(machine, late)
    ahead, after = _over(machine, drive.sample_time - late)
    following = np.zeros((members, n + waiting, n + 1 + waiting))  # from states, the new force, and those before it
    following[:, :n, :n], following[:, :n, [n + age]] = ahead @ rest, after
    if late:
        following[:, :n, [n + age + 1]] = ahead @ before
    following[:, range(n, n + waiting), range(n, n + waiting)] = 1.0
    a, b = np.delete(following, n, axis=2), following[:, :, [n]]
    c = np.concatenate([machine.c, np.zeros((members, machine.c.shape[1], waiting))], axis=2)
    states = machine.states + tuple(f"force_{k + 1}_ago" for k in range(waiting))
    return replace(machine, a=a, b=b, c=c, states=states)


def _over(machine: System, time: float) -> tuple[np.ndarray, np.ndarray]:
    """How states and a constant force act on the states a time later."""
    n = len(machine.states)
    whole = np.zeros((len(machine.a), n + 1, n + 1))
    whole[:, :n, :n], whole[:, :n, n:] = machine.a * time, machine.b * time
    moved = exponentials(whole)
    return moved[:, :n, :n], moved[:, :n, n:]


def exponentials(matrices: np.ndarray) -> np.ndarray:
    """Matrix exponentials, shape (members, n, n): Pade's of order 6 with scaling and squaring (Higham 2005,
    doi:10.1137/04061101X), for all members at once, which `scipy.linalg.expm` takes one by one."""
    norm = np.abs(matrices).sum(axis=-2).max()
    squarings = max(0, int(np.ceil(np.log2(norm / SCALED)))) if norm > 0 else 0
    scaled, one = matrices / 2.0**squarings, np.eye(matrices.shape[-1])
    power, even, odd = one, one * 0.0, one * 0.0
    for k, weight in enumerate(PADE_6):
        term = weight * power
        even, odd = (even + term, odd) if k % 2 == 0 else (even, odd + term)
        power = power @ scaled
    moved = np.linalg.solve(even - odd, even + odd)
    for _ in range(squarings):
        moved = moved @ moved
    return moved


def _delayed(machine: System, delay: float) -> System:
    """The plant behind a delay, as a rational function (Pade)."""
    from control import pade
    from scipy.signal import tf2ss

    la, lb, lc, ld = tf2ss(*pade(delay, PADE))
    n, k = len(machine.states), len(la)
    members = len(machine.a)
    a = np.zeros((members, n + k, n + k))
    a[:, :n, :n], a[:, n:, n:], a[:, :n, n:] = machine.a, la, machine.b @ lc
    b = np.concatenate([machine.b @ ld, np.broadcast_to(lb, (members, k, 1))], axis=1)
    c = np.concatenate([machine.c, np.zeros((members, machine.c.shape[1], k))], axis=2)
    return replace(machine, a=a, b=b, c=c, states=machine.states + tuple(f"delay_{i}" for i in range(k)))
