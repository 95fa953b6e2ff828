"""Doubt: the record is so slow that the Stribeck effect acts throughout.

Friction at higher speeds is then open.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from friso.identification.doubt import Doubt, KeyCase, RaisedDoubt, refused
from friso.identification.estimate import Estimate
from friso.identification.output_error.parameters import stribeck_up_to
from friso.identification.output_error.settings import settings
from friso.identification.settings import doubt_settings

SLIDING = ("friction.coulomb", "friction.viscous", "friction.viscous_asymmetry")
"""Keys of friction beyond the Stribeck effect."""


def find(case: KeyCase) -> Iterator[RaisedDoubt]:
    """Refuse friction of a record that is too slow for the Stribeck effect to decay.

    Such a record shows the sum of the effect and Coulomb friction, of which Coulomb friction is at least a quarter, and
    at most all of it at the highest speed. The record must reach a multiple of the Stribeck velocity. If the velocity
    is not determined, it may be the highest of any bearing, which the record must reach.
    """
    if "friction.stribeck_velocity" not in case.flat:
        return
    stribeck = case.determined.get("friction.stribeck_velocity")
    enough = doubt_settings.stribeck_velocities_of_sliding
    top = float(np.abs(case.velocity).max())
    if top >= (enough * stribeck.high if stribeck else stribeck_up_to(case.flat)):
        return
    why = f"the log moves at {top * 1e3:.3g} mm/s at most, where the Stribeck effect may still act"
    coulomb, viscous = (case.determined.get(key) for key in SLIDING[:2])
    if coulomb and viscous:
        why = f"{why}: {coulomb.value + viscous.value * top:.3g} {case.unit} is friction there"
    answers = _bounded(case.estimates, coulomb, viscous.high * top if viscous else np.inf, why) if coulomb else {}
    refuses = {key: why for key in SLIDING if key not in answers}
    yield RaisedDoubt(size=top, unit="m/s", answers=answers, refuses=refuses)


def _bounded(estimates: Sequence[Estimate], coulomb: Estimate, rise: float, why: str) -> dict[str, Estimate]:
    """Return the range of Coulomb friction, which is left without a value, and that of static friction without one.

    `why` is the reason. `rise` [N] is by how much friction exceeds the fitted Coulomb friction at the highest speed: at
    most all of it is Coulomb friction, since a Stribeck effect that still acts may pass for viscous friction.
    """
    (bounded,) = refused([coulomb], {coulomb.name: why}).values()
    bounded = replace(bounded, high=bounded.high + max(rise, 0.0))
    highest = settings.highest_friction_ratio * bounded.high
    static = [one for one in estimates if one.name == "friction.static" and not one.determined]
    return {coulomb.name: bounded, **{one.name: one.reaching(bounded.low, highest) for one in static}}


DOUBT = Doubt(
    "key",
    find,
    "the highest speed of the record",
    "Coulomb and viscous friction are refused",
    "faster moves",
    after=("impossible-value",),
)
