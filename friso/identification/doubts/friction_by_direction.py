"""Doubt: dry friction differs between forward and backward motion."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.identification.doubt import Doubt, FitCase, FittedCase, RaisedDoubt, TriedForces
from friso.identification.output_error.parameters import BRISTLES
from friso.identification.settings import doubt_settings
from friso.quantities import percent

WHAT = ("Dry friction", "What static friction has beyond Coulomb friction")
"""What differs, by the label of the tried forces."""


def find(case: FitCase) -> Iterator[RaisedDoubt]:
    """Name friction that differs by direction if it explains most of the residual.

    A constant force takes most of the difference in the fit. Its interval reaches to what it would be without, also
    where the difference is sure and explains little.
    """
    effect = case.led_by("friction-by-direction")
    if effect is None:
        for _, explained in case.explained(forces):
            if explained.sure(case.fit)[0]:
                yield RaisedDoubt(fit=case.reaching(explained.moved))
        return
    (share,) = effect.explained.sizes
    what, way = WHAT[int(effect.tried.label)], "forward" if share > 0 else "backward"
    words = (
        f"{what} is about {percent(abs(float(share)))} higher {way} and lower the other way: the stage file has one "
        "for both, and the intervals allow for it; slow passes to and fro would show it"
    )
    yield RaisedDoubt(words=words, size=abs(float(share)), fit=case.reaching(effect.explained.moved), spoils=True)


def forces(case: FittedCase) -> Iterator[TriedForces]:
    """Yield the force of bristles that are stronger forward, and that of a Stribeck effect that is."""
    bristles = case.bristles()
    if bristles is None:
        return
    coulomb, force = case.fit.value("friction.coulomb"), np.abs(case.fit.value(BRISTLES[0]) * bristles.bend)
    for label, against in enumerate((force, force * (1 - coulomb / bristles.level))):
        yield TriedForces([-against], [doubt_settings.friction_share_of_a_tried_force], label)


DOUBT = Doubt(
    "fit",
    find,
    "Coulomb friction and a Stribeck effect that are stronger in one direction",
    "intervals widen, also that of the constant force; friction at low speed is refused",
    "slow passes to and fro",
    forces=forces,
)
