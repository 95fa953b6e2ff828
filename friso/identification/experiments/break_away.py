"""Force ramps from rest, each until the body moves off: static friction.

The break-away force is the force at which a body at rest begins to move; it falls with the force rate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from friso.identification.estimate import Estimate
from friso.identification.kind import ExperimentKind, of_one
from friso.identification.logs.log import Log
from friso.identification.readings.common import by_direction
from friso.identification.readings.course import Course
from friso.identification.readings.ramps import Ramps, force_ramps
from friso.identification.readings.rate_effect import static_friction
from friso.identification.readings.settings import settings as reading_settings


@dataclass(frozen=True)
class BreakAway:
    """Static friction [N] from force ramps, in total and per direction, at infinitely slow rise."""

    static: Estimate
    forward: Estimate
    backward: Estimate
    ramps: Ramps
    warnings: tuple[str, ...]


def static_from_ramps(log: Log, mass: float = 0.0) -> BreakAway:
    """Estimate static friction from the break-away forces of ramps in a log (`rate_effect`).

    Without the moving `mass` [kg], the interval allows for the inertia of the heaviest mass that can have moved so
    fast. Raises InputError for a missing channel.
    """
    ramps = force_ramps(log, mass)
    notes = list(ramps.notes)

    def static(chosen: np.ndarray) -> Estimate:
        off, high = (float(part[chosen].mean()) if chosen.any() else 0.0 for part in (ramps.unsure, ramps.late))
        force, rate = ramps.forces[chosen], ramps.rates[chosen]
        estimate = static_friction("friction.static", force, rate, late=high)
        ends = {"low": max(estimate.low - off, 0.0), "high": estimate.high + off}
        reason = "" if estimate.determined else " ".join([f"{estimate.reason}.", *notes]).rstrip(".")
        return replace(estimate, **ends, systematic=estimate.systematic + off, reason=reason)

    forward, backward = (static(mask) for _, mask in by_direction(ramps.directions))
    together = static(np.ones(len(ramps.forces), dtype=bool))
    if forward.determined and backward.determined and (forward.low > backward.high or backward.low > forward.high):
        notes.append(f"The directions differ: {forward.value:.3g} N forward, {backward.value:.3g} N backward.")
    return BreakAway(together, forward, backward, ramps, tuple(notes))


def _claims_together(courses: Sequence[Course]) -> str | None:
    """Return why logs hold force ramps from rest.

    Returns None unless every log has a ramp, and all logs together have enough.
    """
    ramps = [course.ramps for course in courses]
    enough = all(ramps) and sum(ramps) >= reading_settings.fewest_ramps
    return f"the force rises evenly from none {sum(ramps)} times until the position moves off" if enough else None


KIND = ExperimentKind[BreakAway](
    analyse=of_one(lambda log, prior, settings: static_from_ramps(log, sum(prior.masses(log)))),
    estimates=lambda result, stage: (replace(result.static, name="friction.static"),),
    after=("frequency", "moves"),
    foreign=("force",),
    per_unit=True,
    partial=lambda log: len(static_from_ramps(log).ramps.times) < reading_settings.fewest_ramps,
    claims_together=_claims_together,
)
