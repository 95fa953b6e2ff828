"""Doubt: the delay between force and motion drifts along the record.

Two clocks or a filling buffer cause such a drift.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.identification.doubt import Doubt, FitCase, FittedCase, RaisedDoubt, TriedForces
from friso.identification.doubts.delay import delay_force
from friso.identification.output_error.effects import explained_by_forces
from friso.identification.settings import doubt_settings


def find(case: FitCase) -> Iterator[RaisedDoubt]:
    """Name the delays at the record's ends if a drift explains more than a constant delay."""
    effect = case.led_by("drifting-delay")
    if effect is None:
        return
    late, more = (-float(size) for size in effect.explained.sizes)
    words = (
        f"The delay between force and motion changes along the record, from {late * 1e3:.2g} to "
        f"{(late + more) * 1e3:.2g} ms, as of two clocks: the intervals allow for it; log force and motion by one clock"
    )
    yield case.named(effect, words, more, "s")


def forces(case: FittedCase) -> Iterator[TriedForces]:
    """Yield the forces that a constant and a growing delay add.

    They are the derivative of the force, and its product with a ramp over the record. Nothing is yielded unless a
    changing delay explains more than a constant one.
    """
    force = delay_force(case)
    if case.fit.problem.closed or not force.any():
        return
    units = [doubt_settings.samples_of_a_tried_delay * case.log.sample_time] * 2
    both = [force, force * np.linspace(0.0, 1.0, len(force))]
    alone, together = (explained_by_forces(case.fit, both[:count], units[:count]) for count in (1, 2))
    if together is not None and together.left < doubt_settings.power_share_of_a_drift * (alone.left if alone else 1.0):
        yield TriedForces(both, units)


DOUBT = Doubt(
    "fit",
    find,
    "a force that goes with the derivative of the logged force, more and more along the record",
    "intervals widen; bristles are refused",
    "force and motion logged by one clock",
    after=("friction-by-direction",),
    forces=forces,
)
