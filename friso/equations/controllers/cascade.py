"""The cascade of servo drives: a position loop that commands a velocity to a velocity loop.

Position loop: v = kv (e + (1/T_p) int e dt) + f dr/dt. Velocity loop: F = kp (w + (1/T_v) int w dt) with w = v - dy/dt,
and the force that the move itself is believed to need. An integral without its time is absent. With the proportional
part on the measurement alone, F = kp ((1/T_v) int w dt - dy/dt), it is pseudo-derivative feedback (Phelan 1977,
Automatic Control Systems; Ellis 2012, Control System Design Guide, chapter 6). The structure is that of EMPS (Janot,
Gautier, Brunot 2019) and of drives in general (Gross, Hamann, Wiegaertner 2001, Electrical Feed Drives).
"""

from __future__ import annotations

from collections.abc import Mapping
from math import sqrt
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple

from friso.equations.controllers.pid import SYMBOLS, fed_forward, feedforward_of_moves
from friso.quantities import Number, Quantity, Value, any_sign, non_negative, positive
from friso.stage import ControllerSection, Rule, register_controller
from friso.stage.controllers import Gain, PidLike
from friso.stage.tables import moving_mass

if TYPE_CHECKING:
    import sympy as sp

    from friso.equations.blocks import Blocks, Measured, Signal

KP, POSITION_TIME, VELOCITY_TIME, PROPORTIONAL_ON, VELOCITY_FILTER = (
    f"controller.{name}"
    for name in ("kp", "position_integral_time", "velocity_integral_time", "proportional_on", "velocity_filter")
)

FEEDFORWARD = (
    *("velocity_feedforward", "acceleration_feedforward", "coulomb_feedforward", "viscous_feedforward"),
    "jerk_feedforward",
)


INTEGRAL_TIME_FACTOR = 4.0
"""Initial integral time of a loop, in units of 1/kv."""


class CascadeTerms(NamedTuple):
    """Which terms a cascade has; terms that it lacks are left out of the equations.

    They are the integrals of both loops, the filter of the velocity, and `feedforward`, by the names of its keys.
    """

    position_integral: bool
    velocity_integral: bool
    proportional_on: Literal["error", "measurement"]
    filtered: bool
    feedforward: tuple[str, ...]


@register_controller
class Cascade(ControllerSection):
    """Position loop over velocity loop.

    An integral without a time, a filter of 0 and a feedforward of 0 are absent.
    """

    kind: Literal["cascade"]
    kv: Annotated[Value, Quantity("1/s", positive, "60 1/s")]
    """Gain of the position loop."""
    position_integral_time: Annotated[Value | None, Quantity("s", positive, "50 ms")] = None
    kp: Annotated[Value, Quantity("N*s/m", positive, "500 N*s/m")]
    """Gain of the velocity loop."""
    velocity_integral_time: Annotated[Value | None, Quantity("s", positive, "10 ms")] = None
    proportional_on: Literal["error", "measurement"] = "error"
    """What the gain of the velocity loop acts on besides its integral; the measurement: pseudo-derivative feedback."""
    velocity_filter: Annotated[Value, Quantity("s", non_negative, "0.2 ms")] = Value(0, "0 s")
    """Time constant of the first-order filter of the measured velocity."""
    velocity_feedforward: Annotated[float, Number(non_negative, "1")] = 0.0
    """Fraction of the reference's velocity that is fed forward to the velocity loop."""
    acceleration_feedforward: Annotated[Value, Quantity("kg", non_negative, "1.7 kg")] = Value(0, "0 kg")
    coulomb_feedforward: Annotated[Value, Quantity("N", non_negative, "1 N")] = Value(0, "0 N")
    """Force fed forward with the sign of the reference's velocity."""
    viscous_feedforward: Annotated[Value, Quantity("N*s/m", non_negative, "0.5 N*s/m")] = Value(0, "0 N*s/m")
    jerk_feedforward: Annotated[Value | None, Quantity("kg*s", any_sign, "0.5 g*s")] = None

    usual: ClassVar[Mapping[str, tuple[float, float, str, tuple[str, ...]]]] = MappingProxyType(
        {
            "kv": (0.05, 1e4, "1/s", ("1/s", "1/min")),
            "velocity_integral_time": (1e-4, 1e2, "s", ("ms", "us", "s")),
            "velocity_filter": (1e-7, 1.0, "s", ("ms", "us", "s")),
            "kp": (0.3, 3e4, "N*s/m", ("N*s/m", "N*s/mm", "kN*s/m")),
        }
    )
    speeds_up: ClassVar[Mapping[str, int]] = MappingProxyType(
        {"kv": 1, "kp": 1, "position_integral_time": -1, "velocity_integral_time": -1, "velocity_filter": -1}
    )
    loop_gain = ("kp",)
    position_loop = ("kv", "position_integral_time")
    integral_gain: ClassVar[Mapping[str, int]] = MappingProxyType(
        {"position_integral_time": -1, "velocity_integral_time": -1}
    )
    feeds_back = "velocity"
    decisive = ("velocity_filter", *FEEDFORWARD)
    shares: ClassVar[Mapping[str, str]] = MappingProxyType(
        {"p": "position loop", "v": "velocity", "i": "integral", "f": "feedforward"}
    )
    words: ClassVar[Mapping[str, str]] = MappingProxyType(
        {
            "kv": "Position gain kv",
            "velocity_integral_time": "Integral time of velocity",
        }
    )
    symbols: ClassVar[Mapping[str, tuple[str, str]]] = MappingProxyType(
        {
            "kv": ("gain of the position loop", "kv"),
            "position_integral_time": ("integral time of the position loop", "Tp"),
            "kp": ("gain of the velocity loop", "kp"),
            "velocity_integral_time": ("integral time of the velocity loop", "Tn"),
            "velocity_filter": ("filter of the measured velocity", "Tf"),
            "velocity_feedforward": ("share of the reference's velocity", "f"),
            **SYMBOLS,
        }
    )

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            (PROPORTIONAL_ON, VELOCITY_TIME),
            lambda f: (f[PROPORTIONAL_ON] == "error") | (VELOCITY_TIME in f),
            "the integral of the velocity loop, on which alone the error acts in pseudo-derivative feedback",
            'velocity_integral_time = "10 ms", or proportional_on = "error"',
        ),
    )

    @classmethod
    def variant(cls, flat: Mapping[str, Any]) -> CascadeTerms:
        """Return which terms the controller has, from a stage's keys in SI."""
        return CascadeTerms(
            position_integral=POSITION_TIME in flat,
            velocity_integral=VELOCITY_TIME in flat,
            proportional_on=flat[PROPORTIONAL_ON],
            filtered=bool(flat[VELOCITY_FILTER] > 0),
            feedforward=tuple(name for name in FEEDFORWARD if flat.get(cls.key(name), 0) != 0),
        )

    @classmethod
    def structures(cls, flat: Mapping[str, Any]) -> Mapping[str, Mapping[str, Any]]:
        """Return other structures to try, by name: a mapping of the keys that change to values [SI].

        A structure moves the integral to the other loop, adds feedforward, drops the integral, or switches
        pseudo-derivative feedback on or off. None as a value removes the key.
        """
        listed: dict[str, Mapping[str, Any]] = {}
        outer, inner = flat.get(POSITION_TIME), flat.get(VELOCITY_TIME)
        if inner and not outer:
            moved = {POSITION_TIME: inner, VELOCITY_TIME: None, PROPORTIONAL_ON: "error"}
            listed["integral in the position loop"] = moved
        elif outer and not inner:
            listed["integral in the velocity loop"] = {VELOCITY_TIME: outer, POSITION_TIME: None}
        elif outer and inner:
            listed["integral in the velocity loop alone"] = {POSITION_TIME: None}
        else:
            listed["with an integral"] = {VELOCITY_TIME: INTEGRAL_TIME_FACTOR / flat[cls.key("kv")]}
        if inner:
            other = "error" if flat[PROPORTIONAL_ON] == "measurement" else "measurement"
            named = {"measurement": "pseudo-derivative feedback", "error": "proportional part on the error"}
            listed[named[other]] = {PROPORTIONAL_ON: other}
        ahead: dict[str, Any] = feedforward_of_moves(flat, "viscous_feedforward", "acceleration_feedforward")
        if not flat[cls.key("velocity_feedforward")]:
            ahead[cls.key("velocity_feedforward")] = 1.0
        if ahead:
            listed["feedforward of the move"] = ahead
        if outer or inner:
            gone = {POSITION_TIME: None, VELOCITY_TIME: None, PROPORTIONAL_ON: "error"}
            listed["no integral"] = {key: value for key, value in gone.items() if key in flat and flat[key] != value}
        return listed

    @classmethod
    def as_pid(cls, flat: Mapping[str, Any]) -> PidLike:
        """Return the PID controller with its derivative on the measurement that both loops make."""
        kv, kp = flat[cls.key("kv")], flat[KP]
        inner, outer = (1 / flat[key] if key in flat else 0.0 for key in (VELOCITY_TIME, POSITION_TIME))
        return PidLike(kp * (kv + inner), kp * kv * (inner + outer), kp, flat[VELOCITY_FILTER], moving_mass(flat))

    @classmethod
    def like_pid(cls, pid: PidLike) -> dict[str, Any]:
        """Return the loops that make a PID controller, the faster one outside; {} without a derivative."""
        if not pid.kd or not pid.kp:
            return {}
        half = pid.kp / (2 * pid.kd)
        root = sqrt(max(half**2 - pid.ki / pid.kd, 0.0))
        time = {"velocity_integral_time": 1 / (half - root)} if pid.ki else {}
        return {"kv": half + root, "kp": pid.kd, "velocity_filter": pid.tau, **time}

    @classmethod
    def gains(cls, flat: Mapping[str, Any]) -> tuple[Gain, ...]:
        """Return the numbers to enter into a drive: the keys of the controller that are not 0.

        If the velocity loop has an integral time Tn, its integral gain kp/Tn [N/m] is returned too.
        """
        listed = super().gains(flat)
        if VELOCITY_TIME not in flat:
            return listed
        integral = flat[KP] / flat[VELOCITY_TIME]
        return (*listed, Gain("integral of the velocity loop as a gain, kp/Tn", "ki", integral, "N/m"))

    @classmethod
    def draw(cls, canvas: Any, flat: Mapping[str, Any]) -> None:
        """Draw the cascade: a box and a summing point for each loop, and the feedforward."""
        canvas.box("kv (1 + 1/(Tp s))" if POSITION_TIME in flat else "kv")
        if flat[cls.key("velocity_feedforward")]:
            canvas.sum(below="f dr/dt", minus=False)
        velocity = f"dy/dt{', filtered' if flat[VELOCITY_FILTER] or canvas.filtered else ''}"
        canvas.sum(below=velocity, deep=True)
        on_error, integral = flat[PROPORTIONAL_ON] == "error", VELOCITY_TIME in flat
        canvas.box("kp (1 + 1/(Tn s))" if integral and on_error else "kp/(Tn s)" if integral else "kp")
        ahead = fed_forward(flat)
        if ahead or not on_error:
            canvas.sum(ahead, "" if on_error else f"kp {velocity}")

    @classmethod
    def integrates(cls, flat: Mapping[str, Any]) -> bool:
        """Tell whether either loop has an integral."""
        return POSITION_TIME in flat or VELOCITY_TIME in flat

    @classmethod
    def stiffness(cls, blocks: Blocks, variant: CascadeTerms) -> sp.Expr:
        """Return the proportional stiffness against fast displacements of the stage [N/m].

        The integral of the velocity loop counts, because the integral of velocity is displacement.
        """
        rate = blocks.key("kv") if variant.proportional_on == "error" else 0
        rate = rate + (1 / blocks.key("velocity_integral_time") if variant.velocity_integral else 0)
        return blocks.key("kp") * rate

    @classmethod
    def declare(cls, measured: Measured, blocks: Blocks, variant: CascadeTerms) -> Mapping[str, Signal]:
        """Return the terms of the force [N] by letter: p, v, i and f.

        p is the command of the position loop times kp, and v the negative velocity times kp. i is the integral of the
        velocity loop, and f the feedforward. A term that the controller lacks is 0.
        """
        ahead = {name: blocks.key(name) for name in variant.feedforward}
        kv, kp = blocks.key("kv"), blocks.key("kp")
        with blocks.loop("position"):
            command = measured.error * kv
            if variant.position_integral:
                gain = kv / blocks.key("position_integral_time")
                command += blocks.integral(measured.error, gain, "position_integral", "backward_euler")
            command = blocks.in_position_loop(command, measured)
            command += measured.reference_velocity * ahead.get("velocity_feedforward", 0)
            command = blocks.handed_on(command, "command")
        integral = blocks.nothing
        with blocks.loop("velocity"):
            velocity = blocks.derivative(measured.rated, "position")
            if variant.filtered:
                velocity = blocks.low_pass(velocity, blocks.key("velocity_filter"), "velocity")
            velocity = blocks.fed_back(velocity)
            if variant.velocity_integral:
                gain = kp / blocks.key("velocity_integral_time")
                integral = blocks.integral(command - velocity, gain, "velocity_integral", "backward_euler")
            wanted, velocity = blocks.handed_on(command, "wanted"), blocks.handed_on(velocity, "velocity")
        feedforward = measured.reference_acceleration * ahead.get("acceleration_feedforward", 0)
        feedforward += measured.reference_velocity * ahead.get("viscous_feedforward", 0)
        feedforward += measured.reference_direction * ahead.get("coulomb_feedforward", 0)
        feedforward += measured.reference_jerk * ahead.get("jerk_feedforward", 0)
        return {
            "p": wanted * kp if variant.proportional_on == "error" else blocks.nothing,
            "v": -(velocity * kp),
            "i": integral,
            "f": feedforward,
        }
