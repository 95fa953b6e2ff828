"""Read uncertain numbers as intervals, and give shares of runs, draws, machines or rails with their 95 % intervals.

A quantity is a range, "1 N .. 3 N", "1.7 kg +/- 5 %" or "1.7 kg +/- 0.1 kg", or a single value.

The notation has two uses. A specification allows every value of a range (`Span`). A key of a stage file is uncertain
within it (`uncertain_value`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, Self

import numpy as np
from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from friso.errors import InputError
from friso.quantities import Number, Quantity, Value, non_negative, quoted

IntervalForm = Literal["value", "tolerance", "range"]

_MARKS = ("..", "+/-", "±")

NORMAL_COVERAGE = 1.959963984540054
"""Half-width of a 95 % interval of a normal distribution, in standard deviations."""

WIDE_RATIO = 10.0
"""Ratio of the ends of a range above which its order of magnitude counts as the uncertain quantity."""

BESIDE_CENTRE = 1e-6
"""Half-width of the neighbourhood of a range's centre in which some number must be allowed, relative to the range.

A key that takes whole numbers fails the test."""


@dataclass(frozen=True)
class Interval:
    """A range from `low` to `high` in SI, both included.

    `text` is what the user wrote, and `form` the notation: a range, a tolerance, or a single value.
    """

    low: float
    high: float
    text: str
    form: IntervalForm = "range"

    @property
    def single(self) -> bool:
        """Tell whether a single value was given instead of a range."""
        return self.form == "value"

    @property
    def centre(self) -> float:
        return (self.low + self.high) / 2

    @property
    def middle(self) -> float:
        """Return the centre, which is that of the logarithm for a range over orders of magnitude."""
        return self.evenly(0.5) if self.wide else self.centre

    @property
    def wide(self) -> bool:
        """Tell whether the range spans orders of magnitude, so that its logarithm is taken as uniform."""
        return self.form == "range" and self.low > 0 and self.high > WIDE_RATIO * self.low

    def at(self, share: Any) -> Any:
        """Return the values at fractions `share`, from 0 to 1, of the way from low to high."""
        return self.low + share * (self.high - self.low)

    def evenly(self, share: Any) -> Any:
        """Return the values of an uncertain quantity at quantiles from 0 to 1.

        The quantity is uniform between its ends, or in its logarithm if the range is `wide`.
        """
        return self.low * (self.high / self.low) ** share if self.wide else self.at(share)


class UncertainValue(Value):
    """The centre of an uncertain quantity, and its `interval`.

    The centre of a range over orders of magnitude is its geometric mean. `interval` is the range of a ".." or the 95 %
    interval of a "+/-".
    """

    interval: Interval

    def __new__(cls, si: float, text: str, interval: Interval) -> Self:
        value = super().__new__(cls, si, text)
        value.interval = interval
        return value

    def __reduce__(self) -> tuple[type[Self], tuple[float, str, Interval]]:  # type: ignore[override]
        return type(self), (float(self), self.text, self.interval)


@dataclass(frozen=True)
class Span:
    """A key that takes a range of a quantity: `static: Annotated[Interval, Span(Quantity("N", positive, "3 N"))]`.

    A range of dimensionless numbers is a text too ("0.3 .. 0.8"), a single one may be bare.
    """

    of: Quantity | Number
    example: str

    @property
    def expected(self) -> str:
        """Return the values that the key accepts, in words."""
        unit = f"{self.of.unit}, " if self.of.unit else ""
        return f'a range "LOW .. HIGH" or "VALUE +/- TOLERANCE" ({unit}{self.of.bound.text}), or a single value'

    @property
    def written_example(self) -> str:
        """Return the example as it stands in a file."""
        return f'"{self.example}"'

    def read(self, entry: Any) -> Interval:
        """Return the range that a text such as "2 N .. 4 N" describes; a range stays as it is.

        Raises InputError for a text that is no range, and for a range that the key does not allow in full.
        """
        if isinstance(entry, Interval):
            return entry
        try:
            interval = _read(entry, self.of)[1]
            if not (self.of.bound.holds(interval.low) and self.of.bound.holds(interval.high)):
                raise _Refused(_reach(interval, self.of))
        except _Refused as refused:
            raise InputError("", quoted(entry, str(refused)), self.expected, self.written_example) from None
        return interval

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)


def is_range(value: Any) -> bool:
    """Tell whether a value is a text with the notation of a range."""
    return isinstance(value, str) and any(mark in value for mark in _MARKS)


def uncertain_value(text: str, of: Quantity | Number) -> UncertainValue:
    """Return the uncertain value of a text with the notation of a range. Raises InputError.

    The key must allow both ends of "LOW .. HIGH". Of "VALUE +/- HALF" it need only allow the value: a normal
    distribution has no ends, and draws are cut off at the bound.
    """
    try:
        centre, interval = _read(text, of)
        values = (interval.low, centre, interval.high) if interval.form == "range" else (centre,)
        if not all(of.bound.holds(value) for value in values):
            raise _Refused(_reach(interval, of))
        if interval.low < interval.high and not any(
            of.bound.holds(interval.at(0.5 + side)) for side in (-BESIDE_CENTRE, BESIDE_CENTRE)
        ):
            raise _Refused("no number near the centre is allowed")
    except _Refused as refused:
        expected = f'{of.expected}; or with its uncertainty, "VALUE +/- HALF-WIDTH" or "LOW .. HIGH"'
        raise InputError("", quoted(text, str(refused)), expected, f'"{of.example} +/- 5 %"') from None
    return UncertainValue(interval.middle if interval.wide else centre, text, interval)


class _Refused(Exception):
    """Reason why a text is not a range of a quantity; it becomes the hint of an InputError."""


def _reach(interval: Interval, of: Quantity | Number) -> str:
    return f"ranges from {interval.low:g} to {interval.high:g} {of.unit}".rstrip()


def _read(entry: Any, of: Quantity | Number) -> tuple[float, Interval]:
    """Return centre and range of a text such as "3 N +/- 10 %", or of a single value.

    The ends may lie beyond the bound of the quantity; callers check that. Raises _Refused for any other text, and for a
    range whose ends are reversed.
    """
    text = entry if isinstance(entry, str) else ""
    try:
        if ".." in text:
            low, high = (_number(part, of) for part in text.split("..", 1))
            centre, form = (low + high) / 2, "range"
        elif is_range(text):
            value, tolerance = text.replace("±", "+/-").split("+/-", 1)
            centre, form = _number(value, of), "tolerance"
            off = _half_width(centre, tolerance.strip(), of)
            low, high = centre - off, centre + off
        else:
            low = high = centre = _number(entry, of)
            form = "value"
    except InputError as error:
        raise _Refused(f"of which {error.actual if error.actual != quoted(entry) else error.expected}") from None
    if not low <= high:
        raise _Refused("a reversed range")
    return centre, Interval(low, high, str(getattr(entry, "text", entry)), form)


def _number(value: Any, of: Quantity | Number) -> float:
    if isinstance(of, Quantity):
        return float(of.read(value.strip() if isinstance(value, str) else value))
    return float(of.read(_bare(value)))


def _half_width(centre: float, tolerance: str, of: Quantity | Number) -> float:
    if tolerance.endswith("%"):
        return abs(centre) * _percent(tolerance)
    if isinstance(of, Quantity):
        return float(replace(of, bound=non_negative).read(tolerance))
    return float(Number(non_negative, of.example).read(_bare(tolerance)))


def _bare(value: Any) -> Any:
    """Return the number in a text, or the value itself."""
    if not isinstance(value, str):
        return value
    try:
        return float(value)
    except ValueError:
        raise InputError("", quoted(value, "not a number"), "a number") from None


def _percent(text: str) -> float:
    number = _bare(text.rstrip("%").strip())
    if not 0 <= number < 100:
        raise InputError("", quoted(text, "not a percentage below 100 %"), "0 % or more, below 100 %")
    return number / 100


DOUBT_PROBABILITY = 0.05
"""Probability outside an interval."""


@dataclass(frozen=True)
class Share:
    """The probability of an outcome, estimated from runs, with its interval, usually of 95 %.

    The interval, from `low` to `high` (Clopper, Pearson), holds whatever the outcome of failed runs would have been.
    The probability is NaN if no run succeeded.
    """

    probability: float
    low: float
    high: float


def share(flags: np.ndarray, decided: np.ndarray, doubt: float = DOUBT_PROBABILITY) -> Share:
    """Return the fraction of runs with `flags` set, among those that are `decided`.

    Both arrays have any one shape. The interval allows for either outcome of undecided runs. It misses the probability
    with a probability of at most `doubt`.
    """
    count, unknown = np.size(flags), int(np.count_nonzero(~decided))
    hits = int(np.count_nonzero(flags & decided))
    if not count:
        return Share(np.nan, 0.0, 1.0)
    (low, _), (_, high) = share_interval(hits, count, doubt), share_interval(hits + unknown, count, doubt)
    return Share(hits / (count - unknown) if unknown < count else np.nan, low, high)


def separation(values: np.ndarray, flags: np.ndarray) -> tuple[float, float]:
    """Return how well `values` separate the flagged runs from others, and how probable it is by chance.

    The measure is the rank-biserial correlation (Kerby 2014, doi 10.2466/11.IT.3.1): 1 if all flagged runs have the
    larger values, -1 if they have the smaller ones, 0 if the values separate nothing. Some runs must be flagged, and
    some not. The probability is that of Mann and Whitney's test.
    """
    from scipy.stats import mannwhitneyu  # 0.7 s to import

    test = mannwhitneyu(values[flags], values[~flags])
    return 2 * float(test.statistic) / (flags.sum() * (~flags).sum()) - 1, float(test.pvalue)


def share_interval(hits: int, count: int, doubt: float = DOUBT_PROBABILITY) -> tuple[float, float]:
    """Return the interval of a probability that misses it with a probability of at most `doubt`.

    `hits` of `count` independent trials were seen. Clopper and Pearson 1934, doi:10.1093/biomet/26.4.404. SciPy's
    special functions serve, because its statistics take 0.7 s to import.
    """
    from scipy.special import betaincinv

    low = betaincinv(hits, count - hits + 1, doubt / 2) if hits else 0.0
    high = betaincinv(hits + 1, count - hits, 1 - doubt / 2) if hits < count else 1.0
    return float(low), float(high)


def quantile_interval(values: np.ndarray, share: float) -> tuple[float, float]:
    """Return the 95 % interval of a quantile of a population, from values (n,) drawn from it.

    A fraction `share` of the population lies below the quantile. The interval by order statistics (David, Nagaraja
    2003, Order Statistics, Sec. 7.1) holds for any distribution. It is infinite for too few values.
    """
    from scipy.stats import binom

    ranked = np.concatenate([[-np.inf], np.sort(values), [np.inf]])
    low, high = (int(binom.ppf(tail, values.size, share)) for tail in (0.025, 0.975))
    return float(ranked[low]), float(ranked[high + 1])
