"""Doubt: damping of the bristles that falls with the speed makes them look stiffer."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from friso.identification.doubt import Doubt, KeyCase, RaisedDoubt
from friso.identification.output_error.fit import OutputErrorFit
from friso.identification.output_error.parameters import BRISTLES, EXPONENT, MASS, RATIO
from friso.identification.output_error.refine import refine_fit
from friso.identification.output_error.settings import settings
from friso.identification.readings.common import deflections, stribeck_curve
from friso.identification.settings import doubt_settings

STIFFNESS, DAMPING = BRISTLES
NEEDED = {MASS, STIFFNESS, DAMPING, RATIO, EXPONENT, "friction.coulomb", "friction.stribeck_velocity"}
WHY = "bristle damping that falls with the speed explains the record better than constant damping"


def find(case: KeyCase) -> Iterator[RaisedDoubt]:
    """Refuse bristles if damping that falls with the speed explains the record better than constant damping.

    The damping of friso's bristles is constant; another form falls as exp(-(v/v_s)^2) (Olsson et al. 1998,
    doi:10.1016/S0947-3580(98)70113-X). On logs of the other form, bristles came out up to 1.8 times too stiff. The
    other form is fitted with several dampings at rest, by the force that each saves along the log. On drawn logs with
    constant damping it left at least 3 % more of the residual's power; on 7 of 8 logs of its own, at least 6 % less.
    Only a stage that follows the log is examined.
    """
    fit = case.fit
    if not case.determined.keys() & {*BRISTLES} or fit.problem.closed or not {*fit.problem.names} >= NEEDED:
        return
    free, saved = np.isin(np.arange(len(fit.inner)), fit.free), _saved(fit)
    until = settings.iterations_of_a_repetition, settings.cost_share_of_refinement
    for share in doubt_settings.falling_dampings:
        damping, start = share * np.sqrt(fit.value(STIFFNESS) * fit.value(MASS)), fit.inner.copy()
        start[fit.problem.names.index(DAMPING)] = np.log(damping)
        inputs = replace(fit.problem.inputs, force=fit.problem.inputs.force + damping * saved)
        other = refine_fit([replace(fit.problem, inputs=inputs)], start[None], free, *until)
        if other.cost[0] < fit.cost:
            yield RaisedDoubt(refuses=dict.fromkeys(BRISTLES, WHY))
            return


def _saved(fit: OutputErrorFit) -> np.ndarray:
    """Return the force that falling damping saves along the log, per damping at rest [m/s], shape (n,).

    It is the rate at which the bristles bend, times the fraction by which the damping has fallen.
    """
    position, step = fit.problem.inputs.reference, fit.problem.inputs.sample_time
    stribeck, coulomb = fit.value("friction.stribeck_velocity"), fit.value("friction.coulomb")
    velocity = np.gradient(position, step)
    level = stribeck_curve(np.abs(velocity), coulomb, fit.value(RATIO) * coulomb, stribeck, fit.value(EXPONENT))
    rate = np.gradient(deflections(np.diff(position), level[1:] / fit.value(STIFFNESS)), step)
    return rate * (1 - np.exp(-((velocity / stribeck) ** 2)))


DOUBT = Doubt(
    "key",
    find,
    "the record by bristles whose damping falls with the speed",
    "bristles are refused",
    "small motion before sliding",
    after=("stiffer-bristles",),
)
