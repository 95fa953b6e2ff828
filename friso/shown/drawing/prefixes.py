"""Write numbers for readers: with the SI prefix that suits them, as ranges, in percent."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from friso.axis import axis_shown, unit_shown
from friso.quantities import NOTHING, percent
from friso.shown.drawing.figure import Array

if TYPE_CHECKING:
    from friso.shares import Share

# Prefixes by exponent of ten, and the smallest and largest exponent of the units that take them: lengths beyond metres,
# times beyond seconds and slow frequencies are read best as they are.
_PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_PREFIXED = {"m": (-9, 0), "rad": (-9, 0), "s": (-9, 0), "N": (-9, 9), "J": (-9, 9), "Hz": (0, 9)}
_SIGNS = str.maketrans({"*": "·"})
_POWERS = {"^2": "²", "^3": "³", "**2": "²", "**3": "³"}

SOLVED_LENGTH = 1e-9
"""Length [m] below which a simulated motion cannot be told from rest."""


def choose(values: Array, unit: str, *, log: bool = False) -> tuple[float, str]:
    """Return factor and prefixed unit for `values` [unit]: prefixed value = factor * value.

    The unit follows the kind of axis: "m" is "rad" on a rotary one. If a prefix allows it, the largest magnitude falls
    between 1 and 1000; on a logarithmic axis, the middle of the range does. Units without prefix (kg, m^2) keep the
    factor 1. Only finite values count.
    """
    unit = unit_shown(unit)
    symbol = unit.replace("**", "^").replace("/", "*").split("*")[0]
    text = pretty(unit)
    magnitudes = np.abs(values[np.isfinite(values) & (values != 0)])
    if symbol not in _PREFIXED or magnitudes.size == 0:
        return 1.0, text
    size = float(np.max(magnitudes))
    if log:
        size = math.sqrt(size) * math.sqrt(float(np.min(magnitudes)))
    # 1e-9 of slack: a largest value of 0.001 m is 1 mm although 0.001 * 1000 may fall short of 1
    exponent = 3 * math.floor((math.log10(size) + 1e-9) / 3)
    smallest, largest = _PREFIXED[symbol]
    exponent = min(max(exponent, smallest), largest)
    return 10.0**-exponent, _PREFIXES[exponent] + text


def pretty(unit: str) -> str:
    """Return a unit as it is printed: "N*s/m^2" becomes "N·s/m²".

    On a rotary axis it becomes a rotary unit.
    """
    unit = unit_shown(unit)
    for plain, raised in _POWERS.items():
        unit = unit.replace(plain, raised)
    return unit.translate(_SIGNS)


def with_unit(value: float | None, unit: str, digits: int = 3) -> str:
    """Write a value [unit] with significant `digits`, e.g. "0.52 mm"; a dash without a value.

    A length that the encoder of the axis does not see, or that no run resolves, is only said to be shorter than that.
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    if unseen(value, unit):
        return f"< {with_unit(finest_length(), unit)}"
    factor, text = choose(np.array([value]), unit)
    number = value * factor
    if number == 0 or 1e-3 <= abs(number) < 1e5:
        return f"{_significant(number, digits)} {text}"
    return f"{number:.{digits - 1}e} {text}"


def finest_length() -> float:
    """Return the length [m] below which no number is written: a step of the encoder, or a thousandth of a nanometre."""
    return axis_shown().finest or SOLVED_LENGTH / 1000


def unseen(value: float, unit: str) -> bool:
    """Tell whether a value [unit] is a length that is finer than what is written, but not 0."""
    return unit == "m" and 0 < abs(value) < finest_length() * (1 - 1e-9)


def length_at_rest(value: float, within: float = 0.0) -> str:
    """Write how far [m] a stage still moves.

    Below a nanometre, digits would only show the solver's error. Nobody sees what is below a step of the encoder, and
    nobody asks for what is below the tolerance that the stage states, `within` [m].
    """
    if value < (least := max(finest_length(), within, SOLVED_LENGTH)):
        return f"< {with_unit(least, 'm')}"
    return with_unit(value, "m")


def digits_that_differ(values: Sequence[float]) -> int:
    """Return how many significant digits make different numbers look different, at least three."""
    return next(digits for digits in range(3, 18) if len({f"{x:.{digits - 1}e}" for x in values}) == len({*values}))


def rounded_up(value: float, digits: int = 3) -> float:
    """Round a positive value up to `digits` significant digits."""
    unit = 10.0 ** (math.floor(math.log10(value) + 1e-12) - digits + 1)
    return math.ceil(value / unit - 1e-9) * unit


def rounded_down(value: float, digits: int = 3) -> float:
    """Round a positive value down to `digits` significant digits."""
    unit = 10.0 ** (math.floor(math.log10(value) + 1e-12) - digits + 1)
    return math.floor(value / unit + 1e-9) * unit


def range_with_unit(low: float, high: float, unit: str, digits: int = 3) -> str:
    """Write a range [unit] for a table or a sentence, e.g. "1.72 to 10.8 mm".

    A wide range has two prefixes. A range whose ends have equal digits is a single number.
    """
    if unseen(low, unit):
        return with_unit(high, unit) if unseen(high, unit) else f"{with_unit(low, unit)} to {with_unit(high, unit)}"
    factor, text = choose(np.array([low, high]), unit)
    if 0 < low * factor < 0.01:
        return f"{with_unit(low, unit, digits)} to {with_unit(high, unit, digits)}"
    first, last = _significant(low * factor, digits), _significant(high * factor, digits)
    return f"{first} {text}" if first == last else f"{first} to {last} {text}"


def window_with_unit(low: float, high: float, searched: tuple[float, float], unit: str) -> str:
    """Write the part of a searched range [unit] in words.

    The part counts as open at an end that is also an end of the search.
    """
    if (low, high) == searched:
        return f"all from {range_with_unit(low, high, unit)}"
    if low == searched[0]:
        return f"up to {with_unit(high, unit)}"
    return f"from {with_unit(low, unit)} on" if high == searched[1] else range_with_unit(low, high, unit)


_LOPSIDED = 0.1
"""Smallest difference of the two ends of a swing, relative to the larger one, from which on both are written."""


def swing_with_unit(half: float, middle: float, unit: str, digits: int = 3) -> str:
    """Write a swing [unit] about a reference: "±0.52 mm", or "from −1.54 to +10.6 mm about its target".

    `half` is half of peak to peak, and `middle` the middle between the peaks. Both ends are written if they differ.
    """
    if unseen(half, unit):
        return f"less than ±{with_unit(finest_length(), unit)}"
    factor, text = choose(np.array([2 * half]), unit)
    low, high = (factor * (middle + side * half) for side in (-1, 1))
    if abs(low + high) > _LOPSIDED * max(abs(low), abs(high)):
        first, last = (f"{'+' if end > 0 else '−'}{abs(end):.{digits}g}" for end in (low, high))
        return f"from {first} to {last} {text} about its target"
    return f"±{half * factor:.{digits}g} {text}"


def share_with_interval(share: Share) -> str:
    """Write a fraction and its interval in percent; only exactly 0 and 1 become 0 and 100 %."""
    middle = f"{percentage(share.probability)} %" if math.isfinite(share.probability) else "unknown"
    return f"{middle} ({percentage(share.low)} to {percentage(share.high)} %)"


def percent_range(low: float, high: float) -> str:
    """Write two fractions in percent, with one percent sign for both."""
    return f"{percent(low).removesuffix(' %')} to {percent(high)}"


def percentage(part: float) -> str:
    """Write a fraction in percent without the sign, to a tenth; to a hundredth near 0 and 100."""
    return f"{100 * part:.{1 if part in (0, 1) or 0.001 <= part <= 0.999 else 2}f}"


def listed(parts: Sequence[str], word: str) -> str:
    """Join parts by commas and a word: "a", "a or b", "a, b or c"."""
    return f" {word} ".join(part for part in (", ".join(parts[:-1]), *parts[-1:]) if part)


def _significant(number: float, digits: int) -> str:
    """Write `digits` significant digits without an exponent: 1234.5 becomes 1234, not 1.23e+03."""
    if number == 0:
        return "0"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(number)) + 1e-12))
    return f"{number:.{decimals}f}"
