"""Doubt: friction grows with the force of the motor, as in worm gears, belts and preloaded screws."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.identification.doubt import Doubt, FitCase, FittedCase, RaisedDoubt, TriedForces, way_of
from friso.identification.settings import doubt_settings
from friso.quantities import percent


def find(case: FitCase) -> Iterator[RaisedDoubt]:
    """Look for friction in proportion to the motor's force.

    Such friction makes a mass seem heavier while the motor accelerates it than while it brakes, but the model has one
    mass and one Coulomb friction for both. Without this doubt, a machine of 3 kg and 5 N with a tenth of the force as
    friction was identified as 3.13 to 3.36 kg and 5.44 to 5.60 N. The effect is named if it explains much of the
    residual, and more than a coupling, a delay, or friction that changes with time.
    """
    effect = case.leading
    if effect is None or effect.doubt != "load-friction":
        return
    share = float(effect.explained.sizes[0])
    if effect.explained.left > doubt_settings.power_left_by_a_load or share > doubt_settings.shares_of_a_load[1]:
        return
    words = (
        f"Friction grows with the force of the motor, by {percent(share)} of it, as that of worm gears, belts and "
        "preloaded screws does: no friction of the stage file does so, and the intervals allow for it; constant speeds "
        "with and without a load would show it"
    )
    yield RaisedDoubt(words=words, size=share, fit=case.reaching(effect.explained.moved), explains=True)


def forces(case: FittedCase) -> Iterator[TriedForces]:
    """Yield a force against the motion, in proportion to the motor's force."""
    force = case.log["force"][case.log.longest]
    against, least = -np.abs(force) * way_of(case.velocity), doubt_settings.shares_of_a_load[0]
    yield TriedForces([against], [doubt_settings.share_of_a_tried_load], least=least)


DOUBT = Doubt(
    "fit",
    find,
    "a force against the motion in proportion to the motor's force",
    "intervals widen; a coupling and a delay are not named beside it",
    "constant speeds with and without a load",
    after=("friction-by-direction",),
    forces=forces,
)
