"""Doubt: damping of the bristles that falls with the speed makes them look stiffer."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.identification.doubt import Doubt, FitCase, FittedCase, RaisedDoubt, TriedForces
from friso.identification.output_error.parameters import BRISTLES, MASS
from friso.identification.settings import doubt_settings

WHY = "bristle damping that falls with the speed explains the record better than constant damping"


def find(case: FitCase) -> Iterator[RaisedDoubt]:
    """Refuse bristles if damping that falls with the speed explains part of the residual.

    The damping of friso's bristles is constant; another form falls as exp(-(v/v_s)^2) (Olsson et al. 1998,
    doi:10.1016/S0947-3580(98)70113-X). On logs of the other form, bristles came out up to 1.8 times too stiff.
    """
    for tried, explained in case.explained(forces):
        if explained.sizes[0] > tried.least and explained.sure(case.fit)[0]:
            yield RaisedDoubt(refuses=dict.fromkeys(BRISTLES, WHY), fit=case.reaching(explained.moved))


def forces(case: FittedCase) -> Iterator[TriedForces]:
    """Yield the force that falling damping saves along the log, for half of the critical damping at rest."""
    bristles = case.bristles()
    if bristles is None:
        return
    damping = np.sqrt(case.fit.value(BRISTLES[0]) * case.fit.value(MASS))
    saved = damping * bristles.rate * (1 - np.exp(-(bristles.speed**2)))
    yield TriedForces([saved], [doubt_settings.tried_falling_damping], least=doubt_settings.least_falling_damping)


DOUBT = Doubt(
    "fit",
    find,
    "the force that bristles save whose damping falls with the speed",
    "bristles are refused",
    "small motion before sliding",
    after=("friction-by-direction",),
    forces=forces,
    of_form=True,
)
