"""Build the loop of plant, controller and drive: closed, and cut at the actuator force.

Sampled loops, at one rate or several, are lifted to their common period. After that period all loops are due again. The
controller is that of `friso.equations.sampled`, as a drive computes it. Over a period of N samples the loop is a
time-invariant system with N inputs and outputs (lifting: Chen, Francis 1995, Optimal Sampled-Data Control Systems,
chapter 8; Bittanti, Colaneri 2009, Periodic Systems, chapter 6). Its poles decide on stability.

Cut at the actuator, it has N characteristic loci. A gain or a phase common to all samples brings it to the edge of
stability where one locus passes -1 (MacFarlane, Postlethwaite 1977, doi:10.1080/00207177708922217). So margins are
those of a locus. With all loops at one rate, the loci are the loop's response at a frequency and at its aliases.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, reduce
from typing import Any

import numpy as np
import sympy as sp

from friso.equations.blocks import Loop
from friso.equations.component import Held
from friso.equations.sampled import counter, sampled_controller
from friso.equations.structure import ControllerForm, shared_structure
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
from friso.frequency.settings import settings
from friso.frequency.system import (
    Complex,
    Declared,
    DriveTiming,
    System,
    behind_current_loop,
    delayed,
    fastest,
    waited,
    zero_order_hold,
)
from friso.stage.rig import LOOPS


@dataclass(frozen=True)
class Lifted(System):
    """A system of a drive over the period of its loops: x' = a x + b u, y = c x + d u.

    x' is x one period later; u and y hold the N samples of a period. Shapes are a (members, n, n), b (members, n, N), c
    (members, N, n), and d (members, N, N).
    """

    def over(self, turn: np.ndarray) -> Complex:
        """Return the transfer matrices at frequencies given by a signal's `turn` [rad] in a sample.

        `turn` has the shape (k,), and the result (members, k, N, N).
        """
        return self.at(np.exp(1j * turn * self.d.shape[-1]))

    def fundamental(self, turn: np.ndarray) -> Complex:
        """Return the response to a harmonic signal at its own frequency, shape (members, k).

        The signal turns by an angle (k,) [rad] in each sample.
        """
        return _fundamental(self.over(turn), turn)

    def locus(self, turn: np.ndarray) -> Complex:
        """Return the characteristic locus that follows the response of the loop, shape (members, k).

        It is evaluated at the frequency at which a signal turns by `turn` [rad] in a sample.
        """
        return locus_of(self.over(turn), turn)


def _fundamental(matrices: Complex, turn: np.ndarray) -> Complex:
    """Return the response to a harmonic signal at its own frequency, shape (members, k).

    `matrices` are transfer matrices over a period, (members, k, N, N), at frequencies at which the signal turns by
    `turn` [rad] in a sample.
    """
    turns = np.exp(1j * turn[:, None] * np.arange(matrices.shape[-1]))  # (k, N)
    answers = (matrices @ turns[..., None])[..., 0]
    return np.asarray((answers * turns.conj()).mean(axis=-1), dtype=complex)


def locus_of(matrices: Complex, turn: np.ndarray) -> Complex:
    """Return the characteristic locus that follows the response of a loop, shape (members, k).

    It is the eigenvalue closest to the response to a harmonic signal at its own frequency. `matrices` are transfer
    matrices over a period, (members, k, N, N); the signal turns by `turn` [rad] in a sample.
    """
    if matrices.shape[-1] == 1:
        return matrices[..., 0, 0]
    eigenvalues = np.linalg.eigvals(matrices)
    near = np.abs(eigenvalues - _fundamental(matrices, turn)[..., None]).argmin(axis=-1)
    return np.take_along_axis(eigenvalues, near[..., None], axis=-1)[..., 0].astype(complex)


def samples_controller(flat: Mapping[str, Any], members: int, period: int) -> tuple[System, ...]:
    """Return the controller of a drive at each sample of the period of its loops.

    Its inputs are the measured position and the position from which the velocity is taken [m]. Its outputs are the
    force [N] and the numbers held for the next sample. A controller that feeds back one encoder's position does not use
    the second input.
    """
    form = shared_structure(flat)
    assert form.controller is not None
    both = form.controller.section.feeds_back == "velocity"
    if form.transmission is not None:
        both |= form.transmission.position != form.transmission.velocity
    over = round(float(flat.get("drive.velocity_samples", 1.0)))
    ratios = {name: _samples(flat, name) for name in form.controller.loops}
    kinds: dict[tuple[bool, ...], System] = {}
    systems = []
    for k in range(period):
        due = tuple(name not in ratios or k % ratios[name] == 0 for name in LOOPS)
        if due not in kinds:
            kinds[due] = _declared(form.controller, due, both, over).at(flat, members)
        systems.append(kinds[due])
    return tuple(systems)


def _samples(flat: Mapping[str, Any], name: str) -> int:
    """Return the number of samples after which a loop is due again."""
    key = f"drive.{name}_sample_time"
    return round(float(flat[key] / flat["drive.sample_time"])) if key in flat else 1


@cache
def _declared(form: ControllerForm, due: tuple[bool, ...], both: bool, velocity_samples: int) -> Declared:
    """Return the equations of a controller at a sample at which some loops are `due`.

    They are for small motions. With `both`, the two measured positions are distinguished.
    """
    bare = replace(form, anti_windup=None, settings=form.settings.only("integral_leak"))
    y, rated = sp.symbols("measured_position measured_rated", real=True)
    seen = Loop(-y, y, sp.S.Zero, sp.S.Zero, rated=rated if both else None)
    force, held = sampled_controller(bare, seen, velocity_samples)
    passed: dict[Any, Any] = {counter(name): sp.Integer(not now) for name, now in zip(LOOPS, due, strict=True)}
    numbers: list[Held] = [number for number in held if number.symbol not in passed]
    following = tuple(sp.sympify(number.update).subs(passed) for number in numbers)
    symbols = tuple(number.symbol for number in numbers)
    return Declared(symbols, following, {STAGE: y, RATED: rated}, {FORCE: sp.sympify(force).subs(passed)})


def closed_over_period(machine: System, controls: tuple[System, ...]) -> np.ndarray:
    """Return by what matrix the states of the closed loop change over a period, (members, n, n).

    `machine` is the plant, and `controls` the controller at each sample of the period.
    """
    first, *later = (_step(machine, control, 1.0) for control in controls)
    return reduce(lambda whole, step: step @ whole, later, first)


def cut_over_period(machine: System, controls: tuple[System, ...]) -> Lifted:
    """Return the loop over a period of its drive, cut at the actuator.

    It leads from the forces of a period to the controller's forces, with the sign reversed.
    """
    steps = [_step(machine, control, 0.0) for control in controls]
    held = np.zeros((len(machine.a), controls[0].a.shape[-1], 1))
    push = np.concatenate([machine.b, held], axis=1)
    answers = [-np.concatenate([control.d @ machine.c, control.c], axis=2) for control in controls]
    return _lifted(steps, [push] * len(steps), answers)


def controller_over_period(controls: tuple[System, ...], measured: str) -> Lifted:
    """Return the controller over a period, from one measured signal to the forces.

    The signal `measured` is STAGE or RATED.
    """
    seen = [control.take((measured,), (FORCE,)) for control in controls]
    lifted = _lifted([control.a for control in seen], [control.b for control in seen], [control.c for control in seen])
    direct = np.zeros_like(lifted.d)
    for k, control in enumerate(seen):
        direct[:, k, k] = control.d[:, 0, 0]
    return replace(lifted, d=lifted.d + direct)


def unseen(control: System, measured: str) -> System:
    """Return the controller with all effects of its input `measured` set to 0; the input stays."""
    column = control.inputs.index(measured)
    b, d = control.b.copy(), control.d.copy()
    b[..., column] = d[..., column] = 0.0
    return replace(control, b=b, d=d)


def _lifted(steps: list[np.ndarray], pushes: list[np.ndarray], answers: list[np.ndarray]) -> Lifted:
    """Combine a system's samples over a period: x' = step x + push u, y = answer x at each one.

    The lists have the matrices of each sample, in order.
    """
    count, (members, n) = len(steps), steps[0].shape[:2]
    along = np.broadcast_to(np.eye(n), (members, n, n))
    inputs = np.zeros((members, n, count))  # from the inputs so far to the present state
    c, d = np.zeros((members, count, n)), np.zeros((members, count, count))
    for k, (step, push, answer) in enumerate(zip(steps, pushes, answers, strict=True)):
        c[:, [k]], d[:, [k]] = answer @ along, answer @ inputs
        along, inputs = step @ along, step @ inputs
        inputs[:, :, [k]] += push
    return Lifted(along, inputs, c, d)


def _step(machine: System, control: System, shut: float) -> np.ndarray:
    """Return by what matrix the states of plant and controller change over a sample.

    The plant is `machine`, and the shape (members, n, n). `shut` is 1 if the loop is closed, so that the controller's
    force acts, and 0 if it is cut.
    """
    of_machine = [machine.a + shut * (machine.b @ control.d @ machine.c), shut * (machine.b @ control.c)]
    return np.block([of_machine, [control.b @ machine.c, control.a]])


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

        It is the product of the distances to all closed-loop poles, over that to all poles of the cut loop, and may be
        infinite far beyond all poles that are not cut.
        """
        at = self._at(omega)
        squared = np.ones(omega.shape)
        with np.errstate(over="ignore"):
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

    With loops at several rates it is the characteristic locus (see `locus_of`). The feedback of one
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
