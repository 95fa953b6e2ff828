"""Declare a stage with its real drive, surroundings and rail.

The drive samples, waits, quantises and saturates; motor, cable, rail and floor are imperfect.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from friso.equations.conditions import LEVELS, anywhere
from friso.equations.structure import Structure, structure

if TYPE_CHECKING:
    import sympy as sp

    from friso.equations.blocks import Loop
    from friso.equations.component import Held, Kink
    from friso.equations.model import Control, Model

STATIC_FACTOR, COULOMB_FACTOR, MOTOR_FACTOR = PLACES = ("static_factor", "coulomb_factor", "motor_factor")
"""Names of the friction and motor factors that are looked up by position at every sample. They multiply the cart's
static friction, its Coulomb friction, and the stage's motor constant."""

INJECTED, FLOOR = TIMES = ("injected_force", "floor_acceleration")
"""Names of the signals that are looked up by time at every sample: a force [N] added to the command, and the
acceleration of the floor [m/s^2]."""


READING, COMMANDED = "reading", "commanded"
"""Names of the quantities that a drive logs: the encoder's reading [m] and the commanded force [N]."""

RATED = "seen_rated"
"""Name of the position at the velocity encoder, for a drive that has a separate one."""

VELOCITY_SEED_OFFSET = 2**50
"""Offset from a drive's random seed to the seed for the noise of its velocity encoder. It is larger than any seed."""


@dataclass(frozen=True)
class AsBuilt:
    """Structure of a stage with its real drive.

    `delay_samples` is the delay in whole samples. `current_loop` is true if the current loop lags. `velocity_samples`
    is the number of samples over which a drive without a filter differentiates the position.
    """

    structure: Structure
    delay_samples: int
    current_loop: bool
    velocity_samples: int

    @classmethod
    def of(cls, flat: Mapping[str, Any]) -> AsBuilt:
        """Return the structure of a stage with its drive; `flat` has the stage's keys in SI."""
        samples = round(flat.get("drive.velocity_samples", 1.0))
        return cls(structure(anywhere(flat)), whole_samples(flat), "drive.current_bandwidth" in flat, samples)


def whole_samples(flat: Mapping[str, Any]) -> int:
    """Return the delay of a drive in whole samples, rounded down; `drive.late` is the remainder."""
    return int(flat.get("drive.delay", 0.0) / flat["drive.sample_time"] * (1 + 1e-9) + 1e-9)


NEUTRAL: Mapping[str, float] = {
    "drive.delay": 0.0,
    "drive.encoder_resolution": 0.0,
    "drive.encoder_noise": 0.0,
    "drive.force_resolution": 0.0,
    "drive.motor_constant_ratio": 1.0,
    "drive.feedforward_mass": 0.0,
    "drive.feedforward_coulomb": 0.0,
    "drive.feedforward_viscous": 0.0,
    "drive.integrator_deadband": 0.0,
    "drive.integrator_reset": 0.0,
    "cable.stiffness": 0.0,
    "cable.drag": 0.0,
}
"""Keys of the drive and its cables, with the values [SI] for a drive without imperfections."""


def as_built(form: AsBuilt) -> Model:
    """Return the equations of the stage with its drive.

    Friction factors, motor ripple and floor acceleration are constant over a sample.
    """
    from dataclasses import replace

    from sympy import Symbol

    from friso.equations.component import Clock, key, state
    from friso.equations.model import assemble, resets
    from friso.equations.sampled import SAMPLE_TIME

    loops: list[Loop] = []
    model = assemble(form.structure, lambda stage: _cable(stage.position, stage.velocity), _drive(form, loops))
    position, cart = model.stage.position, model.cart.position
    seen = {state("seen"): position}
    rated = loops[0].rated
    if rated is not None:
        assert isinstance(rated, Symbol)
        seen[state(RATED)] = rated
    places = dict(zip(map(state, PLACES), (cart, cart, position), strict=True))
    clock = Clock(SAMPLE_TIME, key("drive.late"), seen, places, tuple(map(state, TIMES)))
    varied = {key(f"friction.{name}"): key(f"friction.{name}") * state(f"{name}_factor") for name in LEVELS}
    states = tuple(replace(part, derivative=_shaken(part).xreplace(varied)) for part in model.states)
    outputs = {n: replace(output, expression=output.expression.xreplace(varied)) for n, output in model.outputs.items()}
    kinks = tuple(_kink_along_rail(kink, varied) for kink in model.kinks)
    return replace(model, states=states, outputs=outputs, kinks=kinks, jumps=resets(kinks), clock=clock)


def _kink_along_rail(kink: Kink, varied: Mapping[Any, Any]) -> Kink:
    """Return a kink, where derivatives jump, with friction levels that vary along the rail.

    `varied` maps the symbols of these levels to their values on the rail. The levels without the rail's factors decide
    on which side of the kink a run begins.
    """
    from friso.equations.component import Kink, Switch

    there = kink.with_values(varied)
    if not kink.at_start.free_symbols & {*varied}:
        return there
    if isinstance(there, Switch):
        return Switch(there.name, there.enter, there.leave, kink.at_start, there.entered, there.left)
    return Kink(there.name, there.surface, narrow=there.narrow, starts=kink.at_start)


def _shaken(part: Any) -> sp.Expr:
    """Return the derivative of a state, `part`, in a frame that moves with the floor.

    Only velocities change: the floor's acceleration is subtracted.
    """
    from friso.equations.component import Role, state

    return part.derivative - (state(FLOOR) if part.role == Role.VELOCITY else 0)


def _cable(position: sp.Symbol, velocity: sp.Symbol) -> sp.Expr:
    """Return the force of the cables on the stage [N], from its position and velocity."""
    from friso.equations.component import key

    return -key("cable.stiffness") * position - key("cable.drag") * velocity


def _drive(form: AsBuilt, loops: list[Loop]) -> Control:
    """Return the controller together with everything between the encoders and the motor's force.

    Each loop that is made is added to `loops`.
    """
    from sympy import pi

    from friso.equations.blocks import Controller, force_limit
    from friso.equations.component import STEADY, Component, Held, Output, Role, State, key, quantised, state
    from friso.equations.model import loop_stiffness
    from friso.equations.sampled import clipped

    def control(loop: Loop, length: sp.Expr, rate: sp.Expr) -> Controller:
        loops.append(loop)
        reading, exact, sampled = _command(form, loop)
        command: Any = quantised(exact, key("drive.force_resolution"))
        commanded, waiting = state(COMMANDED), [state(f"waiting_{n + 1}") for n in range(form.delay_samples)]
        controller = form.structure.controller
        begun: Any = clipped(STEADY.force, force_limit()) if controller and controller.anti_windup else STEADY.force
        held = [Held(state(READING), reading, STEADY.position), *sampled, Held(commanded, command, begun)]
        held += [Held(new, old, begun) for new, old in zip(waiting, [commanded, *waiting], strict=False)]
        acting = waiting[-1] if waiting else commanded
        force = key("drive.motor_constant_ratio") * state(MOTOR_FACTOR) * acting
        states: tuple[State, ...] = ()
        if form.current_loop:
            lagging, omega = state("motor_force"), 2 * pi * key("drive.current_bandwidth")
            scale = loop_stiffness(form.structure.controller) * length
            settled = key("drive.motor_constant_ratio") * begun
            states = (State(lagging, omega * (force - lagging), "N", scale, Role.LAG, settled),)
            force = lagging
        return Controller(force, Component(states, (), {"force": Output(force, "N", "motor force")}), tuple(held))

    return control


def _command(form: AsBuilt, loop: Any) -> tuple[sp.Expr, sp.Expr, tuple[Any, ...]]:
    """Return the encoder's reading [m], the commanded force [N], and numbers the drive keeps.

    `loop` has what is measured at the sample. The numbers are kept from one sample to the next.
    """
    from dataclasses import replace

    from friso.equations.component import TICK, gaussian, key, quantised, state

    drive = {name: key(f"drive.{name}") for name in ("encoder_noise", "encoder_resolution", "seed")}

    def read(seen: str, seed: sp.Expr) -> Any:
        noisy = state(seen) + drive["encoder_noise"] * gaussian(seed, TICK)
        return quantised(noisy, drive["encoder_resolution"])

    reading = read("seen", drive["seed"])
    rated = None if loop.rated is None else read(RATED, drive["seed"] + VELOCITY_SEED_OFFSET)
    error = loop.error.xreplace({loop.position: reading})
    measured = replace(loop, error=error, position=reading, rated=rated)
    return reading, *controller_as_built(form, measured, state(INJECTED))


def controller_as_built(form: AsBuilt, measured: Loop, injected: Any = 0) -> tuple[sp.Expr, tuple[Held, ...]]:
    """Return the force [N] that a drive commands at a sample, and the numbers that it keeps until the next.

    `measured` has the readings of the encoders and the reference at the sample. An `injected` force [N] is added before
    the limit of the force.
    """
    import sympy as sp

    from friso.equations.component import STEADY, Held, Piecewise, key, state
    from friso.equations.sampled import Rest, sampled_controller

    assert form.structure.controller is not None
    drive = {name.split(".")[1]: key(name) for name in NEUTRAL}
    error, speed, before = measured.error, measured.reference_velocity, state("error_before")
    ahead = drive["feedforward_mass"] * measured.reference_acceleration + drive["feedforward_viscous"] * speed
    ahead += drive["feedforward_coulomb"] * Piecewise((1, speed > 0), (-1, speed < 0), (0, True))
    rest = Rest(
        rests=sp.Abs(error) < drive["integrator_deadband"],
        restarts=sp.And(drive["integrator_reset"] > 0, error * before < 0),
    )
    command, held = sampled_controller(
        form.structure.controller, measured, form.velocity_samples, ahead + injected, rest
    )
    last = Piecewise((error, error**2 > 0), (before, True))  # a reading in whole digits may not change
    return command, (*held, Held(before, last, STEADY.error))
