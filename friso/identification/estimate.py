"""Define the result of an analysis: a value with its 95 % interval, or a range and the reason why there is no value."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from friso.intervals import NORMAL_COVERAGE

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
