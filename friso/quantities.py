"""Numbers with units: what a user writes, checked and turned into SI.

A dimensioned value is a text, number and unit ("2.4 N/mm"); `pint` knows the units. Every refusal is a `StageError`.
"""

import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, lru_cache
from typing import Any, Self

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema


class StageError(ValueError):
    """A wrong input: which key, what was given, what was expected, and an example of what is right."""

    def __init__(self, key: str, given: str, expected: str, example: str = "", origin: str = "") -> None:
        super().__init__(key, given, expected, example, origin)
        self.key, self.given, self.expected, self.example, self.origin = key, given, expected, example, origin

    def __str__(self) -> str:
        head = ": ".join(part for part in (self.origin, self.key) if part)
        rows = {"given": self.given, "expected": self.expected, "example": self.example}
        return "\n".join(
            [head, *(f"  {f'{name}:':<9} {text}" for name, text in rows.items() if text)]
        ).strip()

    def under(self, table: str) -> "StageError":
        """The same error, its key seen from one level further out."""
        return StageError(".".join(filter(None, (table, self.key))), *self.args[1:])

    def found_in(self, origin: str) -> "StageError":
        """The same error, saying which file or option it comes from."""
        return StageError(*self.args[:4], origin)


def as_toml(given: Any) -> str:
    """How a scalar is written in TOML; tables, arrays and the like are named, not written out."""
    if isinstance(given, bool):
        return "true" if given else "false"
    if isinstance(given, str):
        return json.dumps(given, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(given, int | float):
        return repr(given)
    names = {dict: "a table", list: "an array", type(None): "nothing"}
    return names.get(type(given), f"{given} (a {type(given).__name__})")


def quoted(given: Any, hint: str = "") -> str:
    """What was given, for an error message: printable, one line, at most some 60 characters long."""
    try:
        text = as_toml(given).encode(errors="backslashreplace").decode()
    except ValueError:  # an integer of more digits than Python agrees to print
        text = "a huge integer"
    text = text if len(text) <= 60 else f"{text[:57]}..."
    return f"{text} ({hint})" if hint else text


@dataclass(frozen=True)
class Bound:
    """What values are allowed; `holds` broadcasts over arrays. Infinity and NaN never are."""

    text: str
    test: Callable[[Any], Any]

    def holds(self, value: Any) -> Any:
        """True where `value`, a number or an array, is finite and allowed."""
        return (abs(value) < math.inf) & self.test(value)


positive = Bound("greater than 0", lambda value: value > 0)
non_negative = Bound("0 or greater", lambda value: value >= 0)
any_sign = Bound("of any sign", lambda value: value == value)
inside_0_1 = Bound("between 0 and 1 (both excluded)", lambda value: (value > 0) & (value < 1))
at_least_1 = Bound("1 or greater", lambda value: value >= 1)


class Value(float):
    """A dimensioned value: the number in SI, and in `text` what the user wrote."""

    text: str

    def __new__(cls, si: float, text: str) -> Self:
        value = super().__new__(cls, si)
        value.text = text
        return value

    def __getnewargs__(self) -> tuple[float, str]:
        return float(self), self.text


class _Refused(Exception):
    """Why a text is no value of the unit; becomes the hint of a StageError."""


@dataclass(frozen=True)
class Quantity:
    """A field that takes number and unit: `Annotated[Value, Quantity("N/m", positive, example="2.4 N/mm")]`.

    `unit` is the SI unit values are held in. Where it is "Hz", an angle per time (rad/s, rpm) is divided by 2 pi.
    """

    unit: str
    bound: Bound
    example: str

    @property
    def expected(self) -> str:
        """What the field takes, in words."""
        also = "Hz, rad/s or rpm" if self.unit == "Hz" else self.unit
        return f"a text with number and unit, convertible to {also}; {self.bound.text}"

    @property
    def written_example(self) -> str:
        """The example as it stands in a file."""
        return as_toml(self.example)

    def factor(self, unit: str) -> float:
        """SI value of 1 `unit`, to convert arrays with. Raises StageError if the unit is of another kind."""
        try:
            return _factor(unit, self.unit)
        except _Refused as refused:
            raise StageError("", quoted(unit, str(refused)), f"a unit convertible to {self.unit}") from None

    def read(self, given: Any) -> Value:
        """The SI value of what was given. Raises StageError."""
        try:
            value = given if isinstance(given, Value) else _read(given, self.unit)
        except _Refused as refused:
            raise self._error(given, str(refused)) from None
        if not self.bound.holds(value):
            raise self._error(given, "")
        return value

    def _error(self, given: Any, hint: str) -> StageError:
        return StageError("", quoted(given, hint), self.expected, self.written_example)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)


@dataclass(frozen=True)
class Number:
    """A field that takes a bare, dimensionless number: `Annotated[float, Number(inside_0_1, example=0.1)]`."""

    bound: Bound
    example: float

    unit = ""

    @property
    def expected(self) -> str:
        """What the field takes, in words."""
        return f"a bare number without unit, {self.bound.text}"

    @property
    def written_example(self) -> str:
        """The example as it stands in a file."""
        return as_toml(self.example)

    def read(self, given: Any) -> float:
        """What was given, checked. Raises StageError."""
        is_number = isinstance(given, int | float) and not isinstance(given, bool)
        if not is_number or not abs(given) < 1e300 or not self.bound.holds(given):
            raise StageError("", quoted(given), self.expected, self.written_example)
        return given

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)


_NUMBER = re.compile(r"\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)\s*")
_UNIT = re.compile(r"[^\W\d_][\w\s·²³⁴⁻¹*/^().-]{0,60}")


def _read(given: Any, unit: str) -> Value:
    """Number times factor, in exact arithmetic, so that "30 ms" is the float 0.03 and nothing next to it."""
    if isinstance(given, int | float) and not isinstance(given, bool):
        raise _Refused("a bare number; its unit is missing")
    if not isinstance(given, str):
        raise _Refused("not a text")
    number, unit_text = _split(given)
    if not math.isfinite(float(number)):
        raise _Refused("too large")
    is_zero = not re.search("[1-9]", re.split("[eE]", number)[0])
    try:
        factor = Fraction(f"{_factor(unit_text, unit):.15g}")
        value = 0.0 if is_zero or float(number) == 0 else float(Fraction(number) * factor)
    except OverflowError:
        raise _Refused("too large") from None
    if value == 0 and not is_zero:
        raise _Refused("too small: it would become 0")
    return Value(value, given)


def _split(given: str) -> tuple[str, str]:
    """Number and unit of a text. Raises _Refused."""
    match = _NUMBER.match(given)
    if match is None:
        raise _Refused(_why_no_number(given))
    rest = given[match.end() :].strip()
    if not rest:
        raise _Refused("its unit is missing")
    if re.match(r",\s*[0-9]", rest):
        raise _Refused("a decimal comma; write a point")
    if not _UNIT.fullmatch(rest):
        raise _Refused(f"{quoted(rest)} is not a unit")
    return match[1], " ".join(rest.split())


def _why_no_number(given: str) -> str:
    text = given.strip().lower()
    if not text:
        return "empty"
    if text[0] in "−–—":
        return "a typographic minus; write -"
    if re.match(r"[+-]?(nan|inf)", text):
        return "not a finite number"
    return "it does not begin with a number"


@cache
def _registry() -> Any:
    """pint's registry: about 0.2 s to import and build, so only when the first unit is met."""
    import pint

    return pint.UnitRegistry()


@lru_cache(maxsize=1024)
def _root(unit: str) -> tuple[float, dict[str, float], dict[str, float]]:
    """Factor to pint's root units, those units, and the units as written. Raises _Refused."""
    try:
        units = _registry().parse_units(unit)
    except Exception as error:  # pint lets through whatever Python's tokenizer and its own arithmetic raise
        raise _Refused(f"{quoted(unit)} is not a known unit") from error
    factor, root = _registry().get_root_units(units)
    return float(factor), dict(root._units), dict(units._units)


@lru_cache(maxsize=1024)
def _factor(unit: str, si_unit: str) -> float:
    """SI value of one `unit`. Raises _Refused if it is not of the kind of `si_unit`."""
    factor, root, written = _root(unit)
    if si_unit == "Hz":
        return _to_hertz(factor, root, written)
    si_factor, si_root, _ = _root(si_unit)
    if root != si_root:
        raise _Refused(f"{unit} cannot be converted to {si_unit}")
    return factor / si_factor


def _to_hertz(factor: float, root: dict[str, float], written: dict[str, float]) -> float:
    """pint takes 1 Hz for 1 rad/s, so tell them apart here; a plain 1/s could be either and is refused."""
    if root == {"radian": 1, "second": -1}:
        return factor / (2 * math.pi)
    if len(written) == 1 and next(iter(written)).endswith("hertz") and root == {"second": -1}:
        return factor
    hint = "could mean Hz or rad/s" if root == {"second": -1} else "not a frequency"
    raise _Refused(hint)
