"""Numbers with units: what a user writes, checked and turned into SI. Every refusal is a `InputError`.

A dimensioned value is a text, number and unit ("2.4 N/mm"); `pint` knows the units.
"""

import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cache, lru_cache
from importlib.resources import files
from typing import Any, NamedTuple, Self

from pydantic import GetCoreSchemaHandler, ValidationInfo
from pydantic_core import CoreSchema, core_schema

from friso.axis import LINEAR, ROTARY, AxisKind
from friso.errors import InputError, toml_text

LARGEST_INTEGER = 10**60
"""Whole numbers of this size or more are not written out."""


NOTHING = "–"
"""Text in place of a missing value."""


ZERO_SHARE = 1e-9
"""Fraction below which a value counts as 0."""


def percent(share: float, digits: int = 2, signed: bool = False) -> str:
    """Write a fraction in percent to some digits; a dash if it is NaN or infinite.

    `share` is the fraction, and one as small as rounding errors is 0. With `signed`, positive fractions get a plus.
    """
    if not math.isfinite(share):
        return NOTHING
    share = share if abs(share) > ZERO_SHARE else 0.0
    number, plus = float(f"{100 * share:.{digits}g}"), "+" if signed else ""
    if 0 < abs(number) < 1e-4:  # which g would write with an exponent
        return f"{number:{plus}.{digits - 1 - math.floor(math.log10(abs(number)))}f} %"
    return f"{number:{plus}.0f} %" if abs(number) >= 10**digits else f"{number:{plus}g} %"


def plain_factor(factor: float) -> str:
    """Write a factor to three significant digits, without an exponent."""
    rounded = float(f"{factor:.3g}")
    return f"{rounded:.0f}" if abs(rounded) >= 1000 else f"{rounded:g}"


def outwards(value: float, larger: bool) -> float:
    """Round a positive value to three digits: up if `larger`, otherwise down.

    Other values stay as they are.
    """
    if value <= 0:
        return value
    step = 10.0 ** (math.floor(math.log10(value)) - 2)
    steps = math.ceil(value / step - 1e-9) if larger else math.floor(value / step + 1e-9)
    return float(f"{steps * step:.6g}")


def as_toml(value: Any) -> str:
    """Return a text, boolean or number as it is written in TOML, for messages.

    Other values are described in words, such as "a table".
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return toml_text(value)
    if isinstance(value, float):
        return repr(float(value))  # float(): numpy's own repr is no TOML
    if isinstance(value, int):
        return str(value) if abs(value) < LARGEST_INTEGER else "a huge integer"
    names = {dict: "a table", list: "an array", type(None): "nothing"}
    return names.get(type(value)) or f"{' '.join(str(value).split())} (a {type(value).__name__})"


def exactly(value: float, unit: str) -> str:
    """Write a number and its unit so that it reads back as the same number: "19000000 N/m"."""
    return f"{repr(float(value) + 0.0).removesuffix('.0')} {unit}"  # + 0.0: no minus before a zero


def quoted(value: Any, hint: str = "") -> str:
    """Write a value for an error message, short and printable, with a `hint` in brackets."""
    text = as_toml(value).encode(errors="backslashreplace").decode()
    text = text if len(text) <= 60 else f"{text[:57]}..."
    return f"{text} ({hint})" if hint else text


LARGEST_VALUE = 1e30
"""Bound on SI values: larger than any value of a machine, and small enough for squares and products."""

LARGEST = {"m": 1e9}
"""Largest values [SI unit] of keys that are read, by unit: a slip of the pen, not a machine, has larger ones."""

BEYOND = "too large: beyond 1e30 in SI"


@dataclass(frozen=True)
class Bound:
    """Allowed numbers: in words, and as a test that broadcasts over arrays."""

    text: str
    test: Callable[[Any], Any]

    def holds(self, value: Any) -> Any:
        """Tell whether a value, a number or an array, is allowed.

        Numbers larger than any machine has are not.
        """
        return (abs(value) <= LARGEST_VALUE) & self.test(value)


positive = Bound("greater than 0", lambda value: value > 0)
non_negative = Bound("0 or greater", lambda value: value >= 0)
any_sign = Bound("of any sign", lambda value: value == value)
inside_0_1 = Bound("between 0 and 1 (both excluded)", lambda value: (value > 0) & (value < 1))
inside_minus_1_1 = Bound("between -1 and 1 (both excluded)", lambda value: (value > -1) & (value < 1))
at_least_1 = Bound("1 or greater", lambda value: value >= 1)


class Value(float):
    """A dimensioned value: the number in SI, and in `text` what the user wrote."""

    text: str

    def __new__(cls, si: float, text: str) -> Self:
        value = super().__new__(cls, si)
        value.text = text
        return value

    def __reduce__(self) -> tuple[type[Self], tuple[float, str]]:
        return type(self), (float(self), self.text)


class Motor(NamedTuple):
    """What a drive's units stand for.

    `exerts` has the force or torque [N or N m] per unit of command, `counted` the length of a count and the time of a
    sample; `force` is the unit N or N*m.
    """

    exerts: tuple[tuple[str, float], ...]
    counted: tuple[tuple[str, float], ...]
    force: str


_OF_A_MOTOR = re.compile("/A$|ohm|V")
"""Units in which a motor itself is described."""


@dataclass(frozen=True)
class Quantity:
    """A key that takes number and unit, as an annotation declares it.

    An example is `stiffness: Annotated[Value, Quantity("N/m", positive, "2.4 N/mm")]`. `unit` is the SI unit of the
    values. If it is "Hz", angle per time (rad/s, rpm) is divided by 2 pi. Keys are declared as on a linear axis; `on`
    converts them to another, which `axis` names. If `motor` is known, a force may be written in amperes.
    """

    unit: str
    bound: Bound
    example: str
    axis: str = field(default="", kw_only=True)
    motor: Motor | None = field(default=None, kw_only=True)

    def on(self, kind: AxisKind) -> Self:
        """Return the declaration of the key for an axis of this kind, with its units."""
        motor = Motor(kind.exerts, kind.counted, kind.force) if kind.exerts or kind.counted else None
        motor = None if _OF_A_MOTOR.search(self.unit) else motor
        if (unit := kind.unit(self.unit)) == self.unit:
            return self if motor == self.motor else replace(self, motor=motor)
        number, _, written = self.example.partition(" ")
        example = f"{number} {kind.unit(written)}"
        return replace(self, unit=unit, example=example, axis=kind.described, motor=motor)

    @property
    def expected(self) -> str:
        """Return the values that the key accepts, in words."""
        units = "Hz, rad/s or rpm" if self.unit == "Hz" else self.unit
        if self.motor and re.match(re.escape(self.motor.force) + r"\b", self.unit):
            units += "".join(f" or {self.unit.replace(self.motor.force, name, 1)}" for name, _ in self.motor.exerts)
        axis = f" with {self.axis}" if self.axis else ""
        return f"number and unit in quotes, convertible to {units}{axis}, {self.bound.text}"

    @property
    def written_example(self) -> str:
        """Return the example as it stands in a file."""
        return as_toml(self.example)

    def factor(self, unit: str) -> float:
        """Return the SI value of 1 `unit`, to convert arrays with.

        Raises InputError for a unit of another kind.
        """
        try:
            return _factor(_checked_unit(unit), self.unit, self.motor)
        except _Refused as refused:
            raise InputError("", quoted(unit, str(refused)), f"a unit convertible to {self.unit}") from None

    def read(self, entry: Any) -> Value:
        """Return the SI value of a text, or of the text of a Value.

        Raises InputError for anything but a number with a suitable unit within the bound.
        """
        text = getattr(entry, "text", entry)
        try:
            value = _read(text, self.unit, self.motor)
        except _Refused as refused:
            raise InputError("", quoted(text, str(refused)), self.expected, self.written_example) from None
        if not self.bound.holds(value):
            raise InputError("", quoted(text), self.expected, self.written_example)
        if abs(value) > LARGEST.get(self.unit, LARGEST_VALUE):
            hint = f"farther than any stage moves ({LARGEST[self.unit]:.0e} {self.unit})"
            raise InputError("", quoted(text, hint), self.expected, self.written_example)
        return value

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.with_info_plain_validator_function(self._read_on_axis)

    def _read_on_axis(self, entry: Any, info: ValidationInfo) -> Value:
        return self.on(info.context or LINEAR).read(entry)


@dataclass(frozen=True)
class Number:
    """A key that takes a bare, dimensionless number: `alpha: Annotated[float, Number(inside_0_1, "0.1")]`."""

    bound: Bound
    example: str

    unit = ""

    def on(self, kind: AxisKind) -> Self:
        """Return itself: a bare number has no unit that the kind of axis could change."""
        return self

    @property
    def expected(self) -> str:
        """Return the values that the key accepts, in words."""
        return f"a bare number without quotes, {self.bound.text}"

    @property
    def written_example(self) -> str:
        """Return the example as it stands in a file."""
        return self.example

    def read(self, entry: Any) -> float:
        """Return a bare number that the key allows.

        Raises InputError for any other value.
        """
        is_number = isinstance(entry, int | float) and not isinstance(entry, bool)
        if not is_number or not self.bound.holds(entry):
            beyond = is_number and LARGEST_VALUE < abs(entry) < math.inf
            raise InputError("", quoted(entry, BEYOND if beyond else ""), self.expected, self.written_example)
        return entry

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)


class _Refused(Exception):
    """Reason why a text is not a value in a unit; it becomes the hint of an InputError."""


# A strict grammar before pint sees anything: its parser would compute "m^(9^9^9)" and take "N;N" for N^2.
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_FACTOR = r"(?:%|[^\W\d_]\w*)(?: ?(?:\^|\*\*) ?-?[0-9]|⁻?[¹²³⁴])?"
_BETWEEN = "(?: ?[*/·.] ?| {1,3})"
_GROUP = rf"(?:{_FACTOR}|\({_FACTOR}(?:{_BETWEEN}{_FACTOR})*\))"
_UNIT = re.compile(rf"(?:1 ?/ ?)?{_GROUP}(?:{_BETWEEN}{_GROUP})*")
LONGEST_QUANTITY = 100


def _read(entry: Any, si_unit: str, motor: Motor | None) -> Value:
    """Return the SI value of a text in exact arithmetic: "30 ms" gives the float 0.03.

    Raises _Refused for anything but a number with a unit of the kind of `si_unit`, and for a number beyond all
    machines.
    """
    if isinstance(entry, int | float) and not isinstance(entry, bool):
        raise _Refused("a bare number without a unit")
    if not isinstance(entry, str):
        raise _Refused("not a text")
    number, unit = _split(entry)
    factor = _factor(unit, si_unit, motor)
    bare = float(number)
    if bare == 0 and not re.search("[1-9]", re.split("[eE]", number)[0]):
        return Value(0.0, entry)
    magnitude = abs(bare) * float(factor)
    if magnitude > LARGEST_VALUE:
        raise _Refused(BEYOND)
    if magnitude < 1 / LARGEST_VALUE:
        raise _Refused("too small: below 1e-30 in SI")
    return Value(float(Fraction(number) * Fraction(repr(factor))), entry)


def _split(entry: str) -> tuple[str, str]:
    """Return number and unit of a text.

    Raises _Refused for a text without either, or too long a text.
    """
    text = " ".join(entry.split())
    if len(text) > LONGEST_QUANTITY:
        raise _Refused("too long")
    match = _NUMBER.match(text)
    if match is None:
        raise _Refused(_why_no_number(text.lower()))
    rest = text[match.end() :].strip()
    if not rest:
        raise _Refused("its unit is missing")
    if re.match(", ?[0-9]", rest):
        raise _Refused("a decimal comma; use a point")
    return match[0], _checked_unit(rest)


def unit_of(text: Any) -> str:
    """Return the unit of a text with a number and a unit; "" for an uncertain value and for anything else."""
    try:
        return _split(text)[1] if isinstance(text, str) else ""
    except _Refused:
        return ""


def in_unit_of(before: Any, entry: Any) -> Any:
    """Return a number completed by the unit of the text `before`; other entries unchanged.

    `entry` is the number or entry. A unit that is only wrong in its capitals is corrected.
    """
    bare = isinstance(entry, int | float) and not isinstance(entry, bool) and abs(entry) < LARGEST_VALUE
    text = repr(entry) if bare else entry.strip() if isinstance(entry, str) else ""
    number = _NUMBER.match(text) if len(text) <= LONGEST_QUANTITY else None
    if number is None or not isinstance(before, str):
        return entry
    try:
        rest, (_, unit) = text[number.end() :].strip(), _split(before)
    except _Refused:  # an uncertain value
        return entry
    same_prefix = re.sub("[^mM]", "", rest) == re.sub("[^mM]", "", unit)  # a milli is no mega
    same = not rest or (rest.lower() == unit.lower() and same_prefix and not _is_unit(rest))
    return f"{number[0]} {unit}" if same else entry


def _is_unit(text: str) -> bool:
    try:
        return bool(_root(text))
    except _Refused:
        return False


def _why_no_number(text: str) -> str:
    if not text:
        return "empty"
    if text[0] in "−–—":
        return "a typographic minus sign; use -"
    if re.match(r"[+-]?(nan|inf)", text):
        return "not a finite number"
    return "does not begin with a number"


def _checked_unit(text: str) -> str:
    if len(text) > LONGEST_QUANTITY or not _UNIT.fullmatch(text):
        raise _Refused(f"{quoted(text)} is not a unit")
    return text


def si_value(text: str) -> float:
    """Return the SI value of a number with any unit, such as "2.4 N/mm".

    The unit is made of common ones, with * between factors. Raises InputError for any other text.
    """
    try:
        number, unit = _split(text)
        if unknown := [part for part in re.findall(r"[^\W\d_]+", unit) if part not in common_units()]:
            raise _Refused(f"{quoted(unknown[0])} is no usual unit; a product has a *")
        factor, root, names = _root(unit)
        if set(root) <= {"radian", "second"} and root.get("second") == -1:  # Hz, rad/s, rpm, 1/s
            factor = _hertz(factor, {"second": -1}, names)
    except _Refused as refused:
        raise InputError("", quoted(text, str(refused)), "a number and its unit", "2.4 N/mm") from None
    kilograms = 1e-3 ** root.get("gram", 0)  # pint's root unit of mass is the gram
    return float(f"{float(number) * factor * kilograms:.15g}")


TORQUES = ("newton_meter = newton * meter = Nm", "newton_centimeter = newton * centimeter = Ncm")
"""Definitions of torque units as they are printed on motors."""

OF_DRIVES = ("drive_percent = [drive_percent]", "PWM = [pwm]", "sample = [sample]")
"""Definitions of units that drives count in. A per cent of a drive's command is no pure number."""


@cache
def common_units() -> dict[str, tuple[float, dict[str, float], list[str]]]:
    """Return pint's data for common units; with pint itself, reading a stage takes 0.8 s."""
    return json.loads(files("friso").joinpath("units.json").read_text(encoding="utf-8"))


@cache
def _registry() -> Any:
    """Return pint's registry, which is slow to build, for units that are not common ones."""
    import pint

    registry = pint.UnitRegistry(on_redefinition="ignore")
    for definition in (
        *TORQUES,
        *OF_DRIVES,
    ):  # of which pint takes Nm for a measure of yarn, or does not know it, by its version
        registry.define(definition)
    return registry


@lru_cache(maxsize=1024)
def _root(unit: str) -> tuple[float, dict[str, float], list[str]]:
    """Return the factor to pint's root units, their powers, and the names in the unit.

    Raises _Refused for an unknown unit.
    """
    return common_units().get(unit) or by_pint(unit)


def by_pint(unit: str) -> tuple[float, dict[str, float], list[str]]:
    """Return pint's factor to its root units, their powers, and the names in a unit.

    Raises _Refused for an unknown unit.
    """
    try:
        units = _registry().parse_units(unit.replace("%", "drive_percent"))
        factor, root = _registry().get_root_units(units)
    except Exception as error:  # pint lets through whatever Python's tokenizer and its own arithmetic raise
        raise _Refused(f"{quoted(unit)} is not a known unit{_meant(unit)}") from error
    return float(factor), dict(root._units), [*units._units]


_USUAL = ("Hz", "kHz", "N", "kN", "m", "mm", "um", "nm", "s", "ms", "us", "kg", "g", "Pa", "GPa", "rad", "deg", "rpm")
_SPELLED = {name.lower(): name for name in _USUAL}
"""Usual spelling of units that are often written with other capitals."""


def _meant(unit: str) -> str:
    """Return a hint with the usual capitals of a unit; "" if it has them."""
    spelled = re.sub(r"[^\W\d_]+", lambda name: _SPELLED.get(name[0].lower(), name[0]), unit)
    return f"; {spelled}?" if spelled != unit else ""


@lru_cache(maxsize=1024)
def _factor(unit: str, si_unit: str, motor: Motor | None = None) -> float:
    """Return how many `si_unit` make 1 `unit`; a `motor` may convert amperes.

    Raises _Refused if `unit` is unknown or of another kind.
    """
    factor, root, names = _root(unit)
    if si_unit == "Hz":
        return _hertz(factor, root, names)
    if si_unit == "1/s" and any(name.endswith("hertz") for name in names):
        raise _Refused("a frequency, which could mean 2 pi as much")
    si_factor, si_root, _ = _root(si_unit)
    factor, root = _counted(factor, root, si_root, motor)
    for command, needs in COMMANDS.items():
        if forces := [force for force in ("N", "N*m") if _in_command(root, si_root, force, command)]:
            per_unit = dict(motor.exerts).get(command) if motor else None
            if per_unit is None:
                raise _Refused(f"in {needs.format(force=forces[0])}")
            if motor and motor.force in forces:
                return float(f"{factor * per_unit * _root(motor.force)[0] / _root(command)[0] / si_factor:.15g}")
    if root != si_root and not _per_radian(root, si_root):
        of_motor = "; amperes are per length of the load, not per angle of the motor" if _per_angle(root, motor) else ""
        raise _Refused(f"{unit} is not convertible to {si_unit}{of_motor or _of_rotary_axis(root, si_unit)}")
    return float(f"{factor / si_factor:.15g}")  # unit factors are short decimals: drop pint's rounding errors


def _per_radian(root: dict[str, float], si_root: dict[str, float]) -> bool:
    """Tell whether a unit lacks "per radian" to be of the right kind: N m for N m/rad.

    `root` and `si_root` are the powers of pint's root units in the unit and in the right one.
    """
    return si_root.get("radian", 0) < 0 and root == {name: p for name, p in si_root.items() if name != "radian"}


COMMANDS = {
    "A": 'amperes: the stage file needs [actuator] motor_constant = "50 {force}/A", and no resistance',
    "V": 'volts: the stage file needs [actuator] motor_constant = "50 {force}/A", resistance = "2 ohm"',
    "%": 'per cent: the stage file needs [actuator] with motor_constant, resistance, and supply = "24 V"',
    "PWM": "PWM counts: the stage file needs [actuator] with motor_constant, resistance, supply, and full_pwm = 255",
}
"""Units of what drives command, each with what the stage file needs for it."""

COUNTED = {
    "count": ("meter", "radian", "counts", '[drive] encoder_resolution = "1 um"'),
    "sample": ("second", "second", "samples", '[drive] sample_time = "90 us"'),
}
"""Units that a drive counts in: what each is on a linear and on a rotary axis, and what the stage file needs for it."""


def _counted(
    factor: float, root: dict[str, float], si_root: dict[str, float], motor: Motor | None
) -> tuple[float, dict[str, float]]:
    """Return the factor and powers of a unit with lengths and times in place of counts and samples.

    Raises _Refused if they are not known.
    """
    for name, (linear, rotary, words, needs) in COUNTED.items():
        power = root.get(name, 0)
        if not power or name in si_root:
            continue
        size = dict(motor.counted).get(name) if motor else None
        if motor is None or size is None:
            raise _Refused(f"in {words}: the stage file needs {needs}")
        base = linear if motor.force == "N" else rotary
        factor, root = factor * size**power, {**root, base: root.get(base, 0) + power}
        root = {key: value for key, value in root.items() if value and key != name}
    return factor, root


def _in_command(root: dict[str, float], si_root: dict[str, float], force: str, command: str) -> bool:
    """Tell whether a unit has a drive's command in place of a force, such as A/m for N/m.

    Another example is A*s^2/rad for an inertia. `root` and `si_root` are the powers of pint's root units in the unit
    and in the right one; `force` is "N" or "N*m".
    """
    _, of_command, _ = _root(command)
    if any(root.get(name) != power and name not in ("gram", "meter", "second") for name, power in of_command.items()):
        return False
    _, of_force, _ = _root(force)
    powers = {
        name: root.get(name, 0) + of_force.get(name, 0) - of_command.get(name, 0)
        for name in (*root, *of_force, *of_command)
    }
    powers = {name: power for name, power in powers.items() if power}
    return powers == si_root or ("second" not in si_root and powers == {**si_root, "radian": -1})


def _per_angle(root: dict[str, float], motor: Motor | None) -> bool:
    """Tell whether a unit has amperes per angle although a `motor` moves a linear axis.

    `root` has the powers of pint's root units in the unit.
    """
    return bool(motor and motor.force == "N" and root.get("ampere") == 1 and root.get("radian", 0) < 0)


def _of_rotary_axis(root: dict[str, float], si_unit: str) -> str:
    """Return a hint if a unit would be valid on a rotary axis; "" if not.

    `root` has the powers of pint's root units in the unit, and `si_unit` is valid on a linear axis.
    """
    turned = ROTARY.unit(si_unit)
    fits = turned != si_unit and root == _root(turned)[1]
    return f"; it would be of a rotary axis, {ROTARY.described}" if fits else ""


def _hertz(factor: float, root: dict[str, float], names: list[str]) -> float:
    """Return the factor of a frequency to Hz, from its factor to pint's root units.

    `root` has the powers of these units, and `names` are the units named. `pint` alone takes 1 Hz for 1 rad/s. Raises
    _Refused for a plain 1/s, which could be either, and for anything but a frequency.
    """
    if root == {"radian": 1, "second": -1}:
        return factor / (2 * math.pi)
    if root != {"second": -1}:
        raise _Refused("not a frequency")
    if len(names) != 1 or not names[0].endswith("hertz"):
        raise _Refused("could mean Hz or rad/s")
    return float(f"{factor:.15g}")
