"""Ranges of quantities: "1 N .. 3 N", "1.7 kg +/- 5 %", "1.7 kg +/- 0.1 kg", or a single value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from friso.quantities import Number, Quantity, StageError, non_negative, quoted


@dataclass(frozen=True)
class Interval:
    """From `low` to `high`, SI, both included; `text` is what the user wrote."""

    low: float
    high: float
    text: str
    single: bool = False
    """Whether a single value was given, not a range."""

    @property
    def centre(self) -> float:
        return (self.low + self.high) / 2

    def at(self, share: Any) -> Any:
        """The values at shares, from 0 to 1, of the way from low to high."""
        return self.low + share * (self.high - self.low)


@dataclass(frozen=True)
class Span:
    """A key that takes a range of a quantity: `static: Annotated[Interval, Span(Quantity("N", positive, "3 N"))]`.

    A range of dimensionless numbers is a text too ("0.3 .. 0.8"), a single one may be bare.
    """

    of: Quantity | Number
    example: str

    @property
    def expected(self) -> str:
        """What the key takes, in words."""
        unit = f"{self.of.unit}, " if self.of.unit else ""
        return f'a range "LOW .. HIGH" or "VALUE +/- TOLERANCE" ({unit}{self.of.bound.text}), or a single value'

    @property
    def written_example(self) -> str:
        """The example as it stands in a file."""
        return f'"{self.example}"'

    def read(self, given: Any) -> Interval:
        """The range of a text. Raises StageError."""
        if isinstance(given, Interval):
            return given
        text = given if isinstance(given, str) else ""
        try:
            if ".." in text:
                low, high = (self._number(part) for part in text.split("..", 1))
            elif "+/-" in text or "±" in text:
                low, high = self._tolerance(*text.replace("±", "+/-").split("+/-", 1))
            else:
                low = high = self._number(given)
        except StageError as error:
            hint = error.given if error.given != quoted(given) else error.expected
            raise self._refused(given, f"of which {hint}") from None
        single = not any(mark in text for mark in ("..", "+/-", "±"))
        if not low <= high:
            raise self._refused(given, "a reversed range")
        if not (self.of.bound.holds(low) and self.of.bound.holds(high)):
            raise self._refused(given, f"reaches from {low:g} to {high:g} {self.of.unit}".rstrip())
        return Interval(low, high, str(getattr(given, "text", given)), single)

    def _refused(self, given: Any, hint: str) -> StageError:
        return StageError("", quoted(given, hint), self.expected, self.written_example)

    def _number(self, given: Any) -> float:
        if isinstance(self.of, Quantity):
            return float(self.of.read(given.strip() if isinstance(given, str) else given))
        return float(self.of.read(_bare(given)))

    def _tolerance(self, value: str, tolerance: str) -> tuple[float, float]:
        centre, tolerance = self._number(value), tolerance.strip()
        if tolerance.endswith("%"):
            off = abs(centre) * _percent(tolerance)
        elif isinstance(self.of, Quantity):
            off = float(Quantity(self.of.unit, non_negative, self.example).read(tolerance))
        else:
            off = float(_bare(tolerance))
        return centre - off, centre + off

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)


def _bare(given: Any) -> Any:
    """The number in a text, or what was given."""
    if not isinstance(given, str):
        return given
    try:
        return float(given)
    except ValueError:
        raise StageError("", quoted(given, "not a number"), "a number") from None


def _percent(text: str) -> float:
    number = _bare(text.rstrip("%").strip())
    if not 0 <= number < 100:
        raise StageError("", quoted(text, "not a share below 100 %"), "0 % or more, below 100 %")
    return number / 100
