"""Define the estimate, write it in words, and say which experiments would show it.

An estimate is a value with its 95 % interval, or a range and the reason why there is no value. Its numbers have as many
digits as their uncertainty allows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from friso.intervals import NORMAL_COVERAGE
from friso.shown.text import NOTHING, choose, key_in_words, pretty

NO_INTERVAL = "how far off it may be is not known"
"""Reason given for a value that counts as not determined because it has no finite interval."""


@dataclass(frozen=True)
class Estimate:
    """A quantity identified from data, with its 95 % interval or the reason why it has no value.

    `name` is a key of the stage file ("friction.coulomb") or a description ("resonance 1 frequency"); all numbers are
    in the SI `unit`. The `value` has the interval from `low` to `high`, finite and not equal. If the data cannot show
    the quantity, `value` is NaN, `reason` says why, and `low` and `high` bound the remaining range (infinite if nothing
    is known). `systematic` is the part of the interval's half-width that repetition does not reduce.
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
    method: str
    reason: str = ""
    systematic: float = 0.0

    def __post_init__(self) -> None:
        """Turn a value without an interval into one that is not determined."""
        if self.reason or (np.isfinite([self.value, self.low, self.high]).all() and self.low < self.high):
            return
        for name, end in (("value", np.nan), ("low", -np.inf), ("high", np.inf), ("reason", NO_INTERVAL)):
            object.__setattr__(self, name, end)

    @classmethod
    def normal(cls, name: str, unit: str, value: float, deviation: float, method: str) -> Estimate:
        """Make an estimate whose 95 % interval is that of a normal distribution.

        `deviation` is its standard deviation, in the `unit` of the `value`. `name` and `method` are stored.
        """
        half = NORMAL_COVERAGE * deviation
        return cls(name, unit, float(value), float(value - half), float(value + half), method)

    @classmethod
    def unknown(
        cls, name: str, unit: str, method: str, reason: str, low: float = -np.inf, high: float = np.inf
    ) -> Estimate:
        """Make an estimate that the data do not determine, with the reason.

        `low` and `high`, in its `unit`, bound the remaining range (default: nothing is known). `name` and `method` are
        stored.
        """
        return cls(name, unit, np.nan, float(low), float(high), method, reason)

    def withheld(self, reason: str, low: float = -np.inf, high: float = np.inf) -> Estimate:
        """Return the estimate without its value, for a `reason`.

        `low` and `high`, in its `unit`, bound the remaining range (default: nothing is known).
        """
        return Estimate.unknown(self.name, self.unit, self.method, reason, low, high)

    def if_positive(self, reason: str) -> Estimate:
        """Return the estimate, or only its upper bound, with the `reason`, if its interval reaches down to 0."""
        return self if self.low > 0 else self.withheld(reason, 0.0, max(self.high, 0.0) or np.inf)

    def widened(self, further: float) -> Estimate:
        """Return the estimate with its interval extended at both ends by `further`, in its `unit`."""
        return replace(self, low=self.low - further, high=self.high + further)

    def reaching(self, low: float, high: float) -> Estimate:
        """Return the estimate with an interval that also covers the range from `low` to `high`, in its `unit`."""
        return replace(self, low=min(self.low, low), high=max(self.high, high))

    def scaled(self, factor: float) -> Estimate:
        """Return the estimate times a `factor`, which may be negative."""
        low, high = sorted((factor * self.low, factor * self.high))
        systematic = abs(factor) * self.systematic
        return replace(self, value=factor * self.value, low=low, high=high, systematic=systematic)

    @property
    def determined(self) -> bool:
        """Tell whether the data determine the value."""
        return not self.reason

    @property
    def half_width(self) -> float:
        """Return half of the width of the interval."""
        return (self.high - self.low) / 2

    def holds(self, truth: float) -> bool:
        """Tell whether the interval contains a value."""
        return bool(self.low <= truth <= self.high)


_NAMES = {
    "bias.cart": "Constant force on the cart",
    "bias.stage": "Constant force on the stage",
    "friction.viscous_asymmetry": "Asymmetry of viscous friction",
    "viscous": "Viscous friction",
    "coulomb": "Coulomb friction",
    "viscous forward": "Viscous friction, forward",
    "viscous backward": "Viscous friction, backward",
    "coulomb forward": "Coulomb friction, forward",
    "coulomb backward": "Coulomb friction, backward",
    "static friction ratio": "Static over Coulomb friction",
}


def name_of(key: str) -> str:
    """Write a key of the stage file, or another quantity, in words."""
    return _NAMES.get(key) or key_in_words(key)


def within(key: str) -> str:
    """Write the name of a key as inside a sentence; proper names keep their capitals."""
    name = name_of(key)
    return name if name.startswith(("Coulomb", "Stribeck")) else name[0].lower() + name[1:]


def unit_of(unit: str) -> str:
    """Write a unit so that prefixes can be added to it: "N s/m" becomes "N*s/m".

    Factors of 1 are left out: "1 s^2/1" becomes "s^2".
    """
    top, *below = unit.split("/")
    factors = [part for part in top.replace("*", " ").split() if part != "1"]
    below = [part for part in below if part != "1"]
    return "/".join(["*".join(factors) or ("1" if below else ""), *below])


def value_text(estimate: Estimate) -> str:
    """Write a value with its unit, such as "95.28 kg"; a dash without a value."""
    if not math.isfinite(estimate.value):
        return NOTHING
    factor, unit = _scale(estimate)
    return f"{_written(estimate.value, factor, _places(estimate, factor))} {unit}".rstrip()


def interval_text(estimate: Estimate) -> str:
    """Write the interval of an estimate, such as "94.84 to 95.72 kg".

    If the logs show no value, the range that they allow is written.
    """
    low, high = math.isfinite(estimate.low), math.isfinite(estimate.high)
    if not (low or high):
        return NOTHING
    factor, unit = _scale(estimate)
    if low and high and 0 < estimate.low < 1e-2 * estimate.high:  # each end has digits of its own
        return f"{digits(estimate.low, unit_of(estimate.unit))} to {digits(estimate.high, unit_of(estimate.unit))}"
    places = _places(estimate, factor)
    ends = [_written(number, factor, places) for number in (estimate.low, estimate.high)]
    if low and high:
        return f"{ends[0]} to {ends[1]} {unit}".rstrip()
    return f"{'at least' if low else 'at most'} {ends[0] if low else ends[1]} {unit}".rstrip()


def with_interval(estimate: Estimate) -> str:
    """Write value and interval in a sentence, e.g. "95.28 kg (94.84 to 95.72)"."""
    if not estimate.determined:
        return f"not identified ({estimate.reason})"
    unit = _scale(estimate)[1]
    return f"{value_text(estimate)} ({interval_text(estimate).removesuffix(unit).rstrip()})"


def estimates_in_words(estimates: Sequence[Estimate]) -> str:
    """Write several estimates in a sentence, each with its name, value and interval."""
    return ", ".join(f"{within(estimate.name)} {with_interval(estimate)}" for estimate in estimates)


def digits(value: float, unit: str) -> str:
    """Write a value [unit] to three digits with a suitable prefix: "2.1 µm"."""
    if not math.isfinite(value):
        return NOTHING
    factor, text = choose(np.array([value]), unit)
    return f"{value * factor:.3g} {text}".rstrip()


PLAIN_FORCES = (1e-2, 1e4)  # [N]
"""Range of forces, and of quantities per newton, without an SI prefix; they are compared with each other."""


def _scale(estimate: Estimate) -> tuple[float, str]:
    """Return the factor and the prefixed unit in which to write a value.

    If there is no value, factor and unit suit the range that is possible.
    """
    finite = [estimate.low, estimate.high]
    if math.isfinite(estimate.value):  # for a value next to 0, the interval gives the scale
        finite = [max(abs(estimate.value), estimate.half_width) if estimate.value else 0.0]
    unit, size = unit_of(estimate.unit), max((abs(number) for number in finite if math.isfinite(number)), default=0.0)
    low, high = PLAIN_FORCES
    if unit.startswith("N") and low < size < high:
        return 1.0, pretty(unit)
    return choose(np.array(finite), unit)


DIGITS_WITHOUT_AN_INTERVAL = 4
"""Largest number of significant digits of a value without interval, as many as instruments have."""

DIGITS_OF_AN_UNCERTAINTY = 2
"""Number of significant digits of an uncertainty, which also sets the digits of the value."""


def _places(estimate: Estimate, factor: float) -> int:
    """Return how many decimal places the interval of an estimate leaves certain."""
    half = estimate.half_width * factor
    if not (math.isfinite(half) and half > 0):
        finite = [
            abs(number) * factor
            for number in (estimate.value, estimate.low, estimate.high)
            if math.isfinite(number) and number != 0
        ]
        digits_shown = DIGITS_WITHOUT_AN_INTERVAL
        return digits_shown - 1 - math.floor(math.log10(max(finite))) if finite else 0
    return DIGITS_OF_AN_UNCERTAINTY - 1 - math.floor(math.log10(half))


ZEROS_BEFORE_AN_EXPONENT = 4
"""Zeros before the decimal point above which a number gets an exponent, which is then shorter."""

DECIMALS_BEFORE_AN_EXPONENT = 7
"""Decimals above which a number gets an exponent, which is then shorter."""

DIGITS_OF_AN_EXACT_VALUE = 15
"""Largest number of digits after the first one; a floating-point number has no more."""


def _written(value: float, factor: float, places: int) -> str:
    """Write a value times a factor, to so many decimal places, or with an exponent if shorter."""
    zeros, decimals = ZEROS_BEFORE_AN_EXPONENT, DECIMALS_BEFORE_AN_EXPONENT
    if math.isfinite(value) and not -zeros <= places <= decimals:
        size = math.floor(math.log10(abs(value * factor))) if value * factor else 0
        most = min(places + size, DIGITS_OF_AN_EXACT_VALUE)
        return f"{value * factor:.{max(DIGITS_WITHOUT_AN_INTERVAL - 1, most)}e}"
    rounded = round(value * factor, places)
    return f"{rounded + 0.0:.{max(places, 0)}f}"  # + 0.0: no minus before a zero


_OF_BRISTLES = (("presliding",), "small motion before sliding (--as presliding; rehearsed by friso rig presliding)")
_OF_SLOW_SLIDING = (("slow-sliding",), "slow sliding (--as slow-sliding; rehearsed by friso rig constant-speed)")

SHOWN_BY: dict[str, tuple[tuple[tuple[str, ...], str], ...]] = {
    "masses": ((("frequency",), "a frequency response (--as frequency; rehearsed by friso rig frf)"),),
    "friction.coulomb": ((("moves", "constant-speed"), "moves in both directions at several speeds"),),
    "friction.viscous": (
        (("constant-speed",), "constant speeds (--as constant-speed; rehearsed by friso rig constant-speed)"),
    ),
    "friction.static": (
        (("break-away",), "force ramps from rest (--as break-away)"),
        (("stick-slip",), "slow motion that sticks and slips (--as stick-slip; rehearsed by friso rig stiction)"),
    ),
    "friction.stribeck_velocity": (_OF_SLOW_SLIDING,),
    "friction.bristle_stiffness": (_OF_BRISTLES,),
    "friction.bristle_damping": (_OF_BRISTLES,),
    "joint.stiffness": ((("steps",), "steps with the cart fixed (--as steps; rehearsed by friso rig stiffness)"),),
}
"""Experiments that show a key, or a table's keys: the kinds that such a log may have, and what to do."""


def ways_to_show(key: str, done: Set[str] = frozenset()) -> str:
    """Describe the experiments that would show a key, except for `done` kinds; "" if none."""
    ways = SHOWN_BY.get(key) or SHOWN_BY.get(key.split(".")[0]) or ()
    return " or ".join(text for kinds, text in ways if not {*kinds} & done)
