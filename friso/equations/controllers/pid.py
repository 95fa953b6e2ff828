"""PID controllers: feedforward, what all have, and those given by gains.

Describe the feedforward terms of controllers in tables of gains and in drawings of loops.

Define the base of both ways to give a PID controller, by rules or by gains.

PID by its gains (thesis, Eq. 6), with feedforward of acceleration and friction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import sqrt
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple, cast

from friso.errors import StageError
from friso.quantities import Quantity, Value, any_sign, non_negative
from friso.stage import ControllerSection, Rule, register_controller
from friso.stage.controllers import KIND, Gain
from friso.stage.tables import moving_mass

if TYPE_CHECKING:
    import sympy as sp

    from friso.equations.blocks import Blocks, Measured, Signal


SYMBOLS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "acceleration_feedforward": ("feedforward of acceleration", "m"),
        "jerk_feedforward": ("feedforward of jerk", "mj"),
        "viscous_feedforward": ("feedforward of viscous friction", "d"),
        "coulomb_feedforward": ("feedforward of Coulomb friction", "Fc"),
    }
)

TERMS = {
    "acceleration_feedforward": "m d²r/dt²",
    "jerk_feedforward": "mj d³r/dt³",
    "viscous_feedforward": "d dr/dt",
    "coulomb_feedforward": "Fc sign(dr/dt)",
}


def fed_forward(flat: Mapping[str, Any]) -> str:
    """Return the feedforward terms of a controller in words; "" without any."""
    return " + ".join(term for name, term in TERMS.items() if flat.get(ControllerSection.key(name)))


def feedforward_of_moves(flat: Mapping[str, Any], *names: str) -> dict[str, float]:
    """Return the feedforward that moving mass and viscous friction require, by key [SI].

    `names` are the feedforward keys that the controller can have. Only keys among these whose value is not 0, and that
    the stage does not set yet, are in the result.
    """
    needed = {"acceleration_feedforward": moving_mass(flat), "viscous_feedforward": flat.get("friction.viscous", 0.0)}
    return {
        ControllerSection.key(name): float(value)
        for name, value in needed.items()
        if name in names and value and not flat.get(ControllerSection.key(name))
    }


EITHER_FORM = 'crossover = "8 Hz", alpha = 0.1, beta = 2 or kp = "3 N/m", ki = "4 N/(m*s)", kd = "6 N*s/m"'


class Pid(ControllerSection):
    """A PID controller, given by tuning rules or by gains."""

    kind: Literal["pid"]

    written: ClassVar[str]
    """Words for the keys of this way to give a controller, in a message."""
    needed: ClassVar[tuple[str, ...]]
    """Names of the keys of which a table that gives a controller this way has at least one."""
    asked: ClassVar[str]
    """The needed keys, in words for a message."""
    shares: ClassVar[Mapping[str, str]] = MappingProxyType({"p": "proportional", "i": "integral", "d": "derivative"})

    @classmethod
    def pick(cls, forms: Sequence[type[ControllerSection]], table: Mapping[str, Any]) -> type[Pid]:
        """Choose the class that reads a [controller] table: by rules or by gains.

        `forms` are the classes to choose from. Raises StageError for keys of both or of neither.
        """
        by_keys = sorted(cast(Sequence[type[Pid]], forms), key=lambda form: not form.recognised_by)
        keys_of = {
            form: [key for key in form.model_fields if key in {*table} - {*cls.model_fields}] for form in by_keys
        }
        used = [form for form, keys in keys_of.items() if keys]
        if len(used) > 1:
            actual = " together with ".join(f"{', '.join(keys_of[form])} ({form.written})" for form in used)
            raise StageError("", actual, "one form, not both", EITHER_FORM)
        if not used or not {*used[0].needed} & {*table}:
            actual = f"neither {' nor '.join(form.asked for form in by_keys)}"
            raise StageError("", actual, "one of the two forms", EITHER_FORM)
        return used[0]


KP, KI, KD, TAU, DERIVATIVE_ON = (f"controller.{name}" for name in ("kp", "ki", "kd", "tau", "derivative_on"))

FEEDFORWARD = ("viscous_feedforward", "acceleration_feedforward", "coulomb_feedforward", "jerk_feedforward")


INTEGRAL_TIME_FACTOR = 4.0
"""Initial integral time, in units of the derivative time."""


class Terms(NamedTuple):
    """Which terms a PID controller has; terms that it lacks are left out of the equations.

    They are the integral, the derivative and its filter, and `feedforward`, by the names of its keys.
    """

    integral: bool
    filtered: bool
    derivative_on: Literal["none", "error", "measurement"]
    feedforward: tuple[str, ...] = ()


def proportional_derivative(stiffness: float, damping: float) -> dict[str, Any]:
    """Return the keys of a controller with a stiffness [N/m] and a damping [N s/m], no integral."""
    return {KIND: "pid", KP: stiffness, KI: 0.0, KD: damping, TAU: 0.0, DERIVATIVE_ON: "error"}


@register_controller
class PidGains(Pid):
    """PID by its gains (thesis, Eq. 6); omitted gains are 0. The filter acts on the derivative."""

    kp: Annotated[Value, Quantity("N/m", non_negative, "3 N/m")] = Value(0, "0 N/m")
    ki: Annotated[Value, Quantity("N/(m*s)", non_negative, "4 N/(m*s)")] = Value(0, "0 N/(m*s)")
    kd: Annotated[Value, Quantity("N*s/m", non_negative, "6 N*s/m")] = Value(0, "0 N*s/m")
    tau: Annotated[Value, Quantity("s", non_negative, "1 ms")] = Value(0, "0 s")
    derivative_on: Literal["error", "measurement"] = "error"
    viscous_feedforward: Annotated[Value | None, Quantity("N*s/m", any_sign, "6 N*s/m")] = None
    """Force per velocity of the reference; equal to `kd`, it turns a derivative of the measurement into one of the
    error."""
    acceleration_feedforward: Annotated[Value | None, Quantity("kg", any_sign, "1.7 kg")] = None
    coulomb_feedforward: Annotated[Value | None, Quantity("N", any_sign, "1 N")] = None
    """Force fed forward with the sign of the reference's velocity."""
    jerk_feedforward: Annotated[Value | None, Quantity("kg*s", any_sign, "0.5 g*s")] = None

    written = "gains"
    needed = ("kp", "ki", "kd")
    asked = "any of kp, ki, kd"
    speeds_up: ClassVar[Mapping[str, int]] = MappingProxyType({"kp": 2, "ki": 3, "kd": 1, "tau": -1})
    loop_gain = ("kp", "ki", "kd")
    integral_gain: ClassVar[Mapping[str, int]] = MappingProxyType({"ki": 1})
    decisive = ("ki", "kd", "tau")
    shares: ClassVar[Mapping[str, str]] = MappingProxyType({**Pid.shares, "f": "feedforward"})
    symbols: ClassVar[Mapping[str, tuple[str, str]]] = MappingProxyType(
        {
            "kp": ("proportional gain", "kp"),
            "ki": ("integral gain", "ki"),
            "kd": ("derivative gain", "kd"),
            "tau": ("filter of the derivative", "tau"),
            **SYMBOLS,
        }
    )

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            (DERIVATIVE_ON, KD, TAU),
            lambda f: (f[DERIVATIVE_ON] != "error") | (f[KD] == 0) | (f[TAU] > 0),
            "a filter (tau > 0) for the derivative of the error, or the derivative of the measurement",
            'tau = "1 ms", or derivative_on = "measurement"',
        ),
    )

    @classmethod
    def variant(cls, flat: Mapping[str, Any]) -> Terms:
        """Return which terms the controller has, from a stage's keys in SI."""
        derived = flat[KD] > 0
        return Terms(
            integral=bool(flat[KI] > 0),
            filtered=bool(derived and flat[TAU] > 0),
            derivative_on=flat[DERIVATIVE_ON] if derived else "none",
            feedforward=tuple(name for name in FEEDFORWARD if cls.key(name) in flat),
        )

    @classmethod
    def takes_velocity(cls, flat: Mapping[str, Any]) -> bool:
        """Tell whether the controller takes the derivative of the measurement."""
        return bool(flat[KD] > 0 and flat[DERIVATIVE_ON] == "measurement")

    @classmethod
    def structures(cls, flat: Mapping[str, Any]) -> Mapping[str, Mapping[str, Any]]:
        """Return other structures to try, by name: a mapping of the keys that change to values [SI].

        A structure takes the derivative of the other signal, adds feedforward, or drops or adds the integral. None as a
        value removes the key.
        """
        listed: dict[str, Mapping[str, Any]] = {}
        if flat[KD] and flat[DERIVATIVE_ON] == "error":
            listed["derivative of the measurement"] = {DERIVATIVE_ON: "measurement"}
        if flat[KD] and flat[DERIVATIVE_ON] == "measurement" and flat[TAU]:
            listed["derivative of the error"] = {DERIVATIVE_ON: "error"}
        ahead = feedforward_of_moves(flat, "viscous_feedforward", "acceleration_feedforward")
        if ahead and flat[DERIVATIVE_ON] == "measurement":  # the derivative of the measurement opposes the move itself
            ahead[cls.key("viscous_feedforward")] = ahead.get(cls.key("viscous_feedforward"), 0.0) + flat[KD]
        if ahead:
            listed["feedforward of the move"] = ahead
        if flat[KI] and flat[KP]:
            listed["no integral"] = {KI: None}
        elif flat[KP] and flat[KD]:
            listed["with an integral"] = {KI: flat[KP] ** 2 / flat[KD] / INTEGRAL_TIME_FACTOR}
        return listed

    @classmethod
    def gains(cls, flat: Mapping[str, Any]) -> tuple[Gain, ...]:
        """Return the controller's gains and times, and those of an equivalent P over PI loop.

        The gains of the P over PI loop are left out if there is no such loop.
        """
        kp, ki, kd = flat[KP], flat[KI], flat[KD]
        listed = [*super().gains(flat)]
        if ki and kp:
            listed.append(Gain("integral time kp/ki", "Ti", kp / ki, "s"))
        if kp and kd:
            listed.append(Gain("derivative time kd/kp", "Td", kd / kp, "s"))
        if ki and kd and not flat[TAU] and flat[DERIVATIVE_ON] == "measurement" and kp**2 >= 4 * ki * kd:
            half, root = kp / (2 * kd), sqrt((kp / (2 * kd)) ** 2 - ki / kd)
            listed.append(Gain("as P over PI with kp = kd: kv (or 1/Tn)", "kv", half - root, "1/s"))
            listed.append(Gain("as P over PI with kp = kd: Tn (or 1/kv)", "Tn", 1 / (half + root), "s"))
        return tuple(listed)

    @classmethod
    def draw(cls, canvas: Any, flat: Mapping[str, Any]) -> None:
        """Draw the controller: a box for the terms on the error, and a summing point for the others."""
        derivative = "kd s/(1 + tau s)" if flat[TAU] else "kd s"
        on_error = flat[DERIVATIVE_ON] == "error"
        terms = ["kp", *(["ki/s"] if flat[KI] else []), *([derivative] if flat[KD] and on_error else [])]
        canvas.box(" + ".join(terms))
        ahead, beside = fed_forward(flat), flat[KD] and not on_error
        if ahead or beside:
            canvas.sum(ahead, f"[ {derivative} ]-- y" if beside else "")

    @classmethod
    def integrates(cls, flat: Mapping[str, Any]) -> bool:
        """Tell whether the integral gain is not 0."""
        return bool(flat[KI] > 0)

    @classmethod
    def stiffness(cls, blocks: Blocks, variant: Terms) -> sp.Expr:
        """Return the proportional gain [N/m]."""
        return blocks.key("kp")

    @classmethod
    def declare(cls, measured: Measured, blocks: Blocks, variant: Terms) -> Mapping[str, Signal]:
        """Return the terms of the force [N] in Eq. 6 by letter: p, i, d and, if there is any, f.

        f is the feedforward; any other term that the controller lacks is 0.
        """
        kp, ki, kd, tau = map(blocks.key, ("kp", "ki", "kd", "tau"))
        lag = tau if variant.filtered else None
        derivative = {
            "none": lambda: blocks.nothing,
            "error": lambda: blocks.derivative(measured.error, "error", lag) * kd,
            "measurement": lambda: -(blocks.derivative(measured.rated, "position", lag) * kd),
        }
        shares = {
            "p": measured.error * kp,
            "d": derivative[variant.derivative_on](),
            "i": blocks.integral(measured.error, ki, rule="backward_euler") if variant.integral else blocks.nothing,
        }
        references = (
            measured.reference_velocity,
            measured.reference_acceleration,
            measured.reference_direction,
            measured.reference_jerk,
        )
        ahead = [
            reference * blocks.key(name)
            for name, reference in zip(FEEDFORWARD, references, strict=True)
            if name in variant.feedforward
        ]
        return {**shares, "f": sum(ahead, start=blocks.nothing)} if ahead else shares
