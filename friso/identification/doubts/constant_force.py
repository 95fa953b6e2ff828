"""Doubt: a constant force exceeds the friction, by gravity or by an offset of the channel."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.identification.doubt import Doubt, RaisedDoubt, RecordCase
from friso.identification.settings import doubt_settings


def find(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Name a constant force that is larger than Coulomb friction and not small against the whole force."""
    inverse = case.inverse
    offset, coulomb = (abs(inverse.value(name)) for name in ("offset", "coulomb"))
    share = doubt_settings.force_share_of_a_constant_force
    if offset > max(coulomb, share * float(np.std(inverse.measured))):
        force = f"{inverse.value('offset'):.3g} {case.unit}"
        words = f"a constant force of {force} exceeds the friction: gravity, or an offset of the channel"
        yield RaisedDoubt(words=words, size=offset, unit=case.unit)


DOUBT = Doubt(
    "cause",
    find,
    "the constant force of the inverse model beside its friction",
    "reported",
    "the force at rest, in several orientations",
    after=("clipped-force",),
)
