"""Doubt: damping of the bristles that falls with the speed makes them look stiffer."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from friso.identification.doubt import Doubt, KeyCase, RaisedDoubt
from friso.identification.output_error.fit import OutputErrorFit, polished
from friso.identification.output_error.parameters import BRISTLES, MASS, STRIBECK
from friso.identification.output_error.settings import OutputErrorSettings
from friso.identification.readings.common import deflections, stribeck_curve

STIFFNESS, DAMPING = BRISTLES
WHY = "bristle damping that falls with the speed explains the record as well as constant damping"


def find(case: KeyCase) -> Iterator[RaisedDoubt]:
    """Refuse bristles if damping that falls with the speed explains the record as well as constant damping.

    The damping of friso's bristles is constant; another form falls as exp(-(v/v_s)^2) (Olsson et al. 1998,
    doi:10.1016/S0947-3580(98)70113-X). On logs of the other form, bristles came out up to 1.8 times too stiff. The
    other form is fitted by the force that it saves along the log, and the constant one must be clearly better.
    """
    fit, settings = case.fit, OutputErrorSettings.current()
    if not case.determined.keys() & {*BRISTLES} or fit.problem.closed:
        return
    if not {*BRISTLES, *STRIBECK, MASS, "friction.coulomb"} <= {*fit.fitted}:
        return
    start = fit.inner.copy()
    start[fit.problem.names.index(DAMPING)] = np.log(np.sqrt(fit.value(STIFFNESS) * fit.value(MASS)))
    inputs = fit.problem.inputs
    lighter = replace(inputs, force=inputs.force + _saved(fit))
    other = polished(replace(fit.problem, inputs=lighter, unsettled=()), fit.free, start)
    chance = chi2.ppf(settings.probability_of_an_effect, 1) / fit.independent
    if other.cost < fit.cost * (1 + chance):
        yield RaisedDoubt(refuses=dict.fromkeys(BRISTLES, WHY))


def _saved(fit: OutputErrorFit) -> np.ndarray:
    """Return the force [N], shape (n,), that damping which falls with the speed saves along the log.

    The bristles have the fit's stiffness, and critical damping for its mass at rest.
    """
    position, step = fit.problem.inputs.reference, fit.problem.inputs.sample_time
    velocity, stribeck = np.gradient(position, step), fit.value("friction.stribeck_velocity")
    coulomb, stiffness = fit.value("friction.coulomb"), fit.value(STIFFNESS)
    level = stribeck_curve(np.abs(velocity), coulomb, fit.value(STRIBECK[0]) * coulomb, stribeck)
    rate = np.gradient(deflections(np.diff(position), level[1:] / stiffness), step)
    damping = np.sqrt(stiffness * fit.value(MASS))
    return damping * rate * (1 - np.exp(-((velocity / stribeck) ** 2)))


DOUBT = Doubt(
    "key",
    find,
    "the record by bristles whose damping falls with the speed",
    "bristles are refused",
    "small motion before sliding",
    after=("stiffer-bristles",),
)
