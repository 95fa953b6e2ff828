"""Draw leaf springs: force and support stiffness over the deflection, and the modes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from friso.leaf_springs.both_models import BEAMS, CLOSED, BothModels
from friso.leaf_springs.evaluation import Evaluation
from friso.questions.flexure.modes import modes_figure
from friso.shown.drawing.figure import Array, Axis, Dash, Figure, Markers, Panel, Series
from friso.shown.drawing.palette import BLUE, GREY, ORANGE

COLOURS = {BEAMS: BLUE, CLOSED: ORANGE}
DASHES: dict[str, Dash] = {CLOSED: "dashed"}
"""Dashes by model: closed forms are dashed, so that both models are visible where they agree."""

Smooth = Callable[[Array, Array, Array], Array]
"""Function that interpolates: from positions, values there, and other positions, it returns the values at these."""

FINE = 101
"""Number of deflections along a drawn line."""


def flexure_figures(flexure: BothModels) -> tuple[Figure, ...]:
    """Return all figures in the order in which they are read."""
    figures = (_force(flexure), _support(flexure), modes_figure(flexure.best))
    return tuple(replace(figure, subject=flexure.stage.name) for figure in figures)


def _force(flexure: BothModels) -> Figure:
    """Draw the force over the deflection, by both models."""
    reach, steepness = flexure.best.stroke, float(flexure.best.drive[0])
    ends = np.array([0.0, reach])
    straight = Series(ends, steepness * ends, "initial stiffness", GREY, "dotted", 1.2)
    lines, points = _lines(flexure, lambda evaluation: evaluation.forces, _odd)
    panel = Panel("", _deflection(flexure), Axis("Force", "N"), (*lines, straight), (points,))
    caption = (
        "The force that holds the stage deflected, the same in both directions, while it is otherwise free to shift "
        "and turn. The closed forms have a single stiffness; the beams stiffen at large deflections. Dots: computed."
    )
    return Figure("flexure_force", "Force over the stroke", caption, (panel,))


def _support(flexure: BothModels) -> Figure:
    """Draw the support stiffness over the deflection, by both models.

    One panel is for forces along the leaves, the other for forces along their width.
    """
    panels = (
        _supports(flexure, "Along the leaves (x)", lambda evaluation: evaluation.support_x / 1e6),
        _supports(flexure, "Along their width (y)", lambda evaluation: evaluation.support_y / 1e6),
    )
    caption = (
        "The stiffness of the leaves against forces across the motion, at the middle of their ends and with all else "
        "held: it falls as they bend, which is the price of the stroke."
    )
    return Figure("flexure_support", "Support stiffness over the deflection", caption, panels, columns=2)


def _supports(flexure: BothModels, title: str, of: Callable[[Evaluation], Array]) -> Panel:
    """Return the panel of one support stiffness [N/µm], which `of` reads from an evaluation.

    The stiffness is equal for deflections to both sides.
    """
    lines, points = _lines(flexure, of, _even_falling)
    top = 1.1 * max(float(line.y.max()) for line in lines)
    axis = Axis("Stiffness", "N/µm", (0.0, top), prefixed=False)
    return Panel(title, _deflection(flexure), axis, lines, (points,))


def _lines(
    flexure: BothModels, of: Callable[[Evaluation], Array], smooth: Smooth
) -> tuple[tuple[Series, ...], Markers]:
    """Return a quantity over the deflection as a line for each model, and the best one's points.

    `of` reads the quantity from an evaluation, and `smooth` interpolates it between deflections.
    """
    fine = np.linspace(0.0, flexure.best.stroke, FINE)
    lines = tuple(
        Series(
            fine,
            smooth(evaluation.deflections, of(evaluation), fine),
            name,
            COLOURS[name],
            DASHES.get(name, "solid"),
            1.8,
        )
        for name, evaluation in flexure.models.items()
    )
    best = next(iter(flexure.models))
    return lines, Markers(flexure.best.deflections, of(flexure.best), "", COLOURS[best])


def _odd(x: Array, y: Array, at: Array) -> Array:
    """Interpolate an odd function y(x), sampled at x from 0 upwards, at `at` by a cubic spline."""
    return CubicSpline(np.concatenate([-x[:0:-1], x]), np.concatenate([-y[:0:-1], y]))(at)


def _even_falling(x: Array, y: Array, at: Array) -> Array:
    """Interpolate a stiffness y that is even in x, at `at`.

    The inverse is interpolated, since it grows about as the square of x.
    """
    return 1 / CubicSpline(np.concatenate([-x[:0:-1], x]), 1 / np.concatenate([y[:0:-1], y]))(at)


def _deflection(flexure: BothModels) -> Axis:
    """Return the axis of the deflection up to the stroke."""
    return Axis("Deflection", "m", (0.0, flexure.best.stroke))
