"""Write numbers of an identification with as many digits as their uncertainty allows."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from friso.identification.estimate import Estimate
from friso.identification.settings import identification_settings, presentation_settings
from friso.shown.text import NOTHING, choose, key_in_words, pretty

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


def _scale(estimate: Estimate) -> tuple[float, str]:
    """Return the factor and the prefixed unit in which to write a value.

    If there is no value, factor and unit suit the range that is possible.
    """
    finite = [estimate.low, estimate.high]
    if math.isfinite(estimate.value):  # for a value next to 0, the interval gives the scale
        finite = [max(abs(estimate.value), estimate.half_width) if estimate.value else 0.0]
    unit, size = unit_of(estimate.unit), max((abs(number) for number in finite if math.isfinite(number)), default=0.0)
    low, high = presentation_settings.plain_forces
    if unit.startswith("N") and low < size < high:
        return 1.0, pretty(unit)
    return choose(np.array(finite), unit)


def _places(estimate: Estimate, factor: float) -> int:
    """Return how many decimal places the interval of an estimate leaves certain."""
    half = estimate.half_width * factor
    if not (math.isfinite(half) and half > 0):
        finite = [
            abs(number) * factor
            for number in (estimate.value, estimate.low, estimate.high)
            if math.isfinite(number) and number != 0
        ]
        digits_shown = presentation_settings.digits_without_an_interval
        return digits_shown - 1 - math.floor(math.log10(max(finite))) if finite else 0
    return identification_settings.digits_of_an_uncertainty - 1 - math.floor(math.log10(half))


def _written(value: float, factor: float, places: int) -> str:
    """Write a value times a factor, to so many decimal places, or with an exponent if shorter."""
    zeros, decimals = presentation_settings.zeros_before_an_exponent, presentation_settings.decimals_before_an_exponent
    if math.isfinite(value) and not -zeros <= places <= decimals:
        size = math.floor(math.log10(abs(value * factor))) if value * factor else 0
        most = min(places + size, presentation_settings.digits_of_an_exact_value)
        return f"{value * factor:.{max(presentation_settings.digits_without_an_interval - 1, most)}e}"
    rounded = round(value * factor, places)
    return f"{rounded + 0.0:.{max(places, 0)}f}"  # + 0.0: no minus before a zero
