"""Declare the tables of the real drive and the machine's surroundings, and [motion].

The table [motion] has what every motion of the reference has. Each kind of motion is a class in
`friso/equations/motions/`, or comes from a package.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self, cast

import numpy as np
from pydantic import model_validator

from friso.errors import InputError, StageError
from friso.quantities import Bound, Number, Quantity, Value, at_least_1, non_negative, positive, quoted
from friso.stage.controllers import FILTER_RULE, FILTERS, FILTERS_KEY, FilterRule
from friso.stage.section import Rule, Section, Several, UncertainSection, Values, Variants, row_keys

KIND, DURATION = "motion.kind", "motion.duration"
"""Keys that every motion has."""


class ReferenceForm(NamedTuple):
    """What a reference consists of: polynomials of a `degree`, 2 to 4, and sinusoids.

    `tones` is the number of sinusoids.
    """

    degree: int = 2
    tones: int = 0

    @property
    def inputs(self) -> int:
        """Return how many numbers describe a piece of the reference.

        They are derivatives, direction, and four for each sinusoid.
        """
        return 1 + self.degree + (1 + 4 * self.tones if self.tones else 0)


QUADRATIC = ReferenceForm()
"""Reference of parabolic pieces. It fits any motion with bounded acceleration, and rest."""


class Tone(NamedTuple):
    """A sinusoid of the reference: amplitude [m], phase [turns], frequency [Hz], rise [Hz/s].

    The rise is that of the frequency; phase and frequency are those at the start.
    """

    amplitude: Any
    turns: Any
    frequency: Any
    sweep: Any = 0.0


class Stand(NamedTuple):
    """A place where the reference stands still.

    The reference stops there at `corner` [s] and leaves at `until` [s], or stays to the end of the run.
    """

    corner: Any
    until: Any


class Lowered(NamedTuple):
    """A limit that a move is too short to reach.

    It has the move's distance [m], the limit's name, unit and value, and the peak that is reached [SI].
    """

    distance: float
    name: str
    limit: float
    reached: float
    unit: str


Piece = tuple[Any, ...]
"""Start time [s] of a piece, and position [m], velocity [m/s] and acceleration [m/s^2] there. Jerk and snap follow if
the reference has them."""


class Motion(UncertainSection):
    """Base of the motions: each kind declares its keys and its reference.

    A reference consists of polynomial pieces, sinusoids ("tones"), or both. The functions take the stage's keys with SI
    numbers, or arrays with one entry per run.
    """

    kind: Any
    duration: Annotated[Any, Quantity("s", positive, "20 s")]

    rests: ClassVar[bool] = True
    """Whether the reference stands still in the end, so that the stage can hunt."""

    @staticmethod
    def form(flat: Mapping[str, Any]) -> ReferenceForm:
        """Say what the reference consists of: polynomials of a degree, and sinusoids."""
        return QUADRATIC

    @staticmethod
    def pieces(flat: Mapping[str, Any]) -> Sequence[Piece]:
        """Return the pieces of the polynomial part, from time 0; the last one lasts to the end."""
        return [(0.0, 0.0, 0.0, 0.0)]

    @staticmethod
    def tones(flat: Mapping[str, Any]) -> Sequence[Tone]:
        """Return the sinusoids that are added to the polynomials."""
        return ()

    @staticmethod
    def motion_size(flat: Mapping[str, Any]) -> Any:
        """Return the length of the motion [m]; 0 where the reference never moves."""
        return 0.0

    @staticmethod
    def initial_displacement(flat: Mapping[str, Any]) -> Any:
        """Return the position of all masses at the start [m]."""
        return 0.0

    @classmethod
    def stands(cls, flat: Mapping[str, Any]) -> Sequence[Stand]:
        """Return the places where the reference stands still.

        A reference that never stands has one, from its last corner on.
        """
        return [Stand(cls.pieces(flat)[-1][0], flat[DURATION])]

    @staticmethod
    def period(flat: Mapping[str, Any]) -> float | None:
        """Return the period [s] of a reference that repeats for ever; None for any other."""
        return None

    @staticmethod
    def lowered(flat: Mapping[str, Any]) -> Sequence[Lowered]:
        """Return the limits that moves of a stage are too short to reach."""
        return ()

    @staticmethod
    def with_defaults(flat: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return values for keys that the stage file may lack, because they follow from others."""
        return {}

    @staticmethod
    def stretched(flat: Mapping[str, Any], factor: Any) -> Mapping[str, Any]:
        """Return the keys that change when a move becomes longer by a factor, with new values [SI].

        There are none without a move.
        """
        return {}

    @staticmethod
    def varied(flat: Mapping[str, Any], shares: tuple[float, float]) -> Mapping[str, tuple[float, float]]:
        """Return ranges [SI] of two keys for moves around the present one; none if it is no move.

        `shares` are the ends of both ranges, as multiples of the present values.
        """
        return {}


MOTION = Variants("kind", "friso.motions")
register_motion = MOTION.register


def motion_of(flat: Mapping[str, Any]) -> type[Motion]:
    """Return the class of a stage's motion; `flat` has the stage's keys."""
    return cast(type[Motion], MOTION.named(flat[KIND]))


share = Bound("0 or greater, below 1", lambda value: (value >= 0) & (value < 1))
above_minus_1 = Bound("greater than -1", lambda value: value > -1)
seeds = Bound("a whole number from 0, below 1e15", lambda value: (value >= 0) & (value < 1e15) & (value % 1 == 0))


AS_BUILT = ("drive", "rail", "cable", "floor")
"""Tables of the real drive and its surroundings, which analyses of the ideal machine leave out."""

CONVERSIONS = ("machine_unit", "force_per_output", "length_per_unit", "velocity_per_output", "travel_per_turn")
"""Keys of [drive] that only convert units, and so do not describe the real drive.

They are given to friso init --from or read from a file, and friso export needs them."""


def is_as_built(stage: Any) -> bool:
    """Tell whether a stage describes its real drive, such as its sampling, or its surroundings."""
    if any(getattr(stage, table) for table in AS_BUILT[1:]) or getattr(stage.controller, "sample_time", None):
        return True
    return stage.drive is not None and bool({*stage.drive.as_written()} - {*CONVERSIONS})


def left_out(stage: Any, tables: Sequence[str] = AS_BUILT) -> str:
    """Say which `tables` of a stage an analysis of the ideal machine leaves out; "" if none."""
    placed = stage.conditions is not None and stage.conditions.place is not None
    left = [name for name in tables if getattr(stage, name) and not (name == "rail" and placed)]
    if not left:
        return ""
    listed, verb = ", ".join(f"[{name}]" for name in left), "are" if len(left) > 1 else "is"
    return f"{listed} {verb} left out, as in continuous time; friso check and friso simulate run the machine as built"


IntegralRule = Literal["bilinear", "backward_euler", "forward_euler"]
"""Rule by which a drive integrates: the trapezoidal rule, or a sum that includes the present sample (backward) or ends
with the one before (forward)."""

LOOPS = ("velocity", "position")
"""Loops that may have their own sample time, drive.<loop>_sample_time."""


def _multiple(slow: str, fast: str, longer: str, shorter: str) -> Rule:
    """Make the rule that the sample time `slow` is a whole multiple of the sample time `fast`.

    Both are keys; `longer` and `shorter` are example values.
    """
    optional = "velocity" in fast

    def holds(flat: Mapping[str, Any]) -> Any:
        if slow not in flat or (fast not in flat and optional):
            return True
        if fast not in flat:
            return False
        ratio = flat[slow] / flat[fast]
        return (ratio > 1 - 1e-9) & (abs(ratio - np.round(ratio)) < 1e-9 * ratio)

    example = f"{slow.split('.')[1]} = {longer} with {fast.split('.')[1]} = {shorter}"
    return Rule((slow, fast), holds, "a whole multiple of the faster sample time, which is given too", example)


def _one_travel(flat: Mapping[str, Any]) -> Any:
    """Tell whether the travel per turn is stated once, or twice with equal values.

    The result is an array if keys are arrays.
    """
    of_drive, lead, ratio = (
        flat.get(key) for key in ("drive.travel_per_turn", "transmission.lead", "transmission.ratio")
    )
    travel = 2 * np.pi / ratio if ratio is not None else lead
    return True if of_drive is None or travel is None else abs(of_drive / travel - 1) < 1e-6


def _below_half_the_rate(flat: Mapping[str, Any]) -> Any:
    """Tell whether prewarped filters are exact at frequencies below half the sampling frequency."""
    fine: Any = True
    for place in row_keys(flat, FILTERS_KEY) if "drive.sample_time" in flat else ():
        law: Any = FILTERS.classes[flat[f"{place}.kind"]]
        if not law.sampled and flat.get(f"{place}.discretisation", flat.get(FILTER_RULE)) == "prewarped":
            loop = "velocity_" if flat[f"{place}.path"] == "feedback" else ""
            period = flat.get(f"drive.{loop}sample_time", flat["drive.sample_time"])
            exact_at = flat.get(f"{place}.frequency", flat.get(f"{place}.pole_frequency", 0.0))
            fine = fine & (exact_at * period < 1 / 2)
    return fine


class Drive(UncertainSection):
    """How the controller is carried out.

    `friso bode` reads timing, discretisation and current loop; `friso rig` reads all of it.
    """

    sample_time: Annotated[Value | None, Quantity("s", positive, "50 us")] = None
    delay: Annotated[Value | None, Quantity("s", non_negative, "50 us")] = None
    velocity_sample_time: Annotated[Value | None, Quantity("s", positive, "125 us")] = None
    position_sample_time: Annotated[Value | None, Quantity("s", positive, "1 ms")] = None
    """Sample times of the loops of a cascade that are slower than sample_time, each a whole multiple of it."""
    velocity_samples: Annotated[float | None, Number(at_least_1, "1")] = None
    """Number of samples over which the position is differenced for the velocity."""
    integral_discretisation: IntegralRule | None = None
    """Rule of integration; default: a sum that includes the present sample, or trapezoids for van Dijk's rules."""
    filter_discretisation: FilterRule | None = None
    """Rule for filters, and for the controller's own low-pass (which prewarping does not change); default: bilinear."""
    current_bandwidth: Annotated[Value | None, Quantity("Hz", positive, "2 kHz")] = None
    """Bandwidth of the current loop, a first-order lag between the controller's force and the actuator's."""
    force_resolution: Annotated[Value | None, Quantity("N", positive, "10 mN")] = None
    """Smallest step of the commanded force: that of the current, times the motor constant; default: none."""
    encoder_resolution: Annotated[Value | None, Quantity("m", positive, "1 nm")] = None
    encoder_noise: Annotated[Value | None, Quantity("m", non_negative, "0.5 nm")] = None
    """RMS of the encoder noise, independent from sample to sample."""
    relative_noise: Annotated[Value | None, Quantity("m", non_negative, "30 nm")] = None
    """RMS of the noise of the sensor between cart and stage."""
    motor_constant_ratio: Annotated[float | None, Number(positive, "1.47")] = None
    """True motor constant relative to the one that the drive assumes."""
    ripple: Annotated[float | None, Number(share, "0.02")] = None
    """Amplitude of the variation of the force over position, as a fraction of the force."""
    ripple_pitch: Annotated[Value | None, Quantity("m", positive, "24 mm")] = None
    feedforward_mass: Annotated[Value | None, Quantity("kg", non_negative, "1.7 kg")] = None
    feedforward_coulomb: Annotated[Value | None, Quantity("N", non_negative, "1 N")] = None
    feedforward_viscous: Annotated[Value | None, Quantity("N*s/m", non_negative, "0.5 N*s/m")] = None
    integrator_deadband: Annotated[Value | None, Quantity("m", non_negative, "1 um")] = None
    """Largest error at which the integrator pauses."""
    integrator_reset: bool = False
    """Whether the integrator is reset to 0 when the error changes sign."""

    machine_unit: Literal["mm", "cm", "m", "inch", "deg", "rad"] | None = None
    """Unit of positions in the drive, as stated to friso init --from; friso export needs it."""
    force_per_output: Annotated[Value | None, Quantity("N", positive, "20 N")] = None
    """Force per unit of the drive's output, as stated to friso init --from; friso export needs it."""
    length_per_unit: Annotated[Value | None, Quantity("m", positive, "0.5 um")] = None
    """Travel of the load per unit of the drive's position, as stated to friso init --from; friso export needs it."""
    velocity_per_output: Annotated[Value | None, Quantity("m/s", positive, "5 mm/s")] = None
    """Velocity per unit of the drive's output, as stated to friso init --from; friso export needs it."""
    travel_per_turn: Annotated[Value | None, Quantity("m", positive, "10 mm")] = None
    """Travel of the load per turn of the motor, as stated to friso init --from; friso export needs it."""

    rules: ClassVar[tuple[Rule, ...]] = (
        _multiple("drive.velocity_sample_time", "drive.sample_time", '"125 us"', '"62.5 us"'),
        _multiple("drive.position_sample_time", "drive.sample_time", '"1 ms"', '"125 us"'),
        _multiple("drive.position_sample_time", "drive.velocity_sample_time", '"1 ms"', '"125 us"'),
        Rule(
            ("drive.velocity_samples",),
            lambda f: f.get("drive.velocity_samples", 1.0) % 1 == 0,
            "a whole number of samples",
            "velocity_samples = 2",
        ),
        Rule(
            ("drive.travel_per_turn", "transmission.lead", "transmission.ratio"),
            _one_travel,
            "one travel of a turn: that of the transmission is enough",
            '[transmission] lead = "10 mm", without travel_per_turn',
        ),
        Rule(
            ("drive.sample_time",),
            _below_half_the_rate,
            "a sample time of less than half the period of each prewarped filter",
            'sample_time = "125 us" with frequency = "300 Hz"',
        ),
        Rule(
            ("drive.ripple", "drive.ripple_pitch"),
            lambda f: ("drive.ripple" in f) == ("drive.ripple_pitch" in f),
            "the force ripple together with its pitch",
            'ripple = 0.02, ripple_pitch = "24 mm"',
        ),
    )


_DEVIATIONS = ("rail.static_deviation", "rail.coulomb_deviation")
_HARMONICS = ("rail.first_harmonic", "rail.second_harmonic", "rail.third_harmonic")


def _total(flat: Mapping[str, Any], keys: tuple[str, ...]) -> Any:
    """Return the sum of the values of some keys."""
    return sum(flat[key] for key in keys)


class Rail(UncertainSection):
    """How friction varies along the rail: factors of static and of Coulomb friction.

    The factors depend on the position. Factor = (1 + offset) (1 + harmonics of the rolling elements) (random field of
    mean 1).
    """

    seed: Annotated[float, Number(seeds, "1")]
    offset: Annotated[float, Number(above_minus_1, "0.1")] = 0.0
    static_deviation: Annotated[float, Number(share, "0.2")] = 0.0
    coulomb_deviation: Annotated[float, Number(share, "0.2")] = 0.0
    """Standard deviations of the random fields of the friction factors."""
    correlation_length: Annotated[Value | None, Quantity("m", positive, "5 mm")] = None
    """Length over which friction is correlated: places d apart correlate by exp(-(d / correlation_length)^2 / 2)."""
    rolling_pitch: Annotated[Value | None, Quantity("m", positive, "4 mm")] = None
    first_harmonic: Annotated[float, Number(share, "0.1")] = 0.0
    second_harmonic: Annotated[float, Number(share, "0.05")] = 0.0
    third_harmonic: Annotated[float, Number(share, "0.02")] = 0.0

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            (*_DEVIATIONS, "rail.correlation_length"),
            lambda f: ("rail.correlation_length" in f) | (_total(f, _DEVIATIONS) == 0),
            "the correlation length of friction that varies along the rail",
            'correlation_length = "5 mm"',
        ),
        Rule(
            (*_HARMONICS, "rail.rolling_pitch"),
            lambda f: ("rail.rolling_pitch" in f) | (_total(f, _HARMONICS) == 0),
            "the pitch of the rolling elements whose harmonics are given",
            'rolling_pitch = "4 mm"',
        ),
        Rule(
            _HARMONICS,
            lambda f: _total(f, _HARMONICS) < 1,
            "harmonics that add up to less than 1, so that friction stays positive",
            "first_harmonic = 0.1, second_harmonic = 0.05, third_harmonic = 0.02",
        ),
    )


class Cable(UncertainSection):
    """What drags on the stage: a spring that is slack at position 0, and a viscous drag."""

    stiffness: Annotated[Value, Quantity("N/m", non_negative, "50 N/m")] = Value(0, "0 N/m")
    drag: Annotated[Value, Quantity("N*s/m", non_negative, "0.5 N*s/m")] = Value(0, "0 N*s/m")


_PER_ROOT_HERTZ = re.compile(r"(?<!\s)\s*/\s*(Hz(\^|\*\*)0\.5|sqrt\(Hz\)|√Hz)\s*$")


@dataclass(frozen=True)
class Density(Quantity):
    """A key that takes an amplitude spectral density.

    `unit` is what stands before "/Hz^0.5" in the text of a value.
    """

    @property
    def expected(self) -> str:
        """Return the values that the key accepts, in words."""
        return f"number and unit in quotes, convertible to {self.unit}, and /Hz^0.5, {self.bound.text}"

    def read(self, entry: Any) -> Value:
        """Return the SI value of a text (or of the text of a Value), which must end with /Hz^0.5.

        Raises StageError for any other text, or an amplitude that the key does not accept.
        """
        text = getattr(entry, "text", entry)
        amplitude = _PER_ROOT_HERTZ.sub("", text) if isinstance(text, str) else text
        if amplitude == text and isinstance(text, str):
            raise StageError("", quoted(text, "does not end with /Hz^0.5"), self.expected, self.written_example)
        try:
            return Value(super().read(amplitude), text)
        except InputError as error:
            why = error.actual.replace(quoted(amplitude), quoted(text))
            raise StageError("", why, self.expected, self.written_example) from None


class Floor(Section):
    """Vibration of the floor: the one-sided amplitude spectral density of its acceleration.

    Between its points it is straight in log-log, and nothing beyond their band. Its arrays are not in `Stage.flat`.
    """

    frequency: Annotated[Values, Several(Quantity("Hz", positive, "1 Hz"), ("1 Hz", "10 Hz", "100 Hz"))]
    acceleration: Annotated[
        Values,
        Several(
            Density("m/s^2", positive, "1e-4 m/s^2/Hz^0.5"),
            ("1e-5 m/s^2/Hz^0.5", "1e-4 m/s^2/Hz^0.5", "1e-4 m/s^2/Hz^0.5"),
        ),
    ]

    @model_validator(mode="after")
    def _is_a_curve(self) -> Self:
        frequencies, densities = len(self.frequency), len(self.acceleration)
        if frequencies != densities:
            example = 'frequency = ["1 Hz", "100 Hz"], acceleration = ["1e-5 m/s^2/Hz^0.5", "1e-4 m/s^2/Hz^0.5"]'
            text = f"{frequencies} frequencies and {densities} densities"
            raise StageError("acceleration", text, "one density for each frequency", example)
        for low, high in pairwise(self.frequency):
            if not low < high:
                text = f"{quoted(high.text)} after {quoted(low.text)}"
                raise StageError("frequency", text, "increasing frequencies", 'frequency = ["1 Hz", "10 Hz", "100 Hz"]')
        return self
