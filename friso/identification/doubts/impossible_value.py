"""Doubt: an estimate or its interval contains values that the key cannot have, such as a negative friction."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from friso.identification.doubt import Doubt, KeyCase, RaisedDoubt
from friso.identification.estimate import Estimate
from friso.quantities import non_negative, positive
from friso.stage import numeric_keys

NOT_ABOVE_ZERO = "its interval reaches down to zero"
"""Reason why a quantity that cannot be zero has no value."""

NEGATIVE = "it comes out negative, which it cannot be"
"""Reason why a quantity whose whole interval is negative has no value."""


def find(case: KeyCase) -> Iterator[RaisedDoubt]:
    """Cut intervals at 0 for keys that allow no less, and refuse impossible values.

    An estimate with a negative interval is refused; one that cannot be 0 is bounded from above if its interval contains
    0.
    """
    bounds = {key: declared.bound for key, declared in numeric_keys(case.flat).items()}
    answers = {}
    for key, one in case.determined.items():
        bound = bounds.get(key)
        if one.high < 0 and bound in (non_negative, positive):
            answers[key] = Estimate.unknown(key, one.unit, one.method, NEGATIVE, 0.0)
        elif one.low < 0 and bound is non_negative:
            answers[key] = replace(one, value=max(one.value, 0.0), low=0.0)
        elif one.low <= 0 and bound is positive:
            answers[key] = Estimate.unknown(key, one.unit, one.method, NOT_ABOVE_ZERO, 0.0, one.high)
    if answers:
        yield RaisedDoubt(answers=answers)


DOUBT = Doubt("key", find, "the bounds of the keys", "intervals are cut; negative values are refused", "a longer log")
