"""Draw both friction laws as measurements would show them."""

from __future__ import annotations

import numpy as np

from friso.frequency.members import steady_force
from friso.shown.drawing.figure import Axis, Figure, Markers, Panel, Series
from friso.shown.drawing.palette import BLUE, GREY, VERMILLION
from friso.studies.laws.conversion import LawConversion

SHOWN_CURVE_LENGTH = 5.0
"""Length of drawn virgin curves, in units of the deflection that static friction causes at the first stiffness."""

MOST_POINTS = 40
"""Largest number of measured points drawn."""


def convert_figures(conversion: LawConversion) -> list[Figure]:
    """Draw virgin curves, and steady friction over speed, before and after the conversion.

    Measured points are drawn if the virgin curve comes from a file.
    """
    levels, before = conversion.before.levels, conversion.before
    stages = (
        (conversion.source, before, VERMILLION, "solid"),
        (conversion.stage, conversion.after, BLUE, "dashed"),
    )
    speeds = np.geomspace(1e-2, 1e2, 400) * levels.stribeck_velocity
    points = conversion.points
    reach = SHOWN_CURVE_LENGTH * levels.static / before.stiffness if before.stiffness else np.inf
    if points is not None:
        reach = max(points.displacement)
    virgin, steady = [], []
    for stage, curve, colour, dash in stages:
        flat, near = stage.flat(), curve.displacement <= reach
        label = flat["friction.model"]
        shows = "curve through the points" if points and curve is before else label
        virgin.append(Series(curve.displacement[near], curve.force[near], shows, colour, dash))  # type: ignore[arg-type]
        steady.append(Series(speeds, steady_force(flat, speeds, True), label, colour, dash))  # type: ignore[arg-type]
    shown = ()
    if points is not None:
        some = np.unique(np.linspace(0, len(points.force) - 1, MOST_POINTS).astype(int))
        shown = (Markers(points.displacement[some], points.force[some], "measured points", GREY),)
    panels = (
        Panel("From rest, slowly", Axis("Displacement", "m"), Axis("Friction force", "N"), tuple(virgin), shown),
        Panel("Steady motion", Axis("Speed", "m/s", log=True), Axis("Friction force", "N"), tuple(steady)),
    )
    caption = "Friction as measurements show it, before and after the conversion."
    return [Figure("friction", "Friction before and after", caption, panels, 2, conversion.stage.name)]
