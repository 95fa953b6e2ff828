"""Show the results of motion before sliding."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from friso.identification.experiments.presliding import Presliding
from friso.identification.kind import Source
from friso.quantities import percent
from friso.questions.identify.estimates import estimates_document
from friso.questions.identify.kind_view import TIME, Facts, KindView
from friso.questions.identify.numbers import with_interval
from friso.shown.documents import entries
from friso.shown.drawing.figure import Axis, Figure, Panel, Series
from friso.shown.drawing.palette import BLUE, INK, ORANGE


def _facts(result: Presliding) -> Facts:
    """List stiffness and damping of the bristles, the moving mass, and friction not explained."""
    facts = [
        ("Stiffness of the bristles", with_interval(result.stiffness)),
        ("Damping of the bristles", with_interval(result.damping)),
        ("Moving mass", with_interval(result.mass)),
    ]
    if len(result.time):
        facts += [("Residual friction", f"{percent(result.unexplained, 3)} of its standard deviation")]
    return tuple(facts)


def _numbers(result: Presliding) -> dict[str, Any]:
    """Return the mass, and stiffness and damping of the bristles, for the document."""
    estimates = estimates_document(result, "stiffness", "damping", "mass")
    return estimates | entries(result, "unexplained", "warnings")


def _figures(result: Presliding, logs: Sequence[Source], name: str) -> list[Figure]:
    """Draw force and model, and the motion, over the last tenth of the record.

    The list is empty if no model was fitted.
    """
    if not len(result.model):
        return []
    return [Figure(f"{name}_force", "Motion before sliding", presliding_caption(result), presliding_panels(result))]


def presliding_caption(result: Presliding) -> str:
    """Say how stiff and damped the bristles are, and how much of the friction stays unexplained."""
    return (
        f"The last tenth of the record. Stiffness of the bristles: {with_interval(result.stiffness)}; damping: "
        f"{with_interval(result.damping)}. {percent(result.unexplained, 3)} of the friction remains unexplained."
    )


def presliding_panels(result: Presliding) -> tuple[Panel, ...]:
    """Draw force and model, and the motion, over the last tenth of the record."""
    late = slice(-(len(result.time) // 10), None)
    time, motion = result.time[late], result.position[late] - result.position[late].mean()
    lines = (
        Series(time, result.force[late], "force, low-passed", INK, width=1.6),
        Series(time, result.model[late], "mass and bristles", ORANGE, "dashed", 1.2),
    )
    return (
        Panel("", TIME, Axis("Force", "N"), lines),
        Panel("", TIME, Axis("Position about its mean", "m"), (Series(time, motion, "", BLUE, width=1.0),)),
    )


VIEW = KindView[Presliding]("Motion before sliding", _facts, _numbers, _figures)
