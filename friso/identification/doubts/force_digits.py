"""Doubt: the resolution of the force is coarse compared with the friction."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.identification.doubt import Doubt, RaisedDoubt, RecordCase
from friso.identification.readings.common import digit_of
from friso.identification.settings import DoubtSettings
from friso.quantities import percent


def find(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Compare the resolution of the force with Coulomb friction.

    The resolution is the step of which all steps of the force are multiples, in a log where most steps are zero. A
    command in steps has none.
    """
    settings, force = DoubtSettings.current(), case.log["force"][case.log.longest]
    steps = np.abs(np.diff(force))
    digit = float(steps[steps > settings.rounding_of_a_digit * steps.max(initial=0.0)].min(initial=np.inf))
    coulomb = abs(case.inverse.value("coulomb"))
    dithered = np.median(steps) > 0  # noise of a digit and more makes up for it
    fine = not np.isfinite(digit) or digit < settings.friction_share_of_a_digit * coulomb
    if dithered or fine or digit_of(force) == 0:
        return
    digits = steps / digit
    if np.abs(digits - np.rint(digits)).max() > settings.error_of_a_whole_digit:
        return
    words = (
        f"The force is logged in steps of {digit:.2g} {case.unit}, {percent(digit / coulomb)} of Coulomb friction: "
        "what friction does at low speed is hidden in them; log it with more digits"
    )
    yield RaisedDoubt(words, digit, case.unit)


DOUBT = Doubt("record", find, "the steps of the force beside Coulomb friction", "reported", "a log with more digits")
