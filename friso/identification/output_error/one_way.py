"""How far the forward and the backward motion of a record move a fit apart: friction that differs by direction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from friso.identification.output_error.fit import OutputErrorFit, everywhere, fits
from friso.intervals import COVERAGE
from friso.progress import Progress, silent

LEAST = 0.2
"""Share of the samples that count of which a direction consists at least."""

CLEARLY = 0.5
"""Share of the sum of squares that both directions, each by itself, leave at most where friction differs between them
by more than its level: our choice."""

EITHER = ("friction.viscous_asymmetry", "bias.cart", "bias.stage")
"""What one direction alone does not tell from friction."""


@dataclass(frozen=True)
class EitherWay:
    """A `fit` whose deviations reach to what either direction alone shows, and what both leave [N], RMS, where that is
    so much `less` that friction differs between them by more than its level."""

    fit: OutputErrorFit
    less: float | None = None


def either_way(both: OutputErrorFit, velocity: np.ndarray, thorough: bool, progress: Progress = silent) -> EitherWay:
    """A fit beside those to the forward and to the backward motion of its record.

    The model has one static friction, one Stribeck velocity and one set of bristles for both; where these differ, what
    a fit to both makes of them need not be between them. `velocity` [m/s], shape (n,), is smooth. Deviations reach
    there, beyond chance. A `thorough` search begins everywhere, since that fit may be an optimum that neither direction
    has, and another one with it.
    """
    names = [parameter.name for parameter in both.problem.parameters]
    free = tuple(i for i in both.free if names[i] not in EITHER)
    counted = both.problem.counted
    ways = [counted * (way * velocity > 0) for way in (1, -1)]
    if min(way.sum() for way in ways) < LEAST * counted.sum():
        return EitherWay(both)
    problems = [replace(both.problem, counted=way, unsettled=()) for way in ways]
    starts = everywhere(both.problem, free, both.inner) if thorough else both.inner[None]
    alone = fits(problems, free, starts, progress)
    deviation = np.sqrt(np.diag(both.covariance))
    off = np.abs([one.inner - both.inner for one in alone]).max(axis=0)[list(both.free)] / COVERAGE
    usable = np.isfinite(deviation) & (deviation > 0)
    wider = np.divide(np.maximum(off - deviation, 0.0), deviation, out=np.zeros_like(off), where=usable) + 1
    left = sum(one.cost for one in alone) * len(counted) / counted.sum()
    reaching = replace(both, covariance=both.covariance * np.outer(wider, wider))
    return EitherWay(reaching, float(np.sqrt(left)) if left < CLEARLY * both.left**2 else None)
