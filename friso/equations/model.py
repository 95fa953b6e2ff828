"""Assemble a stage's equations from parts, and derive their variational equations.

The parts give states, right-hand side, kinks and outputs. Kinks are where derivatives jump.

The variational equations say how a small deviation from a motion evolves. Between kinks it obeys the linearised
equations. At a kink the right-hand side, its derivative or the state itself may jump. The deviation then jumps too,
because the neighbouring motion crosses a little earlier or later. The jump is the saltation matrix (Leine, Nijmeijer
2004, doi:10.1007/978-3-540-44398-8, chapter 7).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, cast

import sympy as sp
from mpmath import mp
from sympy import prime

from friso.equations.blocks import Controller, Loop
from friso.equations.component import (
    STEADY,
    TICK,
    TIME,
    Clock,
    Component,
    Held,
    Kink,
    Output,
    Piecewise,
    Role,
    State,
    Switch,
    key,
    state,
)
from friso.equations.conditions import under_acceleration
from friso.equations.continuous import Continuous, continuous_controller
from friso.equations.friction.common import Friction
from friso.equations.masses import (
    BACKLASH,
    Body,
    at_motor,
    joint_deflection,
    joint_force,
    parasitic_force,
    position_outputs,
    transmission,
    transmission_deflection,
)
from friso.equations.motion import declared
from friso.equations.structure import ControllerForm, Structure
from friso.stage.rig import QUADRATIC, ReferenceForm
from friso.stage.tables import BRAKING, MOTOR_MASS, friction_law

REFERENCE = declared().inputs
"""Position, velocity and acceleration of a reference at its last corner."""

MOTION_SIZE = key("motion.size")
"""Length of the motion [m]; 0 where the reference stands still."""


SMALLEST_LENGTH = sp.Rational(1, 10**4)
"""Lower bound of the length scale, as a fraction of the motion, for stages with little friction."""


@dataclass(frozen=True)
class Model:
    """Equations of a stage with the bodies `stage` (measured) and `cart` (with friction).

    A rigid stage has one body that is both. The right-hand side is smooth while the kinks' `beyond` symbols are held.
    `TIME` counts from the last corner of the reference.

    - `deviation` [m]: position minus reference.
    - `length` [m] and `rate` [1/s]: scales of the motion, from which the solver takes its absolute tolerances.
    - `breakaway` [N]: largest force of the controller at which nothing moves: friction at rest, and with a backlash the
      force at half of it.
    - `steady` [N]: friction in a steady motion, None where the law lacks it.
    - `stiffness` [N/m]: proportional stiffness of the loop.
    - `jumps`: for each kink, the jumps of states where it is crossed, as expressions of the values just before.
    - `inputs`: values that are new at every corner of the reference, in this order; `reference`: what its pieces
      consist of.
    - `held`: numbers that stay constant between corners, or between the samples of a `clock` if there is one.
    """

    states: tuple[State, ...]
    stage: Body
    cart: Body
    kinks: tuple[Kink, ...]
    outputs: Mapping[str, Output]
    deviation: sp.Expr
    deviation_rate: sp.Expr
    length: sp.Expr
    rate: sp.Expr
    breakaway: sp.Expr
    stiffness: sp.Expr
    steady: sp.Expr | None = None
    jumps: Mapping[Kink, Mapping[sp.Symbol, sp.Expr]] = field(default_factory=dict)
    inputs: tuple[sp.Symbol, ...] = REFERENCE
    reference: ReferenceForm = QUADRATIC
    held: tuple[Held, ...] = ()
    clock: Clock | None = None

    @property
    def symbols(self) -> tuple[sp.Symbol, ...]:
        return tuple(part.symbol for part in self.states)

    @property
    def rhs(self) -> tuple[sp.Expr, ...]:
        return tuple(part.derivative for part in self.states)

    @property
    def settled(self) -> tuple[sp.Expr, ...]:
        """Return states and held numbers in a steady motion that has lasted, in terms of `STEADY`."""
        return tuple(part.settled for part in (*self.states, *self.held))

    @property
    def switches(self) -> tuple[Switch, ...]:
        """Return the modes with memory."""
        return tuple(kink for kink in self.kinks if isinstance(kink, Switch))

    @property
    def discrete(self) -> tuple[sp.Symbol, ...]:
        """Return the symbols of a run besides its states: held numbers and modes with memory."""
        return (*(held.symbol for held in self.held), *(switch.beyond for switch in self.switches))

    @property
    def fixed(self) -> tuple[sp.Symbol, ...]:
        """Return the symbols that are constant during a step: inputs, discrete states, table values."""
        return (*self.inputs, *self.discrete, *(self.clock.tabled if self.clock else ()))

    @property
    def parameters(self) -> tuple[sp.Symbol, ...]:
        """Return the stage-file keys that the equations contain, with the motion's length, sorted."""
        expressions = [*self.rhs, *(k.surface for k in self.kinks), *(o.expression for o in self.outputs.values())]
        expressions += [*(part.scale for part in self.states), *(part.update for part in self.held), *self.settled]
        expressions += [*(k.at_start for k in self.kinks), *(e for jump in self.jumps.values() for e in jump.values())]
        others = {*self.symbols, *(k.beyond for k in self.kinks), *self.fixed, TIME, TICK, *STEADY}
        if self.clock:
            expressions += [self.clock.period, self.clock.late]
            others |= {*self.clock.seen}
        free: set[Any] = set().union(*(e.free_symbols for e in expressions)) - others
        return tuple(sorted(free, key=str))


def resets(kinks: Iterable[Kink]) -> dict[Kink, dict[sp.Symbol, sp.Expr]]:
    """Return the jumps of states where a mode with memory changes, by the mode and the state.

    The values are expressions of the values just before. Modes are among the `kinks`, where derivatives jump.
    """
    switches = (kink for kink in kinks if isinstance(kink, Switch))
    return {switch: {x: new - x for x, new in becomes.items()} for switch in switches if (becomes := switch.becomes)}


Control = Callable[[Loop, sp.Expr, sp.Expr], Controller]
"""Function that makes a controller from its inputs, a length [m] and a rate [1/s].

Length and rate scale the controller's states.
"""


External = Callable[[Body], sp.Expr]
"""Function that gives an external force [N] on the stage, which may depend on its motion."""


def assemble(
    structure: Structure, external: External | None = None, control: Control | None = None, alone: bool = False
) -> Model:
    """Return the equations of every stage with this structure.

    An `external` force may act besides the actuator's, and another controller may replace the structure's in
    continuous time. Friction that follows the drive's force is as if nothing else resisted the drive, if it is `alone`.
    """
    chain, course = _bodies(structure), declared(structure.reference)
    friction = friction_law(structure.friction).declare(chain.cart.velocity, structure.friction_variant)
    unaccelerated = friction and friction.driven_by(None)
    if friction and structure.load_follows:
        friction = friction.with_values(under_acceleration(course.acceleration_size))
    motor_friction = _motor_friction(structure, chain)
    breakaway = _breakaway(structure, friction, motor_friction)
    length, rate = _scales(structure, breakaway, chain.mass)
    stage, rated = chain.measured(structure)
    loop = Loop(
        course.position - stage.position,
        stage.position,
        rated.velocity,
        course.velocity,
        course.acceleration,
        course.direction,
        None if rated is stage else rated.position,
        course.jerk,
        rated.ahead,
    )
    form = structure.controller
    if control is None and form is not None:
        control = partial(continuous_controller, form)
    acting = control(loop, length, rate) if control else None
    driven = chain.motor or chain.stage
    braking = key(BRAKING) * driven.velocity if structure.braked else sp.S.Zero
    pushed = acting.force if acting else sp.S.Zero
    felt = None if alone else pushed - braking
    friction, motor_friction = (law and law.driven_by(felt) for law in (friction, motor_friction))
    forces = Pushes(pushed - braking, external(chain.stage) if external else sp.S.Zero)
    bodies, parts = _mechanics(structure, chain, (friction, motor_friction), forces, (length, rate))
    if acting:
        parts.append(acting.component)
    outputs = {
        "reference": Output(course.position, "m", "reference"),
        "error": Output(loop.error, "m", "error"),
    }
    for part in parts:
        outputs |= part.outputs
    kinks = tuple(kink for part in parts for kink in part.kinks)
    return Model(
        states=(*bodies, *(part_state for part in parts for part_state in part.states)),
        stage=stage,
        cart=chain.cart,
        kinks=kinks,
        outputs=outputs,
        deviation=stage.position - course.position,
        deviation_rate=stage.velocity - course.velocity,
        length=length,
        rate=rate,
        breakaway=breakaway,
        stiffness=loop_stiffness(structure.controller),
        steady=_steady(chain, unaccelerated, motor_friction, structure.braked),
        jumps=resets(kinks),
        inputs=course.inputs,
        reference=structure.reference,
        held=acting.held if acting else (),
    )


def loop_stiffness(form: ControllerForm | None) -> sp.Expr:
    """Return the proportional stiffness of the loop [N/m]; 0 without a controller."""
    return form.section.stiffness(Continuous(sp.S.One), form.variant) if form else sp.S.Zero


@dataclass(frozen=True)
class Bodies:
    """The bodies of a stage: cart, stage (the same when rigid), parasitic mass and motor."""

    cart: Body
    stage: Body
    parasitic: Body | None = None
    motor: Body | None = None

    @property
    def mass(self) -> sp.Expr:
        """Return the whole moving mass [kg]."""
        mass = self.cart.mass + (self.stage.mass if self.stage is not self.cart else 0)
        mass += self.parasitic.mass if self.parasitic else 0
        return mass + (self.motor.mass if self.motor else 0)

    def measured(self, structure: Structure) -> tuple[Body, Body]:
        """Return the two bodies whose position and whose velocity the controller measures."""
        form = structure.transmission
        sides = (form.position, form.velocity) if form else ("load", "load")
        on_position, on_velocity = (self.motor if side == "motor" and self.motor else self.stage for side in sides)
        return on_position, on_velocity


@dataclass(frozen=True)
class Pushes:
    """The forces [N] of the actuator, and of external causes on the stage."""

    actuator: sp.Expr
    external: sp.Expr


def _bodies(structure: Structure) -> Bodies:
    """Return the bodies of a stage with their masses.

    They are cart and stage, and a parasitic mass or a motor if there is one.
    """
    bias = {name: key(f"bias.{name}") for name in structure.biased}
    motor, load_ahead = None, sp.S.Zero
    if structure.transmission:
        carrying = -sum(bias.values(), start=sp.S.Zero)
        motor_ahead = STEADY.deflected * transmission_deflection(structure.plays, carrying) if bias else sp.S.Zero
        if structure.transmission.position == "motor":
            motor_ahead, load_ahead = sp.S.Zero, -motor_ahead
        motor = Body.named("motor_", key(MOTOR_MASS), motor_ahead)
    if structure.joint == "rigid":
        rigid = Body.named("", sum((key(f"masses.{name}") for name in structure.masses), start=sp.S.Zero), load_ahead)
        return Bodies(rigid, rigid, motor=motor)
    cart_ahead = load_ahead
    if "cart" in bias:
        cart_ahead += STEADY.deflected * joint_deflection(structure.joint, bias["cart"])
    cart, parasitic, stage_mass = Body.named("cart_", key("masses.cart"), cart_ahead), None, key("masses.stage")
    if structure.parasitic:
        parasitic = Body.named("parasitic_", key("parasitic.mass"), load_ahead)
        stage_mass -= parasitic.mass
    return Bodies(cart, Body.named("", stage_mass, load_ahead), parasitic, motor)


def _positions(structure: Structure, chain: Bodies) -> list[Component]:
    """Return position and velocity of the stage as outputs.

    With a transmission, the outputs of the side whose position is measured come first, then those of the other side.
    """
    if not (structure.transmission and chain.motor):
        return [position_outputs("", "stage", chain.stage)]
    sides = {"load": chain.stage, "motor": chain.motor}
    measured = sides.pop(structure.transmission.position)
    stage_outputs = position_outputs("", structure.transmission.position, measured)
    return [stage_outputs, *(position_outputs(f"{side}_", side, body) for side, body in sides.items())]


def _motor_friction(structure: Structure, chain: Bodies) -> Friction | None:
    """Return the friction law at the motor, by the motor's velocity; None without such friction."""
    form = structure.transmission
    if form is None or chain.motor is None:
        return None
    velocity = chain.cart.velocity
    friction = friction_law(form.friction).declare(velocity, form.friction_variant)
    return at_motor(friction, velocity, chain.motor.velocity) if friction else None


def _breakaway(structure: Structure, *frictions: Friction | None) -> sp.Expr:
    """Return the largest force [N] of the controller at which nothing moves.

    It is the sum of friction forces at rest, and of the controller's force at an error of half the backlash.
    """
    force = sum((friction.breakaway for friction in frictions if friction), start=sp.S.Zero)
    return force + (loop_stiffness(structure.controller) * BACKLASH / 2 if structure.plays else 0)


def _steady(chain: Bodies, friction: Friction | None, motor_friction: Friction | None, braked: bool) -> sp.Expr | None:
    """Return friction [N] at guide and motor while all masses move with the cart, and the motor's braking.

    Returns None if a law does not determine it.
    """
    total: sp.Expr | None = friction.steady(chain.cart.velocity) if friction else sp.S.Zero
    if total is not None and braked:
        total += key(BRAKING) * chain.cart.velocity
    if motor_friction and chain.motor and total is not None:
        part = motor_friction.driven_by(None).steady(chain.motor.velocity)
        total = None if part is None else total + part.subs(chain.motor.velocity, chain.cart.velocity)
    return total


def _scales(structure: Structure, breakaway: sp.Expr, mass: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Return the length [m] and the rate [1/s] by which a hunting cycle is sized.

    The length is the deflection of the loop by the break-away force, or about the motion itself if that is shorter. The
    rate is the natural frequency of mass and loop, but at least one over the duration of the motion. A hunting cycle is
    a few lengths wide and takes a few times 1/rate. Without friction the length is that of the motion, or else the
    deflection by the forces of [bias].
    """
    stiffness = loop_stiffness(structure.controller)
    if breakaway == 0:
        bias = sum((sp.Abs(key(f"bias.{name}")) for name in structure.biased), start=sp.S.Zero)
        length, deflection = MOTION_SIZE, bias / stiffness if bias else sp.S.Zero
    else:
        deflection = breakaway / stiffness
        length = sp.Max(sp.Min(MOTION_SIZE, deflection), SMALLEST_LENGTH * MOTION_SIZE)
    length = Piecewise((length, MOTION_SIZE > 0), (deflection, True))
    return length, sp.Max(sp.sqrt(stiffness / mass), 1 / key("motion.duration"))


def _mechanics(
    structure: Structure,
    chain: Bodies,
    frictions: tuple[Friction | None, Friction | None],
    forces: Pushes,
    scales: tuple[sp.Expr, sp.Expr],
) -> tuple[list[State], list[Component]]:
    """Return the states of every body by Newton's law, and the parts that supply the forces.

    `frictions` act on the cart and at the motor; `forces` are those of the actuator and of external causes. `scales`
    are the length [m] and the rate [1/s] of the states.
    """
    cart, stage, parasitic, motor = chain.cart, chain.stage, chain.parasitic, chain.motor
    friction, motor_friction = frictions
    bias = {name: key(f"bias.{name}") for name in structure.biased}
    drag = (friction.force if friction else sp.S.Zero) - bias.get("cart", sp.S.Zero)
    parts = [*_positions(structure, chain), position_outputs("cart_", "cart", cart)]
    states: list[State] = []
    driven = forces.actuator
    if structure.transmission and motor:
        driven, part = transmission(structure.plays, motor, stage)
        resisting = motor_friction.force if motor_friction else sp.S.Zero
        states += motor.under(forces.actuator - driven - resisting, *scales)
        parts += [part, *([motor_friction.component] if motor_friction else [])]
    on_stage = driven + forces.external + bias.get("stage", sp.S.Zero)
    if parasitic:
        inner = parasitic_force(parasitic, stage)
        on_stage -= inner
        states += parasitic.under(inner, *scales)
    if structure.joint == "rigid":
        states[:0] = stage.under(on_stage - drag, *scales)
    else:
        on_cart, part = joint_force(
            structure.joint,
            stage.position - cart.position,
            stage.velocity - cart.velocity,
            structure.limiter_pulls,
        )
        states[:0] = [*stage.under(on_stage - on_cart, *scales), *cart.under(on_cart - drag, *scales)]
        parts.append(part)
    if friction:
        output = Component(outputs={"friction_force": Output(friction.force, "N", "friction force")})
        parts += [friction.component, output]
    return states, parts


PREFIX = "small_"
"""Prefix of the names of deviations."""


def variational(model: Model) -> Model:
    """Return the model extended by a small deviation of each state, after the states.

    Deviations do not influence the step size. They are those of a neighbouring motion with other initial states.
    """
    small = {part.symbol: state(f"{PREFIX}{part.symbol}") for part in model.states}
    deviations = tuple(
        State(
            small[part.symbol],
            _directional_derivative(part.derivative, small),
            part.unit,
            part.scale,
            Role.DEVIATION,
            controlled=False,
        )
        for part in model.states
    )
    jumps = {kink: {**model.jumps.get(kink, {}), **_saltation(model, kink, small)} for kink in model.kinks}
    return replace(
        model, states=(*model.states, *deviations), jumps={kink: jump for kink, jump in jumps.items() if jump}
    )


Small = Mapping[sp.Symbol, sp.Symbol]


def _directional_derivative(expression: sp.Expr, small: Small) -> sp.Expr:
    """Return how much an expression changes with a small deviation.

    `small` maps each symbol to the symbol of its deviation.
    """
    terms = (sp.diff(expression, x) * deviation for x, deviation in small.items())
    return sum(terms, start=sp.S.Zero)


def _saltation(model: Model, kink: Kink, small: Small) -> dict[sp.Symbol, sp.Expr]:
    """Return the jump of deviations at a kink, where derivatives jump, by symbol of deviation.

    It is (f+ - f-) times the component of the deviation across the kink, divided by the speed of crossing. f- and f+
    are the right-hand sides just before and just after the crossing. `small` maps symbols to those of their deviations.
    """
    speed = sp.diff(kink.surface, TIME)
    speed += sum((sp.diff(kink.surface, part.symbol) * part.derivative for part in model.states), start=sp.S.Zero)
    share = _directional_derivative(kink.surface, small) / speed
    if isinstance(kink, Switch):
        return _saltation_with_reset(model, kink, small, share)
    across = {
        part.symbol: gap * (1 - 2 * kink.beyond)
        for part in model.states
        if not _vanishes(gap := part.derivative.subs(kink.beyond, 1) - part.derivative.subs(kink.beyond, 0), kink)
    }
    return {small[x]: gap * share for x, gap in across.items()}


def _saltation_with_reset(model: Model, switch: Switch, small: Small, share: sp.Expr) -> dict[sp.Symbol, sp.Expr]:
    """Return the jump of deviations where a `switch` changes and states x become R(x).

    The result is by symbol of deviation. Derivatives jump as well there. The jump is DR small + (f+ - DR f-) share -
    small. f- and f+ are the right-hand sides just before and just after the crossing, f+ at R(x). `share` is the time
    by which the neighbouring motion crosses earlier or later.
    """
    becomes = switch.becomes
    behind = {**becomes, switch.beyond: 1 - switch.beyond}
    before = {part.symbol: part.derivative for part in model.states}
    jumps: dict[sp.Symbol, sp.Expr] = {}
    for x, rate in before.items():
        if x not in becomes and not rate.free_symbols & {switch.beyond, *becomes}:
            continue
        new = becomes.get(x, x)
        carried = _directional_derivative(new, small)
        moved = sum((sp.diff(new, y) * before[y] for y in before), start=sp.S.Zero)
        jumps[small[x]] = carried - small[x] + (cast(sp.Expr, rate.xreplace(behind)) - moved) * share
    return jumps


def _vanishes(gap: sp.Expr, kink: Kink) -> bool:
    """Tell whether a difference is zero everywhere on a kink's surface, where derivatives jump.

    `gap` is the difference, an expression, tested at some points. The result is false if the surface is linear in no
    symbol, as at the end of a window. It is also false if the surface has no slope at one of the points.
    """
    if gap == 0:
        return True
    linear = (s for s in sorted(kink.surface.free_symbols, key=str) if sp.diff(kink.surface, s, 2) == 0)
    if (symbol := next(linear, None)) is None:
        return False
    others = sorted((kink.surface.free_symbols | gap.free_symbols) - {symbol}, key=str)
    rest, slope, difference = (
        sp.lambdify([symbol, *others], part, [{"sine": lambda turn: mp.sin(2 * mp.pi * turn)}, "mpmath"])
        for part in (kink.surface.subs(symbol, 0), sp.diff(kink.surface, symbol), gap)
    )
    with mp.workdps(TESTED_DECIMALS):
        for n in range(1, TRIED_POINTS + 1):
            point = [mp.mpf(int(prime(n + k)) % 97) / (50 + n) + 1 for k in range(1, len(others) + 1)]
            if not (steep := slope(0, *point)):
                return False
            at = -rest(0, *point) / steep
            if abs(difference(at, *point)) > ZERO_BOUND:
                return False
    return True


TRIED_POINTS, TESTED_DECIMALS, ZERO_BOUND = 3, 50, 1e-25
"""Number of points at which a difference is tested, decimals of its value, and the bound below which it counts as 0."""
