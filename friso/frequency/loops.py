"""Build the loop of plant, controller and drive: closed, and cut at the actuator force; for many states at once.

Friction is taken in a steady state: stuck under a bias force, or sliding at a speed.

Sampled loops, at one rate or several, are lifted to their common period. After that period all loops are due again. The
controller is that of `friso.equations.sampled`, as a drive computes it. Over a period of N samples the loop is a
time-invariant system with N inputs and outputs (lifting: Chen, Francis 1995, Optimal Sampled-Data Control Systems,
chapter 8; Bittanti, Colaneri 2009, Periodic Systems, chapter 6). Its poles decide on stability.

Cut at the actuator, it has N characteristic loci. A gain or a phase common to all samples brings it to the edge of
stability where one locus passes -1 (MacFarlane, Postlethwaite 1977, doi:10.1080/00207177708922217). So margins are
those of a locus. With all loops at one rate, the loci are the loop's response at a frequency and at its aliases.

`friso.linear` gives a stage in one of its states to python-control, as a linear system.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, reduce
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy as sp

from friso.equations.blocks import Controller, Loop
from friso.equations.component import Component, Held, Kink
from friso.equations.continuous import continuous_controller
from friso.equations.masses import flanks, touching
from friso.equations.model import REFERENCE as REFERENCE_COURSE
from friso.equations.model import assemble
from friso.equations.roles import Role
from friso.equations.sampled import counter, sampled_controller
from friso.equations.structure import ControllerForm, Structure, shared_structure
from friso.errors import InputError
from friso.frequency.system import (
    FORWARD,
    Complex,
    Declared,
    DriveTiming,
    Members,
    System,
    behind_current_loop,
    delayed,
    fastest,
    law_of,
    level,
    limit_cases,
    limiter_in_series,
    limiter_states,
    motor_law_of,
    waited,
    zero_order_hold,
)
from friso.quantities import quoted
from friso.stage import Stage
from friso.stage.arguments import check_arguments
from friso.stage.rig import LOOPS
from friso.stage.tables import MOTOR_STATES, STATE_PREFIX, of_motor

if TYPE_CHECKING:
    from control import StateSpace


def operating_point(flat: Mapping[str, Any], members: Members) -> dict[str, Any]:
    """Return the steady values of a stage's friction law in each state of `members`, by name.

    Each has the shape (members,). They are the values of its internal states, of its modes with memory, of the sides of
    its kinks (where derivatives jump), and of its direction. The result is empty without friction.
    """
    law, forward = law_of(flat), members.forward.astype(float)
    if law is None:
        return {}
    sign = 2 * forward - 1
    at = {**flat, "velocity": sign * np.maximum(members.speed, np.finfo(float).tiny), FORWARD: forward}
    sliding, stuck = law.sliding(at), law.stuck({**at, "bias": sign * members.bias})
    internal = {
        name: np.where(members.stuck, rest, moving)
        for name, rest, moving in zip((*law.states, *law.modes), stuck, sliding, strict=True)
    }
    return {FORWARD: forward, **internal}


def operating_point_of_motor(flat: Mapping[str, Any], members: Members) -> dict[str, Any]:
    """Return the steady values of the friction law at the motor in each state, by name.

    The motor moves with the load and bears no bias force.
    """
    unbiased = replace(members, bias=np.zeros(len(members)))
    point = operating_point(of_motor(flat), unbiased)
    beyond = "beyond_"
    return {
        f"{beyond}{STATE_PREFIX}{name.removeprefix(beyond)}" if name.startswith(beyond) else f"{STATE_PREFIX}{name}": at
        for name, at in point.items()
    }


FORCE, DISTURBANCE, REFERENCE, NOISE = "force", "disturbance on cart", "reference", "sensor noise"
FEEDFORWARD = "reference velocity", "reference acceleration", "reference jerk"
STAGE, CART, DEFLECTION, VELOCITY = "stage", "cart", "joint deflection", "stage velocity"
RATED = "velocity's encoder"
"""Name of the position signal that the drive differentiates to a velocity: the velocity encoder's, if separate."""

_REFERENCE, _POSITION, _VELOCITY, *_DERIVATIVES = (
    sp.Symbol(f"measured_{name}", real=True) for name in ("r", "y", "v", "r_rate", "r_bend", "r_jerk")
)
_CONTROLLER_INPUTS = {
    REFERENCE: _REFERENCE,
    STAGE: _POSITION,
    VELOCITY: _VELOCITY,
    **dict(zip(FEEDFORWARD, _DERIVATIVES, strict=True)),
}


def plant(flat: Mapping[str, Any], members: Members) -> System:
    """Return the plant in each state of `members`, which are all stuck or all sliding.

    Inputs are the forces on stage and cart [N]. Outputs are the positions of stage and cart, the joint deflection, the
    position at the velocity's encoder [m], and the velocity of the stage [m/s]. `flat` has the keys in SI, which may be
    arrays of shape (members,).
    """
    form = _plant(shared_structure(flat).standing)
    velocity = np.where(members.forward, members.speed, -members.speed)
    values = {**flat, **operating_point(flat, members)}
    values |= dict.fromkeys(form.velocities, velocity)
    values |= {**_ahead(touching, members.touched.astype(float)), **_ahead(flanks, 1.0)}
    values |= {str(symbol): 0.0 for symbol in REFERENCE_COURSE}  # the reference rests
    bodies = {form.cart: law_of(flat)}
    if form.motor:
        bodies[form.motor] = motor_law_of(flat)
        values |= operating_point_of_motor(flat, members)
    system = form.declared.at(values, len(members))
    for body, law in bodies.items():
        if law is not None:
            stuck = members.stuck.all()
            system = _following(system, body, law.states) if stuck else _without_constants(system, law.states)
    return system


def mechanics(flat: Mapping[str, Any], touched: np.ndarray) -> System:
    """Return the masses without friction as systems, from forces on stage and cart to positions.

    There is one system for each entry of `touched`, with the limiter touched or not. Raises InputError for a
    transmission with another nonlinearity than the friction of the guide.
    """
    drive = shared_structure(flat).transmission
    if drive is not None and (drive.backlash or drive.friction != "none"):
        actual = "a backlash" if drive.backlash else "friction at the motor"
        raise InputError("transmission", actual, "the friction of the guide alone", "friso check, which simulates")
    declared = _plant(replace(shared_structure(flat).standing, friction="none", friction_variant=None)).declared
    masses = declared.at({**flat, **_ahead(touching, touched.astype(float))}, len(touched))
    return masses.take((FORCE, DISTURBANCE), (STAGE, CART))


def _ahead(kinks: Callable[[sp.Expr], tuple[Kink, Kink]], values: Any) -> dict[str, Any]:
    """Return the symbols of the stops ahead and behind, by name: `values` say where the one ahead is touched.

    With the limiter, members that touch it do so ahead. With a backlash, the motor stands on the flank ahead, on which
    it pushes the load forward.
    """
    ahead, behind = (str(kink.beyond) for kink in kinks(sp.S.Zero))
    return {ahead: values, behind: 0.0}


def compensator(flat: Mapping[str, Any], members: int) -> System:
    """Return the controller, from reference and measurements to the force [N].

    Inputs are the reference, position [m] and velocity [m/s] of the stage, and velocity [m/s], acceleration [m/s^2] and
    jerk [m/s^3] of the reference. There are `members` equal ones, unless keys are arrays. Raises InputError for a
    controller that exerts no force.
    """
    form = shared_structure(flat).controller
    assert form is not None  # a stage file has a controller
    bare = replace(form, anti_windup=None, settings=form.settings.only("integral_leak"))
    system = _compensator(bare).at(flat, members)
    if not (system.c.any() or system.d.any()):
        raise InputError("controller", "gains that are all 0", "a controller that acts", 'kp = "3 N/m"')
    return system


def reference_derivatives(control: System) -> tuple[str, ...]:
    """Return names of the derivatives of the reference that a controller takes."""
    return tuple(name for name in FEEDFORWARD if control.sees(name))


@dataclass(frozen=True)
class _Plant:
    """The model's own equations in symbols, with a force in place of the controller.

    It has the names of all velocities, and of position and velocity of the cart and of the motor (None without a
    transmission).
    """

    declared: Declared
    velocities: tuple[str, ...]
    cart: tuple[str, str]
    motor: tuple[str, str] | None


@cache
def _plant(form: Structure) -> _Plant:
    push = sp.Symbol("actuator_force", real=True)
    seen: list[Loop] = []

    def control(loop: Loop, length: sp.Expr, rate: sp.Expr) -> Controller:
        seen.append(loop)
        return Controller(push, Component())

    at_rest = replace(form, controller=None, biased=("cart",), limiter_pulls=True)  # a touched limiter stays touched
    model = assemble(at_rest, control=control, alone=True)
    (loop,) = seen
    expressions = {name: output.expression for name, output in model.outputs.items()}
    rated = loop.position if loop.rated is None else loop.rated
    outputs = {STAGE: loop.position, CART: expressions["cart_position"], VELOCITY: loop.velocity, RATED: rated}
    if "joint_deflection" in expressions:
        outputs[DEFLECTION] = expressions["joint_deflection"]
    inputs = {FORCE: push, DISTURBANCE: sp.Symbol("bias.cart", real=True)}
    velocities = tuple(str(state.symbol) for state in model.states if state.role == Role.VELOCITY)
    cart = (str(model.cart.position), str(model.cart.velocity))
    motor = MOTOR_STATES if form.transmission else None
    return _Plant(Declared(model.symbols, model.rhs, inputs, outputs), velocities, cart, motor)


def cart_states(flat: Mapping[str, Any]) -> tuple[str, str]:
    """Return the names of the states that are position and velocity of the body with friction."""
    return _plant(shared_structure(flat).standing).cart


@cache
def _compensator(form: ControllerForm) -> Declared:
    speed, acceleration, jerk = _DERIVATIVES
    loop = Loop(_REFERENCE - _POSITION, _POSITION, _VELOCITY, speed, acceleration, reference_jerk=jerk)
    control = continuous_controller(form, loop, sp.S.One, sp.S.One)
    states = control.component.states
    # within all limits of the controller
    within: dict[Any, Any] = {kink.beyond: sp.S.Zero for kink in control.component.kinks}
    symbols = tuple(state.symbol for state in states)
    force, *rates = (sp.sympify(e).subs(within) for e in (control.force, *(state.derivative for state in states)))
    return Declared(symbols, tuple(rates), _CONTROLLER_INPUTS, {FORCE: force})


def _following(system: System, cart: tuple[str, str], internal: tuple[str, ...]) -> System:
    """Return the system with the friction law's internal states tied to the stuck cart.

    At rest the rate of these states is proportional to the velocity of the cart alone. So they differ from a multiple
    of its position by a constant, which depends on where on the rail the cart got stuck. Nothing controls that
    constant, and it does not matter; it would be a pole at 0.
    """
    position, velocity = map(system.states.index, cart)
    a, c = system.a.copy(), system.c.copy()
    for z in map(system.states.index, internal):
        share = system.a[:, z, velocity]
        for matrix in (a, c):
            matrix[:, :, position] += share[:, None] * matrix[:, :, z]
    return replace(system, a=a, c=c).keep([i for i, name in enumerate(system.states) if name not in internal])


def _without_constants(system: System, internal: tuple[str, ...]) -> System:
    """Return the system without internal states of the friction law that stay constant.

    An example is the force of an element that slips. Such a state would be a pole at 0.
    """
    unmoved = [z for z in map(system.states.index, internal) if not (system.a[:, z].any() or system.b[:, z].any())]
    return system.keep([i for i in range(len(system.states)) if i not in unmoved])


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


SLOW_POLE_SHARE = 1e-6
"""Relative frequency below which sampling and delay do not change poles."""


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
        fast = np.where(np.abs(closed) > SLOW_POLE_SHARE / step, _real_parts(closed), -np.inf)
        slow = np.where(np.abs(bare) <= SLOW_POLE_SHARE / step, _real_parts(bare), -np.inf)
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


UNDAMPED_RATIO = 1e-9
"""Damping ratio below which poles are on the imaginary axis, within rounding."""


def _real_parts(poles: Complex) -> np.ndarray:
    """Return real parts of poles, (members, n), 0 on the imaginary axis up to rounding."""
    size = np.abs(poles)
    fastest = np.where(np.isfinite(size), size, 0.0).max(axis=1, keepdims=True)
    edge = np.where(poles.imag != 0, UNDAMPED_RATIO * size, 0.0) + ROUNDING * fastest
    return np.where(np.abs(poles.real) <= edge, 0.0, poles.real)


@check_arguments
def linear(stage: Stage, case: str | Members | None = None, part: str = "plant", series: bool = False) -> StateSpace:
    """Return a stage in one state as a `control.StateSpace` in SI units, with named signals.

    `case` is the name of a limit case ("stuck", "sliding", "stuck-touched", "sliding-touched", or "given" for a stage
    that has just one; default: the first of them that the stage has), or a state such as
    `friso.member(speed=1e-3)` [m/s], `friso.member(bias=2.0)` [N], both with `touched=True` if the limiter is.
    `part` is one of

    - "plant": from "force" on the stage and "disturbance on cart" [N] to "stage", "cart" and "joint deflection" [m];
    - "controller": from "reference" and "stage" [m] (and "stage velocity" [m/s] if it measures that) to "force" [N];
      one with feedforward also from "reference velocity" [m/s], "reference acceleration" [m/s^2] and "reference jerk"
      [m/s^3], here and below;
    - "open": the loop cut at the actuator, from "force" to minus the "force" of the controller;
    - "closed": from "force", "reference", "disturbance on cart" and "sensor noise" [m] to "stage", "cart", "joint
      deflection" and "force".

    All are in continuous time, without sampling, delay and current loop of a drive. With `series`, a touched limiter
    acts by the formula that Table 1 of the thesis prints, instead of in parallel with the joint. Where the cart is
    stuck, its bristles follow it and are no states; a derivative of the measured velocity does not see the noise of the
    sensor, which has none. Raises InputError for an unknown case or part, and for a state that the stage cannot be in.

    Examples
    --------
    >>> import friso
    >>> stage = friso.load(friso.example("thesis_rig"))
    >>> friso.linear(stage, "stuck").output_labels
    ['stage', 'cart', 'joint deflection']
    """
    if not isinstance(case, str | Members | None):
        raise InputError("case", quoted(case), "the name of a limit case, or a state", "case=friso.member(speed=1e-3)")
    flat: Mapping[str, Any] = stage.flat()
    cases = limit_cases(flat)
    member = _checked(flat, case) if isinstance(case, Members) else _chosen("case", case or next(iter(cases)), cases)
    if series and member.touched.all():
        flat, member = limiter_in_series(flat), member.with_limiter(False)
    system = _chosen("part", part, _PARTS)(flat, member)
    return _control(system, f"{stage.name} {part}".strip())


def _checked(flat: Mapping[str, Any], member: Members) -> Members:
    """Return a state of a stage unchanged, after checking that the stage can be in it.

    Raises InputError for several states at once, a limiter that cannot be so, or a bias force that breaks the cart
    away.
    """
    if len(member) != 1:
        raise InputError(
            "case", f"{len(member)} states", "a single one", "friso.linear(stage, friso.member(speed=1e-3))"
        )
    if bool(member.touched[0]) not in limiter_states(flat):
        state = f"a limiter that is {'' if member.touched[0] else 'not '}touched"
        raise InputError("case", state, "what the joint allows: free with a stroke, it may be both", "touched=False")
    least, most = -level(flat, not member.forward[0]), level(flat, bool(member.forward[0]))
    if member.bias[0] and not least < member.bias[0] < most:
        expected = f"between {least:g} N and {most:g} N, at which the cart breaks away"
        raise InputError("case", f"a bias of {member.bias[0]:g} N", expected, "friso.member(bias=0.5)")
    return member


def _control(system: System, name: str) -> StateSpace:
    from control import StateSpace

    names = {"states": [*system.states], "inputs": [*system.inputs], "outputs": [*system.outputs]}
    return StateSpace(system.a[0], system.b[0], system.c[0], system.d[0], name=name, **names)


def _controller(flat: Mapping[str, Any], member: Members) -> System:
    controller = compensator(flat, len(member))
    measured = (REFERENCE, STAGE, VELOCITY) if controller.sees(VELOCITY) else (REFERENCE, STAGE)
    return controller.take((*measured, *reference_derivatives(controller)), (FORCE,))


def _at_axis(system: System) -> System:
    """Return the system without its outputs of velocity, which only the controller uses."""
    return system.take(system.inputs, [name for name in system.outputs if name not in (VELOCITY, RATED)])


_PARTS: dict[str, Callable[[Mapping[str, Any], Members], System]] = {
    "plant": lambda flat, member: _at_axis(plant(flat, member)),
    "controller": _controller,
    "open": open_loop,
    "closed": lambda flat, member: _at_axis(closed_loop(flat, member)),
}


def _chosen(what: str, name: str, choices: Mapping[str, Any]) -> Any:
    if name not in choices:
        first = next(iter(choices))
        raise InputError(what, quoted(name), f"one of {', '.join(choices)}", f'friso.linear(stage, {what}="{first}")')
    return choices[name]
