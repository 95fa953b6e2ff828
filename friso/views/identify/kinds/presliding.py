"""How motion before sliding is shown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from friso.identify.experiments.presliding import Presliding
from friso.identify.kind import Source
from friso.views.drawing.figure import BLUE, INK, ORANGE, Axis, Figure, Panel, Series
from friso.views.identify.estimates import estimate_document
from friso.views.identify.kind_view import TIME, Facts, KindView
from friso.views.identify.numbers import with_interval


def _facts(it: Presliding) -> Facts:
    facts = [
        ("Stiffness of the bristles", with_interval(it.stiffness)),
        ("Damping of the bristles", with_interval(it.damping)),
        ("Moving mass", with_interval(it.mass)),
    ]
    if len(it.time):
        facts += [("Friction left unexplained", f"{it.unexplained:.1%} of its standard deviation")]
    return tuple(facts)


def _numbers(it: Presliding) -> dict[str, Any]:
    several = {"stiffness": it.stiffness, "damping": it.damping, "mass": it.mass}
    return {
        **{name: estimate_document(each) for name, each in several.items()},
        "unexplained": it.unexplained,
        "warnings": list(it.warnings),
    }


def _figures(it: Presliding, logs: Sequence[Source], name: str) -> list[Figure]:
    """Force and model, and the motion, over the last tenth of the record."""
    if not len(it.model):
        return []
    return [Figure(f"{name}_force", "Motion before sliding", presliding_caption(it), presliding_panels(it))]


def presliding_caption(it: Presliding) -> str:
    """What the bristles are, and how much of the force they explain."""
    return (
        f"The last tenth of the record. Stiffness of the bristles: {with_interval(it.stiffness)}; damping: "
        f"{with_interval(it.damping)}. {it.unexplained:.1%} of the friction are left unexplained."
    )


def presliding_panels(it: Presliding) -> tuple[Panel, ...]:
    """Force and model, and the motion, over the last tenth of the record."""
    late = slice(-(len(it.time) // 10), None)
    time, motion = it.time[late], it.position[late] - it.position[late].mean()
    lines = (
        Series(time, it.force[late], "force, low-passed", INK, width=1.6),
        Series(time, it.model[late], "mass and bristles", ORANGE, "dashed", 1.2),
    )
    return (
        Panel("", TIME, Axis("Force", "N"), lines),
        Panel("", TIME, Axis("Position about its mean", "m"), (Series(time, motion, "", BLUE, width=1.0),)),
    )


VIEW = KindView[Presliding]("Motion before sliding", _facts, _numbers, _figures)
