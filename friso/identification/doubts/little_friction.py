"""Doubt: Coulomb friction is zero, negative or impossibly small."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.identification.doubt import Doubt, RaisedDoubt, ValueCase
from friso.identification.settings import doubt_settings


def find(case: ValueCase) -> Iterator[RaisedDoubt]:
    """Compare the Coulomb friction of the inverse model with zero, and with the whole force.

    In a log with one direction of motion, friction and a constant force cannot be separated, and may cancel.
    """
    value, unit = case.inverse.value("coulomb"), case.unit
    least = doubt_settings.force_share_of_no_friction * float(np.std(case.inverse.measured))
    if value < least:
        yield RaisedDoubt(words=_sentence(case, value, least), size=value, unit=unit)


def _sentence(case: ValueCase, value: float, least: float) -> str:
    """Write the sentence on possible causes of little, or negative, friction.

    `value` is the Coulomb friction of the inverse model, and `least` the size below which it counts as none, both in
    the unit of the force.
    """
    one, unit = case.inverse.estimate("coulomb"), case.unit
    if not one.determined:
        says, does = ("which helps the motion", "exceeds") if value <= -least else ("next to nothing", "may hide")
        return (
            f"Coulomb friction and the constant force are {value:.2g} {unit} together, {says}: the log moves in one "
            f"direction only, and gravity, or an offset of the channel, {does} friction"
        )
    if value > -least:
        return (
            f"Coulomb friction is estimated as {value:.2g} {unit}, next to nothing: no friction in this force, a wrong "
            "--scale, or friction that a drive compensates"
        )
    interval = f"{value:.3g} {unit} ({one.low:.3g} to {one.high:.3g})"
    if one.high >= 0:
        return f"The log does not tell Coulomb friction from none: it is estimated as {interval}"
    return (
        f"Coulomb friction is estimated as {interval}, negative, as that of no bearing is: the force leaves out what a "
        "drive adds against friction, or more, another channel is taken for it, or the stage hardly slides"
    )


DOUBT = Doubt(
    "value", find, "the Coulomb friction of the inverse model", "reported", "a log of the whole force of the drive"
)
