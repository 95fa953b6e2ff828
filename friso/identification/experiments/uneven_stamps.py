"""Logs without an even clock (serial, CAN, ROS): mass, Coulomb and viscous friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from friso.identification.combine import Correlated
from friso.identification.estimate import Estimate
from friso.identification.estimate_documents import estimate_document
from friso.identification.kind import AnalysisSettings, ExperimentKind, Prior, Source, by_rows
from friso.identification.logs.log import ROLES, Log
from friso.identification.output_error.parameters import BRISTLES
from friso.identification.readings.course import Course
from friso.identification.readings.friction_velocity import METHOD_OF_STAMPS as METHOD
from friso.identification.readings.friction_velocity import StampedFriction, stamped_friction
from friso.shown.documents import entries
from friso.shown.drawing.figure import BLUE, INK, Axis, Figure, Markers, Panel, Series
from friso.shown.text import with_unit
from friso.stage import Stage

_DENIED = {"friction.static": "N", **dict(zip(BRISTLES, ("N/m", "N*s/m"), strict=False))}
"""Keys, with their units, of what happens within a few samples."""


class UnevenStampsKind(ExperimentKind[StampedFriction]):
    """Moves with uneven instants, which show mass and friction over speed."""

    title = "Uneven clock"
    roles = ("velocity|position", "force")
    foreign = ("force",)
    per_unit = True
    stamped = True

    def analyse_log(self, log: Log, prior: Prior, settings: AnalysisSettings) -> StampedFriction:
        """Identify mass and friction from one log."""
        return stamped_friction(log)

    def estimates(self, result: StampedFriction, stage: Stage | None) -> tuple[Estimate, ...]:
        """Return estimates of stage-file keys if the force was in newtons, and what the clock does not show."""
        if result.log.unit("force") != ROLES["force"] or result.log.axis.force != result.log.axis.unit(ROLES["force"]):
            return ()
        masses = [key for key in ("masses.cart", "masses.stage") if stage is None or key in stage.flat()]
        one = stage is None or len(masses) == 1
        names = {"mass": masses[0] if one else "moved mass", "bias.cart": f"bias.{masses[0].removeprefix('masses.')}"}
        shown = (replace(estimate, name=names.get(estimate.name, estimate.name)) for estimate in result.estimates)
        why = f"samples {with_unit(result.steps[1], 's')} apart on an uneven clock do not show it"
        return *shown, *(Estimate.unknown(key, unit, METHOD, why) for key, unit in _DENIED.items())

    def correlated(self, result: StampedFriction, estimates: Sequence[Estimate]) -> Correlated:
        """Return the determined estimates with their correlation in the fit."""
        determined = [estimate for estimate in estimates if estimate.determined]
        return by_rows(result, estimates, determined.index)

    def claims(self, course: Course) -> str | None:
        """Return why a log is of this kind: its samples have no even clock."""
        return "the samples have no even clock" if course.log.is_uneven else None

    def sentences(self, result: StampedFriction) -> tuple[str, ...]:
        """Say what an uneven clock does not show, and what would."""
        least, usual, most = (with_unit(step, "s") for step in result.steps)
        return (
            f"The clock of {result.log.name} is uneven ({least} to {most} between samples, {usual} usually): force and "
            "motion are compared at their stamps, which shows mass and sliding friction; bristles, the Stribeck effect "
            "and delays need an even clock, of 500 Hz or more",
        )

    def numbers(self, result: StampedFriction) -> dict[str, Any]:
        """Return the estimates and the friction curve, for the document."""
        return {
            "estimates": [estimate_document(estimate) for estimate in result.estimates],
            **entries(result, "velocity_m_per_s", "friction_n", "fitted_n", "width", "steps_s"),
        }

    def figures(self, result: StampedFriction, logs: Sequence[Source], name: str) -> list[Figure]:
        """Draw friction over velocity."""
        order = np.argsort(result.velocity)
        curve = Series(result.velocity[order], result.fitted[order], "fit", INK)
        points = Markers(result.velocity, result.friction, "force less inertia", BLUE)
        axes = Axis("Velocity", result.log.unit("velocity")), Axis("Friction", result.log.unit("force"))
        caption = f"Force less inertia, by local polynomials over {result.width} samples."
        return [Figure(f"{name}_velocity", "Friction over velocity", caption, (Panel("", *axes, (curve,), (points,)),))]


KIND = UnevenStampsKind()
