"""The figures of a leaf-spring mechanism: its force and supports over the deflection, and its modes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from friso.flexure.evaluation import Evaluation
from friso.views.figure import GREY, Array, Axis, Dash, Figure, Panel, Series
from friso.views.flexure_found import CLOSED, COLOURS, Found
from friso.views.flexure_modes import modes_figure

DASHES: dict[str, Dash] = {CLOSED: "dashed"}
"""Closed forms are dashed, so that both are seen where they agree."""


def flexure_figures(found: Found) -> tuple[Figure, ...]:
    """All figures, in the order in which they are read."""
    figures = (_force(found), _support(found), modes_figure(found.best))
    return tuple(replace(figure, subject=found.stage.name) for figure in figures)


def _force(found: Found) -> Figure:
    """Force over deflection, to both sides alike."""
    reach, steepness = found.best.stroke, float(found.best.drive[0])
    ends = np.array([0.0, reach])
    straight = Series(ends, steepness * ends, "initial stiffness", GREY, "dotted", 1.2)
    lines = _lines(found, lambda it: it.forces)
    panel = Panel("", _deflection(found), Axis("Force", "N"), (*lines, straight))
    caption = (
        "The force that holds the stage deflected, the same to both sides. Above the straight line the leaves stiffen: "
        "pulled between their clamps, they cannot shorten freely."
    )
    return Figure("flexure_force", "Force over the stroke", caption, (panel,))


def _support(found: Found) -> Figure:
    """Support stiffness along the leaves and along their width."""
    axis = _deflection(found)
    panels = tuple(
        Panel(title, axis, Axis("Stiffness", "N/µm", (0.0, 1.1 * _most(found, of) / 1e6), prefixed=False), lines)
        for title, of in (
            ("Along the leaves (x)", lambda it: it.support_x),
            ("Along their width (y)", lambda it: it.support_y),
        )
        for lines in [_lines(found, lambda it, of=of: of(it) / 1e6)]
    )
    caption = (
        "What the leaves hold against forces across the motion, at the middle of their ends and with all else held: it "
        "falls as they bend, and that is what the stroke costs."
    )
    return Figure("flexure_support", "Support stiffness over the deflection", caption, panels, columns=2)


def _lines(found: Found, of: Callable[[Evaluation], Array]) -> tuple[Series, ...]:
    """The same quantity by each model."""
    return tuple(
        Series(it.deflections, of(it), name, COLOURS[name], DASHES.get(name, "solid"), 1.8)
        for name, it in found.models.items()
    )


def _most(found: Found, of: Callable[[Evaluation], Array]) -> float:
    return max(float(of(it).max()) for it in found.models.values())


def _deflection(found: Found) -> Axis:
    return Axis("Deflection", "m", (0.0, found.best.stroke))
