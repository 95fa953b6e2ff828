"""Doubt: friction differs along the way, by a worn stretch, a varying preload or a dry place."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.identification.doubt import Doubt, FitCase, FittedCase, RaisedDoubt, TriedForces, way_of
from friso.identification.doubts.cogging import places_along
from friso.identification.settings import doubt_settings


def find(case: FitCase) -> Iterator[RaisedDoubt]:
    """Name the variation of friction along the way if it explains most of the residual."""
    effect = case.led_by("friction-by-place")
    if effect is None:
        return
    columns = places_along(case.log["position"][case.log.longest])
    friction = sum(share * column for share, column in zip(effect.explained.sizes, columns, strict=True))
    size, reach = float(np.ptp(friction)), float(np.abs(friction).max())
    words = (
        f"Friction differs along the way by {size:.2g} {case.unit}: the intervals reach from its least to its largest; "
        "slow passes to and fro over the same way would show it"
    )
    yield case.named_along(effect, words, size, {"friction.coulomb": reach / case.fit.value("friction.coulomb")})


def forces(case: FittedCase) -> Iterator[TriedForces]:
    """Yield friction that is larger at one place, for each of several places along the way."""
    if "friction.coulomb" not in case.fit.problem.names:
        return
    along = [-column * way_of(case.velocity) for column in places_along(case.log["position"][case.log.longest])]
    unit = doubt_settings.friction_share_of_a_tried_force * case.fit.value("friction.coulomb")
    yield TriedForces(along, [unit] * len(along))


DOUBT = Doubt(
    "fit",
    find,
    "friction of its own at places along the way",
    "intervals reach from the least to the largest friction; bristles are refused",
    "slow passes to and fro over the same way",
    after=("friction-by-direction",),
    forces=forces,
    places=True,
)
"""The doubt divides the way into the places of `cogging`; a force that changes sign with direction is friction."""
