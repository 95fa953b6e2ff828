"""Doubt: the resolution of the position is coarse compared with its travel."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.identification.doubt import Doubt, RaisedDoubt, RecordCase
from friso.identification.settings import doubt_settings


def find(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Compare the travel with the smallest step of the position.

    A coarse resolution turns into noise of the acceleration, and hides the deflection of bristles.
    """
    position = case.log["position"][case.log.longest]
    steps = np.abs(np.diff(position))
    digit, travel = float(steps[steps > 0].min(initial=np.inf)), float(np.ptp(position))
    if digit * doubt_settings.digits_of_a_fine_position < travel:
        return
    words = f"the position has steps of {digit:.2g} m over a travel of {travel:.3g} m: log it with more digits"
    yield RaisedDoubt(words, digit, "m")


DOUBT = Doubt(
    "fault",
    find,
    "the smallest step of the position beside its travel",
    "reported",
    "a log with more digits",
    after=("position-jump",),
)
