"""Doubt: a compliant coupling between force and position makes the mass too large or too small."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.identification.doubt import IMITATED, Doubt, FitCase, FittedCase, RaisedDoubt, TriedForces
from friso.identification.inverse_model import motion
from friso.identification.output_error.effects import is_sure_beside_all
from friso.identification.output_error.parameters import BRISTLES, MASS, is_free
from friso.identification.settings import doubt_settings
from friso.quantities import percent


def find(case: FitCase) -> Iterator[RaisedDoubt]:
    """Look for a load on a coupling, by the second derivative of the acceleration.

    If the motor's position is measured, a load m on a coupling of natural frequency w seems to weigh m / (1 + s^2 /
    w^2) in motion exp(s t): well below w, its force lacks m / w^2 times the second derivative of the acceleration. If
    the position of the load is measured, the force that moves a mass M before the coupling is greater by M / w^2 times
    that derivative. At the reversals of a slow motion, friction may do the same: no coupling is named then, nor if it
    explains little.
    """
    fit = case.fit
    for tried, explained in case.explained(forces) if not is_free(case.flat) else ():
        lighter, further = -float(explained.moved[fit.fitted.index(MASS)]), case.reaching(explained.moved)
        if lighter * explained.sizes[0] <= 0 or not is_sure_beside_all(fit, tried.forces, tried.units):
            yield RaisedDoubt(fit=further)
            return
        share = -float(np.expm1(-lighter))
        clear = case.leading is not None or explained.left <= doubt_settings.power_left_by_an_effect
        words = _sentence(share) if clear and case.may_name("coupling") else ""  # averaged motion looks like that, too
        yield RaisedDoubt(words=words, size=share, fit=further, refuses=dict.fromkeys(BRISTLES, IMITATED))


def forces(case: FittedCase) -> Iterator[TriedForces]:
    """Yield the force that a coupling would add, scaled to the inertia, if a mass is fitted."""
    fit, step = case.fit, case.log.sample_time
    if MASS not in fit.fitted:
        return
    cutoff = doubt_settings.bandwidths_of_a_coupling * case.inverse.bandwidth
    acceleration = motion(case.log["position"][case.log.longest], step, cutoff).acceleration
    force = np.gradient(np.gradient(acceleration, step), step)
    size = float(np.std(force))
    if size > 0:
        force *= fit.value(MASS) * float(np.std(acceleration)) / size
        yield TriedForces([force], [doubt_settings.mass_share_of_a_tried_coupling])


def _sentence(share: float) -> str:
    """Write the sentence on a coupling that changes the identified mass by the fraction `share`."""
    where, way = (
        ("a part of the load moved on a coupling behind the measured position", "smaller")
        if share > 0
        else ("the position were measured behind a coupling", "larger")
    )
    return (
        f"The force goes with the motion as if {where}: the mass may be {percent(abs(share))} {way}, for which the "
        "intervals allow; a frequency response would show the coupling"
    )


DOUBT = Doubt(
    "fit",
    find,
    "a force that goes with the second derivative of the acceleration",
    "intervals widen; bristles are refused",
    "a frequency response",
    after=("load-friction", "play", "cogging", "friction-by-place", "drifting-delay"),
    forces=forces,
)
