"""Doubt: errors of the position make stiff bristles look soft."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.identification.doubt import Doubt, KeyCase, RaisedDoubt
from friso.identification.output_error.parameters import BRISTLES
from friso.identification.output_error.refine import mean_square, refine_fit
from friso.identification.output_error.repeated import simulated_log
from friso.identification.output_error.settings import OutputErrorSettings
from friso.identification.settings import DoubtSettings

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
    place, settings = fit.problem.names.index(STIFFNESS), OutputErrorSettings.current()
    stiffer = np.log(DoubtSettings.current().stiffer_bristles)
    tried = np.repeat(fit.inner[None], 1 + len(stiffer), axis=0)
    tried[1:, place] += stiffer
    free = np.isin(np.arange(len(fit.inner)), [number for number in fit.free if number != place])
    refitted = refine_fit(
        [fit.problem],
        tried,
        np.repeat(free[None], len(tried), axis=0),
        settings.iterations_of_a_profile,
        settings.cost_share_of_refinement,
        slopes=fit.slopes,
    )
    rng, part = np.random.default_rng(settings.seed_of_repetitions), case.log.longest
    simulated = [
        simulated_log(fit.problem, inner, case.log, part, case.inverse.bandwidth, case.quality.noise, rng)
        for inner in refitted.inner
    ]
    own = [mean_square(log.residuals(inner[None]))[0] for log, inner in zip(simulated, refitted.inner, strict=True)]
    beyond = refitted.cost / np.array(own)
    if beyond[1:].min() <= max(1.0, beyond[0]):
        yield RaisedDoubt(refuses=dict.fromkeys(BRISTLES, WHY))


DOUBT = Doubt(
    "key",
    find,
    "what stiffer bristles leave unexplained, beside what errors of the position leave on them",
    "bristles are refused",
    "an encoder of finer resolution, or small motion before sliding",
    after=("impossible-value",),
)
