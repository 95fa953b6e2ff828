"""Doubt: an estimate or its interval contains values that the key cannot have, such as a negative friction."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from friso.identification.doubt import Doubt, KeyCase, RaisedDoubt
from friso.quantities import non_negative, positive
from friso.stage import numeric_keys

NOT_ABOVE_ZERO = "its interval reaches down to zero"
"""Reason given for a quantity without a value: it must be positive but its interval contains zero."""

NEGATIVE = "it comes out negative, which it cannot be"
"""Reason given for a quantity without a value: its whole interval is negative."""


def find(case: KeyCase) -> Iterator[RaisedDoubt]:
    """Cut intervals at 0 for keys that cannot be negative, and withhold impossible values.

    An estimate whose whole interval is negative is withheld. A key that must be positive gets an upper bound only, if
    its interval contains 0.
    """
    bounds = {key: declared.bound for key, declared in numeric_keys(case.flat).items()}
    answers = {}
    for key, one in case.determined.items():
        bound = bounds.get(key)
        if one.high < 0 and bound in (non_negative, positive):
            answers[key] = one.withheld(NEGATIVE, 0.0)
        elif one.low < 0 and bound is non_negative:
            answers[key] = replace(one, value=max(one.value, 0.0), low=0.0)
        elif one.low <= 0 and bound is positive:
            answers[key] = one.withheld(NOT_ABOVE_ZERO, 0.0, one.high)
    if answers:
        yield RaisedDoubt(answers=answers)


DOUBT = Doubt("key", find, "the bounds of the keys", "intervals are cut; negative values are refused", "a longer log")
