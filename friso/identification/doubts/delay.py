"""Doubt: a delay between force and motion, too short to show in the inverse model, passes for damping."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.identification.doubt import Doubt, FitCase, FittedCase, RaisedDoubt, TriedForces
from friso.identification.output_error.effects import is_sure_beside_all
from friso.identification.readings.common import low_pass
from friso.identification.settings import doubt_settings


def find(case: FitCase) -> Iterator[RaisedDoubt]:
    """Look for a delay of the force, by the derivative of the logged force.

    A force that acts later by a short time differs from the logged force by that time times its derivative. Bristles
    turn the delay into damping, by their stiffness, and inertia turns it into viscous friction. Only a stage that
    follows the log is examined. In slow motion a delay cannot be told from friction at the reversals, and is not named;
    nor is one that leaves much of the residual, as digits of an encoder do.
    """
    for tried, explained in case.explained(forces):
        late, words = -float(explained.sizes[0]), ""
        long = abs(late) >= doubt_settings.samples_of_a_delay * case.log.sample_time
        clear = long and explained.left <= doubt_settings.power_left_by_a_delay
        if clear and case.may_name("delay") and is_sure_beside_all(case.fit, tried.forces, tried.units):
            words = (
                f"The motion seems to come {abs(late) * 1e3:.2g} ms {'after' if late > 0 else 'before'} the force: a "
                "delay of the drive or between the channels, which passes for damping and viscous friction; the "
                "intervals allow for it"
            )
        yield RaisedDoubt(words=words, size=late, unit="s", fit=case.reaching(explained.moved))


def forces(case: FittedCase) -> Iterator[TriedForces]:
    """Yield the force that a small delay adds: in proportion to the logged force's derivative.

    Nothing is yielded for a closed loop: only a stage that follows the log is examined.
    """
    force = delay_force(case)
    if not case.fit.problem.closed and force.any():
        yield TriedForces([force], [doubt_settings.samples_of_a_tried_delay * case.log.sample_time])


def delay_force(case: FittedCase) -> np.ndarray:
    """Return the derivative of the logged force [N/s], shape (n,), without noise."""
    cutoff = doubt_settings.bandwidths_of_a_delayed_force * case.inverse.bandwidth
    force = low_pass(case.log["force"][case.log.longest], case.log.sample_time, cutoff)
    return np.gradient(force, case.log.sample_time)


DOUBT = Doubt(
    "fit",
    find,
    "a force that goes with the derivative of the logged force",
    "intervals widen",
    "a frequency response, whose phase shows the delay",
    after=("coupling",),
    forces=forces,
)
