"""Doubt: the resolution of the force is coarse compared with the friction."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.identification.doubt import Doubt, RaisedDoubt, RecordCase
from friso.identification.readings.common import digit_of
from friso.identification.settings import doubt_settings
from friso.quantities import percent


def find(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Compare the resolution of the force with Coulomb friction.

    Noise of a digit or more dithers a coarse resolution, so the doubt is raised only if most steps of the force are
    zero.
    """
    force = case.log["force"][case.log.longest]
    digit, coulomb = digit_of(force), abs(case.inverse.value("coulomb"))
    fine = digit == 0 or digit < doubt_settings.friction_share_of_a_digit * coulomb
    if fine or np.median(np.abs(np.diff(force))) > 0:
        return
    words = (
        f"The force is logged in steps of {digit:.2g} {case.unit}, {percent(digit / coulomb)} of Coulomb friction: "
        "what friction does at low speed is hidden in them; log it with more digits"
    )
    yield RaisedDoubt(words, digit, case.unit, spoils=True)


DOUBT = Doubt(
    "record",
    find,
    "the steps of the force beside Coulomb friction",
    "friction at low speed is refused",
    "a log with more digits",
)
