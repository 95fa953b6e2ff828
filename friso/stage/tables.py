"""The tables of a stage file: masses, friction, joint, parasitic mode, controller, motion."""

from collections.abc import Hashable, Mapping
from typing import Annotated, Any, ClassVar, Literal, Self, cast

from pydantic import model_validator

from friso.errors import StageError
from friso.quantities import (
    Number,
    Quantity,
    Value,
    any_sign,
    at_least_1,
    inside_0_1,
    non_negative,
    positive,
)
from friso.stage.section import Rule, Section, UncertainSection, Variants


class Masses(UncertainSection):
    """What moves; with both masses and no joint they move as one rigid mass."""

    cart: Annotated[Value | None, Quantity("kg", positive, "1.2 kg")] = None
    stage: Annotated[Value | None, Quantity("kg", positive, "0.5 kg")] = None

    @model_validator(mode="after")
    def _is_not_empty(self) -> Self:
        if self.cart is None and self.stage is None:
            raise StageError("", "neither cart nor stage", "at least one of the two masses", 'cart = "1.2 kg"')
        return self


class FrictionSection(UncertainSection):
    """Base of the friction laws, each of which declares its keys, `model: Literal["name"]`, and its equations."""

    model: Any
    decisive: ClassVar[tuple[str, ...]] = ()
    """The numeric keys on which `variant` depends."""

    @staticmethod
    def variant(flat: Mapping[str, Any]) -> Hashable:
        """What else than the law's name its equations depend on, such as a whole exponent."""
        return None

    @staticmethod
    def declare(velocity: Any, variant: Any) -> Any:
        """The equations of the law for a body moving at `velocity`, or None if there is no force."""
        return None


FRICTION = Variants("model")
register_friction = FRICTION.register


def friction_law(name: str) -> type[FrictionSection]:
    """The class of the registered law called `name`."""
    return cast(type[FrictionSection], FRICTION.classes[name])


class Joint(UncertainSection):
    """The compliant joint between cart and stage; its limiter acts in parallel when touched."""

    locked: bool = False
    stiffness: Annotated[Value | None, Quantity("N/m", positive, "2.4 N/mm")] = None
    damping: Annotated[Value | None, Quantity("N*s/m", non_negative, "0.5 N*s/m")] = None
    stroke: Annotated[Value | None, Quantity("m", non_negative, "1 mm")] = None
    limiter_stiffness: Annotated[Value, Quantity("N/m", positive, "2e7 N/m")]
    limiter_damping: Annotated[Value, Quantity("N*s/m", non_negative, "100 N*s/m")]

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
    """Constant forces, as of a cable or of gravity on a tilted rail."""

    cart: Annotated[Value | None, Quantity("N", any_sign, "0.2 N")] = None
    stage: Annotated[Value | None, Quantity("N", any_sign, "0.2 N")] = None


class Controller(UncertainSection):
    """What both forms of the controller share."""

    kind: Literal["pid"]
    force_limit: Annotated[Value | None, Quantity("N", positive, "200 N")] = None
    anti_windup: Literal["clamp"] | None = None

    @model_validator(mode="after")
    def _anti_windup_has_a_limit(self) -> Self:
        if self.anti_windup and self.force_limit is None:
            raise StageError("anti_windup", '"clamp"', "a force_limit as well", 'force_limit = "200 N"')
        return self


class TunedController(Controller):
    """PID by van Dijk's tuning rules (thesis, Eq. 7, 8)."""

    crossover: Annotated[Value, Quantity("Hz", positive, "8 Hz")]
    alpha: Annotated[float, Number(inside_0_1, "0.1")]
    beta: Annotated[float, Number(at_least_1, "2")]
    tuned_mass: Annotated[Value | None, Quantity("kg", positive, "1.7 kg")] = None


class GainsController(Controller):
    """PID by its gains (thesis, Eq. 6); a gain left out is 0."""

    kp: Annotated[Value, Quantity("N/m", non_negative, "3 N/m")] = Value(0, "0 N/m")
    ki: Annotated[Value, Quantity("N/(m*s)", non_negative, "4 N/(m*s)")] = Value(0, "0 N/(m*s)")
    kd: Annotated[Value, Quantity("N*s/m", non_negative, "6 N*s/m")] = Value(0, "0 N*s/m")
    tau: Annotated[Value, Quantity("s", non_negative, "1 ms")] = Value(0, "0 s")
    derivative_on: Literal["error", "measurement"] = "error"

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            ("controller.derivative_on", "controller.kd", "controller.tau"),
            lambda f: (
                (f["controller.derivative_on"] != "error") | (f["controller.kd"] == 0) | (f["controller.tau"] > 0)
            ),
            "a filter (tau > 0) for the derivative of the error, or the derivative of the measurement",
            'tau = "1 ms", or derivative_on = "measurement"',
        ),
    )


_EITHER_FORM = 'crossover = "8 Hz", alpha = 0.1, beta = 2 or kp = "3 N/m", ki = "4 N/(m*s)", kd = "6 N*s/m"'


def controller_form(table: dict[str, Any]) -> type[Section]:
    """The class for a [controller] table: by rules or by gains. Raises StageError for both or neither."""
    rules = [key for key in TunedController.model_fields if key in table and key not in Controller.model_fields]
    gains = [key for key in GainsController.model_fields if key in table and key not in Controller.model_fields]
    if rules and gains:
        text = f"{', '.join(rules)} (van Dijk's rules) together with {', '.join(gains)} (gains)"
        raise StageError("", text, "one form, not both", _EITHER_FORM)
    if not rules and not {"kp", "ki", "kd"} & {*gains}:
        raise StageError("", "neither crossover nor any of kp, ki, kd", "one of the two forms", _EITHER_FORM)
    return TunedController if rules else GainsController


ROUNDING = 1e-12
"""Relative slack of the limits on times, which are sums of decimal numbers."""


class Motion(UncertainSection):
    """Base of the motions: what the reference does."""

    kind: Any
    duration: Annotated[Value, Quantity("s", positive, "20 s")]


MOTION = Variants("kind")


@MOTION.register
class ThereAndBack(Motion):
    """Two equal steps, there and back, each accelerating for acceleration_time and braking likewise."""

    kind: Literal["there_and_back"]
    acceleration: Annotated[Value, Quantity("m/s^2", non_negative, "100 m/s^2")]
    acceleration_time: Annotated[Value, Quantity("s", non_negative, "30 ms")]
    return_at: Annotated[Value, Quantity("s", non_negative, "5 s")]

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            ("motion.acceleration_time", "motion.return_at"),
            lambda f: 2 * f["motion.acceleration_time"] <= f["motion.return_at"] * (1 + ROUNDING),
            "the move there (2 acceleration_time) finished before return_at",
            'acceleration_time = "30 ms", return_at = "5 s"',
        ),
        Rule(
            ("motion.acceleration_time", "motion.return_at", "motion.duration"),
            lambda f: (
                f["motion.return_at"] + 2 * f["motion.acceleration_time"] <= f["motion.duration"] * (1 + ROUNDING)
            ),
            "the move back (return_at + 2 acceleration_time) finished within the duration",
            'acceleration_time = "30 ms", return_at = "5 s", duration = "20 s"',
        ),
    )


@MOTION.register
class Release(Motion):
    """Everything displaced and at rest, the reference 0."""

    kind: Literal["release"]
    displacement: Annotated[Value, Quantity("m", any_sign, "2 mm")]


@MOTION.register
class Step(Motion):
    """The reference jumps at the start."""

    kind: Literal["step"]
    size: Annotated[Value, Quantity("m", any_sign, "1 mm")]


@MOTION.register
class Ramp(Motion):
    """The reference moves at constant velocity."""

    kind: Literal["ramp"]
    velocity: Annotated[Value, Quantity("m/s", any_sign, "0.1 m/s")]


@MOTION.register
class Hold(Motion):
    """The reference stays 0."""

    kind: Literal["hold"]
