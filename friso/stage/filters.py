"""The tables [[controller.filters]]: transfer functions of up to second order.

They are in the order of the signal.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from math import pi, sqrt
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from friso.quantities import Number, Quantity, Value, any_sign, non_negative, positive
from friso.stage.lists import Several, Values, row_keys
from friso.stage.section import Rule, TableArray, UncertainSection, Variants, keys_below

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
