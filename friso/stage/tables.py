"""The tables of a stage file, apart from the controller, the drive and uncertainty.

They are masses, friction and the conditions under which it was measured, joint, parasitic mode and motion; the tables
[transmission], [motor_friction] and [encoder] stand between motor and load.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from math import pi
from typing import Annotated, Any, ClassVar, Literal, Self, cast

from pydantic import model_validator

from friso.axis import axis_of
from friso.errors import StageError
from friso.quantities import Bound, Number, Quantity, Value, any_sign, non_negative, positive, quoted
from friso.stage.section import UNKNOWN, Rule, Section, UncertainSection, Variants


class AxisTable(UncertainSection):
    """Units of the stage file: on a rotary axis kg m^2, N m and rad replace kg, N and m."""

    kind: Literal["linear", "rotary"] = "linear"


@dataclass(frozen=True)
class MotorConstant(Quantity):
    """A key that takes the motor constant, at the load."""

    @property
    def expected(self) -> str:
        """Say in words what values the key accepts."""
        at_load = "at the load: of a motor of 0.5 N*m/A, 2 pi / lead times as much"
        return f"{super().expected}, {at_load if self.unit == 'N/A' else 'behind any gear'}"


MOTOR_CONSTANT = MotorConstant("N/A", positive, "50 N/A")


class Actuator(Section):
    """What a drive's command exerts: amperes, or volts on the motor's resistance.

    Without a resistance the drive commands a current. Forces, also per length or time, may then be written in A, A/mm,
    A*s/m, ... in every table. With a resistance it commands a voltage: forces may be written in V, with a supply also
    in %, with full_pwm also in PWM, and the motor brakes by its back-EMF. How far the true constant is off is
    drive.motor_constant_ratio.
    """

    motor_constant: Annotated[Value | None, MOTOR_CONSTANT] = None
    """Force per ampere at the load; for a motor with a screw, its torque per ampere times 2 pi / lead. Default: the
    back-EMF."""
    resistance: Annotated[Value | None, Quantity("ohm", positive, "2 ohm")] = None
    """Resistance between the terminals, of a motor whose voltage the drive commands."""
    back_emf: Annotated[Value | None, Quantity("V*s/m", positive, "50 V*s/m")] = None
    """Voltage per speed of the load; default: the motor constant, in SI the same number with a commutator."""
    supply: Annotated[Value | None, Quantity("V", positive, "24 V")] = None
    """Voltage of a command of 100 %, and of full_pwm."""
    full_pwm: Annotated[float | None, Number(positive, "255")] = None
    """Command, in PWM counts, at which the motor gets the whole supply."""

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        if self.motor_constant is None and self.back_emf is None:
            expected = "what an ampere exerts, or the back_emf"
            raise StageError("motor_constant", "nothing", expected, 'motor_constant = "50 N/A"')
        for key, other, example in (
            ("back_emf", "resistance", 'resistance = "2 ohm"'),
            ("supply", "resistance", 'resistance = "2 ohm"'),
            ("full_pwm", "supply", 'supply = "24 V"'),
        ):
            if getattr(self, key) is not None and getattr(self, other) is None:
                raise StageError(other, "nothing", f"what belongs to {key}", example)
        return self

    @property
    def _constants(self) -> tuple[float, float]:
        """Return force per ampere and voltage per speed, in SI."""
        force, voltage = self.motor_constant, self.back_emf
        return float(voltage if force is None else force), float(force if voltage is None else voltage)  # type: ignore[arg-type]

    @property
    def exerts(self) -> tuple[tuple[str, float], ...]:
        """Return the force [N or N m] at standstill per unit of each command that the drive may have."""
        force, _ = self._constants
        if self.resistance is None:
            return (("A", force),)
        per_volt = force / float(self.resistance)
        full = None if self.supply is None else per_volt * float(self.supply)
        listed = [("V", per_volt), *([] if full is None else [("%", full / 100)])]
        return (*listed, *([("PWM", full / self.full_pwm)] if full is not None and self.full_pwm else []))

    @property
    def braking(self) -> float | None:
        """Return the force per speed [N s/m or N m s/rad] by which back-EMF brakes; None for a commanded current."""
        if self.resistance is None:
            return None
        force, voltage = self._constants
        return force * voltage / float(self.resistance)


BRAKING = "actuator.braking"
"""Key of the damping by back-EMF, which follows from the table."""


class Masses(UncertainSection):
    """What moves; with both masses and no joint they move as one rigid mass."""

    cart: Annotated[Value | None, Quantity("kg", positive, "1.2 kg")] = None
    stage: Annotated[Value | None, Quantity("kg", positive, "0.5 kg")] = None

    @model_validator(mode="after")
    def _is_not_empty(self) -> Self:
        if self.cart is None and self.stage is None:
            raise StageError("", "neither cart nor stage", "at least one of the two masses", 'cart = "1.2 kg"')
        return self


USUAL = ("static", "coulomb", "stribeck_velocity", "bristle_stiffness", "bristle_damping", "viscous")
"""Keys of friction for which similar contacts have a usual range (`friso.stage.contacts`)."""


class FrictionSection(UncertainSection):
    """Base of the friction laws, which declare keys, `model: Literal["name"]`, and equations."""

    model: Any
    decisive: ClassVar[tuple[str, ...]] = ()
    """The numeric keys on which `variant` depends."""
    under_conditions: ClassVar[bool] = False
    """Whether [conditions] multiply static and Coulomb friction of the law."""
    decided_by: ClassVar[Mapping[str, str]] = {}
    """Experiments that would determine keys that other measurements leave open, by key. Under the key "" stands the
    experiment that distinguishes the law from LuGre."""
    follows_drive: ClassVar[bool] = False
    """Whether friction grows with the force of the drive."""
    fitted: ClassVar[bool] = False
    """Whether `friso identify` fits the law's parameters to logs of moves."""
    words: ClassVar[Mapping[str, str]] = {}
    """Names of keys on the axes of maps, where the key itself is not clear enough."""

    @classmethod
    def otherwise(cls, key: str) -> str:
        """Return what stands for a key of friction that nobody measured."""
        named = "; guess names the contact" if "guess" in cls.model_fields else ""
        if key in USUAL:
            return f'; or "{UNKNOWN}", for the range of similar contacts{named}'
        required = key in cls.model_fields and cls.model_fields[key].is_required() and key != "model"
        return f'; if nobody knows it, model = "lugre" takes "{UNKNOWN}"' if required else ""

    @staticmethod
    def variant(flat: Mapping[str, Any]) -> Hashable:
        """Return further choices on which a law's equations depend, such as a whole exponent.

        They follow from its keys, `flat`.
        """
        return None

    @staticmethod
    def declare(velocity: Any, variant: Any) -> Any:
        """Return the equations of the law for a body moving at `velocity`; None for no force."""
        return None

    @staticmethod
    def shown(flat: Mapping[str, Any]) -> Any:
        """Return what measurements would show of a law with these keys, in SI.

        See `friso.equations.friction.common.MeasuredFriction`.
        """

    @staticmethod
    def keeping(measured: Any, elements: int) -> dict[str, Any]:
        """Return keys [SI] with which the law reproduces measured friction as closely as it can.

        Laws with several elements have `elements` in parallel.
        """
        return {}

    @staticmethod
    def left_open(measured: Any) -> dict[str, tuple[float, float]]:
        """Return the keys that measured friction does not determine, and their ranges [SI]."""
        return {}

    @staticmethod
    def active(flat: Mapping[str, Any]) -> str:
        """Return the condition of passivity that the law violates; "" if passive or without one.

        A law that is not passive returns more energy than it received, as no real friction does. `flat` has the keys in
        SI.
        """
        return ""


FRICTION = Variants("model", "friso.friction")
register_friction = FRICTION.register


def friction_law(name: str) -> type[FrictionSection]:
    """Return the class of the friction law called `name`."""
    return cast(type[FrictionSection], FRICTION.named(name))


def passive_where(flat: Mapping[str, Any]) -> str:
    """Return the condition of passivity that a stage's friction law violates, in words.

    It is given in the units of the stage's axis; "" if the law is passive, or has no condition.
    """
    return axis_of(flat).text(friction_law(flat["friction.model"]).active(flat))


def friction_laws() -> dict[str, type[FrictionSection]]:
    """Return the classes of all friction laws by name."""
    return cast(dict[str, type[FrictionSection]], FRICTION.classes)


class Joint(UncertainSection):
    """The compliant joint between cart and stage; its limiter acts in parallel when touched.

    With `limiter_pulls = false` the damping of a free joint's limiter does not hold back what leaves it.
    """

    locked: bool = False
    stiffness: Annotated[Value | None, Quantity("N/m", positive, "2.4 N/mm")] = None
    damping: Annotated[Value | None, Quantity("N*s/m", non_negative, "0.5 N*s/m")] = None
    stroke: Annotated[Value | None, Quantity("m", non_negative, "1 mm")] = None
    limiter_stiffness: Annotated[Value, Quantity("N/m", positive, "2e7 N/m")]
    limiter_damping: Annotated[Value, Quantity("N*s/m", non_negative, "100 N*s/m")]
    limiter_pulls: bool | None = None

    @model_validator(mode="after")
    def _free_joint_is_complete(self) -> Self:
        for key, example in (("damping", "0.5 N*s/m"), ("stroke", "1 mm")):
            if not self.locked and getattr(self, key) is None:
                expected = f"the {key} of the joint; only a joint with locked = true needs none"
                raise StageError(key, "nothing", expected, f'{key} = "{example}"')
        return self


class Parasitic(UncertainSection):
    """First internal mode of the joint: part of the stage mass on a spring of its own."""

    frequency: Annotated[Value, Quantity("Hz", positive, "300 Hz")]
    mass: Annotated[Value, Quantity("kg", positive, "0.25 kg")]
    damping_ratio: Annotated[float, Number(non_negative, "0.01")]


class Bias(UncertainSection):
    """Constant forces, positive towards larger positions.

    They are due to a cable, a tilted rail, or the weight of a vertical axis. Runs begin with the actuator carrying
    their sum.
    """

    cart: Annotated[Value | None, Quantity("N", any_sign, "0.2 N")] = None
    stage: Annotated[Value | None, Quantity("N", any_sign, "0.2 N")] = None


TIME_ROUNDING = 1e-12
"""Relative tolerance for limits on times, which are sums of decimal numbers."""


class PositionTolerance(UncertainSection):
    """The deviation from its reference within which the stage counts as in position."""

    within: Annotated[Value, Quantity("m", positive, "5 um")]


class StatedMoves(Section):
    """The machine's moves, uniform in the logarithm: friso tune draws one per machine.

    Without accelerations, all moves have that of [motion].
    """

    smallest: Annotated[Value, Quantity("m", positive, "10 um")]
    largest: Annotated[Value, Quantity("m", positive, "32 mm")]
    lowest_acceleration: Annotated[Value | None, Quantity("m/s^2", positive, "1 m/s^2")] = None
    highest_acceleration: Annotated[Value | None, Quantity("m/s^2", positive, "10 m/s^2")] = None

    @model_validator(mode="after")
    def _are_ranges(self) -> Self:
        lowest, highest = self.lowest_acceleration, self.highest_acceleration
        if (lowest is None) != (highest is None):
            key, example = ("lowest", "1 m/s^2") if lowest is None else ("highest", "10 m/s^2")
            expected = "both ends of the accelerations, or neither"
            raise StageError(f"{key}_acceleration", "nothing", expected, f'{key}_acceleration = "{example}"')
        ends = [("smallest", "largest", '"10 um"', '"32 mm"')]
        ends += [("lowest_acceleration", "highest_acceleration", '"1 m/s^2"', '"10 m/s^2"')] * (lowest is not None)
        for low, high, first, last in ends:
            if getattr(self, low) > getattr(self, high):
                actual = f"{quoted(getattr(self, high).text)} with {low} = {quoted(getattr(self, low).text)}"
                raise StageError(high, actual, f"at least the {low}", f"{low} = {first}, {high} = {last}")
        return self


CONDITIONS = "conditions"

from_0_to_1 = Bound("from 0 to 1", lambda value: (value >= 0) & (value <= 1))


def _falls(flat: Mapping[str, Any]) -> Any:
    """Tell whether static friction is at least Coulomb friction under the operating conditions.

    The result is true for laws that lack one of these levels. It is also true if static friction is smaller without the
    conditions, because the friction law reports that.
    """
    if not {"friction.static", "friction.coulomb"} <= {*flat}:
        return True
    static, coulomb = (flat[f"friction.{x}"] * flat.get(f"{CONDITIONS}.{x}_factor", 1.0) for x in ("static", "coulomb"))
    # the law itself reports the second case
    return (static >= coulomb) | (flat["friction.static"] < flat["friction.coulomb"])


class Conditions(UncertainSection):
    """Place on the rail, load and temperature of the guide.

    They give factors on static and Coulomb friction.
    """

    place: Annotated[Value | None, Quantity("m", any_sign, "120 mm")] = None
    """Place on the rail whose friction factors apply ([rail]). A drive as built moves along the rail instead."""
    load: Annotated[float, Number(positive, "1.3")] = 1.0
    """Normal force on the guide, relative to that at which [friction] was measured."""
    load_per_acceleration: Annotated[Value, Quantity("s^2/m", non_negative, "0.02 s^2/m")] = Value(0, "0 s^2/m")
    """Growth of the load per acceleration of the reference, due for example to a centre of mass beside the drive."""
    load_share: Annotated[float, Number(from_0_to_1, "0.8")] = 1.0
    """Fraction of friction that is proportional to the normal force; the rest is due to seals and preload."""
    cold: Annotated[float, Number(positive, "1.6")] = 1.0
    """Friction of the cold machine relative to that of the warm machine, which [friction] describes."""
    running_time: Annotated[Value, Quantity("s", non_negative, "5 min")] = Value(0, "0 s")
    """Time since the machine was cold; a motion is short compared with the warm-up."""
    warm_up_time: Annotated[Value | None, Quantity("s", positive, "20 min")] = None
    """Time constant of the warm-up."""

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            ("friction.model",),
            lambda flat: friction_law(flat["friction.model"]).under_conditions,
            "a law of the guide whose levels [conditions] multiply",
            'model = "lugre"',
        ),
        Rule(
            ("conditions.place",),
            lambda flat: "conditions.place" not in flat or "rail.seed" in flat,
            "a [rail] on which that place lies",
            '[rail] seed = 1, static_deviation = 0.2, correlation_length = "5 mm"',
        ),
        Rule(
            ("conditions.place",),
            _falls,
            "a place at which the rail leaves static friction no smaller than Coulomb friction",
            "static_deviation = 0.2, coulomb_deviation = 0.2 in [rail]",
        ),
        Rule(
            ("conditions.cold", "conditions.warm_up_time"),
            lambda flat: (flat.get("conditions.cold", 1.0) == 1) | ("conditions.warm_up_time" in flat),
            "the time constant of the warm-up, for a machine colder than [friction] describes",
            'warm_up_time = "20 min"',
        ),
    )


TRANSMISSION, MOTOR_FRICTION, ENCODER = "transmission", "motor_friction", "encoder"
MOTOR_MASS, INERTIA, LEAD, RATIO, BACKLASH = (
    f"{TRANSMISSION}.{name}" for name in ("mass", "inertia", "lead", "ratio", "backlash")
)
STATE_PREFIX = "motor_"
"""Prefix of the names of states that belong to the motor."""

MOTOR_STATES = ("motor_position", "motor_velocity")
"""Names of the motor's position and velocity, converted to the load."""

Side = Literal["motor", "load"]
"""A side of the transmission."""


class Transmission(UncertainSection):
    """A screw, belt or gear: the motor's mass at the load, and the connecting spring."""

    mass: Annotated[Value | None, Quantity("kg", positive, "2 kg")] = None
    """Mass of everything that moves with the motor, reflected to the load; alternatively its `inertia` with `lead` or
    `ratio`."""
    inertia: Annotated[Value | None, Quantity("kg*m^2", positive, "1.2e-4 kg*m^2")] = None
    """Moment of inertia of motor, coupling and screw, about the motor's axis, on linear and rotary axes alike."""
    lead: Annotated[Value | None, Quantity("m", positive, "10 mm")] = None
    """Travel of the load per turn of the motor."""
    ratio: Annotated[float | None, Number(positive, "5")] = None
    """Turns of the motor per turn of the load, on a rotary axis."""
    stiffness: Annotated[Value, Quantity("N/m", positive, "120 N/um")]
    damping: Annotated[Value, Quantity("N*s/m", non_negative, "2e3 N*s/m")]
    backlash: Annotated[Value | None, Quantity("m", non_negative, "5 um")] = None
    """Total backlash, from flank to flank."""

    @model_validator(mode="after")
    def _motor_has_one_mass(self) -> Self:
        geared = [name for name in ("lead", "ratio") if getattr(self, name) is not None]
        either = 'mass = "2 kg", or inertia = "1.2e-4 kg*m^2" with lead = "10 mm"'
        if self.mass is not None and (self.inertia is not None or geared):
            actual = f"mass together with {'inertia' if self.inertia is not None else geared[0]}"
            raise StageError("mass", actual, "the mass of the motor at the load, or what it follows from", either)
        if self.mass is None and self.inertia is None:
            raise StageError("mass", "neither mass nor inertia of the motor", "one of the two", either)
        if self.inertia is not None and len(geared) != 1:
            actual = "an inertia with both lead and ratio" if geared else "an inertia without lead or ratio"
            expected = "the lead of a linear axis, or the ratio of a rotary one"
            raise StageError("inertia", actual, expected, 'inertia = "1.2e-4 kg*m^2", lead = "10 mm"')
        return self


class Encoder(UncertainSection):
    """Sides of the transmission on which the controller's position and velocity are measured."""

    position: Side
    velocity: Side


def motor_mass(flat: Mapping[str, Any]) -> Any:
    """Return the motor's mass at the load [kg], from its inertia and its travel per turn.

    The result is None if either is missing. `flat` has the stage's keys in SI.
    """
    lead = flat[LEAD] if LEAD in flat else 2 * pi / flat[RATIO] if RATIO in flat else None
    return None if INERTIA not in flat or lead is None else flat[INERTIA] * (2 * pi / lead) ** 2


def leading_friction(flat: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a stage's keys with the motor's friction as [friction], if the guide has none."""
    alone = flat["friction.model"] == "none" and f"{MOTOR_FRICTION}.model" in flat
    return of_motor(flat) if alone else flat


def moving_mass(flat: Mapping[str, Any]) -> Any:
    """Return the whole mass that the controller moves [kg], reflected to the load."""
    return sum(flat.get(key, 0.0) for key in ("masses.cart", "masses.stage", MOTOR_MASS))


def of_motor(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return a stage's keys with the motor's friction under [friction], without [conditions].

    The conditions belong to the guide, whose friction is left out.
    """
    kept = {key: value for key, value in flat.items() if not key.startswith(("friction.", f"{CONDITIONS}."))}
    return {**kept, "friction.model": "none", **as_friction(flat)}


def as_friction(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys of [motor_friction] under the names that a friction law uses."""
    before = f"{MOTOR_FRICTION}."
    return {f"friction.{key.removeprefix(before)}": value for key, value in flat.items() if key.startswith(before)}
