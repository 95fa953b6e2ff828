"""The table [controller]: what every controller declares, and the registry of controllers.

Any controller may have the keys against friction.

The tables [[controller.filters]] are transfer functions of up to second order, in the order of the signal.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from inspect import get_annotations
from math import pi, sqrt
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self, cast

import numpy as np
from pydantic import model_validator

from friso.errors import StageError
from friso.quantities import Number, Quantity, Value, any_sign, non_negative, positive
from friso.stage.section import (
    Rows,
    Rule,
    Section,
    SectionClass,
    Several,
    TableArray,
    UncertainSection,
    Values,
    Variants,
    element_keys,
    keys_below,
    load_own,
    numeric_fields,
    row_keys,
)

FORWARD, FEEDBACK = "forward", "feedback"
"""Paths of filters: the demanded force, or the measured signal."""

FILTER_RULE = "drive.filter_discretisation"
"""Key of the rule that applies to filters without a rule of their own."""

MOST_FILTERS = 12
"""Largest number of filters of a controller."""

FilterRule = Literal["bilinear", "prewarped", "backward_euler"]
"""Rule by which a drive discretises a filter: the bilinear transform (Tustin), the bilinear transform prewarped to be
exact at the frequency of the poles, or backward differences."""

Polynomial = tuple[Any, Any, Any]
"""Coefficients of 1, s [s] and s^2 [s^2]."""


class Transfer(NamedTuple):
    """A transfer function: coefficients of 1, s and s^2 of its numerator and denominator.

    The numerator is `upper`, the denominator `lower`, whose first coefficient is 1.
    """

    upper: Polynomial
    lower: Polynomial


class FilterSection(UncertainSection):
    """Base of the filters, which declare keys, `kind: Literal["name"]`, and transfer function."""

    kind: Any
    path: Literal["forward", "feedback"] = FORWARD

    sampled: ClassVar[bool] = False
    """Whether the filter is given by coefficients for samples, which no rule of a drive changes."""

    @classmethod
    def variant(cls, row: Mapping[str, Any]) -> Hashable:
        """Return further choices on which the equations of a filter depend, such as its order.

        `row` holds the filter's keys with SI values.
        """
        return None

    @classmethod
    def transfer(cls, row: Mapping[str, Any], variant: Any) -> Transfer:
        """Return the transfer function from the filter's keys in `row`, numbers or symbols."""
        raise NotImplementedError


class ContinuousFilter(FilterSection):
    """Base of the filters that are given in continuous time."""

    discretisation: FilterRule | None = None
    """Rule by which the drive discretises the filter; default: drive.filter_discretisation, bilinear."""


FILTERS = Variants("kind")
FILTER_ARRAY = TableArray(FILTERS, '[[controller.filters]] kind = "notch", frequency = "300 Hz" ...', MOST_FILTERS)


@FILTERS.register
class NotchFilter(ContinuousFilter):
    """A notch: (s^2 + (1 - depth) w s + w_0^2)/(s^2 + w s + w_0^2).

    The width w lies between the points at -3 dB of a notch that is as deep as can be.
    """

    kind: Literal["notch"]
    frequency: Annotated[Value, Quantity("Hz", positive, "300 Hz")]
    width: Annotated[Value, Quantity("Hz", positive, "100 Hz")]
    depth: Annotated[float, Number(any_sign, "0.9")] = 1.0
    """Fraction of the signal that the notch removes at its frequency."""

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(("depth",), lambda f: (f["depth"] > 0) & (f["depth"] <= 1), "a depth above 0, 1 at most", "depth = 0.9"),
    )

    @classmethod
    def transfer(cls, row: Mapping[str, Any], variant: None) -> Transfer:
        """Return the transfer function of a notch."""
        omega, width = _omega(row["frequency"]), _omega(row["width"])
        damping, bend = width / omega**2, 1 / omega**2
        return Transfer((1, (1 - row["depth"]) * damping, bend), (1, damping, bend))


@FILTERS.register
class LowPassFilter(ContinuousFilter):
    """1/(1 + s/w_0), or of the second order 1/(1 + 2 zeta s/w_0 + s^2/w_0^2)."""

    kind: Literal["low_pass"]
    frequency: Annotated[Value, Quantity("Hz", positive, "1 kHz")]
    order: Literal[1, 2] = 1
    damping_ratio: Annotated[float, Number(positive, "0.7")] = sqrt(0.5)
    """Damping ratio zeta of a second-order low-pass."""

    @classmethod
    def variant(cls, row: Mapping[str, Any]) -> int:
        """Return the order of the low-pass, 1 or 2."""
        return int(row["order"])

    @classmethod
    def transfer(cls, row: Mapping[str, Any], variant: int) -> Transfer:
        """Return the transfer function of a low-pass."""
        omega = _omega(row["frequency"])
        lower = (1, 1 / omega, 0) if variant == 1 else _second_order(omega, row["damping_ratio"])
        return Transfer((1, 0, 0), lower)


@FILTERS.register
class LeadLagFilter(ContinuousFilter):
    """(1 + s/w_z)/(1 + s/w_p): a lead where the zero is the slower one."""

    kind: Literal["lead_lag"]
    zero_frequency: Annotated[Value, Quantity("Hz", positive, "20 Hz")]
    pole_frequency: Annotated[Value, Quantity("Hz", positive, "200 Hz")]

    @classmethod
    def transfer(cls, row: Mapping[str, Any], variant: None) -> Transfer:
        """Return the transfer function of a lead or lag."""
        zero, pole = (_omega(row[f"{place}_frequency"]) for place in ("zero", "pole"))
        return Transfer((1, 1 / zero, 0), (1, 1 / pole, 0))


@FILTERS.register
class BiquadFilter(ContinuousFilter):
    """(1 + 2 zeta_z s/w_z + s^2/w_z^2)/(1 + 2 zeta_p s/w_p + s^2/w_p^2), by its zeros and poles."""

    kind: Literal["biquad"]
    zero_frequency: Annotated[Value, Quantity("Hz", positive, "180 Hz")]
    zero_damping: Annotated[float, Number(non_negative, "0.05")]
    pole_frequency: Annotated[Value, Quantity("Hz", positive, "220 Hz")]
    pole_damping: Annotated[float, Number(any_sign, "0.5")]

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            ("pole_damping",),
            lambda f: f["pole_damping"] > 0,
            "a filter that is stable: poles with a damping ratio greater than 0",
            "pole_damping = 0.5",
        ),
    )

    @classmethod
    def transfer(cls, row: Mapping[str, Any], variant: None) -> Transfer:
        """Return the transfer function of a biquad."""
        zeros, poles = (
            _second_order(_omega(row[f"{place}_frequency"]), row[f"{place}_damping"]) for place in ("zero", "pole")
        )
        return Transfer(zeros, poles)


@FILTERS.register
class SampledBiquadFilter(FilterSection):
    """y = b0 u + b1 u' + b2 u'' - a1 y' - a2 y'', primes for samples before, as drives take it.

    In continuous time it is the filter of which these are the coefficients by the bilinear transform at `sample_time`;
    a drive with that sample time takes them as they are.
    """

    kind: Literal["sampled_biquad"]
    numerator: Annotated[Values, Several(Number(any_sign, "0.94"), ("0.94", "-1.85", "0.93"), 3, 3)]
    denominator: Annotated[Values, Several(Number(any_sign, "-1.85"), ("-1.85", "0.87"), 2, 2)]
    """The coefficients a1 and a2."""
    sample_time: Annotated[Value, Quantity("s", positive, "125 us")]

    sampled: ClassVar[bool] = True
    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            ("denominator",),
            lambda f: (abs(f["denominator.2"]) < 1) & (abs(f["denominator.1"]) < 1 + f["denominator.2"]),
            "a filter that is stable: abs(a2) < 1 and abs(a1) < 1 + a2",
            "denominator = [-1.85, 0.87]",
        ),
    )

    @classmethod
    def transfer(cls, row: Mapping[str, Any], variant: None) -> Transfer:
        """Return the continuous transfer function by the inverse bilinear transform."""
        half = row["sample_time"] / 2
        b0, b1, b2 = (row[f"numerator.{n}"] for n in (1, 2, 3))
        a1, a2 = (row[f"denominator.{n}"] for n in (1, 2))
        total = 1 + a1 + a2
        upper = (b0 + b1 + b2, 2 * half * (b0 - b2), half**2 * (b0 - b1 + b2))
        lower = (total, 2 * half * (1 - a2), half**2 * (1 - a1 + a2))
        return Transfer(*(tuple(part / total for part in polynomial) for polynomial in (upper, lower)))


def _omega(frequency: Any) -> Any:
    """Return the angular frequency [rad/s] of a frequency [Hz], which may be a symbol."""
    if isinstance(frequency, float):
        return 2 * pi * frequency
    from sympy import pi as exact

    return 2 * exact * frequency


def _second_order(omega: Any, damping: Any) -> Polynomial:
    return (1, 2 * damping / omega, 1 / omega**2)


class FilterForm(NamedTuple):
    """Structure of a filter: kind, path, the choices of its equations, and discretisation."""

    kind: str
    path: str
    variant: Hashable
    discretisation: FilterRule = "bilinear"

    @property
    def section(self) -> type[FilterSection]:
        """Return the class that declares the filter's transfer function."""
        return FILTERS.classes[self.kind]  # type: ignore[return-value]


def filter_forms(flat: Mapping[str, Any], key: str) -> tuple[FilterForm, ...]:
    """Return the structure of each filter in an array of filters.

    `flat` has the stage's keys, and `key` names the array: "controller.filters".
    """
    forms = []
    for place in row_keys(flat, key):
        row = keys_below(flat, place)
        law: Any = FILTERS.classes[row["kind"]]
        own = "bilinear" if law.sampled else flat.get(FILTER_RULE, "bilinear")
        rule = row.get("discretisation", own)
        forms.append(FilterForm(row["kind"], row["path"], law.variant(row), rule))
    return tuple(forms)


class AgainstFriction(UncertainSection):
    """Settings of a drive against friction."""

    kind: Any
    integral_limit: Annotated[Value | None, Quantity("N", positive, "2 N")] = None
    """Largest force that each integral holds."""
    integral_leak: Annotated[Value | None, Quantity("Hz", positive, "0.1 Hz")] = None
    """Corner frequency below which an integral acts as a low-pass."""
    error_deadband: Annotated[Value | None, Quantity("m", positive, "1 um")] = None
    """Amount by which the error is reduced, at most to 0, before anything acts on it.

    With an exit or a time the error is 0 within the deadband, and whole outside."""
    error_deadband_exit: Annotated[Value | None, Quantity("m", positive, "3 um")] = None
    """Larger error at which the deadband is left; default: the deadband itself."""
    error_deadband_time: Annotated[Value | None, Quantity("s", positive, "10 ms")] = None
    """Time that the error has to stay below the deadband before it is entered."""
    error_deadband_gain: Annotated[float | None, Number(non_negative, "0.2")] = None
    """Factor on the error within the deadband; default: 0."""
    integral_deadband: Annotated[Value | None, Quantity("m", positive, "1 um")] = None
    """Error below which integrals pause."""
    integral_deadband_exit: Annotated[Value | None, Quantity("m", positive, "3 um")] = None
    """Larger error at which paused integrals continue; default: the deadband itself."""
    integral_deadband_time: Annotated[Value | None, Quantity("s", positive, "10 ms")] = None
    """Time that the error has to stay below the deadband before integrals pause."""
    integral_deadband_decay: Annotated[Value | None, Quantity("s", positive, "50 ms")] = None
    """Time constant with which paused integrals decay; default: they hold."""
    integral_rests_in_moves: bool | None = None
    """Whether integrals pause while the reference moves."""
    integral_reset: bool | None = None
    """Whether integrals restart when the error changes sign."""
    standstill_window: Annotated[Value | None, Quantity("m", positive, "5 um")] = None
    """Error below which the gains are multiplied by `standstill_factor`; integrals keep their force."""
    standstill_window_exit: Annotated[Value | None, Quantity("m", positive, "15 um")] = None
    """Larger error at which the usual gains return; default: the window itself."""
    standstill_window_time: Annotated[Value | None, Quantity("s", positive, "10 ms")] = None
    """Time that the error has to stay within the window before the gains change."""
    standstill_factor: Annotated[float | None, Number(positive, "0.5")] = None
    standstill_integral_factor: Annotated[float | None, Number(non_negative, "0.2")] = None
    """Factor on the integral gain within the window, for controllers by gains; default: `standstill_factor`."""
    freeze_window: Annotated[Value | None, Quantity("m", positive, "1 um")] = None
    """Error below which the force is switched off and integrals are emptied, while the reference rests."""
    freeze_window_exit: Annotated[Value | None, Quantity("m", positive, "3 um")] = None
    """Larger error at which the controller is engaged again; default: the window itself."""
    freeze_window_time: Annotated[Value | None, Quantity("s", positive, "10 ms")] = None
    """Time that the error has to stay within the window before the force is switched off."""
    windows_at_rest: bool | None = None
    """Whether deadbands and windows act only while the reference rests."""
    windows_in_position_loop: bool | None = None
    """Whether windows, factors and pauses act on what a cascade's position loop commands, and on its integral alone."""
    moving_factor: Annotated[float | None, Number(positive, "1.5")] = None
    """Factor on the gains while the reference moves; integrals keep their force."""
    schedule_error: Annotated[Values | None, Several(Quantity("m", non_negative, "0 um"), ("2 um", "20 um"), 2, 12)] = (
        None
    )
    """Sizes of the error, in rising order, at which `schedule_factor` multiplies the gains; between them linearly."""
    schedule_speed: Annotated[
        Values | None, Several(Quantity("m/s", non_negative, "0 mm/s"), ("1 mm/s", "20 mm/s"), 2, 12)
    ] = None
    """Speeds, in rising order, at which `schedule_factor` multiplies the gains, instead of errors."""
    schedule_factor: Annotated[Values | None, Several(Number(positive, "0.5"), ("0.2", "1"), 2, 12)] = None
    stiction_push: Annotated[Value | None, Quantity("N", positive, "1 N")] = None
    """Force towards the reference while the reference rests and the error exceeds `stiction_push_window`."""
    stiction_push_window: Annotated[Value | None, Quantity("m", non_negative, "2 um")] = None
    dither_amplitude: Annotated[Value | None, Quantity("N", positive, "0.5 N")] = None
    """Amplitude of a sinusoidal force, whose phase is 0 at every corner of the reference."""
    dither_frequency: Annotated[Value | None, Quantity("Hz", positive, "200 Hz")] = None

    @model_validator(mode="after")
    def _schedule_is_whole(self) -> Self:
        places = [name for name in SCHEDULES if getattr(self, name) is not None]
        if len(places) > 1:
            raise StageError(places[1], "a schedule over the error as well", "one of them", EXAMPLES[places[0]])
        factors = self.schedule_factor
        if (factors is None) != (not places):
            lacking = "schedule_factor" if places else "schedule_error"
            raise StageError(lacking, "nothing", "as many values as the rest of the schedule", EXAMPLES[lacking])
        if places and factors is not None:
            at = [float(value) for value in getattr(self, places[0])]
            if len(at) != len(factors):
                expected = f"as many values as {places[0]} has, {len(at)}"
                raise StageError("schedule_factor", f"{len(factors)} values", expected, EXAMPLES["schedule_factor"])
            if at != sorted({*at}):
                raise StageError(places[0], "values in another order", "rising values", EXAMPLES[places[0]])
        return self

    @model_validator(mode="after")
    def _settings_are_whole(self) -> Self:
        for first, second in PAIRS:
            for key, other in ((first, second), (second, first)):
                if getattr(self, key) is not None and getattr(self, other) is None:
                    raise StageError(other, "nothing", f"what belongs to {key}", EXAMPLES[other])
        for key in WINDOW_OF:
            if getattr(self, key) is not None and getattr(self, WINDOW_OF[key]) is None:
                raise StageError(WINDOW_OF[key], "nothing", f"what belongs to {key}", EXAMPLES[WINDOW_OF[key]])
        return self


PAIRS = (
    ("standstill_window", "standstill_factor"),
    ("stiction_push", "stiction_push_window"),
    ("dither_amplitude", "dither_frequency"),
)
"""Keys that must be given together."""

WINDOWS = ("error_deadband", "integral_deadband", "standstill_window", "freeze_window")
"""Keys of errors below which a setting acts. Each may have an exit, a larger error, and a time to stay."""

WINDOW_OF: Mapping[str, str] = {
    **{f"{window}_{part}": window for window in WINDOWS for part in ("exit", "time")},
    "error_deadband_gain": "error_deadband",
    "integral_deadband_decay": "integral_deadband",
    "standstill_integral_factor": "standstill_window",
}
"""The key of the window to which another key belongs."""

INNER_WINDOWS = "windows_in_position_loop"
"""Key that lets settings act on the position loop of a cascade alone."""

SCHEDULES = ("schedule_error", "schedule_speed")
"""Keys of what a schedule of the gains may depend on."""

EXAMPLES = {
    "schedule_error": 'schedule_error = ["2 um", "20 um"]',
    "schedule_speed": 'schedule_speed = ["1 mm/s", "20 mm/s"]',
    "schedule_factor": "schedule_factor = [0.2, 1]",
    "error_deadband": 'error_deadband = "1 um"',
    "integral_deadband": 'integral_deadband = "1 um"',
    "freeze_window": 'freeze_window = "1 um"',
    "standstill_window": 'standstill_window = "5 um"',
    "standstill_factor": "standstill_factor = 0.5",
    "stiction_push": 'stiction_push = "1 N"',
    "stiction_push_window": 'stiction_push_window = "2 um"',
    "dither_amplitude": 'dither_amplitude = "0.5 N"',
    "dither_frequency": 'dither_frequency = "200 Hz"',
}


@dataclass(frozen=True)
class FrictionSettings:
    """Which settings against friction a controller has: the names of their keys, and the points of its schedule."""

    names: tuple[str, ...] = ()
    points: int = 0

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def only(self, name: str) -> FrictionSettings:
        """Return this one of the settings alone, if the controller has it."""
        return FrictionSettings((name,) if name in self else ())

    def remembers(self, window: str) -> bool:
        """Tell whether the past decides if a window acts: it has an exit or a time, or empties integrals."""
        return window == "freeze_window" or f"{window}_exit" in self or f"{window}_time" in self

    @property
    def bends(self) -> bool:
        """Tell whether the controller acts otherwise near the reference than far from it."""
        return any(name in self for name in ("stiction_push", *SCHEDULES, *WINDOWS))

    @property
    def swings_alone(self) -> bool:
        """Tell whether a loop without integral may swing for ever.

        A force that is switched where the error grows, and back where it shrinks, feeds a swing.
        """
        forces = (window for window in WINDOWS if window != "integral_deadband" and window in self)
        return any(map(self.remembers, forces))

    @property
    def past_decides(self) -> bool:
        """Tell whether more than the distance decides how a stage goes on that sticks off its reference."""
        return self.swings_alone or "integral_deadband_time" in self


NO_SETTINGS = FrictionSettings()


def settings_of(flat: Mapping[str, Any]) -> FrictionSettings:
    """Return which settings against friction a stage's controller has; `flat` has its keys."""
    names = (name for name in get_annotations(AgainstFriction) if name != "kind")
    points = {name: len(element_keys(flat, f"{CONTROLLER}.{name}")) for name in SCHEDULES}
    values = ((name, flat.get(f"{CONTROLLER}.{name}", points.get(name, 0) > 0)) for name in names)
    present = tuple(name for name, value in values if value is not None and value is not False)
    return FrictionSettings(present, sum(points.values()))


def dead_band(flat: Mapping[str, Any]) -> Any:
    """Return the error [m] up to which the controller may exert no force; 0 without a dead zone."""
    sizes = [flat.get(f"{CONTROLLER}.{window}{end}", 0.0) for window in FORCELESS for end in ("", "_exit")]
    return np.maximum.reduce(np.broadcast_arrays(*sizes))


FORCELESS = ("error_deadband", "freeze_window")
"""Windows in which the controller exerts no force."""


def integral_leak(flat: Mapping[str, Any]) -> Any:
    """Return the frequency [Hz] below which integrals leak; 0 without a leak."""
    own = flat.get("controller.parts.leak", 0.0) * flat.get("controller.speed", 1.0) / (2 * np.pi)
    return flat.get("controller.integral_leak", 0.0) + own


CONTROLLER = "controller"
KIND, FORCE_LIMIT, ANTI_WINDUP, ANTI_WINDUP_TIME, FILTERS_KEY = (
    f"{CONTROLLER}.{name}" for name in ("kind", "force_limit", "anti_windup", "anti_windup_time", "filters")
)
"""Stage-file keys that every controller has."""

OF_ANY_FORM = ("kind", "force_limit", "anti_windup", "anti_windup_time", "filters")
"""Keys of a controller that stay if it is given in another way, by gains instead of rules."""

AntiWindup = Literal["none", "clamp", "back_calculation"]
"""What integrators do while the force is at its limit: they continue to wind up; stop where they would drive the force
further; or unwind in proportion to the excess force."""

DEFAULT_ANTI_WINDUP: AntiWindup = "clamp"
"""Anti-windup of a stage file that has a force limit but names no anti-windup."""

BACK_CALCULATION: AntiWindup = "back_calculation"

SYMBOLS = {"force_limit": ("limit of the force", "Fmax"), "integral_limit": ("limit of the integrals", "Imax")}
"""Names and symbols, in a table of gains, of keys that every controller has."""


class Gain(NamedTuple):
    """A number to enter into a drive: name, symbol, value [SI], and unit on a linear axis."""

    name: str
    symbol: str
    value: float
    unit: str


class PidLike(NamedTuple):
    """Gains kp [N/m], ki [N/(m s)], kd [N s/m] and filter time tau [s] of a PID controller that acts on a mass [kg]."""

    kp: float
    ki: float
    kd: float
    tau: float
    mass: float

    @property
    def crossover(self) -> float:
        """Return the frequency [Hz] at which the derivative, or without one the proportional gain, holds the mass."""
        return (self.kd / self.mass if self.kd else sqrt(self.kp / self.mass)) / (2 * pi)


class ControllerSection(AgainstFriction):
    """Base of the controllers.

    Each declares its keys, `kind: Literal["name"]`, its blocks, and everything else that friso asks of a controller; no
    other module reads its keys. A kind may be given in several ways ("forms"), such as by rules or by gains. These are
    told apart by their keys, and derive from the class that declares the kind.
    """

    force_limit: Annotated[Value | None, Quantity("N", positive, "200 N")] = None
    anti_windup: AntiWindup | None = None
    anti_windup_time: Annotated[Value | None, Quantity("s", positive, "50 ms")] = None
    filters: Annotated[Rows, FILTER_ARRAY] = Rows()

    feeds_back: ClassVar[Literal["position", "velocity"]] = "position"
    """The signal on which filters of the feedback path act."""
    bandwidth_key: ClassVar[str | None] = None
    """The key [Hz] that states the bandwidth, if the controller has one."""
    bandwidth_name: ClassVar[str] = "crossover"
    """Name of the bandwidth key in a sentence."""
    speeds_up: ClassVar[Mapping[str, int]] = MappingProxyType({})
    """Exponents by key, for a controller that becomes faster by a factor. Each key is multiplied by the factor to the
    power of its exponent, which multiplies all poles and zeros by the factor."""
    shaped_by: ClassVar[Mapping[str, tuple[float, float]]] = MappingProxyType({})
    """Tuning ranges of the keys that shape a controller without making it faster."""
    loop_gain: ClassVar[tuple[str, ...]] = ()
    """Names of the keys to whose product the loop gain is proportional."""
    position_loop: ClassVar[tuple[str, ...]] = ()
    """Names of the keys of a position loop above another loop, if the controller has one."""
    integral_gain: ClassVar[Mapping[str, int]] = MappingProxyType({})
    """Exponents by key, for a controller whose integral gains alone grow by a factor; none if no keys set them."""
    decisive: ClassVar[tuple[str, ...]] = ()
    """Names of the numeric keys on which `variant` and `integrates` depend, for example by being zero."""
    recognised_by: ClassVar[tuple[str, ...]] = ()
    """Names of the keys that identify this form among others of its kind. One of them in a table is enough; a form
    without such keys is the default."""
    shares: ClassVar[Mapping[str, str]] = MappingProxyType({})
    """Labels in plots of the terms of the force."""
    words: ClassVar[Mapping[str, str]] = MappingProxyType({})
    """Names of keys on the axes of maps, where the key itself is not clear enough."""
    usual: ClassVar[Mapping[str, tuple[float, float, str, tuple[str, ...]]]] = MappingProxyType({})
    """Usual values of keys in positioning stages. For each key: the two ends of its range, their unit, and the units in
    which values are reported. Gains are per kilogram of moving mass."""
    symbols: ClassVar[Mapping[str, tuple[str, str]]] = MappingProxyType({})
    """Names and symbols of keys in a table of gains, where the key itself is not clear enough."""

    @model_validator(mode="after")
    def _anti_windup_is_whole(self) -> Self:
        if self.anti_windup and self.force_limit is None:
            raise StageError("anti_windup", f'"{self.anti_windup}"', "a force_limit as well", 'force_limit = "200 N"')
        by_time = self.anti_windup == BACK_CALCULATION
        if by_time and self.anti_windup_time is None:
            expected = "the time in which the integrator unwinds as well"
            raise StageError("anti_windup", f'"{BACK_CALCULATION}"', expected, 'anti_windup_time = "50 ms"')
        if self.anti_windup_time is not None and not by_time:
            actual = f'anti_windup = "{self.anti_windup}"' if self.anti_windup else "no anti_windup"
            expected = "the anti-windup to which this time belongs"
            raise StageError("anti_windup_time", actual, expected, f'anti_windup = "{BACK_CALCULATION}"')
        return self

    @model_validator(mode="after")
    def _has_integral_gains(self) -> Self:
        if self.standstill_integral_factor is not None and not self.integral_gain:
            key, expected = "standstill_integral_factor", "a controller with keys for its integral gains, or nothing"
            raise StageError(key, f'kind = "{self.kind}" as it is written here', expected, "standstill_factor = 0.5")
        if self.windows_in_position_loop and not self.position_loop:
            expected = 'a position loop above a velocity loop, kind = "cascade"'
            raise StageError(INNER_WINDOWS, f'kind = "{self.kind}"', expected, f"{INNER_WINDOWS} = false")
        return self

    @classmethod
    def pick(cls, forms: Sequence[type[ControllerSection]], table: Mapping[str, Any]) -> type[ControllerSection]:
        """Choose the class that reads a [controller] table, among the `forms` of this kind.

        A form is one way to give a controller, such as by rules or by gains. The first is the default. Raises
        StageError if none fits, or more than one.
        """
        return forms[0]

    @classmethod
    def with_defaults(cls, flat: Mapping[str, Any]) -> dict[str, Any]:
        """Return values for keys that the stage file may lack, because they follow from others.

        `flat` has the stage's keys in SI.
        """
        return {}

    @classmethod
    def variant(cls, flat: Mapping[str, Any]) -> Hashable:
        """Return further choices on which the equations depend, such as terms that are absent.

        They follow from the stage's keys, `flat`.
        """
        return None

    @classmethod
    def integrates(cls, flat: Mapping[str, Any]) -> bool:
        """Tell whether there is integral action, which winds up while a stage sticks."""
        raise NotImplementedError

    @classmethod
    def takes_velocity(cls, flat: Mapping[str, Any]) -> bool:
        """Tell whether the controller acts on a measured velocity, which may have its own encoder."""
        return cls.feeds_back == "velocity"

    @classmethod
    def stiffness(cls, blocks: Any, variant: Any) -> Any:
        """Return the proportional stiffness of the loop [N/m], which scales the motion."""
        raise NotImplementedError

    @classmethod
    def declare(cls, measured: Any, blocks: Any, variant: Any) -> Mapping[str, Any]:
        """Return the terms of the force [N], made by `blocks` from the `measured` inputs.

        See `friso.equations.blocks`.
        """
        raise NotImplementedError

    @classmethod
    def structures(cls, flat: Mapping[str, Any]) -> Mapping[str, Mapping[str, Any]]:
        """Return other structures of the controller for `friso tune` to try, by their names.

        Each has the keys of the stage file that change: numbers [SI] as floats, texts, or None for keys to remove.
        There may be none.
        """
        return {}

    @classmethod
    def as_pid(cls, flat: Mapping[str, Any]) -> PidLike | None:
        """Return the PID controller that acts alike, or nearly; None for a kind that does not say."""
        return None

    @classmethod
    def like_pid(cls, pid: PidLike) -> dict[str, Any]:
        """Return keys by name [SI], None for keys to leave out, that act as a PID controller does, or nearly."""
        return {}

    @classmethod
    def gains(cls, flat: Mapping[str, Any]) -> tuple[Gain, ...]:
        """Return the numbers to enter into a drive.

        They are the keys that are not 0: the controller's own, then those of every controller.
        """
        fields = numeric_fields(cls)
        names = sorted(fields, key=lambda name: name in ControllerSection.model_fields)
        return tuple(
            Gain(*cls._called(name), float(flat[cls.key(name)]), fields[name].unit)
            for name in names
            if flat.get(cls.key(name))
        )

    @classmethod
    def _called(cls, name: str) -> tuple[str, str]:
        """Return the words for a key in a table of gains, and its symbol."""
        return {**SYMBOLS, **cls.symbols}.get(name, (name.replace("_", " "), name))

    @classmethod
    def draw(cls, canvas: Any, flat: Mapping[str, Any]) -> None:
        """Draw the path from the error to the demanded force on a `canvas` of text characters.

        By default it is a box (`friso.drives.gains.Canvas`).
        """
        canvas.box(flat[KIND])

    def note(self, flat: Mapping[str, Any]) -> str:
        """Say what a verdict on a stage with this controller assumes, in a sentence; "" for nothing."""
        return ""

    @classmethod
    def key(cls, name: str) -> str:
        """Return the stage-file key of a name in the table [controller], such as "controller.kp"."""
        return f"{CONTROLLER}.{name}"


class Controllers(Variants):
    """Registry of controllers by kind.

    A kind may be given in several ways ("forms"), such as by rules or by gains, which their keys tell apart.
    """

    def __init__(self) -> None:
        super().__init__("kind", "friso.controllers")
        self._forms: dict[str, list[type[ControllerSection]]] = {}

    @property
    def forms(self) -> dict[str, list[type[ControllerSection]]]:
        """Return the classes of each kind of controller, one for each way to give it."""
        load_own(self.group)
        return self._forms

    def register(self, cls: SectionClass) -> SectionClass:
        """Add the class of a controller, as a class decorator.

        Raises InputError for a kind that another class declares.
        """
        form = cast(type[ControllerSection], cls)
        owner = next(base for base in form.__mro__ if self.tag in get_annotations(base))
        super().register(owner)
        self._forms.setdefault(self.name_of(form), []).append(form)
        return cls

    def pick(self, table: dict[str, Any]) -> type[Section]:
        """Return the class that reads a [controller] table.

        Raises InputError for an unknown kind, StageError for keys of none or of several of its classes.
        """
        owner = cast(type[ControllerSection], super().pick(table))
        return owner.pick(self.forms[table[self.tag]], table)

    def of(self, flat: Mapping[str, Any]) -> type[ControllerSection]:
        """Return the class of a stage's controller; `flat` has the stage's keys."""
        forms = self._forms_of(flat[KIND])
        recognised = (form for form in forms if any(form.key(name) in flat for name in form.recognised_by))
        return next(recognised, None) or next(form for form in forms if not form.recognised_by)

    @property
    def words(self) -> dict[str, str]:
        """Return the words for keys of controllers on the axes of maps."""
        forms_of_all = (form for forms in self.forms.values() for form in forms)
        return {form.key(name): word for form in forms_of_all for name, word in form.words.items()}

    def form(self, kind: str, name: str) -> type[ControllerSection]:
        """Return the class with this name among those of a kind of controller."""
        return next(form for form in self._forms_of(kind) if form.__name__ == name)

    def _forms_of(self, kind: str) -> list[type[ControllerSection]]:
        """Return the classes of a kind of controller, which an installed package may have added.

        There is one for each way to give it, such as by rules or by gains.
        """
        self.named(kind)
        return self.forms[kind]


CONTROLLERS = Controllers()
register_controller = CONTROLLERS.register


def controller_of(flat: Mapping[str, Any]) -> type[ControllerSection]:
    """Return the class of a stage's controller; `flat` has the stage's keys."""
    return CONTROLLERS.of(flat)


def as_tuned(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Return the controller's keys that follow from other keys, at their present values [SI].

    If these are set, the controller stays tuned for the machine of the stage file while the machine changes.
    """
    controller = controller_of(flat)
    of_file = {*map(controller.key, numeric_fields(controller))}
    return {key: flat[key] for key in controller.with_defaults(flat) if key in of_file}
