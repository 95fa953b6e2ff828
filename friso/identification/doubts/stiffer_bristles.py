"""Doubt: errors of the position make stiff bristles look soft."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.identification.doubt import Doubt, KeyCase, RaisedDoubt
from friso.identification.output_error.parameters import BRISTLES
from friso.identification.output_error.problem import Problem
from friso.identification.output_error.refine import mean_square, refine_fit
from friso.identification.output_error.repeated import simulated_log
from friso.identification.output_error.settings import settings
from friso.identification.settings import doubt_settings

STIFFNESS = "friction.bristle_stiffness"
WHY = "errors of the position would leave as much force unexplained on stiffer bristles"


def find(case: KeyCase) -> Iterator[RaisedDoubt]:
    """Refuse bristles if stiffer ones would explain the record as well as its position allows.

    An error of the position bends stiff bristles more than soft ones, so that a fit prefers soft ones (errors in
    variables: Fuller 1987, doi:10.1002/9780470316665). Each stiffness that is tried, with all else refitted, leaves a
    residual beside the record, and one beside a simulated log of its own machine. The first must exceed the second.
    """
    fit = case.fit
    if STIFFNESS not in case.determined or fit.problem.closed:
        return
    place = fit.problem.names.index(STIFFNESS)
    most = np.log(fit.problem.parameters[place].high) - fit.inner[place]
    stiffer = np.array([more for more in np.log(doubt_settings.stiffer_bristles) if more <= most])
    tried = np.repeat(fit.inner[None], 1 + len(stiffer), axis=0)
    tried[1:, place] += stiffer
    free = np.isin(np.arange(len(fit.inner)), [number for number in fit.free if number != place])
    until = settings.iterations_of_a_profile, settings.cost_share_of_refinement
    refitted = refine_fit([fit.problem], tried, free, *until, slopes=fit.slopes)
    rng = np.random.default_rng(settings.seed_of_repetitions)
    beyond = [
        cost / mean_square(_own_log(case, inner, rng).residuals(inner[None]))[0]
        for inner, cost in zip(refitted.inner, refitted.cost, strict=True)
        if np.isfinite(cost)
    ]
    if np.isfinite(refitted.cost[0]) and min(beyond[1:], default=np.inf) <= max(1.0, beyond[0]):
        yield RaisedDoubt(refuses=dict.fromkeys(BRISTLES, WHY))


def _own_log(case: KeyCase, inner: np.ndarray, rng: np.random.Generator) -> Problem:
    """Return the problem of fitting a simulated log of the machine with the fitted numbers `inner`."""
    bandwidth, noise = case.inverse.bandwidth, case.quality.noise
    return simulated_log(case.fit.problem, inner, case.log, case.log.longest, bandwidth, noise, rng)


DOUBT = Doubt(
    "key",
    find,
    "what stiffer bristles leave unexplained, beside what errors of the position leave on them",
    "bristles are refused",
    "an encoder of finer resolution, or small motion before sliding",
    after=("impossible-value",),
)
