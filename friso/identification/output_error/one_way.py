"""How far the forward and the backward motion of a record move a fit apart: friction that differs by direction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from friso.identification.output_error.fit import OutputErrorFit
from friso.identification.output_error.refine import refine_fit
from friso.intervals import COVERAGE

ITERATIONS = 12
"""Of each of these fits, which begin at that of both directions."""

LEAST = 0.2
"""Share of the samples that count of which a direction consists at least."""

EITHER = ("friction.viscous_asymmetry", "bias.cart", "bias.stage")
"""What one direction alone does not tell from friction."""


def reaching_either_way(fit: OutputErrorFit, velocity: np.ndarray) -> OutputErrorFit:
    """The fit with deviations that reach, beyond chance, to what either direction of the motion alone shows.

    The model has one static friction, one Stribeck velocity and one set of bristles for both; where these differ, what
    a fit to both makes of them need not be between them. `velocity` [m/s], shape (n,), is smooth.
    """
    names = [parameter.name for parameter in fit.problem.parameters]
    free = np.array([i in fit.free and name not in EITHER for i, name in enumerate(names)])
    counted = fit.problem.counted
    ways = [counted * (way * velocity > 0) for way in (1, -1)]
    if min(way.sum() for way in ways) < LEAST * counted.sum():
        return fit
    one_way = [
        refine_fit(replace(fit.problem, counted=way), fit.inner[None], free[None], ITERATIONS).inner[0] for way in ways
    ]
    deviation = np.sqrt(np.diag(fit.covariance))
    apart = np.abs(one_way - fit.inner).max(axis=0)[list(fit.free)] / COVERAGE
    usable = np.isfinite(deviation) & (deviation > 0)
    wider = np.divide(np.maximum(apart - deviation, 0.0), deviation, out=np.zeros_like(apart), where=usable) + 1
    return replace(fit, covariance=fit.covariance * np.outer(wider, wider))
