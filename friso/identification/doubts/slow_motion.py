"""Doubt: the record is so slow that the Stribeck effect acts throughout.

Friction at higher speeds is then open.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.identification.doubt import Doubt, KeyCase, RaisedDoubt
from friso.identification.output_error.parameters import stribeck_up_to
from friso.identification.settings import DoubtSettings

SLIDING = ("friction.coulomb", "friction.viscous", "friction.viscous_asymmetry")
"""Keys of friction beyond the Stribeck effect."""


def find(case: KeyCase) -> Iterator[RaisedDoubt]:
    """Refuse friction of a record that is too slow for the Stribeck effect to decay.

    Such a record shows the sum of the effect and Coulomb friction, of which Coulomb friction is at least a quarter. The
    record must reach a multiple of the Stribeck velocity. If the velocity is not determined, it may be the highest of
    any bearing, which the record must reach.
    """
    if "friction.stribeck_velocity" not in case.flat:
        return
    stribeck, level = (case.determined.get(f"friction.{name}") for name in ("stribeck_velocity", "coulomb"))
    enough = DoubtSettings.current().stribeck_velocities_of_sliding
    top = float(np.abs(case.velocity).max())
    if top >= (enough * stribeck.high if stribeck else stribeck_up_to(case.flat)):
        return
    dry = f": {level.value:.3g} {case.unit} is dry friction there" if level else ""
    why = f"the log moves at {top * 1e3:.3g} mm/s at most, where the Stribeck effect may still act{dry}"
    yield RaisedDoubt(size=top, unit="m/s", refuses=dict.fromkeys(SLIDING, why))


DOUBT = Doubt(
    "key",
    find,
    "the highest speed of the record",
    "Coulomb and viscous friction are refused",
    "faster moves",
    after=("impossible-value",),
)
