"""Doubt: forward and backward friction differ in more than their levels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from friso.identification.doubt import Doubt, FitCase, RaisedDoubt
from friso.identification.output_error.fit import everywhere, fits
from friso.identification.settings import doubt_settings
from friso.intervals import NORMAL_COVERAGE
from friso.progress import between

EITHER = ("friction.viscous_asymmetry", "bias.cart", "bias.stage")
"""Keys that motion in one direction cannot separate from friction."""


def find(case: FitCase) -> Iterator[RaisedDoubt]:
    """Fit forward and backward motion separately, if the common fit does not explain both.

    The model has one static friction, one Stribeck velocity and one set of bristles for both directions. If these
    differ, the common fit need not lie between them, so intervals are widened to reach both results. If the model lacks
    something, starts spread over the whole ranges of the parameters, because the common fit may be far from either
    optimum.
    """
    both = case.fit
    if both.explains(case.quality.noise):
        return
    names = both.problem.names
    free = tuple(i for i in both.free if names[i] not in EITHER)
    counted = both.problem.counted
    ways = [counted * (way * case.velocity > 0) for way in (1, -1)]
    if min(way.sum() for way in ways) < doubt_settings.sample_share_of_a_direction * counted.sum():
        return
    problems = [replace(both.problem, counted=way, unsettled=()) for way in ways]
    starts = everywhere(both.problem, free, both.inner) if case.quality.lacks_something else both.inner[None]
    progress = between(case.progress, 0, 1, "moves: forward and backward motion alone")
    alone = fits(problems, free, starts, progress)
    off = np.abs([one.inner - both.inner for one in alone]).max(axis=0)[list(both.free)] / NORMAL_COVERAGE
    left = sum(one.cost for one in alone) * len(counted) / counted.sum()
    reaching = both.with_deviations(np.maximum(off, both.deviation))
    if left >= doubt_settings.cost_share_of_either_direction * both.left**2:
        yield RaisedDoubt(fit=reaching)
        return
    less = float(np.sqrt(left))
    words = (
        f"Friction differs between forward and backward motion by more than its level: either alone leaves "
        f"{less:.2g} {case.unit} unexplained, both together {both.left:.2g} {case.unit}"
    )
    yield RaisedDoubt(words=words, size=less, unit=case.unit, fit=reaching, spoils=True)


DOUBT = Doubt(
    "fit",
    find,
    "fits to the forward and to the backward motion alone",
    "intervals reach to both; friction at low speed is refused",
    "slow passes to and fro",
)
