"""Force ramps from rest, each until the body moves off: static friction.

The break-away force is the force at which a body at rest begins to move; it falls with the force rate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friso.identification.estimate import Estimate, with_interval
from friso.identification.estimate_documents import estimates_document
from friso.identification.kind import AREA, WAYS, AnalysisSettings, ExperimentKind, Facts, Prior, Source
from friso.identification.logs.log import Log
from friso.identification.readings.common import by_direction
from friso.identification.readings.course import FEWEST_RAMPS, Course
from friso.identification.readings.motion_events import Ramps, force_ramps, static_friction
from friso.shown.documents import entries
from friso.shown.drawing.figure import INK, Axis, Band, Figure, Limit, Markers, Panel
from friso.shown.text import range_with_unit
from friso.stage import Stage


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


class BreakAwayKind(ExperimentKind[BreakAway]):
    """Force ramps from rest, which show static friction."""

    title = "Break-away ramps"
    after = ("frequency", "moves")
    foreign = ("force",)
    per_unit = True

    def claims_together(self, courses: Sequence[Course]) -> str | None:
        """Return why logs hold force ramps from rest.

        Returns None unless every log has a ramp, and all logs together have enough.
        """
        ramps = [course.ramps for course in courses]
        enough = all(ramps) and sum(ramps) >= FEWEST_RAMPS
        return f"the force rises evenly from none {sum(ramps)} times until the position moves off" if enough else None

    def facts(self, result: BreakAway) -> Facts:
        """List static friction, overall and by direction, with number and force rates of the ramps."""
        facts = [
            ("Static friction", with_interval(result.static)),
            ("Forward", with_interval(result.forward)),
            ("Backward", with_interval(result.backward)),
            ("Ramps", str(len(result.ramps.times))),
        ]
        if len(rates := result.ramps.rates):
            facts.append(("Force rates", range_with_unit(float(rates.min()), float(rates.max()), "N/s")))
        return tuple(facts)

    def numbers(self, result: BreakAway) -> dict[str, Any]:
        """Return static friction with all ramps, for the document."""
        estimates = estimates_document(result, "static", "forward", "backward")
        readings = entries(result.ramps, "forces_n", "rates_n_per_s", "directions")
        return {**estimates, **readings, **entries(result, "warnings")}

    def figures(self, result: BreakAway, logs: Sequence[Source], name: str) -> list[Figure]:
        """Draw the break-away force over the force rate; nothing without ramps."""
        ramps = result.ramps
        if not len(ramps.times):
            return []
        points = tuple(
            Markers(ramps.rates[chosen], ramps.forces[chosen], word, WAYS[word])
            for word, chosen in (("forward", ramps.directions > 0), ("backward", ramps.directions < 0))
            if chosen.any()
        )
        low, high = float(ramps.rates.min()) / 1.3, float(ramps.rates.max()) * 1.3
        bands, limits = (), ()
        if np.isfinite([result.static.low, result.static.high]).all():
            ends = np.array([low, high])
            bands = (
                Band(
                    ends, np.full(2, result.static.low), np.full(2, result.static.high), "static friction, 95 %", AREA
                ),
            )
        if result.static.determined:
            limits = (Limit((result.static.value,), "", INK),)
        panel = Panel(
            "",
            Axis("Force rate", "N/s", (low, high), log=True),
            Axis("Break-away force", "N"),
            (),
            points,
            limits,
            bands=bands,
        )
        caption = (
            f"One point per ramp from rest. Static friction from the slowest ramps: {with_interval(result.static)}."
        )
        return [Figure(f"{name}_rates", "Break-away force over force rate", caption, (panel,))]

    def analyse_log(self, log: Log, prior: Prior, settings: AnalysisSettings) -> BreakAway:
        """Analyse a log of ramps, with the masses that other experiments gave."""
        return static_from_ramps(log, sum(prior.masses(log)))

    def estimates(self, result: BreakAway, stage: Stage | None) -> tuple[Estimate, ...]:
        """Return the estimate of static friction."""
        return (replace(result.static, name="friction.static"),)

    def partial(self, log: Log) -> bool:
        """Tell whether a log alone has too few ramps."""
        return len(static_from_ramps(log).ramps.times) < FEWEST_RAMPS


KIND = BreakAwayKind()
