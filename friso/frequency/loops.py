"""Build the loop of plant, controller and drive: closed, and cut at the actuator force."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.frequency.drive import DriveTiming, behind_current_loop, delayed, fastest, waited, zero_order_hold
from friso.frequency.members import Members
from friso.frequency.parts import (
    DISTURBANCE,
    FORCE,
    NOISE,
    RATED,
    REFERENCE,
    STAGE,
    VELOCITY,
    compensator,
    plant,
    reference_derivatives,
)
from friso.frequency.rates import Lifted, closed_over_period, cut_over_period, samples_controller, unseen
from friso.frequency.settings import settings
from friso.frequency.system import Complex, System

ROUNDING = 50 * float(np.finfo(float).eps)
"""Rounding error of a slow pole, relative to the fastest pole."""


def open_loop(flat: Mapping[str, Any], members: Members) -> System:
    """Return the loop cut at the actuator force, in continuous time, in each state of `members`.

    It leads from the force on the stage to the controller's force with reversed sign. So 1 + L = 0 at the poles of the
    closed loop.
    """
    return _cut(plant(flat, members), compensator(flat, len(members)))


def closed_loop(flat: Mapping[str, Any], members: Members) -> System:
    """Return the closed loop in continuous time, in each state of `members`.

    Inputs are a force on the stage, the reference, a disturbance on the cart, noise of the sensor, and feedforward of
    the reference. Outputs are the outputs of the plant, and the actuator force.
    """
    machine, control = plant(flat, members), compensator(flat, len(members))
    ahead = reference_derivatives(control)
    n, k = len(machine.states), len(control.states)
    channels = machine.take((FORCE, DISTURBANCE), (STAGE, VELOCITY))
    push = machine.b[:, :, [machine.inputs.index(FORCE)]]
    measured, commanded = control.take((STAGE, VELOCITY), (FORCE,)), control.take((REFERENCE, STAGE, *ahead), (FORCE,))
    of_machine = [machine.a + push @ measured.d @ channels.c, push @ control.c]
    a = np.block([of_machine, [measured.b @ channels.c, control.a]])
    outside = np.zeros((len(members), n + k, 2))
    outside[:, :n] = machine.b
    inside = np.concatenate([push @ commanded.d, commanded.b], axis=1)
    outputs = np.concatenate([machine.c, np.zeros((len(members), machine.c.shape[1], k))], axis=2)
    force = np.concatenate([measured.d @ channels.c, control.c], axis=2)
    d = np.zeros((len(members), outputs.shape[1] + 1, 4 + len(ahead)))
    d[:, -1:, 2:] = commanded.d
    return System(
        a,
        np.concatenate([outside, inside], axis=2),
        np.concatenate([outputs, force], axis=1),
        d,
        machine.states + control.states,
        (FORCE, DISTURBANCE, REFERENCE, NOISE, *ahead),
        (*machine.outputs, FORCE),
    )


@dataclass(frozen=True)
class Poles:
    """Poles of the `closed` loop, and of the loop `cut` open, in many states of a stage.

    Both have the shape (members, n), one row per state. They include the drive, and are in the plane of s [rad/s], or
    of z for a sampled drive. `continuous` are the poles of the closed loop in continuous time without delay.
    """

    closed: Complex
    cut: Complex
    continuous: Complex
    drive: DriveTiming

    @property
    def in_s(self) -> Complex:
        """Return the closed-loop poles as s [rad/s] (see `DriveTiming.to_s`)."""
        return self.drive.to_s(self.closed)

    @property
    def abscissa(self) -> np.ndarray:
        """Return the real part [1/s] of the rightmost closed-loop pole in each state, (members,).

        It is 0 for a pole on the imaginary axis, up to rounding. Slow poles are taken in continuous time without delay,
        where rounding does less harm.
        """
        step = self.drive.sample_time or self.drive.delay
        if not step:
            return _real_parts(self.closed).max(axis=1)
        closed, bare = self.in_s, self.continuous
        fast = np.where(np.abs(closed) > settings.slow_pole_share / step, _real_parts(closed), -np.inf)
        slow = np.where(np.abs(bare) <= settings.slow_pole_share / step, _real_parts(bare), -np.inf)
        return np.maximum(fast.max(axis=1), slow.max(axis=1))

    def distance(self, omega: np.ndarray) -> np.ndarray:
        """Return abs(1 + L) of the loop L at angular frequencies [rad/s], shape (members, k).

        It is the product of the distances to all closed-loop poles, over that to all poles of the cut loop.
        """
        at = self._at(omega)
        squared = np.ones(omega.shape)
        for closed, cut in zip(self.closed.T[..., None], self.cut.T[..., None], strict=True):
            squared *= _squared(at, closed) / _squared(at, cut)
        return np.sqrt(squared)

    def loop(self, omega: np.ndarray) -> Complex:
        """Return the open loop L in each state, shape (members, k).

        `omega` [rad/s], shape (k,), are angular frequencies. L is computed from the poles as a ratio minus 1. Its
        rounding error is therefore relative to abs(1 + L): where L is much smaller than 1, few of its digits are right.
        """
        at = self._at(omega)
        ratio = np.ones((len(self.closed), len(omega)), complex)
        for closed, cut in zip(self.closed.T[..., None], self.cut.T[..., None], strict=True):
            ratio *= (at - closed) / (at - cut)
        return ratio - 1

    def _at(self, omega: np.ndarray) -> Complex:
        """Return angular frequencies [rad/s] as points in the plane of the poles."""
        time = self.drive.sample_time * self.drive.period
        return np.asarray(np.exp(1j * omega * time) if time else 1j * omega)


def poles(flat: Mapping[str, Any], members: Members, drive: DriveTiming, cut: str = "") -> Poles:
    """Return the poles of the loop in each state of `members`.

    The stage is stuck in all of them, or in none. A delay in continuous time is replaced by a rational function. `cut`
    names the measured signal, STAGE or VELOCITY, whose feedback is left open. Raises InputError for a delay that is too
    long for that function.
    """
    machine = _driven(flat, members, drive)
    bare = _cut(machine, _continuous(flat, len(members), cut))
    if drive.sample_time:
        sampled, controls = _held(machine, drive), _controls(flat, len(members), drive, cut)
        matrices = closed_over_period(sampled, controls), cut_over_period(sampled, controls).a
        closed, opened = (np.linalg.eigvals(matrix).astype(complex) for matrix in matrices)
        return Poles(closed, opened, _shut(bare), drive)
    loop = bare
    if drive.delay:
        late = delayed(machine, drive.delay, fastest(_shut(bare)))
        loop = _cut(late, _continuous(flat, len(members), cut))
    closed = _shut(loop)
    return Poles(closed, np.linalg.eigvals(loop.a).astype(complex), closed if loop is bare else _shut(bare), drive)


def response(
    flat: Mapping[str, Any], member: Members, drive: DriveTiming, cut: str = ""
) -> Callable[[np.ndarray], Complex]:
    """Return the loop L of a stage in one state, exactly, as a function of frequencies [rad/s].

    With loops at several rates it is the characteristic locus (see `friso.frequency.rates`). The feedback of one
    measured signal may be `cut`.
    """
    if drive.sample_time:
        lifted = lifted_loop(flat, member, drive, cut)
        return lambda omega: lifted.locus(omega * drive.sample_time)[0]
    loop = _cut(_driven(flat, member, drive), _continuous(flat, 1, cut))
    return lambda omega: loop.at(1j * omega)[0, :, 0, 0] * np.exp(-1j * omega * drive.delay)


def lifted_loop(flat: Mapping[str, Any], member: Members, drive: DriveTiming, cut: str = "") -> Lifted:
    """Return the loop of a sampled drive over the period of its loops, cut at the actuator.

    The feedback of one measured signal may be `cut` as well.
    """
    return cut_over_period(_held(_driven(flat, member, drive), drive), _controls(flat, len(member), drive, cut))


def _driven(flat: Mapping[str, Any], members: Members, drive: DriveTiming) -> System:
    """Return the plant with its drive, from the commanded force to all that is measured."""
    machine = plant(flat, members).take((FORCE,), (STAGE, VELOCITY, RATED))
    return behind_current_loop(machine, drive.lag)


def _held(machine: System, drive: DriveTiming) -> System:
    """Return a plant behind hold and delay, from the force to the positions one sample later."""
    samples, late = drive.samples_late
    return waited(zero_order_hold(machine, drive.sample_time, late), samples).take((FORCE,), (STAGE, RATED))


def _continuous(flat: Mapping[str, Any], members: int, cut: str) -> System:
    """Return the controller in continuous time, without the measured signal `cut`.

    There are `members` equal ones, unless keys are arrays.
    """
    control = compensator(flat, members)
    return unseen(control, cut) if cut else control


def _controls(flat: Mapping[str, Any], members: int, drive: DriveTiming, cut: str) -> tuple[System, ...]:
    """Return the controller at each sample of a period, without the measured signal `cut`."""
    controls = samples_controller({**flat, "drive.sample_time": drive.sample_time}, members, drive.period)
    sampled = {VELOCITY: RATED}.get(cut, cut)
    return tuple(unseen(control, sampled) for control in controls) if cut else controls


def _cut(machine: System, control: System) -> System:
    """Return plant and controller in series, from the force to minus the controller's force."""
    machine, control = machine.take((FORCE,), (STAGE, VELOCITY)), control.take((STAGE, VELOCITY), (FORCE,))
    unheld = np.zeros((len(machine.a), len(machine.states), len(control.states)))
    a = np.block([[machine.a, unheld], [control.b @ machine.c, control.a]])
    b = np.concatenate([machine.b, control.b @ machine.d], axis=1)
    c = -np.concatenate([control.d @ machine.c, control.c], axis=2)
    return System(a, b, c, -control.d @ machine.d, machine.states + control.states, (FORCE,), (FORCE,))


def _squared(at: Complex, pole: Complex) -> np.ndarray:
    """Return squared distances of points `at` from a pole of each member, (members, points).

    The pole has the shape (members, 1).
    """
    return np.asarray((at.real - pole.real) ** 2 + (at.imag - pole.imag) ** 2)


def _shut(loop: System) -> Complex:
    """Return the poles of the closed loop of a cut loop without direct feedthrough (d is 0)."""
    return np.linalg.eigvals(loop.a - loop.b @ loop.c).astype(complex)


def _real_parts(poles: Complex) -> np.ndarray:
    """Return real parts of poles, (members, n), 0 on the imaginary axis up to rounding."""
    size = np.abs(poles)
    fastest = np.where(np.isfinite(size), size, 0.0).max(axis=1, keepdims=True)
    edge = np.where(poles.imag != 0, settings.undamped_ratio * size, 0.0) + ROUNDING * fastest
    return np.where(np.abs(poles.real) <= edge, 0.0, poles.real)
